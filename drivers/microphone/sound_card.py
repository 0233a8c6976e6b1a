"""Microphone of the sound card, recorded by a worker process."""

from collections import deque
from pathlib import Path
from threading import Lock

import numpy as np

from drivers.api import DeviceStatus, Health, StatusCallback, ignore
from drivers.api.sensors import SOUND_RATE, Sound
from drivers.clock import Clock
from drivers.extras import extra_hint
from drivers.transport.loop import guard_callback
from drivers.transport.worker_process import Message, WorkerProcess

MAX_KEPT_SECONDS = 5.0
"""Seconds of sound that the buffer of the microphone holds."""

MAX_LATENESS = 0.25
"""Maximum difference in seconds between expected and actual arrival of a piece of sound; above it, sound was lost."""

OFFLINE_TIMEOUT = 2.0
"""Seconds without sound after which the microphone counts as offline."""

HANG_TIMEOUT = 10.0
"""Seconds without sound after which the worker process is killed."""

WORKER_PROGRAM = Path(__file__).with_name("capture_worker.py")


class SoundCardMicrophone:
    """Microphone at the sound card: a ``drivers.api.Microphone``, recorded by a worker process.

    ``device`` is part of the name of the input device; empty for the system's default. ``backend`` is one of
    miniaudio's backends, such as ``null`` in tests. The time stamp of a piece of sound is computed from the number of
    samples before it, and adjusted slowly to the arrival times, so it jitters less than these. If no more sound
    arrives, a new worker process is started.
    """

    name = "microphone"

    def __init__(
        self,
        clock: Clock,
        *,
        device: str = "",
        backend: str = "",
        report: StatusCallback = ignore,
    ) -> None:
        self._clock = clock
        self._report = guard_callback(report)
        self._hint = extra_hint("listen", "`arecord -l` lists microphones")
        self._worker = WorkerProcess(
            self.name, WORKER_PROGRAM, clock, arguments=(device, backend), hint=self._hint, report=report
        )
        self._lock = Lock()  # over all below
        self._buffer: deque[Sound] = deque()
        self._piece_count = self._gap_count = 0
        self._next_stamp: float | None = None  # the time of the next sample, if none is lost
        self._last_sign_at: float | None = None  # when it last gave a sign, None while it does not run

    def open(self) -> None:
        """Start recording; returns at once, whether there is a microphone or not."""
        self._worker.open(self)

    def rest(self) -> None:
        """Do nothing: a microphone has no actuator."""

    def close(self) -> None:
        self._worker.close()
        with self._lock:
            self._buffer.clear()
            self._next_stamp = self._last_sign_at = None

    def health(self) -> Health:
        state = self._worker.health()
        with self._lock:
            counters = {**state.counters, "pieces": self._piece_count, "gaps": self._gap_count}
            newest = self._buffer[-1].end if self._buffer else None
        if not state.online:
            return Health(False, state.detail, state.hint, counters)
        if newest is None or self._clock.now() - newest > OFFLINE_TIMEOUT:
            return Health(False, f"{self.name}: no sound arrives", self._hint, counters)
        return Health(True, counters=counters)

    def read(self, after: int) -> list[Sound]:
        """Return the pieces of sound with a number above ``after``, oldest first, from a buffer of 5 s."""
        with self._lock:
            hangs = self._last_sign_at is not None and self._clock.now() - self._last_sign_at > HANG_TIMEOUT
            heard = [sound for sound in self._buffer if sound.number > after]
        if hangs:
            self._worker.kill()
        return heard

    # --- the worker's thread ------------------------------------------------------------------------------------------

    def on_started(self) -> None:
        """Start the timeout for sound: the worker process has started, and records from now on."""
        with self._lock:
            self._last_sign_at = self._clock.now()

    def on_exit(self, reason: str) -> None:  # noqa: ARG002 - the worker reports it
        """Mark a gap in the sound, because the worker process has exited."""
        with self._lock:
            self._next_stamp = self._last_sign_at = None

    def on_message(self, message: Message, body: bytes) -> None:
        """Buffer a piece of sound."""
        if "ready" in message:
            self._report(DeviceStatus(self.name, "online", f"records through {message['ready']}"))
        if body:
            self._append(np.frombuffer(body, "<i2").astype(np.int16))

    def _append(self, samples: "np.ndarray[tuple[int], np.dtype[np.int16]]") -> None:
        length = len(samples) / SOUND_RATE
        now = self._clock.now()
        arrived = now - length
        with self._lock:
            self._last_sign_at = now
            expected = self._next_stamp
            follows = expected is not None and abs(arrived - expected) <= MAX_LATENESS
            stamp = expected + (arrived - expected) / 100 if expected is not None and follows else arrived
            skipped = self._piece_count > 0 and not follows
            self._gap_count += skipped
            number = self._buffer[-1].number + 1 + skipped if self._buffer else self._piece_count + self._gap_count
            self._buffer.append(Sound(number, stamp, samples))
            self._piece_count += 1
            self._next_stamp = stamp + length
            while self._buffer[0].end < self._next_stamp - MAX_KEPT_SECONDS:
                self._buffer.popleft()
