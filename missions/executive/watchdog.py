"""Watchdog of the tick loop: reports a leaf that blocks it, and stops the robot meanwhile."""

import os
from collections.abc import Callable, Mapping
from enum import Enum
from threading import Event, Thread
from types import TracebackType
from typing import Final, Self

from behaviours.leaf import Leaf
from behaviours.run import RunState, log
from drivers.api.fast_dataclass import dataclass
from drivers.clock import SystemClock
from drivers.errors import DeviceFault
from missions.executive.events import FaultRaised
from missions.executive.stream import EventStream

CHECK_INTERVAL = 0.05
"""Seconds between two checks of the tick loop."""

STOP_REPEAT_DELAY = 0.2
"""Seconds until actuators are stopped a second time, since a command may have been in progress."""

SUSPEND_THRESHOLD = 1.0
"""Seconds between two checks above which the whole process counts as having been suspended, not only the tick loop."""


@dataclass(frozen=True, slots=True)
class WatchdogLimits:
    """Time limits in seconds.

    A leaf that blocks a tick for ``slow`` is reported. After ``stall`` without a heartbeat of the loop, the robot is
    stopped. A leaf that blocks a tick for ``fail`` fails, even if it returns a success. After ``lost`` without a
    heartbeat, or ``react`` after a signal without reaction, the run is abandoned and the process ends.
    """

    slow: float = 0.25
    stall: float = 0.5
    fail: float = 2.0
    lost: float = 15.0
    react: float = 2.0


class LoopState(Enum):
    """State of a tick loop, as the watchdog sees it.

    STALLED: no heartbeat, so the robot was stopped. STOPPED_TWICE: it was stopped again, in case a command was in
    progress.
    """

    ALIVE, STALLED, STOPPED_TWICE = range(3)


class LoopEvent(Enum):
    """Observation of a tick loop: LIFE is a heartbeat, STALL its absence; REPEAT says that the second stop is due."""

    LIFE, STALL, REPEAT = range(3)


TRANSITIONS: Final = {
    **{(state, LoopEvent.LIFE): LoopState.ALIVE for state in LoopState},
    (LoopState.ALIVE, LoopEvent.STALL): LoopState.STALLED,
    (LoopState.STALLED, LoopEvent.REPEAT): LoopState.STOPPED_TWICE,
}
"""Next state of the tick loop by state and event; pairs that are missing lead to STALLED.

In all states except ALIVE, no leaf may move an actuator.
"""


StopActions = Mapping[str, Callable[[], None]]
"""Functions that stop the actuators, by name of the part."""

AbandonRun = Callable[[str, str], None]
"""Ends the process with a result ("failure" or "interrupted") and a reason, since the loop cannot."""


