"""The microphone of the sound card, recorded by a program of its own."""

from collections import deque
from pathlib import Path
from threading import Lock

import numpy as np

from drivers.api import DeviceStatus, Health, Report, ignore
from drivers.api.sensors import SOUND_RATE, Sound
from drivers.clock import Clock
from drivers.extras import extra_hint
from drivers.transport.loop import guarded
from drivers.transport.pipe import Message, Worker

KEPT = 5.0
"""Seconds of sound that are kept."""

LATE = 0.25
"""Seconds by which sound may come later than its turn; more than that was lost on its way."""

SILENCE = 2.0
"""Seconds without sound after which a microphone counts as offline."""

HANGS = 10.0
"""Seconds without sound after which the program that records is killed, unless it has ended itself."""

PROGRAM = Path(__file__).with_name("capture_worker.py")


class CapturedMicrophone:
    """A ``drivers.api.Microphone``: the sound card's ``device`` (part of its name; empty: the system's choice).

    Stamps count samples and follow the clock slowly, so that they are steadier than the arrival of sound. ``backend``
    is one of miniaudio's, for tests. When no more sound comes, recording begins anew.
    """

    name = "microphone"

    def __init__(
        self,
        clock: Clock,
        *,
        device: str = "",
        backend: str = "",
        report: Report = ignore,
    ) -> None:
        self._clock = clock
        self._report = guarded(report)
        self._hint = extra_hint("listen", "`arecord -l` lists microphones")
        self._worker = Worker(self.name, PROGRAM, clock, arguments=(device, backend), hint=self._hint, report=report)
        self._lock = Lock()  # over all below
        self._kept: deque[Sound] = deque()
        self._pieces = self._gaps = 0
        self._expected: float | None = None  # the time of the next sample, if none is lost
        self._since: float | None = None  # when it last gave a sign, None while it does not run

    def open(self) -> None:
        """Start to record; returns at once, whether there is a microphone or not."""
        self._worker.open(self)

    def rest(self) -> None:
        """Do nothing: a microphone moves nothing."""

    def close(self) -> None:
        """Stop recording. Safe from any state, more than once."""
        self._worker.close()
        with self._lock:
            self._kept.clear()
            self._expected = self._since = None

    def health(self) -> Health:
        """Say whether sound arrives."""
        state = self._worker.health()
        with self._lock:
            counters = {**state.counters, "pieces": self._pieces, "gaps": self._gaps}
            newest = self._kept[-1].end if self._kept else None
        if not state.online:
            return Health(False, state.detail, state.hint, counters)
        if newest is None or self._clock.now() - newest > SILENCE:
            return Health(False, f"{self.name}: no sound arrives", self._hint, counters)
        return Health(True, counters=counters)

    def read(self, after: int) -> list[Sound]:
        """Return the pieces with a larger number than ``after``, oldest first; at most the last 5 s are kept."""
        with self._lock:
            hangs = self._since is not None and self._clock.now() - self._since > HANGS
            heard = [sound for sound in self._kept if sound.number > after]
        if hangs:
            self._worker.kill()
        return heard

    # --- the worker's thread ------------------------------------------------------------------------------------------

    def started(self) -> None:
        """Begin to wait for sound: it records at once."""
        with self._lock:
            self._since = self._clock.now()

    def lost(self, why: str) -> None:  # noqa: ARG002 - the worker reports it
        """Note that the next sound does not follow the last."""
        with self._lock:
            self._expected = self._since = None

    def received(self, message: Message, body: bytes) -> None:
        """Keep a piece of sound."""
        if "ready" in message:
            self._report(DeviceStatus(self.name, "online", f"records through {message['ready']}"))
        if body:
            self._keep(np.frombuffer(body, "<i2").astype(np.int16))

    def _keep(self, samples: "np.ndarray[tuple[int], np.dtype[np.int16]]") -> None:
        length = len(samples) / SOUND_RATE
        now = self._clock.now()
        arrived = now - length
        with self._lock:
            self._since = now
            expected = self._expected
            follows = expected is not None and abs(arrived - expected) <= LATE
            stamp = expected + (arrived - expected) / 100 if expected is not None and follows else arrived
            skipped = self._pieces > 0 and not follows
            self._gaps += skipped
            number = self._kept[-1].number + 1 + skipped if self._kept else self._pieces + self._gaps
            self._kept.append(Sound(number, stamp, samples))
            self._pieces += 1
            self._expected = stamp + length
            while self._kept[0].end < self._expected - KEPT:
                self._kept.popleft()
