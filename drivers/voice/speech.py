"""Voice with a synthesiser: queue of speech and sounds, played on a thread of its own."""

import shlex
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from threading import Condition, Thread

from drivers.api import (
    DEFAULT_STYLE,
    DeviceStatus,
    Health,
    Priority,
    SpeechStyle,
    StatusCallback,
    Utterance,
    Voice,
    ignore,
)
from drivers.api.driver import DriverContext
from drivers.api.fast_dataclass import dataclass
from drivers.api.sections import VoiceKeys
from drivers.clock import Clock
from drivers.errors import BadRequest, DeviceFault, DriverError, NotConnected
from drivers.sound.cancel_token import CancelToken
from drivers.sound.engines import EspeakEngine, PiperEngine, SpeechEngine
from drivers.sound.player import SoundPlayer
from drivers.sound.speech_programs import KNOWN_PROGRAMS, ProgramEngine, Synthesiser, find_synthesiser
from drivers.sound.utterances import SpokenUtterance, UtteranceQueue, fill_manner, mouth_movement, speaking_time
from drivers.sound.wav import check_sound_file, sound_duration
from drivers.transport.loop import guard_callback
from drivers.voice.declared import SpeechKeys


class SpeechVoice:
    """Voice that speaks with ``engine`` and plays the sound with ``player``: a ``drivers.api.Voice``.

    ``default_style`` is the style of the robot file. An utterance of higher priority interrupts the current one, which
    is repeated afterwards. An utterance that cannot be played is printed by ``out`` and lasts as long as speech would;
    the reason is reported. ``changed`` is called from the voice's thread at the end of each utterance.
    """

    name = "voice"

    def __init__(
        self,
        clock: Clock,
        engine: SpeechEngine,
        player: SoundPlayer,
        out: Callable[[str], None],
        *,
        default_style: SpeechStyle = DEFAULT_STYLE,
        report: StatusCallback = ignore,
        changed: Callable[[], None] = ignore,
    ) -> None:
        self._clock = clock
        self._engine = engine
        self._player = player
        self._default_style = default_style
        self._out = guard_callback(out)
        self._report = guard_callback(report)
        self._changed = guard_callback(changed)
        self._condition = Condition()  # over all attributes below
        self._queue = UtteranceQueue[SpokenUtterance]()
        self._current: SpokenUtterance | None = None
        self._cut = CancelToken()  # of the current one
        self._thread: Thread | None = None
        self._ending = False
        self._last_problem = ("", "")
        self._counters = {"said": 0, "failed": 0}

    def open(self) -> None:
        """Start the thread and the worker processes; returns at once."""
        with self._condition:
            if self._thread is None:
                self._ending = False
                self._engine.open()
                if not self._engine.plays_sound:
                    self._player.open()
                self._thread = Thread(target=self._run, name=f"voice {self.name}", daemon=True)
                self._thread.start()

    def rest(self) -> None:
        """Cancel all utterances."""
        with self._condition:
            for words in self._queue:
                words.cancel()

    def close(self) -> None:
        """Cancel all utterances, end the thread and the worker processes."""
        with self._condition:
            self._ending = True
            self.rest()
            self._condition.notify_all()
            thread, self._thread = self._thread, None
        if thread is not None:
            thread.join()
        self._engine.close()
        self._player.close()

    def health(self) -> Health:
        """Return whether the voice can speak, and the reason if it cannot.

        If it can, but there is no sound card or the last utterance failed, ``detail`` has that reason.
        """
        with self._condition:
            counters = dict(self._counters)
            if self._thread is None:
                return Health(False, f"{self.name}: not opened yet", counters=counters)
            broken = self._engine.failure_reason or self._player.failure_reason
            if broken:
                return Health(False, broken, "until then speech is printed", counters)
            mute = self._player.mute_reason
            problem = (mute, self._player.hint) if mute else self._last_problem
            return Health(True, *problem, counters=counters)

    def say(self, text: str, manner: SpeechStyle = DEFAULT_STYLE, priority: Priority = Priority.NORMAL) -> Utterance:
        """Queue ``text`` for speech. Raises NotConnected before ``open`` and after ``close``."""
        return self._enqueue(
            SpokenUtterance(self._drop, text, fill_manner(manner, self._default_style), priority, None)
        )

    def play(self, path: Path, priority: Priority = Priority.NORMAL) -> Utterance:
        """Queue an audio file. Raises BadRequest and NotConnected."""
        return self._enqueue(
            SpokenUtterance(
                self._drop, f"[{path.name}]", self._default_style, priority, check_sound_file(self.name, path)
            )
        )

    def speaking(self) -> Utterance | None:
        """Return the utterance that is being played; None if there is none."""
        current = self._current
        return current if current is not None and current.started is not None else None

    def _enqueue(self, words: SpokenUtterance) -> SpokenUtterance:
        with self._condition:
            if self._thread is None:
                raise NotConnected(f"{self.name}: not open, cannot say {words.text!r}")
            if not words.text.strip():
                words.ended.set()
                return words
            self._queue.insert(words)
            if self._current is not None and self._queue.first is not self._current:
                self._cut.cancel()
            self._condition.notify_all()
        return words

    def _drop(self, words: SpokenUtterance, *, cancelled: bool = True) -> None:
        """End the utterance ``words`` now: remove it from the queue, and interrupt it if it is being played.

        ``cancelled`` is stored in it: False if it ends for another reason than a cancellation.
        """
        with self._condition:
            if not words.done():
                words.cancelled = cancelled
            words.ended.set()
            self._queue.remove(words)
            if words is self._current:
                self._cut.cancel()

    # --- the thread ---------------------------------------------------------------------------------------------------

    def _run(self) -> None:
        while True:
            with self._condition:
                self._condition.wait_for(lambda: self._queue.first or self._ending)
                words, cut = self._queue.first, CancelToken()
                if self._ending or words is None:
                    return
                self._current, self._cut = words, cut
            whole = self._say(words, cut)
            with self._condition:
                self._current = None
                if whole:
                    self._drop(words, cancelled=False)
                words.reset_start()
            if words.done():
                self._changed()

    def _say(self, words: SpokenUtterance, cut: CancelToken) -> bool:
        """Speak or play the utterance ``words``, print it if that fails; return True if it was not interrupted."""
        try:
            whole = self._play_or_speak(words, cut)
        except BadRequest as error:  # not an audio file: there is no duration to wait for
            self._fail(error)
            words.cancel()
            return False
        except DriverError as error:
            self._fail(error)
        except Exception as error:  # any error: the voice needs this thread
            self._fail(DeviceFault(f"{self.name}: {words.text[:40]!r}: {type(error).__name__}: {error}"))
        else:
            if whole:
                with self._condition:
                    self._counters["said"] += 1
                    self._last_problem = ("", "")
            return whole
        return self._print(words, cut)

    def _play_or_speak(self, words: SpokenUtterance, cut: CancelToken) -> bool:
        def on_start(at: float, seconds: float) -> None:
            words.on_start(at, seconds)
            if self._player.mute_reason:
                self._out(words.text)

        if words.path is not None:
            words.seconds = sound_duration(words.path)
            self._player.open()
            return self._player.play_file(words.path, cut, on_start)
        words.seconds = speaking_time(words.text, words.manner.speed)
        if self._engine.plays_sound:
            words.on_start(self._clock.now(), words.seconds)
        speech = self._engine.speak(words.text, words.manner, cut)
        if speech is None:
            return not cut.is_cancelled
        words.seconds, words.shapes = speech.seconds, mouth_movement(speech.phonemes, speech.seconds)
        return self._player.play(speech, cut, on_start)

    def _fail(self, error: DriverError) -> None:
        problem = str(error), error.hint
        with self._condition:
            self._counters["failed"] += 1
            is_repeated, self._last_problem = problem == self._last_problem, problem
        if not is_repeated and not isinstance(error, NotConnected):  # the worker process has reported it already
            self._report(DeviceStatus(self.name, "fault", *problem))

    def _print(self, words: SpokenUtterance, cut: CancelToken) -> bool:
        """Print the utterance ``words`` and wait for its remaining duration; return False if interrupted."""
        if cut.is_cancelled:
            return False
        if words.started is None or not self._player.mute_reason:
            self._out(words.text)
        if words.started is None:
            words.on_start(self._clock.now(), words.seconds)
        return not cut.wait(words.end - self._clock.now())


