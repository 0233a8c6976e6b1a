"""From sound to words: cuts out what is said, has a program of its own recognise it, and keeps what it was ready."""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from enum import Enum
from threading import Event, Lock, Thread
from typing import Any, Final, Protocol

import numpy as np

from perception.api import Words, ignore
from perception.hearing.engines import Judgement
from perception.hearing.sound import FULL, RATE, Clip, EndPointer, Piece, levels

KEPT = 30.0
"""Seconds for which words are kept."""

WAITING = 8
"""Clips that wait for the recogniser at most; it is ten times as fast as speech, unless it has died."""

SILENCE = -90.0
"""dBFS when there is no sound at all."""

CLIP_TIMEOUT = 10.0
"""Seconds that the recogniser may take for a clip; then it hangs, and is killed."""

START = 60.0
"""The same to get ready: large models of Vosk are slow to load."""


class RecogniserState(Enum):
    """State of the recogniser's process: it loads its model, waits for a clip, or decodes one."""

    ABSENT, STARTING, READY, DECODING = range(4)


class RecogniserEvent(Enum):
    """Event of the recogniser's process."""

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


class Talker(Protocol):
    """Who talks with a program: ``drivers.transport.pipe.Talker``."""

    def started(self) -> None:
        """It runs, and knows nothing yet."""
        ...

    def received(self, message: Mapping[str, Any], body: bytes) -> None:
        """It said something."""
        ...

    def lost(self, why: str) -> None:
        """It has died."""
        ...


class Worker(Protocol):
    """A program in a process of its own: ``drivers.transport.pipe.Worker``."""

    def open(self, talker: Talker) -> None:
        """Start it."""
        ...

    def close(self) -> None:
        """End it. Safe more than once."""
        ...

    def kill(self) -> None:
        """Kill it, whatever it does; another one follows."""
        ...

    def send(self, message: Mapping[str, Any], body: bytes = b"", *, timeout: float = 1.0) -> None:
        """Tell it something. Raises OSError when it cannot be told."""
        ...


class Engine(Protocol):
    """A way to recognise speech: those of ``perception.hearing.engines``."""

    def instructions(self) -> Mapping[str, Any]:
        """Return what a new process must be told."""
        ...

    def sound(self, clip: Clip) -> bytes:
        """Return what is decoded of a clip."""
        ...

    def judge(self, clip: Clip, answer: Mapping[str, Any]) -> Judgement:
        """Return what an answer means."""
        ...


def never(_start: float, _end: float) -> bool:
    """Say that the robot is silent: the ``deaf`` of ears without a voice beside them."""
    return False


