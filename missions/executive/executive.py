"""The tick loop: schedules ticks, reads the robot's inputs once at the start of each, and ends a run safely."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from enum import Enum
from math import inf
from threading import Lock
from typing import Final

from py_trees.common import Status

from behaviours.leaf import Leaf
from behaviours.node import Node
from behaviours.run import DEAD_RECKONING_REASON, RunState
from config.units import Quantity
from drivers.api import JointState, Reading
from drivers.api.fast_dataclass import dataclass
from drivers.api.kinds import SOUND_KINDS
from missions.executive.events import Ended, Notified, Started, Ticked, VariableSet, status_word
from missions.executive.guard import BaseGuard
from missions.executive.stream import EventStream
from missions.executive.submission import Submission
from missions.executive.tick_cache import TickCache
from missions.executive.tick_record import Answer, TickKind, TickRecord
from missions.language.kinds import STATE_KINDS
from missions.language.operators import RANDOM

# Frozen tick: during a tick, the time and all query results stay the same.
#
# Changes of variables by behaviours are reported as they occur.

Variables = dict[str, object]

_MUTABLE_TYPES = frozenset({list, dict, set})
"""Types of values that a behaviour may change in place; such values are copied for their event."""

_COMPARABLE_TYPES = frozenset({bool, int, float, str, Quantity})
"""Types of variables that count as unchanged if the new value is equal.

A value of any other type is unchanged only if it is the same object.
"""


UNREPORTED_NAMES = {*STATE_KINDS, RANDOM}
"""Names in the scope of a mission that are no variables: the robot's state, and the source of random numbers."""


class VariableChanges:
    """Reports changed variables of a mission and its sub-missions as events to the ``stream``.

    Call ``emit`` after variables may have changed. A list that a behaviour changes in place is not reported.
    """

    def __init__(self, root: Node, run: RunState, stream: EventStream) -> None:
        self._run = run
        self._stream = stream
        inner = {node.key: node.inner for node in root.iterate() if isinstance(node, Submission)}
        self._scopes: list[tuple[str, Variables, Variables]] = [
            (key, variables, {}) for key, variables in ({"": run.variables} | inner).items()
        ]

    def emit(self) -> None:
        """Report all variables that have changed since the last call as events, if the stream has listeners."""
        if not self._stream.has_listeners:
            return
        time, tick = self._run.clock.now(), self._run.tick
        for scope, variables, reported in self._scopes:
            for name, value in _take_changes(variables, reported):
                dimension = value.dimension if isinstance(value, Quantity) else None
                self._stream.emit(VariableSet(time, tick, scope, name, value, dimension))


def _take_changes(variables: Variables, reported: Variables) -> Iterator[tuple[str, object]]:
    """Yield each changed variable with its value, None if it was deleted.

    Compares ``variables`` with the values ``reported`` before, and updates the latter.
    """
    for name, value in variables.items():
        if name not in UNREPORTED_NAMES and not (name in reported and _is_same_value(value, reported[name])):
            reported[name] = value
            yield name, copy(value) if type(value) in _MUTABLE_TYPES else value
    for name in [name for name in reported if name not in variables]:
        del reported[name]
        yield name, None


def _is_same_value(one: object, other: object) -> bool:
    if isinstance(one, Quantity) and isinstance(other, Quantity) and one.dimension != other.dimension:
        return False
    return one is other or (type(one) is type(other) and type(one) in _COMPARABLE_TYPES and one == other)


SAMPLE_INTERVAL_TICKS = 10
"""Ticks between two samples, for records, of those parts of the robot that the mission does not read."""

MOVING_SAMPLE_INTERVAL_TICKS = 3
"""Ticks between two samples of moving joints for records; a leg makes a step in less than a second.

Not 2 or 4: a walking cycle of 0.8 s would always be sampled at the same phases, and its peaks missed.
"""

JOINTS_QUERY = "states"
"""Name of the method of an arm that returns the states of its joints."""

TickObserver = Callable[[TickRecord], None]
"""Called with the record of each tick, on the tick thread, right after the tick; it must neither block nor raise."""