# Factories of voices from the keys of a robot file; without a synthesiser the voice prints its text.

SPEECH_WHEELS = ("espeakng_loader", "miniaudio")
"""Python packages of the extra ``speak``."""


@dataclass(frozen=True, slots=True)
class VoiceSettings:
    """Settings of a voice from its section of the robot file. ``backend`` is one of miniaudio's, for tests."""

    driver: str = "auto"
    style: SpeechStyle = DEFAULT_STYLE
    volume: float = 1.0
    device: str = ""
    model: str = ""
    command: str = ""
    backend: str = ""


def make_voice(
    settings: VoiceSettings,
    clock: Clock,
    out: Callable[[str], None],
    *,
    report: StatusCallback = ignore,
    changed: Callable[[], None] = ignore,
) -> Voice:
    """Return the voice for ``settings``; a printed one if there is no synthesiser. ``out`` prints its texts."""
    engine = _make_engine(settings, clock, report)
    if engine is None:
        from drivers.sound.printed_voice import PrintedVoice  # noqa: PLC0415 - a voice that is heard prints by itself

        return PrintedVoice(clock, out, default_manner=settings.style, changed=changed)
    player = SoundPlayer(clock, device=settings.device, volume=settings.volume, backend=settings.backend, report=report)
    return SpeechVoice(clock, engine, player, out, default_style=settings.style, report=report, changed=changed)


