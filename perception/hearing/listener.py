"""Speech recognition: from pieces of sound to recognised phrases, by a worker process."""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from enum import Enum
from threading import Event, Lock, Thread
from typing import Any, Final, Protocol

import numpy as np

from perception.api import Words, ignore
from perception.hearing.engines import Judgement
from perception.hearing.sound import FULL_SCALE_LEVEL, RATE, Clip, EndPointer, Piece, levels

MAX_WORD_AGE = 30.0
"""Seconds for which recognised words are kept."""

MAX_WAITING_CLIPS = 8
"""Largest number of clips that wait for the recogniser.

A recogniser that works is ten times as fast as speech, so more clips wait only if it has died.
"""

SILENCE_LEVEL = -90.0
"""Level of digital silence in dBFS."""

CLIP_TIMEOUT = 10.0
"""Seconds within which the recogniser must decode a clip; otherwise it counts as hanging and is killed."""

START_TIMEOUT = 60.0
"""Seconds within which the recogniser must start; large models of Vosk load slowly."""


class RecogniserState(Enum):
    """State of the recogniser's process: it loads its model, waits for a clip, or decodes one."""

    ABSENT, STARTING, READY, DECODING = range(4)


class RecogniserEvent(Enum):
    """Event of the recogniser's process: it has started, is ready, got a clip, has decoded it, or has died."""

    STARTED, READY, CLIP_SENT, DECODED, LOST = range(5)


TRANSITIONS: Final = {
    **{(state, RecogniserEvent.STARTED): RecogniserState.STARTING for state in RecogniserState},
    **{(state, RecogniserEvent.LOST): RecogniserState.ABSENT for state in RecogniserState},
    (RecogniserState.STARTING, RecogniserEvent.READY): RecogniserState.READY,
    (RecogniserState.READY, RecogniserEvent.READY): RecogniserState.READY,
    (RecogniserState.DECODING, RecogniserEvent.READY): RecogniserState.DECODING,
    (RecogniserState.READY, RecogniserEvent.CLIP_SENT): RecogniserState.DECODING,
    (RecogniserState.DECODING, RecogniserEvent.DECODED): RecogniserState.READY,
}


class RecogniserHandler(Protocol):
    """Receiver of the messages of the speech recogniser's worker process."""

    def on_started(self) -> None:
        """Called when the process has started; it needs its setup."""
        ...

    def on_message(self, message: Mapping[str, Any], body: bytes) -> None:
        """Called for each message of the process."""
        ...

    def on_exit(self, reason: str) -> None:
        """Called when the process has died."""
        ...


class RecogniserWorker(Protocol):
    """Worker process that is restarted if it dies, as ``drivers.transport.worker_process.WorkerProcess``."""

    def open(self, handler: RecogniserHandler) -> None:
        """Start the process."""
        ...

    def close(self) -> None:
        """End the process. Safe more than once."""
        ...

    def kill(self) -> None:
        """Kill the process; it is restarted."""
        ...

    def send(self, message: Mapping[str, Any], body: bytes = b"", *, timeout: float = 1.0) -> None:
        """Send a message to the process, followed by the bytes of ``body``. Raises OSError if it cannot be sent.

        ``timeout`` is the maximum time to wait, in seconds.
        """
        ...


class RecogniserEngine(Protocol):
    """Translator between the listener and one kind of recogniser, such as ``perception.hearing.engines.SphinxEngine``.

    It makes the messages to the worker process, and interprets the replies.
    """

    def setup_message(self) -> Mapping[str, Any]:
        """Return the setup message for a new worker process, such as its model and the phrases to listen for."""
        ...

    def prepare_sound(self, clip: Clip) -> bytes:
        """Return the sound of a clip that is to be decoded."""
        ...

    def judge(self, clip: Clip, answer: Mapping[str, Any]) -> Judgement:
        """Return the phrase and score for the worker's reply to a clip."""
        ...


def never_deaf(_start: float, _end: float) -> bool:
    """Return False, since the robot does not speak: the default ``is_deaf`` for a robot without a voice."""
    return False