class Listener:
    """Understands the sound that it is given: a ``Hearing``, and the ``Talker`` of its ``worker``.

    What scores ``threshold`` or more is accepted. ``deaf(start, end)`` tells whether sound of that time is not to be
    listened to, since the robot itself speaks. ``changed`` is called, from the worker's thread, after words have come,
    accepted or not; it must return at once. ``take`` is for one thread, the rest for any.
    """

    def __init__(
        self,
        worker: Worker,
        engine: Engine,
        *,
        threshold: float = 0.0,
        deaf: Callable[[float, float], bool] = never,
        changed: Callable[[], None] = ignore,
    ) -> None:
        self._worker = worker
        self._engine = engine
        self._threshold = threshold
        self._deaf = deaf
        self._changed = changed
        self._cutter = EndPointer()
        self._number: int | None = None  # of the newest piece
        self._recent = np.zeros(0, np.int16)
        self._lock = Lock()  # over everything below
        self._state = RecogniserState.ABSENT
        self._waiting: deque[Clip] = deque(maxlen=WAITING)
        self._sent: Clip  # the newest clip that was sent
        self._since: float | None = None  # the time of the first sound after something was wanted of the recogniser
        self._count = 0
        self._accepted: deque[Words] = deque()
        self._refused: deque[Words] = deque()
        self._listened: float | None = None

    # --- Hearing ------------------------------------------------------------------------------------------------------

    def words(self) -> tuple[Words, ...]:
        """The phrases of the last 30 s, newest first."""
        return self._fresh(self._accepted)

    def refused(self) -> tuple[Words, ...]:
        """What was said in the last 30 s and taken for no phrase, newest first; each with the nearest phrase."""
        return self._fresh(self._refused)

    def listened(self) -> float | None:
        """The time up to which it has listened, None before it could."""
        return self._listened

    def level(self) -> float:
        """How loud the last 0.1 s were, in dBFS."""
        recent = self._recent
        return max(SILENCE, float(levels(recent, len(recent))[0] - FULL)) if len(recent) else SILENCE

    @property
    def ready(self) -> bool:
        """True while the recogniser runs and knows what to listen for."""
        return self._state in (RecogniserState.READY, RecogniserState.DECODING)

    @property
    def pending(self) -> bool:
        """True while something that was said is not understood yet."""
        with self._lock:
            return bool(self._waiting) or self._state is RecogniserState.DECODING

    # --- sound --------------------------------------------------------------------------------------------------------

    def take(self, piece: Piece) -> None:
        """Listen to the next piece of sound."""
        self._recent = np.concatenate([self._recent, piece.samples])[-RATE // 10 :]
        gap = self._number is not None and piece.number != self._number + 1
        self._number = piece.number
        deaf = self._deaf(piece.stamp, piece.end)
        if gap or deaf:
            self._cutter.reset()
        clips = [] if deaf else self._cutter.take(piece.samples, piece.stamp)
        with self._lock:
            self._waiting.extend(clips)
            hangs = self._hangs(piece.end)
            if self.ready and not hangs:
                self._listened = piece.end
        if hangs:
            self._worker.kill()
        if clips:
            self._ask()

    def _hangs(self, now: float) -> bool:
        """Say whether the recogniser has owed an answer for too long. Time is that of the sound."""
        if self._state not in (RecogniserState.STARTING, RecogniserState.DECODING):
            return False
        if self._since is None:
            self._since = now
        return now - self._since > (START if self._state is RecogniserState.STARTING else CLIP_TIMEOUT)

    def _ask(self) -> None:
        """Have the oldest clip recognised, unless another is."""
        with self._lock:
            if self._state is not RecogniserState.READY or not self._waiting:
                return
            self._advance(RecogniserEvent.CLIP_SENT)
            self._count += 1
            self._since = None
            number, clip = self._count, self._waiting.popleft()
            self._sent = clip
        with suppress(OSError):  # it is dying, and ``lost`` follows
            self._worker.send({"decode": number}, self._engine.sound(clip), timeout=CLIP_TIMEOUT)

    def _advance(self, event: RecogniserEvent) -> None:
        self._state = TRANSITIONS[self._state, event]

    # --- the worker's thread ------------------------------------------------------------------------------------------

    def started(self) -> None:
        """Tell a new process what to listen for."""
        with self._lock:
            self._advance(RecogniserEvent.STARTED)
            self._since = None
        with suppress(OSError):  # it is dying, and ``lost`` follows
            self._worker.send(self._engine.instructions(), timeout=CLIP_TIMEOUT)

    def lost(self, why: str) -> None:  # noqa: ARG002 - the worker reports it
        """Forget what it was asked: nobody knows whether that was what killed it."""
        with self._lock:
            self._advance(RecogniserEvent.LOST)

    def received(self, message: Mapping[str, Any], body: bytes) -> None:  # noqa: ARG002 - none is sent
        """Take an answer, and ask for the next clip."""
        with self._lock:
            if "ready" in message:
                self._advance(RecogniserEvent.READY)
            decoded = self._state is RecogniserState.DECODING and message.get("decoded") == self._count
        if decoded:
            try:
                self._keep(self._count, self._sent, *self._engine.judge(self._sent, message))
            finally:
                with self._lock:
                    self._advance(RecogniserEvent.DECODED)
            self._changed()
        self._ask()

    def _keep(self, number: int, clip: Clip, phrase: str, score: float) -> None:
        words = Words(number, phrase, clip.start, clip.end, score)
        with self._lock:
            kept = self._accepted if phrase and score >= self._threshold else self._refused
            kept.appendleft(words)

    def _fresh(self, kept: deque[Words]) -> tuple[Words, ...]:
        with self._lock:
            while kept and kept[-1].stamp < (self._listened or 0.0) - KEPT:
                kept.pop()
            return tuple(kept)


# The robot's ears: listen to a microphone on a thread of their own.

PERIOD = 0.05
"""Seconds between looks at the microphone."""


class SoundSource(Protocol):
    """Where sound comes from: a microphone."""

    def read(self, after: int) -> Sequence[Piece]:
        """Return the pieces with a larger number than ``after``, oldest first."""
        ...


class Ears:
    """Gives every sound of ``source`` to ``listener``, whose ``worker`` it starts and ends.

    An error costs the sound that caused it, and goes to ``on_trouble`` unless it is the same as the last.
    """

    def __init__(
        self,
        source: SoundSource,
        listener: Listener,
        worker: Worker,
        *,
        on_trouble: Callable[[Exception], None] = ignore,
    ) -> None:
        self._source = source
        self._listener = listener
        self._worker = worker
        self._on_trouble = on_trouble
        self._trouble = ""
        self._newest = -1
        self._ending = Event()
        self._thread: Thread | None = None

    def open(self) -> None:
        """Start listening; returns at once. Safe more than once."""
        if self._thread is None:
            self._ending.clear()
            self._newest = -1  # a microphone may count anew
            self._worker.open(self._listener)
            self._thread = Thread(target=self._run, name="ears", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """End the thread and the recogniser. Safe from any state, more than once, but not from a callback."""
        self._ending.set()
        thread, self._thread = self._thread, None
        self._worker.close()
        if thread is not None:
            thread.join()

    def _run(self) -> None:
        while not self._ending.wait(PERIOD):
            try:
                for piece in self._source.read(self._newest):
                    self._newest = piece.number
                    self._listener.take(piece)
            except Exception as error:  # whatever it is, a robot that goes deaf for good is worse
                self._note(error)

    def _note(self, error: Exception) -> None:
        what = f"{type(error).__name__}: {error}"
        if what != self._trouble:
            self._trouble = what
            self._on_trouble(error)
