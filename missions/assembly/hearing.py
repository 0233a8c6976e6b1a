"""Ears of a robot: a microphone, and a recogniser for the phrases of a mission."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from config.robot import Section
from drivers.api import Device, DeviceStatus, Health, Microphone, StatusCallback, Voice
from drivers.api.driver import resolve_name
from drivers.api.sensor_sections import MicrophoneKeys
from drivers.clock import Clock
from drivers.transport.worker_process import WorkerProcess
from missions.assembly.half_duplex import HalfDuplex
from missions.library.pronunciation import lexicon_for
from perception.api import Hearing as Heard
from perception.api import Words, ignore
from perception.hearing.acceptance import load_acceptance
from perception.hearing.engines import MODEL_ENGINES, ModelEngine, SphinxEngine
from perception.hearing.grammar import PhraseGrammar
from perception.hearing.listener import Ears, SpeechListener, never_deaf

if TYPE_CHECKING:
    from missions.assembly.assemble import RealPartFactory


class MicrophoneEars:
    """Ears of a robot: the device of the part ``microphone`` together with a speech recogniser.

    It implements ``perception.api.Hearing``.
    """

    def __init__(
        self, microphone: Microphone, worker: WorkerProcess, listener: SpeechListener, report: StatusCallback
    ) -> None:
        self.name = microphone.name
        self.listener = listener
        self._microphone = microphone
        self._worker = worker
        self._ears = Ears(
            microphone,
            listener,
            worker,
            on_trouble=lambda error: report(
                DeviceStatus(microphone.name, "fault", f"speech could not be processed: {error}")
            ),
        )

    def open(self) -> None:
        """Start to listen; returns at once."""
        self._microphone.open()
        self._ears.open()

    def rest(self) -> None:
        """Do nothing: ears do not move anything."""

    def close(self) -> None:
        """Stop listening, in any state. Idempotent."""
        self._ears.close()
        self._microphone.close()

    def health(self) -> Health:
        """Return the health of the microphone, or of the recogniser if the microphone works."""
        sound, recogniser = self._microphone.health(), self._worker.health()
        if not sound.online:
            return sound
        if not recogniser.online or not self.listener.is_ready:
            detail = recogniser.detail or f"{self.name}: the recogniser is not ready yet"
            return Health(False, detail, recogniser.hint, sound.counters)
        return sound

    def words(self) -> Sequence[Words]:
        return self.listener.words()

    def refused(self) -> Sequence[Words]:
        return self.listener.refused()

    def listened(self) -> float | None:
        return self.listener.listened()

    def level(self) -> float:
        return self.listener.level()


def real_ears(factory: "RealPartFactory", section: Section, devices: Mapping[str, Any]) -> tuple[Device, Heard]:
    """Return ears for the phrases of a mission, as the device to open and as the part that leaves use.

    They ignore sound during the robot's own speech.
    """
    keys: MicrophoneKeys = section.keys
    voice: Voice | None = devices.get("voice")
    overrides, hooks, simulation = factory.overrides, factory.hooks, factory.simulation
    phrases = overrides.interests.phrases
    if simulation is None or overrides.world is None:
        source: Microphone = factory.device(section)
        deaf = HalfDuplex(voice, factory.clock).may_be_own_speech
        found = make_ears(keys, source, phrases, factory.clock, report=hooks.report, deaf=deaf, changed=hooks.on_change)
        return found, found
    ears, simulation.on_reply = resolve_name("missions.assembly.simulated_hearing:make_simulated_ears")(
        keys,
        overrides.world,
        phrases,
        factory.clock,
        voice=voice,
        seed=overrides.seed,
        report=hooks.report,
        changed=hooks.on_change,
    )
    return ears, ears


def make_ears(
    config: MicrophoneKeys,
    source: Microphone,
    phrases: Sequence[str],
    clock: Clock,
    *,
    report: StatusCallback,
    deaf: Callable[[float, float], bool] = never_deaf,
    changed: Callable[[], None] = ignore,
) -> MicrophoneEars:
    """Return ears that recognise ``phrases`` in the sound of ``source``.

    ``deaf(start, end)`` returns whether to ignore the sound between two times (s); ``changed`` is called after a
    phrase.
    """
    engine = _engine(config, PhraseGrammar.from_texts(phrases), clock)
    worker = WorkerProcess("microphone", engine.program, clock, hint=engine.hint, report=report)
    return MicrophoneEars(
        source,
        worker,
        SpeechListener(worker, engine, threshold=config.threshold, is_deaf=deaf, changed=changed),
        report,
    )


def _engine(config: MicrophoneKeys, grammar: PhraseGrammar, clock: Clock) -> SphinxEngine | ModelEngine:
    if (kind := MODEL_ENGINES.get(config.recogniser)) is not None:
        return kind(grammar, Path(config.model).expanduser().absolute())
    return SphinxEngine(grammar, lexicon_for(config, grammar.words, clock), load_acceptance())