class SpeechListener:
    """Recognises phrases in sound: a ``perception.api.Hearing``, and the handler of its ``worker``.

    Phrases with a score of ``threshold`` or more are accepted. Sound is ignored while ``is_deaf(start, end)``, because
    the robot itself speaks. ``changed`` is called from the worker's thread after new words, accepted or not, and must
    return at once. ``process`` is for one thread, the rest for any.
    """

    def __init__(
        self,
        worker: RecogniserWorker,
        engine: RecogniserEngine,
        *,
        threshold: float = 0.0,
        is_deaf: Callable[[float, float], bool] = never_deaf,
        changed: Callable[[], None] = ignore,
    ) -> None:
        self._worker = worker
        self._engine = engine
        self._threshold = threshold
        self._is_deaf = is_deaf
        self._changed = changed
        self._end_pointer = EndPointer()
        self._newest_number: int | None = None  # of the newest piece
        self._recent_sound = np.zeros(0, np.int16)
        self._lock = Lock()  # over everything below
        self._state = RecogniserState.ABSENT
        self._waiting_clips: deque[Clip] = deque(maxlen=MAX_WAITING_CLIPS)
        self._sent_clip: Clip  # the newest clip that was sent
        self._waiting_since: float | None = None  # time of the first sound after the last request
        self._sent_count = 0
        self._accepted: deque[Words] = deque()
        self._refused: deque[Words] = deque()
        self._listened_until: float | None = None

    # --- Hearing ------------------------------------------------------------------------------------------------------

    def words(self) -> tuple[Words, ...]:
        return self._recent_words(self._accepted)

    def refused(self) -> tuple[Words, ...]:
        return self._recent_words(self._refused)

    def listened(self) -> float | None:
        return self._listened_until

    def level(self) -> float:
        """Return the level of the last 0.1 s, in dBFS."""
        recent = self._recent_sound
        return (
            max(SILENCE_LEVEL, float(levels(recent, len(recent))[0] - FULL_SCALE_LEVEL))
            if len(recent)
            else SILENCE_LEVEL
        )

    @property
    def is_ready(self) -> bool:
        """True while the recogniser is set up and running."""
        return self._state in (RecogniserState.READY, RecogniserState.DECODING)

    @property
    def is_pending(self) -> bool:
        """True while clips of speech wait to be decoded, or one is being decoded."""
        with self._lock:
            return bool(self._waiting_clips) or self._state is RecogniserState.DECODING

    # --- sound --------------------------------------------------------------------------------------------------------

    def process(self, piece: Piece) -> None:
        """Process the next piece of sound."""
        self._recent_sound = np.concatenate([self._recent_sound, piece.samples])[-RATE // 10 :]
        gap = self._newest_number is not None and piece.number != self._newest_number + 1
        self._newest_number = piece.number
        deaf = self._is_deaf(piece.stamp, piece.end)
        if gap or deaf:
            self._end_pointer.reset()
        clips = [] if deaf else self._end_pointer.process(piece.samples, piece.stamp)
        with self._lock:
            self._waiting_clips.extend(clips)
            hangs = self._is_hanging(piece.end)
            if self.is_ready and not hangs:
                self._listened_until = piece.end
        if hangs:
            self._worker.kill()
        if clips:
            self._send_next_clip()

    def _is_hanging(self, now: float) -> bool:
        """Return whether the recogniser takes longer than ``CLIP_TIMEOUT`` or ``START_TIMEOUT``.

        ``now`` is the time of the newest sound, so that a pause of the microphone does not count.
        """
        if self._state not in (RecogniserState.STARTING, RecogniserState.DECODING):
            return False
        if self._waiting_since is None:
            self._waiting_since = now
        return now - self._waiting_since > (START_TIMEOUT if self._state is RecogniserState.STARTING else CLIP_TIMEOUT)

    def _send_next_clip(self) -> None:
        """Send the oldest waiting clip to the recogniser, if it is ready."""
        with self._lock:
            if self._state is not RecogniserState.READY or not self._waiting_clips:
                return
            self._handle_event(RecogniserEvent.CLIP_SENT)
            self._sent_count += 1
            self._waiting_since = None
            number, clip = self._sent_count, self._waiting_clips.popleft()
            self._sent_clip = clip
        with suppress(OSError):  # it is dying, and ``on_exit`` follows
            self._worker.send({"decode": number}, self._engine.prepare_sound(clip), timeout=CLIP_TIMEOUT)

    def _handle_event(self, event: RecogniserEvent) -> None:
        self._state = TRANSITIONS[self._state, event]

    # --- the worker's thread ------------------------------------------------------------------------------------------

    def on_started(self) -> None:
        """Send the setup message to the recogniser's process, which has just started."""
        with self._lock:
            self._handle_event(RecogniserEvent.STARTED)
            self._waiting_since = None
        with suppress(OSError):  # it is dying, and ``on_exit`` follows
            self._worker.send(self._engine.setup_message(), timeout=CLIP_TIMEOUT)

    def on_exit(self, reason: str) -> None:  # noqa: ARG002 - the worker reports it
        """Drop the clip that was being decoded, since this clip may be the cause of the process's death."""
        with self._lock:
            self._handle_event(RecogniserEvent.LOST)

    def on_message(self, message: Mapping[str, Any], body: bytes) -> None:  # noqa: ARG002 - none is sent
        """Process a reply of the recogniser's process, and send it the next clip."""
        with self._lock:
            if "ready" in message:
                self._handle_event(RecogniserEvent.READY)
            decoded = self._state is RecogniserState.DECODING and message.get("decoded") == self._sent_count
        if decoded:
            try:
                self._store_words(self._sent_count, self._sent_clip, *self._engine.judge(self._sent_clip, message))
            finally:
                with self._lock:
                    self._handle_event(RecogniserEvent.DECODED)
            self._changed()
        self._send_next_clip()

    def _store_words(self, number: int, clip: Clip, phrase: str, score: float) -> None:
        words = Words(number, phrase, clip.start, clip.end, score)
        with self._lock:
            kept = self._accepted if phrase and score >= self._threshold else self._refused
            kept.appendleft(words)

    def _recent_words(self, kept: deque[Words]) -> tuple[Words, ...]:
        with self._lock:
            while kept and kept[-1].stamp < (self._listened_until or 0.0) - MAX_WORD_AGE:
                kept.pop()
            return tuple(kept)


# The robot's ears: listen to a microphone on a thread of their own.

READ_INTERVAL = 0.05
"""Seconds between two reads of the microphone."""


class SoundSource(Protocol):
    """Source of sound, such as a microphone."""

    def read(self, after: int) -> Sequence[Piece]:
        """Return the pieces with a number above ``after``, oldest first."""
        ...


class Ears:
    """Passes the sound of ``source`` to ``listener`` on its own thread, and manages the listener's ``worker``.

    After an error the sound that caused it is dropped. The error is passed to ``on_trouble`` unless it equals the last
    one.
    """

    def __init__(
        self,
        source: SoundSource,
        listener: SpeechListener,
        worker: RecogniserWorker,
        *,
        on_trouble: Callable[[Exception], None] = ignore,
    ) -> None:
        self._source = source
        self._listener = listener
        self._worker = worker
        self._on_trouble = on_trouble
        self._last_error = ""
        self._newest_number = -1
        self._closing = Event()
        self._thread: Thread | None = None

    def open(self) -> None:
        """Start listening; returns at once. Safe more than once."""
        if self._thread is None:
            self._closing.clear()
            self._newest_number = -1  # a microphone may restart its numbers
            self._worker.open(self._listener)
            self._thread = Thread(target=self._run, name="ears", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """End the thread and the recogniser. Safe from any state, more than once, but not from a callback."""
        self._closing.set()
        thread, self._thread = self._thread, None
        self._worker.close()
        if thread is not None:
            thread.join()

    def _run(self) -> None:
        while not self._closing.wait(READ_INTERVAL):
            try:
                for piece in self._source.read(self._newest_number):
                    self._newest_number = piece.number
                    self._listener.process(piece)
            except Exception as error:  # any error: a permanently deaf robot is worse
                self._report_error(error)

    def _report_error(self, error: Exception) -> None:
        what = f"{type(error).__name__}: {error}"
        if what != self._last_error:
            self._last_error = what
            self._on_trouble(error)
