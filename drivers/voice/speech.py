"""The voice of a machine that has one: words and sounds in their turn, on a thread of its own."""

import shlex
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from threading import Condition, Thread

from drivers.api import (
    AS_USUAL,
    DeviceStatus,
    Health,
    Manner,
    Priority,
    Report,
    Utterance,
    Voice,
    ignore,
)
from drivers.api.driver import Site
from drivers.api.quick import dataclass
from drivers.api.sections import VoiceKeys
from drivers.clock import Clock
from drivers.errors import BadRequest, DeviceFault, DriverError, NotConnected
from drivers.sound.cut import Cut
from drivers.sound.engines import Engine, Espeak, Piper
from drivers.sound.player import Player
from drivers.sound.program import KNOWN, Speaker, Synthesiser, find_synthesiser
from drivers.sound.spoken import SpokenWords, Turns, filled, movement, seconds_of
from drivers.sound.wav import checked, length_of
from drivers.transport.loop import guarded
from drivers.voice.declared import SpeechKeys


class SpeechVoice:
    """A ``drivers.api.Voice`` that speaks with ``engine`` and plays with ``player``; ``usual`` is the robot's manner.

    Whatever takes the first of its ``Turns`` breaks off what has it, which is said again afterwards. What cannot be
    heard goes to ``out``, and takes as long; why, is reported. ``changed`` is called from the thread whenever something
    has ended.
    """

    name = "voice"

    def __init__(
        self,
        clock: Clock,
        engine: Engine,
        player: Player,
        out: Callable[[str], None],
        *,
        usual: Manner = AS_USUAL,
        report: Report = ignore,
        changed: Callable[[], None] = ignore,
    ) -> None:
        self._clock = clock
        self._engine = engine
        self._player = player
        self._usual = usual
        self._out = guarded(out)
        self._report = guarded(report)
        self._changed = guarded(changed)
        self._turn = Condition()  # over everything below
        self._turns = Turns[SpokenWords]()
        self._current: SpokenWords | None = None
        self._cut = Cut()  # of the current one
        self._thread: Thread | None = None
        self._ending = False
        self._trouble = ("", "")
        self._counters = {"said": 0, "failed": 0}

    def open(self) -> None:
        """Start the thread that speaks, and the programs; returns at once."""
        with self._turn:
            if self._thread is None:
                self._ending = False
                self._engine.open()
                if not self._engine.speaks_itself:
                    self._player.open()
                self._thread = Thread(target=self._run, name=f"voice {self.name}", daemon=True)
                self._thread.start()

    def rest(self) -> None:
        """Fall silent: cancel all that is being said or waiting."""
        with self._turn:
            for words in self._turns:
                words.cancel()

    def close(self) -> None:
        """Fall silent at once, end the thread and the programs."""
        with self._turn:
            self._ending = True
            self.rest()
            self._turn.notify_all()
            thread, self._thread = self._thread, None
        if thread is not None:
            thread.join()
        self._engine.close()
        self._player.close()

    def health(self) -> Health:
        """Say whether it can speak; after a failure, how the last utterance failed."""
        with self._turn:
            counters = dict(self._counters)
            if self._thread is None:
                return Health(False, f"{self.name}: not opened yet", counters=counters)
            broken = self._engine.broken or self._player.broken
            if broken:
                return Health(False, broken, "until then it prints what it would say", counters)
            mute = self._player.mute
            trouble = (mute, self._player.hint) if mute else self._trouble
            return Health(True, *trouble, counters=counters)

    def say(self, text: str, manner: Manner = AS_USUAL, priority: Priority = Priority.NORMAL) -> Utterance:
        """Speak ``text`` in its turn. Raises NotConnected before ``open`` and after ``close``."""
        return self._queued(SpokenWords(self._drop, text, filled(manner, self._usual), priority, None))

    def play(self, path: Path, priority: Priority = Priority.NORMAL) -> Utterance:
        """Play a file in its turn. Raises BadRequest and NotConnected."""
        return self._queued(SpokenWords(self._drop, f"[{path.name}]", self._usual, priority, checked(self.name, path)))

    def speaking(self) -> Utterance | None:
        """Return what is heard now."""
        current = self._current
        return current if current is not None and current.started is not None else None

    def _queued(self, words: SpokenWords) -> SpokenWords:
        with self._turn:
            if self._thread is None:
                raise NotConnected(f"{self.name}: not open, cannot say {words.text!r}")
            if not words.text.strip():
                words.ended.set()
                return words
            self._turns.insert(words)
            if self._current is not None and self._turns.first is not self._current:
                self._cut.make()
            self._turn.notify_all()
        return words

    def _drop(self, words: SpokenWords, *, cancelled: bool = True) -> None:
        """End ``words`` now: take them out of the queue, and break them off if they are being said."""
        with self._turn:
            if not words.done():
                words.cancelled = cancelled
            words.ended.set()
            self._turns.drop(words)
            if words is self._current:
                self._cut.make()

    # --- the thread ---------------------------------------------------------------------------------------------------

    def _run(self) -> None:
        while True:
            with self._turn:
                self._turn.wait_for(lambda: self._turns.first or self._ending)
                words, cut = self._turns.first, Cut()
                if self._ending or words is None:
                    return
                self._current, self._cut = words, cut
            whole = self._say(words, cut)
            with self._turn:
                self._current = None
                if whole:
                    self._drop(words, cancelled=False)
                words.forget()
            if words.done():
                self._changed()

    def _say(self, words: SpokenWords, cut: Cut) -> bool:
        """Say or play ``words``; True when they have come to their end. What cannot be heard is printed."""
        try:
            whole = self._sound(words, cut)
        except BadRequest as error:  # it is no sound: there is nothing to take time for
            self._fail(error)
            words.cancel()
            return False
        except DriverError as error:
            self._fail(error)
        except Exception as error:  # whatever it is: this thread is the robot's voice
            self._fail(DeviceFault(f"{self.name}: {words.text[:40]!r}: {type(error).__name__}: {error}"))
        else:
            if whole:
                with self._turn:
                    self._counters["said"] += 1
                    self._trouble = ("", "")
            return whole
        return self._print(words, cut)

    def _sound(self, words: SpokenWords, cut: Cut) -> bool:
        def begun(at: float, seconds: float) -> None:
            words.begin(at, seconds)
            if self._player.mute:
                self._out(words.text)

        if words.path is not None:
            words.seconds = length_of(words.path)
            self._player.open()
            return self._player.play_file(words.path, cut, begun)
        words.seconds = seconds_of(words.text, words.manner.speed)
        if self._engine.speaks_itself:
            words.begin(self._clock.now(), words.seconds)
        speech = self._engine.speak(words.text, words.manner, cut)
        if speech is None:
            return not cut.made
        words.seconds, words.shapes = speech.seconds, movement(speech.phonemes, speech.seconds)
        return self._player.play(speech, cut, begun)

    def _fail(self, error: DriverError) -> None:
        trouble = str(error), error.hint
        with self._turn:
            self._counters["failed"] += 1
            known, self._trouble = trouble == self._trouble, trouble
        if not known and not isinstance(error, NotConnected):  # which the program's keeper has told already
            self._report(DeviceStatus(self.name, "fault", *trouble))

    def _print(self, words: SpokenWords, cut: Cut) -> bool:
        """Print what cannot be heard, and take as long, or what is left of that; False when it was broken off."""
        if cut.made:
            return False
        if words.started is None or not self._player.mute:
            self._out(words.text)
        if words.started is None:
            words.begin(self._clock.now(), words.seconds)
        return not cut.wait(words.end - self._clock.now())


