"""Ears in a simulated world in real time.

They recognise synthesised speech if the packages for that are installed; otherwise they receive phrases as text.
"""

from collections.abc import Callable, Sequence
from importlib.util import find_spec
from threading import Event, Lock, Thread

from config.world import WorldConfig
from config.world_items import PersonConfig
from drivers.api import DeviceStatus, Health, SpeechStyle, StatusCallback, Voice
from drivers.api.sensor_sections import MicrophoneKeys
from drivers.clock import Clock
from drivers.extras import extra_hint
from drivers.microphone.twin import HearingTwin
from drivers.microphone.virtual import VoicedMicrophone
from drivers.sim.person_actions import PersonReply
from drivers.sound.engines import EspeakEngine
from missions.assembly.half_duplex import HalfDuplex
from missions.assembly.hearing import MicrophoneEars, make_ears
from perception.api import Words
from perception.hearing.grammar import PhraseGrammar

NEEDED_MODULES = ("espeakng_loader", "pocketsphinx")
"""Python modules for synthesised speech and its recognition."""

PERSON_VOICES = {
    "anna": "en-us+f2",
    "ben": "en-us+m7",
    "chidi": "en-us",
    "dora": "en-us+f4",
    "emil": "en+m3",
    "farah": "en+linda",
}
"""Synthesiser voice of each simulated person, by the person's look."""

WORDS_PER_MINUTE = 150.0
"""Speech rate of simulated people in words per minute."""


class TextEars:
    """Ears that receive the phrases of simulated people as text, for runs in real time. Queries are thread-safe."""

    def __init__(self, twin: HearingTwin[Words]) -> None:
        self.name = twin.name
        self._twin = twin
        self._lock = Lock()  # over the twin
        self._ending = Event()
        self._thread: Thread | None = None

    def open(self) -> None:
        """Start to listen. Idempotent."""
        if self._thread is None:
            self._twin.open()
            self._ending.clear()
            self._thread = Thread(target=self._run, name="hearing", daemon=True)
            self._thread.start()

    def rest(self) -> None:
        """Do nothing: ears do not move anything."""

    def close(self) -> None:
        """Stop listening, in any state. Idempotent."""
        self._ending.set()
        thread, self._thread = self._thread, None
        if thread is not None:
            thread.join()
        self._twin.close()

    def health(self) -> Health:
        """Return the health of the ears: whether they listen."""
        return self._twin.health()

    def hear(self, reply: PersonReply) -> None:
        """Process the phrase in ``reply``, which a person in the world says now."""
        with self._lock:
            self._twin.on_reply(reply)

    def words(self) -> Sequence[Words]:
        with self._lock:
            return self._twin.words()

    def refused(self) -> Sequence[Words]:
        with self._lock:
            return self._twin.refused()

    def listened(self) -> float | None:
        return self._twin.listened()

    def level(self) -> float:
        with self._lock:
            return self._twin.level()

    def _run(self) -> None:
        while not self._ending.wait(self._twin.STEP_INTERVAL):
            with self._lock:
                self._twin.step()


def make_simulated_ears(
    config: MicrophoneKeys,
    world: WorldConfig,
    phrases: Sequence[str],
    clock: Clock,
    *,
    voice: Voice | None,
    seed: int,
    report: StatusCallback,
    changed: Callable[[], None],
) -> tuple[MicrophoneEars | TextEars, Callable[[PersonReply], None]]:
    """Return ears, and a function to call with each phrase that people say within earshot. Raises BadRequest."""
    if config.recogniser == "pocketsphinx" and all(find_spec(name) for name in NEEDED_MODULES):
        people = {person.name: _manner(person) for person in world.people}
        engine = EspeakEngine(
            clock,
            default_manner=SpeechStyle(PERSON_VOICES["chidi"], WORDS_PER_MINUTE),
            report=report,
            name="microphone",
        )
        source = VoicedMicrophone(
            clock, engine, lambda who: people[who], is_deaf=HalfDuplex(voice, clock).may_be_own_speech, report=report
        )
        deaf = HalfDuplex(voice, clock).may_be_own_speech
        ears = make_ears(config, source, phrases, clock, report=report, deaf=deaf, changed=changed)
        return ears, source.on_reply
    text = TextEars(
        HearingTwin(
            clock,
            PhraseGrammar.from_texts(phrases),
            Words,
            is_deaf=HalfDuplex(voice, clock).may_be_own_speech,
            mishearing=world.physics.mishearing,
            seed=seed,
            report=report,
            changed=changed,
        )
    )
    reason = "people's speech arrives as text: no synthesis or recognition is installed"
    report(DeviceStatus("microphone", "fault", reason, extra_hint("speak", extra_hint("listen"))))
    return text, text.hear


def _manner(person: PersonConfig) -> SpeechStyle:
    return SpeechStyle(PERSON_VOICES[person.look], WORDS_PER_MINUTE)