class TickSnapshot:
    """Begins and ends the tick snapshots of a ``run``, in which time stands still and inputs are cached.

    At the end of each snapshot, its record is passed to the observers.
    """

    def __init__(self, run: RunState, cache: TickCache, changes: VariableChanges) -> None:
        self._run = run
        self._cache = cache
        self._changes = changes
        self._observers: tuple[TickObserver, ...] = ()
        self._began_at = 0.0
        self._is_moving = False

    def observe(self, on_tick: TickObserver) -> None:
        """Add an observer of tick records."""
        self._observers += (on_tick,)
        self._cache.is_recording = True

    def emit_changes(self) -> None:
        """Emit an event for each variable that has changed since the last call."""
        self._run.variables_changed = False
        self._changes.emit()

    def begin(self) -> None:
        """Begin a snapshot: the time stands still, and each input is read once and cached."""
        if self._observers:
            self._began_at = self._run.wall.now()
        self._cache.is_open = True
        self._run.tick_time = self._run.clock.now()

    def end(self, kind: TickKind, late: float = 0.0) -> None:
        """End a snapshot: let time run again, clear the cache, and pass the tick's record to the observers.

        ``late`` is the delay of the tick in seconds.
        """
        run = self._run
        time, run.tick_time = run.tick_time or 0.0, None
        if kind == "tick":
            run.last_tick_at = time
        if run.variables_changed:
            self.emit_changes()
        if not self._observers:
            self._cache.close()
            return
        looked = run.tick % SAMPLE_INTERVAL_TICKS == 1
        if looked or (self._is_moving and run.tick % MOVING_SAMPLE_INTERVAL_TICKS == 1):
            self._cache.sample("" if looked else JOINTS_QUERY)
        answers, spent = self._cache.take_answers(), run.wall.now() - self._began_at
        if looked:
            self._is_moving = is_moving(answers)
        overheld, run.overrun_failure = run.overrun_failure, None
        record = TickRecord(kind, run.tick, time, late, spent, answers, overheld)
        for on_moment in self._observers:
            on_moment(record)


def is_moving(answers: Sequence[Answer]) -> bool:
    """Return True if a joint moves, by the joint states among the ``answers`` of the robot's parts."""
    looks = [value for _, what, _, value in answers if what == JOINTS_QUERY]
    return any(
        isinstance(reading, Reading) and isinstance(reading.value, JointState) and reading.value.moving
        for look in looks
        if isinstance(look, Mapping)
        for reading in look.values()
    )


class RunMode(Enum):
    """Mode of a tick loop. HELD: paused by a stop, so that requests to resume or step have no effect."""

    TICKING, PAUSED, HELD = range(3)


class RunModeEvent(Enum):
    """Event that changes the mode of a tick loop: a request, or an ALARM by which the base guard ends the mission."""

    PAUSE, RESUME, HOLD, RELEASE, ALARM = range(5)


TRANSITIONS: Final = {
    **{(mode, RunModeEvent.HOLD): RunMode.HELD for mode in RunMode},
    **{(mode, RunModeEvent.ALARM): RunMode.TICKING for mode in RunMode},  # the next ticks end the mission
    (RunMode.TICKING, RunModeEvent.PAUSE): RunMode.PAUSED,
    (RunMode.TICKING, RunModeEvent.RESUME): RunMode.TICKING,
    (RunMode.TICKING, RunModeEvent.RELEASE): RunMode.TICKING,
    (RunMode.PAUSED, RunModeEvent.PAUSE): RunMode.PAUSED,
    (RunMode.PAUSED, RunModeEvent.RESUME): RunMode.TICKING,
    (RunMode.PAUSED, RunModeEvent.RELEASE): RunMode.PAUSED,
    (RunMode.HELD, RunModeEvent.PAUSE): RunMode.HELD,
    (RunMode.HELD, RunModeEvent.RESUME): RunMode.HELD,
    (RunMode.HELD, RunModeEvent.RELEASE): RunMode.PAUSED,
}

HALT_TIMEOUT = 2.0
"""Seconds that leaves have to halt at the end of a run; then their actuators are stopped anyway."""

GUARD_INTERVAL = 1.0
"""Maximum seconds between two checks of the base (battery, contacts) while the mission is paused."""

STOP_POLL_INTERVAL = 0.05
"""Seconds within which a ``stop`` is noticed.

A stop wakes no thread: a signal handler must not take the lock of an Event, which it may have interrupted.
"""


@dataclass(frozen=True, slots=True)
class Result:
    """Result of a run: ``result`` is success, failure, interrupted or error, ``reason`` says why.

    The reason is empty for a success, unless motions were measured by dead reckoning only.
    """

    mission: str
    result: str
    reason: str
    seconds: float
    ticks: int