# From the keys of a robot file to a voice; one that cannot speak here prints its words.

WHEELS = ("espeakng_loader", "miniaudio")
"""What the extra ``speak`` installs."""


@dataclass(frozen=True, slots=True)
class Wish:
    """The voice that is wanted, in the words of a robot file; ``backend`` is one of miniaudio's, for tests."""

    driver: str = "auto"
    usual: Manner = AS_USUAL
    volume: float = 1.0
    device: str = ""
    model: str = ""
    command: str = ""
    backend: str = ""


def make_voice(
    wish: Wish,
    clock: Clock,
    out: Callable[[str], None],
    *,
    report: Report = ignore,
    changed: Callable[[], None] = ignore,
) -> Voice:
    """Return a voice; ``out`` prints what cannot be heard."""
    engine = _engine(wish, clock, report)
    if engine is None:
        from drivers.sound.printed import PrintedVoice  # noqa: PLC0415 - a voice that is heard prints by itself

        return PrintedVoice(clock, out, usual=wish.usual, changed=changed)
    player = Player(clock, device=wish.device, volume=wish.volume, backend=wish.backend, report=report)
    return SpeechVoice(clock, engine, player, out, usual=wish.usual, report=report, changed=changed)


def _engine(wish: Wish, clock: Clock, report: Report) -> Engine | None:
    installed = find_synthesiser(volume=wish.volume) if wish.driver in ("auto", "program") else None
    match wish.driver:
        case "espeak":
            return Espeak(clock, usual=wish.usual, report=report)
        case "auto" if all(find_spec(wheel) for wheel in WHEELS):
            return Espeak(clock, usual=wish.usual, report=report)
        case "piper":
            return Piper(Path(wish.model).expanduser(), clock)
        case "command":
            program, *arguments = shlex.split(wish.command)
            return Speaker(Synthesiser(program, tuple(arguments), wish.volume), clock)
        case "auto" | "program" if installed is not None:
            return Speaker(installed, clock)
        case "program":  # which will say that it is missing
            return Speaker(Synthesiser("espeak-ng", KNOWN["espeak-ng"]), clock)
    return None


def auto(keys: SpeechKeys, site: Site) -> Voice:
    """Return the first of a synthesiser's wheel, an installed synthesiser and printing that there is."""
    return _voice("auto", keys, site)


def espeak(keys: SpeechKeys, site: Site) -> Voice:
    """Return the voice of the synthesiser's wheel."""
    return _voice("espeak", keys, site)


def program(keys: SpeechKeys, site: Site) -> Voice:
    """Return the voice of an installed synthesiser."""
    return _voice("program", keys, site)


def piper(keys: SpeechKeys, site: Site) -> Voice:
    """Return a voice of Piper."""
    return _voice("piper", keys, site)


def command(keys: SpeechKeys, site: Site) -> Voice:
    """Return the voice of a command line."""
    return _voice("command", keys, site)


def printed(keys: VoiceKeys, site: Site) -> Voice:
    """Return a voice that prints its words."""
    return make_voice(Wish("print", keys.manner), site.clock, site.out, report=site.report, changed=site.changed)


def _voice(driver: str, keys: SpeechKeys, site: Site) -> Voice:
    model = str(Path(keys.model).expanduser().absolute()) if keys.model else ""
    wish = Wish(driver, keys.manner, keys.volume, keys.device, model, keys.command)
    return make_voice(wish, site.clock, site.out, report=site.report, changed=site.changed)