class Watchdog:
    """Checks a run every ``CHECK_INTERVAL`` from its own thread; it never waits for the loop or for a device.

    ``is_armed`` means that the loop should be running; a paused loop sends heartbeats too. ``first_signal`` is a
    function that returns the name of a received signal; ``abandon`` ends a run whose main thread hangs. A hanging leaf
    may hold the lock of a driver, so each actuator is stopped in a thread of its own.
    """

    def __init__(
        self,
        run: RunState,
        stream: EventStream,
        *,
        stop_actions: StopActions,
        first_signal: Callable[[], str | None],
        abandon: AbandonRun,
        limits: WatchdogLimits | None = None,
    ) -> None:
        self.is_armed = False
        self.limits = limits or WatchdogLimits()
        self._run = run
        self._stream = stream
        self._stop_actions = stop_actions
        self._first_signal = first_signal
        self._abandon = abandon
        self._thread: Thread | None = None
        self._process: int | None = None
        self._done = Event()
        self._stop_threads: dict[str, Thread] = {}
        self._checked_at = self._awake_since = run.wall.now()
        self._signalled_at: float | None = None  # time of the first signal
        self._watched: tuple[Leaf | None, int] = (None, 0)
        self._watched_since = 0.0
        self._is_reported = False
        self._loop = LoopState.ALIVE
        self._stalled: tuple[Leaf | None, int] = (None, 0)  # the leaf that blocked the loop, and the tick
        self._stalled_at = 0.0

    def start(self) -> None:
        """Start the watchdog's thread."""
        if self._thread is None:
            self._done.clear()
            self._process = os.getpid()
            self._thread = Thread(target=self._watch, name="watchdog", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Stop the watchdog's thread. May be called more than once, in any state."""
        self.is_armed = False
        self._done.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def permit(self) -> None:
        """Raise DeviceFault if the running leaf must not move an actuator.

        It must not if it blocks the tick and the robot was stopped for that, or if it runs in a process that a leaf has
        forked.
        """
        if self._process not in (None, os.getpid()):
            raise DeviceFault("kept still: a forked process cannot drive the robot")
        if self._loop is not LoopState.ALIVE and self._stalled == (self._run.active_leaf, self._run.tick):
            raise DeviceFault(f"kept still: {self._culprit(self._stalled[0])} holds the tick")

    def check(self) -> None:
        """Check the run once: report a slow leaf, stop the robot, or abandon the run, as needed."""
        now = self._run.wall.now()
        if now - self._checked_at > SUSPEND_THRESHOLD:
            self._awake_since = now
        self._checked_at = now
        silence = now - max(self._run.heartbeat_at, self._awake_since)
        if self.is_armed:
            self._check_leaf(now)
            self._check_loop(now, silence)
        word = self._first_signal()
        if word is not None:
            self._signalled_at = now if self._signalled_at is None else self._signalled_at
            if min(now - self._signalled_at, silence) > self.limits.react:
                self._give_up("interrupted", word)

    def _watch(self) -> None:
        while not self._done.wait(CHECK_INTERVAL):
            try:
                self.check()
            except Exception:  # the watchdog must go on
                log.exception("error in the watchdog")

    def _check_leaf(self, now: float) -> None:
        """Report a leaf that blocks a tick for too long."""
        leaf, tick = watched = self._run.active_leaf, self._run.tick
        if watched != self._watched:
            self._watched, self._watched_since, self._is_reported = watched, now, False
        if leaf is None:
            return
        held = now - self._watched_since
        if held > self.limits.slow and not self._is_reported:
            self._is_reported = True
            self._emit_fault(
                f"{leaf.label} has held a tick for {held:.2f} s", "a tick must not wait: return running instead"
            )
        if held > self.limits.fail:
            self._run.overrun = leaf, tick, self._watched_since

    def _check_loop(self, now: float, silence: float) -> None:
        """Stop the robot while the loop shows no sign of life."""
        if silence <= self.limits.stall:
            self._handle(LoopEvent.LIFE)
            return
        leaf = self._watched[0]
        # Several leaves may block the same tick, one after another: each is kept still.
        is_next = self._watched != self._stalled and now - self._watched_since > self.limits.stall
        if self._loop is LoopState.ALIVE or is_next:
            self._stalled, self._stalled_at = self._watched, now
            self._handle(LoopEvent.STALL)
            self._emit_fault(f"{self._culprit(leaf)} has held up the robot for {silence:.2f} s: it is kept still")
            self._stop_actuators()
        elif self._loop is LoopState.STALLED and now - self._stalled_at > STOP_REPEAT_DELAY:
            self._handle(LoopEvent.REPEAT)
            self._stop_actuators()
        if silence > self.limits.lost:
            self._give_up("failure", f"{self._culprit(leaf)}: blocked the tick for over {self.limits.lost:g} s")

    def _handle(self, event: LoopEvent) -> None:
        self._loop = TRANSITIONS.get((self._loop, event), LoopState.STALLED)

    def _stop_actuators(self) -> None:
        free = [
            part
            for part in self._stop_actions
            if part not in self._stop_threads or not self._stop_threads[part].is_alive()
        ]
        self._stop_threads.update(attempt_all({part: self._stop_actions[part] for part in free}))

    def _give_up(self, result: str, reason: str) -> None:
        self._done.set()
        self.is_armed = False
        self._stop_actuators()
        self._abandon(result, reason)

    def _emit_fault(self, detail: str, hint: str = "") -> None:
        self._stream.emit(FaultRaised(self._run.clock.now(), "executive", "fault", detail, hint))

    @staticmethod
    def _culprit(leaf: Leaf | None) -> str:
        return "the executive" if leaf is None else leaf.label


def attempt_all(steps: Mapping[str, Callable[[], object]], seconds: float = 0.0) -> dict[str, Thread]:
    """Call functions in parallel threads, wait up to ``seconds`` for all of them, and return the threads."""
    threads = {name: Thread(target=_attempt, args=(name, step), name=name, daemon=True) for name, step in steps.items()}
    for thread in threads.values():
        thread.start()
    clock = SystemClock()
    for thread in threads.values() if seconds else ():
        thread.join(max(0.0, seconds - clock.now()))
    return threads


def _attempt(name: str, step: Callable[[], object]) -> None:
    try:
        step()
    except Exception:  # the other actions have their own threads
        log.exception("%s: the watchdog's action failed", name)