class Executive:
    """Ticks a tree at up to ``rate`` ticks a second, at once when woken, until it ends or is stopped.

    Ticks keep to an absolute schedule; ``Run.wake`` brings the next one forward. ``tick`` may also be called without
    the loop: for tests, simulated time and single steps. The ``guard``, which checks the base, is called before each
    tick: if it returns a reason, the tree is halted and fails.

    Inputs are read in snapshots: during a snapshot the time stands still, and each part of the robot returns one value
    per query. For that, the parts need proxies with ``cache``. A snapshot is a tick, a check of the guard while paused,
    or a step of the final halt. ``observe`` passes the records of snapshots to observers; ``replay_tick`` repeats the
    decisions from such a record. ``after_tick`` is called after each tick, on its thread.
    """

    def __init__(
        self,
        root: Node,
        run: RunState,
        stream: EventStream,
        *,
        rate: float = 20.0,
        mission: str = "",
        guard: BaseGuard | None = None,
        cache: TickCache | None = None,
        after_tick: Callable[[], None] | None = None,
    ) -> None:
        self.root = root
        self.run = run
        self.stream = stream
        self.mission = mission
        self.overruns = 0
        self._guard = guard
        self._guarded_at = -inf
        self._tick_snapshot = TickSnapshot(run, cache or TickCache(), VariableChanges(root, run, stream))
        self._after_tick = after_tick
        self._alarm = ""  # why the guard halted the tree
        self._halt_deadline: float | None = None
        self._period = 1.0 / rate
        self._woken = run.wake_event
        self.idle: Callable[[float], object] = run.wake_event.wait
        """Function that waits (s) while the mission is paused; in real time, unless it is replaced for simulated time.
        """
        self._stop_reason: str | None = None
        self._mode, self._mode_lock = RunMode.TICKING, Lock()
        self._steps = 0  # requested while paused, and not made yet; guarded by the lock
        run.observer = stream
        run.notify = self._notify

    def observe(self, on_tick: TickObserver) -> None:
        """Add an observer of tick records, from the next tick on."""
        self._tick_snapshot.observe(on_tick)

    # --- called from any thread ---------------------------------------------------------------------------------------

    def stop(self, reason: str) -> None:
        """End the run after the present tick. The only method that a signal handler may call."""
        self._stop_reason = reason

    @property
    def stopping(self) -> bool:
        """True after ``stop``."""
        return self._stop_reason is not None

    def pause(self) -> None:
        """Stop ticking; the mission keeps its state, and its actuators hold still."""
        self._change_mode(RunModeEvent.PAUSE)

    @property
    def paused(self) -> bool:
        """True between ``pause`` and ``resume``."""
        return self._mode is not RunMode.TICKING

    def hold(self, *, held: bool) -> None:
        """Pause without ticks or steps, and ignore requests to resume, until called with ``held=False``.

        Then the mission is still paused.
        """
        self._change_mode(RunModeEvent.HOLD if held else RunModeEvent.RELEASE)

    def keep_still(self) -> None:
        """Stop the actuators of a paused mission once, until its next tick. A pause does not interrupt a sentence."""
        if not self.run.is_held:
            self.run.is_held = True
            self.run.safe_stop(self.root.claims - SOUND_KINDS)

    def step(self) -> None:
        """Tick once while paused; no effect while held. A hold or a resume drops the steps that are not made yet."""
        with self._mode_lock:
            if self._mode is RunMode.PAUSED:
                self._steps += 1
        self._woken.set()

    def _take_step(self) -> bool:
        """Return True if a step is pending, and count it as made."""
        with self._mode_lock:
            if self._steps == 0:
                return False
            self._steps -= 1
            return True

    def resume(self) -> None:
        """Continue after ``pause``; no effect while held."""
        self._change_mode(RunModeEvent.RESUME)

    def _change_mode(self, event: RunModeEvent) -> None:
        with self._mode_lock:  # a concurrent resume must not undo the hold of a stop
            self._mode = TRANSITIONS[self._mode, event]
            if self._mode is not RunMode.PAUSED:
                self._steps = 0
        self._woken.set()

    # --- the loop -----------------------------------------------------------------------------------------------------

    def emit_start(self, *, file: str, robot: str, params: Mapping[str, object]) -> None:
        """Emit the start event, and the initial variables."""
        self.stream.emit(
            Started(self.time(), self.mission, file, robot, {name: str(value) for name, value in params.items()})
        )
        self._tick_snapshot.emit_changes()

    def loop(self) -> Result:
        """Tick until the tree ends or ``stop`` is called, then halt; return the result. Does not raise."""
        due = self.run.now()
        while self._stop_reason is None:
            if self._mode is not RunMode.TICKING and not self._take_step():
                self.keep_still()
                self.idle(STOP_POLL_INTERVAL)
                self._woken.clear()
                due = self.run.now()
                self.run.record_heartbeat()
                self._guard_paused(due)
                if self._alarm:
                    self._change_mode(RunModeEvent.ALARM)
                continue
            self._woken.clear()
            if self.tick(late=max(0.0, self.run.now() - due)) is not Status.RUNNING:
                break
            due = self._wait(due)
        return self._make_result()

    def _wait(self, due: float) -> float:
        """Wait until ``due`` (s), a wake or a stop; return the due time of the next tick.

        The tick rate is kept by an absolute schedule: an early tick does not shift it. Ticks missed by an overrun are
        counted and left out.
        """
        now = self.run.now()
        if now >= due:
            missed = int((now - due) / self._period)
            self.overruns += missed
            due += (missed + 1) * self._period
        while self._stop_reason is None and (remaining := due - self.run.now()) > 0:
            woken = self.run.wait(min(remaining, STOP_POLL_INTERVAL))
            self.run.record_heartbeat()
            if woken:
                break
        return due

    def tick(self, *, late: float = 0.0) -> Status:
        """Tick the tree once, ``late`` seconds after it was due, and return its status."""
        self.run.tick += 1
        self.run.is_held = False
        self._tick_snapshot.begin()
        try:
            self._run_guard()
            status = self._halt_for_alarm() if self._alarm else self.root.execute_tick()
        finally:
            self._tick_snapshot.end("tick", late)
        if self.stream.has_listeners:
            lateness = late if late > self._period else None
            self.stream.emit(Ticked(self.time(), self.run.tick, status_word(self.root), lateness))
        self.run.record_heartbeat()
        if self._after_tick is not None:
            self._after_tick()
        return status

    def _guard_paused(self, now: float) -> None:
        """Check the base while paused: at once if it reports a change, otherwise every ``GUARD_INTERVAL`` seconds."""
        if self._guard is not None and (now - self._guarded_at >= GUARD_INTERVAL or self._guard.has_changed()):
            self._guarded_at = now
            self._run_guard_snapshot()

    def _run_guard_snapshot(self) -> None:
        self._tick_snapshot.begin()
        try:
            self._run_guard()
        finally:
            self._tick_snapshot.end("look")

    def _run_guard(self) -> None:
        if self._guard is not None:
            self._alarm = self._alarm or self._guard.check()

    def _halt_for_alarm(self) -> Status:
        """Halt the tree because the base guard ends the mission; return RUNNING until it is at rest, then FAILURE."""
        if not self._halt_tree():
            return Status.RUNNING
        self.root.feedback_message, self._alarm = self._alarm, ""
        self.root.publish(Status.FAILURE)
        return Status.FAILURE

    def halt(self) -> bool:
        """Halt the tree; return True once it is at rest. Leaves that need more than HALT_TIMEOUT are abandoned."""
        self._tick_snapshot.begin()
        try:
            return self._halt_tree()
        finally:
            self._tick_snapshot.end("halt")

    def _halt_tree(self) -> bool:
        now = self.run.now()
        if self._halt_deadline is None:
            self._halt_deadline = now + HALT_TIMEOUT
        if not self.root.halt():
            if now < self._halt_deadline:
                return False
            self.root.stop()
        self._halt_deadline = None
        return True

    def replay_tick(self, record: TickRecord) -> None:
        """Repeat the decisions of a recorded snapshot.

        Before the call, the clock of the run must be set to the time of ``record``, and the parts of the robot must be
        proxies that return its ``answers``.
        """
        self.run.tick = record.tick
        if record.overheld is not None:
            key, seconds = record.overheld
            leaves = (node for node in self.root.iterate() if isinstance(node, Leaf) and node.key == key)
            self.run.overrun = next(((leaf, record.tick, self.run.wall.now() - seconds) for leaf in leaves), None)
        match record.kind:
            case "tick":
                self.run.tick -= 1
                self.tick(late=record.late)
            case "look":
                self._run_guard_snapshot()
            case "halt":
                self.halt()

    def wait_period(self) -> None:
        """Wait for one tick period, ignoring wakes: for manual ticks in simulated time."""
        due = self.run.now() + self._period
        while (remaining := due - self.run.now()) > 0:
            self._woken.clear()
            self.run.wait(remaining)

    def time(self) -> float:
        """Return the seconds since the start of the run. Thread-safe."""
        return self.run.clock.now()

    def _notify(self, text: str) -> None:
        self.stream.emit(Notified(self.run.now(), self.run.tick, text))

    def _make_result(self) -> Result:
        status = self.root.status
        if self._stop_reason is not None and status not in (Status.SUCCESS, Status.FAILURE):
            outcome, reason = "interrupted", self._stop_reason
            self._halt_all()
        else:
            outcome = "success" if status is Status.SUCCESS else "failure"
            reason = self.root.reason if status is Status.FAILURE else DEAD_RECKONING_REASON * self.run.dead_reckoned
        return Result(self.mission, outcome, reason, self.time(), self.run.tick)

    def _halt_all(self) -> None:
        while not self.halt():
            self.run.tick += 1
            self._woken.clear()
            self.run.wait(self._period)
            self.run.record_heartbeat()

    def emit_end(self, result: Result) -> None:
        """Emit the event that the mission has ended with ``result``."""
        self.stream.emit(Ended(self.time(), result.mission, result.result, result.reason, result.seconds, result.ticks))