def _make_engine(settings: VoiceSettings, clock: Clock, report: StatusCallback) -> SpeechEngine | None:
    installed = find_synthesiser(volume=settings.volume) if settings.driver in ("auto", "program") else None
    match settings.driver:
        case "espeak":
            return EspeakEngine(clock, default_manner=settings.style, report=report)
        case "auto" if all(find_spec(wheel) for wheel in SPEECH_WHEELS):
            return EspeakEngine(clock, default_manner=settings.style, report=report)
        case "piper":
            return PiperEngine(Path(settings.model).expanduser(), clock)
        case "command":
            program, *arguments = shlex.split(settings.command)
            return ProgramEngine(Synthesiser(program, tuple(arguments), settings.volume), clock)
        case "auto" | "program" if installed is not None:
            return ProgramEngine(installed, clock)
        case "program":  # it will report that the program is missing
            return ProgramEngine(Synthesiser("espeak-ng", KNOWN_PROGRAMS["espeak-ng"]), clock)
    return None


def auto(keys: SpeechKeys, context: DriverContext) -> Voice:
    """Return the best available voice: with the Python package of espeak-ng, an installed program, or printed text."""
    return _make_from_keys("auto", keys, context)


def espeak(keys: SpeechKeys, context: DriverContext) -> Voice:
    """Return a voice that speaks with the Python package of espeak-ng."""
    return _make_from_keys("espeak", keys, context)


def program(keys: SpeechKeys, context: DriverContext) -> Voice:
    """Return a voice that speaks with an installed program such as espeak-ng."""
    return _make_from_keys("program", keys, context)


def piper(keys: SpeechKeys, context: DriverContext) -> Voice:
    """Return a voice that speaks with Piper."""
    return _make_from_keys("piper", keys, context)


def command(keys: SpeechKeys, context: DriverContext) -> Voice:
    """Return a voice that speaks with the command line in its section."""
    return _make_from_keys("command", keys, context)


def printed(keys: VoiceKeys, context: DriverContext) -> Voice:
    """Return a voice that prints its text."""
    return make_voice(
        VoiceSettings("print", keys.style),
        context.clock,
        context.print_line,
        report=context.report,
        changed=context.on_change,
    )


def _make_from_keys(driver: str, keys: SpeechKeys, context: DriverContext) -> Voice:
    model = str(Path(keys.model).expanduser().absolute()) if keys.model else ""
    settings = VoiceSettings(driver, keys.style, keys.volume, keys.device, model, keys.command)
    return make_voice(settings, context.clock, context.print_line, report=context.report, changed=context.on_change)
