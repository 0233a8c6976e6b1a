"""The robot's ears: a microphone, and what understands the phrases that a mission listens for."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from config.robot import Section
from drivers.api import Device, DeviceStatus, Health, Microphone, Report, Voice
from drivers.api.driver import resolved
from drivers.api.senses import MicrophoneKeys
from drivers.clock import Clock
from drivers.transport.pipe import Worker
from missions.assembly.duplex import HalfDuplex
from missions.library.pronouncing import lexicon_for
from perception.api import Hearing as Heard
from perception.api import Words, ignore
from perception.hearing.acceptance import learned
from perception.hearing.engines import MODELLED, Modelled, Sphinx
from perception.hearing.grammar import Grammar
from perception.hearing.listener import Ears, Listener, never

if TYPE_CHECKING:
    from missions.assembly.assemble import Place


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
                DeviceStatus(microphone.name, "fault", f"what was said could not be searched: {error}")
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


def real_ears(place: "Place", section: Section, made: Mapping[str, Any]) -> tuple[Device, Heard]:
    """Return ears that understand the phrases of a mission, and do not hear the robot itself speak."""
    keys: MicrophoneKeys = section.keys
    voice: Voice | None = made.get("voice")
    wishes, audience, simulation = place.wishes, place.audience, place.simulation
    phrases = wishes.interests.phrases
    if simulation is None or wishes.world is None:
        source: Microphone = place.device(section)
        deaf = HalfDuplex(voice, place.clock).deaf
        found = hearing(keys, source, phrases, place.clock, report=audience.report, deaf=deaf, changed=audience.changed)
        return found, found
    ears, simulation.robot_hears = resolved("missions.assembly.simulated_hearing:simulated_hearing")(
        keys,
        wishes.world,
        phrases,
        place.clock,
        voice=voice,
        seed=wishes.seed,
        report=audience.report,
        changed=audience.changed,
    )
    return ears, ears


def hearing(
    config: MicrophoneKeys,
    source: Microphone,
    phrases: Sequence[str],
    clock: Clock,
    *,
    report: Report,
    deaf: Callable[[float, float], bool] = never,
    changed: Callable[[], None] = ignore,
) -> Hearing:
    """Return ears that understand ``phrases`` of what comes from ``source``.

    Raises NotConnected without a recogniser, and BadRequest for words of which nobody knows how they are pronounced.
    """
    engine = _engine(config, Grammar.of(phrases), clock)
    worker = Worker("microphone", engine.program, clock, hint=engine.hint, report=report)
    return Hearing(
        source, worker, Listener(worker, engine, threshold=config.threshold, deaf=deaf, changed=changed), report
    )


def _engine(config: MicrophoneKeys, grammar: Grammar, clock: Clock) -> Sphinx | Modelled:
    if (kind := MODELLED.get(config.recogniser)) is not None:
        return kind(grammar, Path(config.model).expanduser().absolute())
    return Sphinx(grammar, lexicon_for(config, grammar.words, clock), learned())
