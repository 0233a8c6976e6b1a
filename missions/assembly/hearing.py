"""The robot's ears: a microphone, and what understands the phrases that a mission listens for."""

from collections.abc import Callable, Sequence
from pathlib import Path

from config.microphone import MicrophoneConfig
from drivers.api import Health, Microphone, Notice, Report
from drivers.clock import Clock
from drivers.microphone.captured import CapturedMicrophone
from drivers.microphone.wav import WavMicrophone
from drivers.pipe import Worker
from missions.assembly.pronouncing import lexicon_for
from perception.api import Words
from perception.hearing.acceptance import learned
from perception.hearing.ears import Ears
from perception.hearing.engines import Sphinx, Vosk
from perception.hearing.grammar import Grammar
from perception.hearing.listener import Listener, never, unheard


class Hearing:
    """A microphone with ears behind it: the device ``microphone``, and a ``perception.api.Hearing``."""

    def __init__(self, microphone: Microphone, worker: Worker, listener: Listener, report: Report) -> None:
        self.name = microphone.name
        self.listener = listener
        self._microphone = microphone
        self._worker = worker
        self._ears = Ears(
            microphone,
            listener,
            worker,
            on_trouble=lambda error: report(
                Notice(microphone.name, "fault", f"what was said could not be searched: {error}")
            ),
        )

    def open(self) -> None:
        """Begin to listen; returns at once."""
        self._microphone.open()
        self._ears.open()

    def rest(self) -> None:
        """Do nothing: ears move nothing."""

    def close(self) -> None:
        """End it. Safe from any state, more than once."""
        self._ears.close()
        self._microphone.close()

    def health(self) -> Health:
        """Say whether sound arrives, and is understood."""
        sound, recogniser = self._microphone.health(), self._worker.health()
        if not sound.online:
            return sound
        if not recogniser.online or not self.listener.ready:
            detail = recogniser.detail or f"{self.name}: the recogniser is not ready yet"
            return Health(False, detail, recogniser.hint, sound.counters)
        return sound

    def words(self) -> Sequence[Words]:
        """See perception.api.Hearing."""
        return self.listener.words()

    def refused(self) -> Sequence[Words]:
        """See perception.api.Hearing."""
        return self.listener.refused()

    def listened(self) -> float | None:
        """See perception.api.Hearing."""
        return self.listener.listened()

    def level(self) -> float:
        """See perception.api.Hearing."""
        return self.listener.level()


def hearing(
    config: MicrophoneConfig,
    source: Microphone,
    phrases: Sequence[str],
    clock: Clock,
    *,
    report: Report,
    deaf: Callable[[float, float], bool] = never,
    changed: Callable[[], None] = unheard,
) -> Hearing:
    """Return ears that understand ``phrases`` of what comes from ``source``.

    Raises NotConnected without a recogniser, and BadRequest for words of which nobody knows how they are pronounced.
    """
    engine = _engine(config, Grammar.of(phrases), clock)
    worker = Worker("microphone", engine.program, clock, hint=engine.hint, report=report)
    return Hearing(
        source, worker, Listener(worker, engine, threshold=config.threshold, deaf=deaf, changed=changed), report
    )


def microphone(config: MicrophoneConfig, clock: Clock, report: Report) -> Microphone:
    """Return where the sound comes from that a robot file says; a relative path goes from the working folder."""
    if config.driver == "file":
        return WavMicrophone(Path(config.source).expanduser().absolute(), clock, report=report)
    return CapturedMicrophone(clock, device=config.source, report=report)


def _engine(config: MicrophoneConfig, grammar: Grammar, clock: Clock) -> Sphinx | Vosk:
    if config.recogniser == "vosk":
        return Vosk(grammar, Path(config.model).expanduser().absolute())
    return Sphinx(grammar, lexicon_for(config, grammar.words, clock), learned())
