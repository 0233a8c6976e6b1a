"""Microphone in a simulated world: hears the replies of people, spoken by a synthesiser, and a quiet room's noise."""

from collections.abc import Callable
from queue import SimpleQueue
from threading import Event, Lock, Thread

import numpy as np

from drivers.api import SOUND_RATE, DeviceStatus, Health, Samples, Sound, SpeechStyle, StatusCallback, ignore
from drivers.clock import Clock
from drivers.errors import DriverError
from drivers.microphone.twin import never_deaf
from drivers.microphone.wav_microphone import MAX_KEPT_PIECES, PIECE_SAMPLES, resample
from drivers.sim.person_actions import PersonReply
from drivers.sound.cancel_token import CancelToken
from drivers.sound.engines import SpeechEngine

NOISE_LEVEL = 25.0
"""Standard deviation of the noise of a quiet room, in units of 16-bit samples."""

VOICE_GAIN = 0.4
"""Factor by which the synthesiser's samples are scaled, as for a person some way from the microphone."""

SPEECH_LEAD_TIME = 0.05
"""Seconds from now at which speech starts at the earliest, since pieces already read cannot be changed."""

CLOSED = None


class VoicedMicrophone:
    """Simulated microphone: a ``drivers.api.Microphone`` that hears the replies of simulated people.

    ``engine`` synthesises the speech, ``voice_of(name)`` returns the voice of a person. ``is_deaf(start, end)`` returns
    True if the robot itself speaks in that time; people begin to speak only after the robot has ended.
    """

    name = "microphone"

    def __init__(
        self,
        clock: Clock,
        engine: SpeechEngine,
        voice_of: Callable[[str], SpeechStyle],
        *,
        is_deaf: Callable[[float, float], bool] = never_deaf,
        report: StatusCallback = ignore,
    ) -> None:
        self._clock = clock
        self._engine = engine
        self._voice_of = voice_of
        self._is_deaf = is_deaf
        self._report = report
        self._lock = Lock()  # over the speeches
        self._speeches: list[tuple[int, Samples]] = []  # the number of its first sample, and the sound
        self._replies: SimpleQueue[PersonReply | None] = SimpleQueue()
        self._closing = Event()
        self._thread: Thread | None = None
        self._opened_at: float | None = None

    def open(self) -> None:
        if self._thread is None:
            self._closing.clear()
            self._engine.open()
            self._opened_at = self._clock.now()
            self._thread = Thread(target=self._run, name="people", daemon=True)
            self._thread.start()

    def rest(self) -> None:
        """Do nothing: a microphone has no actuator."""

    def close(self) -> None:
        self._closing.set()
        self._replies.put(CLOSED)
        thread, self._thread = self._thread, None
        self._engine.close()
        if thread is not None:
            thread.join()
        self._opened_at = None

    def health(self) -> Health:
        if self._opened_at is None:
            return Health(False, f"{self.name}: not opened yet", "open it first")
        return Health(not self._engine.failure_reason, self._engine.failure_reason)

    def on_reply(self, reply: PersonReply) -> None:
        """Queue the reply of a person, to be spoken now. From any thread."""
        self._replies.put(reply)

    def read(self, after: int) -> list[Sound]:
        """Return the pieces up to now with a number above ``after``, from the last 5 s."""
        began = self._opened_at
        if began is None:
            return []
        sounded = self._elapsed_samples() // PIECE_SAMPLES
        wanted = range(max(after + 1, sounded - MAX_KEPT_PIECES, 0), sounded)
        return [Sound(each, began + each * PIECE_SAMPLES / SOUND_RATE, self._piece(each)) for each in wanted]

    def _elapsed_samples(self) -> int:
        """Return the number of samples since the microphone was opened."""
        return int((self._clock.now() - (self._opened_at or 0.0)) * SOUND_RATE + 1e-6)

    def _piece(self, number: int) -> Samples:
        """Return a piece: noise, seeded by its number, plus the speech in it."""
        sound = np.random.default_rng(number).normal(0.0, NOISE_LEVEL, PIECE_SAMPLES)
        first = number * PIECE_SAMPLES
        with self._lock:
            for start, speech in self._speeches:
                low, high = max(start, first), min(start + len(speech), first + PIECE_SAMPLES)
                if low < high:
                    sound[low - first : high - first] += speech[low - start : high - start] * VOICE_GAIN
        return np.asarray(np.clip(np.rint(sound), -32768, 32767), np.int16)

    # --- the thread ---------------------------------------------------------------------------------------------------

    def _run(self) -> None:
        while (reply := self._replies.get()) is not CLOSED and not self._closing.is_set():
            try:
                self._speak(reply)
            except Exception as error:  # whatever it is: the next one may be heard
                if not self._closing.is_set():
                    hint = error.hint if isinstance(error, DriverError) else ""
                    self._report(DeviceStatus(self.name, "fault", f"{reply.speaker} cannot be heard: {error}", hint))

    def _speak(self, reply: PersonReply) -> None:
        """Synthesise the speech of a reply, wait until the robot is silent, and add the speech to the sound."""
        spoken = self._engine.speak(reply.text, self._voice_of(reply.speaker), CancelToken())
        if spoken is None:
            return
        sound = resample(np.frombuffer(spoken.samples, "<i2").astype(np.float64), spoken.rate)
        while self._is_deaf(self._clock.now(), self._clock.now() + SPEECH_LEAD_TIME) and not self._closing.wait(
            SPEECH_LEAD_TIME
        ):
            pass
        start = self._elapsed_samples() + round(SPEECH_LEAD_TIME * SOUND_RATE)
        with self._lock:
            now = self._elapsed_samples()
            latest = max((each + len(speech) for each, speech in self._speeches), default=0)
            self._speeches = [
                (each, speech)
                for each, speech in self._speeches
                if each + len(speech) > now - MAX_KEPT_PIECES * PIECE_SAMPLES
            ]
            self._speeches.append((max(start, latest), sound))  # one after another, as polite people do
