"""The tick loop: when to tick, what to tell, and how a run ends safely whatever ends it."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from enum import Enum
from math import inf
from queue import SimpleQueue
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

# The frozen tick: while the executive ticks, time stands still and every question has one answer.
#
# What behaviours have stored in variables by then is told as it changes.

Variables = dict[str, object]

_MUTABLE_TYPES = frozenset({list, dict, set})
"""Kinds of values that may be others by the time they are told."""

_COMPARABLE_TYPES = frozenset({bool, int, float, str, Quantity})
"""Kinds of values that say the same when they are equal. With others, only one and the same is surely no news."""


class VariableChanges:
    """Tells the ``stream`` what is new in the variables of a mission and of those inside it.

    To be asked after what may have stored something; in between it costs nothing. A list that a behaviour alters,
    instead of storing another, is no news.
    """

    def __init__(self, root: Node, run: RunState, stream: EventStream) -> None:
        self._run = run
        self._stream = stream
        inner = {node.key: node.inner for node in root.iterate() if isinstance(node, Submission)}
        self._scopes: list[tuple[str, Variables, Variables]] = [
            (key, variables, {}) for key, variables in ({"": run.variables} | inner).items()
        ]

    def emit(self) -> None:
        """Tell all that is new, if anybody wants to know."""
        if not self._stream.has_listeners:
            return
        time, tick = self._run.clock.now(), self._run.tick
        for scope, variables, told in self._scopes:
            for name, value in _take_changes(variables, told):
                dimension = value.dimension if isinstance(value, Quantity) else None
                self._stream.emit(VariableSet(time, tick, scope, name, value, dimension))


def _take_changes(variables: Variables, reported: Variables) -> Iterator[tuple[str, object]]:
    """Yield what is new in ``variables`` since it was ``told``, and tell it there; what is gone is None."""
    for name, value in variables.items():
        if name not in STATE_KINDS and not (name in reported and _is_same_value(value, reported[name])):
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
"""Ticks from one look at the parts of the robot that a mission does not ask, to the next."""

MOVING_SAMPLE_INTERVAL_TICKS = 3
"""Ticks from one look at joints to the next while some are on the move: a leg makes a step in less than a second.

Not 2 or 4: a walk of 0.8 s would be looked at in the same phases of its cycle all along, and its peaks be missed.
"""

JOINTS_QUERY = "states"
"""The question that joints are looked at by."""

TickObserver = Callable[[TickRecord], None]
"""Told of each frozen tick, on the thread that ticks, right after it: it must neither wait nor raise."""


class TickSnapshot:
    """Begins and ends the frozen ticks of a ``run``, and hands on the record of each, with its ``answers``."""

    def __init__(self, run: RunState, cache: TickCache, changes: VariableChanges) -> None:
        self._run = run
        self._cache = cache
        self._changes = changes
        self._observers: tuple[TickObserver, ...] = ()
        self._began_at = 0.0
        self._is_moving = False

    def observe(self, on_tick: TickObserver) -> None:
        """Call ``on_moment`` with the record of each frozen tick."""
        self._observers += (on_tick,)
        self._cache.is_recording = True

    def emit_changes(self) -> None:
        """Tell what variables have changed."""
        self._run.variables_changed = False
        self._changes.emit()

    def begin(self) -> None:
        """Let time stand still."""
        if self._observers:
            self._began_at = self._run.wall.now()
        self._cache.is_open = True
        self._run.tick_time = self._run.clock.now()

    def end(self, kind: TickKind, late: float = 0.0) -> None:
        """Let time go on, and hand over what the tick has brought."""
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
    """Say whether joints that were looked at are on the move."""
    looks = [value for _, what, _, value in answers if what == JOINTS_QUERY]
    return any(
        isinstance(reading, Reading) and isinstance(reading.value, JointState) and reading.value.moving
        for look in looks
        if isinstance(look, Mapping)
        for reading in look.values()
    )


class RunMode(Enum):
    """Mode of a tick loop; HELD: paused, and no request resumes or steps it."""

    TICKING, PAUSED, HELD = range(3)


class RunModeEvent(Enum):
    """Request to a tick loop, or the ALARM of its guard."""

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
"""Seconds that leaves have to stop cleanly at the end of a run; then their actuators are brought to rest anyway."""

GUARD_INTERVAL = 1.0
"""Seconds within which the guard looks at a base that feels nothing new, while the mission is paused."""

STOP_POLL_INTERVAL = 0.05
"""Seconds within which a ``stop`` is seen. It wakes nobody: a signal handler must not take the lock of an Event, which
may be the very one that it has interrupted."""


@dataclass(frozen=True, slots=True)
class Result:
    """How a run ended: ``result`` is success, failure, interrupted or error.

    A success has a ``reason`` only where motions succeeded by dead reckoning.
    """

    mission: str
    result: str
    reason: str
    seconds: float
    ticks: int


class Executive:
    """Ticks a tree at up to ``rate`` ticks a second, at once when woken, until it ends or is told to stop.

    The rate is a ceiling on waiting: ticks keep to an absolute schedule, and ``Run.wake`` brings the next one forward.
    ``tick`` may also be called by hand, with no loop and no waiting: for tests, simulated time and single steps.
    The ``guard`` looks before each tick: once it says why the mission must end, the tree is halted, and has failed.

    Within a tick, a look of the guard while the mission is paused, and each part of the halting at the end, time stands
    still, and the robot's parts, which must have been ``asked`` through ``answers``, say each thing once. From the
    records of these moments, which ``observe`` hands on, ``replay_tick`` decides over again as it was decided then.
    ``check_tick`` is called when a tick is over, on its thread.
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
        self._alarm = ""  # why the guard has the tree halted
        self._halt_deadline: float | None = None
        self._period = 1.0 / rate
        self._woken = run.wake_event
        self.idle: Callable[[float], object] = run.wake_event.wait
        """Lets time pass while the mission is paused: real time, unless somebody puts a simulated one in its place."""
        self._stop_reason: str | None = None
        self._mode, self._mode_lock = RunMode.TICKING, Lock()
        self._steps: SimpleQueue[None] = SimpleQueue()  # counts: no step is lost, whatever thread it comes from
        run.observer = stream
        run.notify = self._notify

    def observe(self, on_tick: TickObserver) -> None:
        """Call ``on_moment`` with the record of each frozen tick, from the next one on."""
        self._tick_snapshot.observe(on_tick)

    # --- called from any thread ---------------------------------------------------------------------------------------

    def stop(self, reason: str) -> None:
        """End the run after the present tick. The one call that a signal handler may make."""
        self._stop_reason = reason

    @property
    def stopping(self) -> bool:
        """True once ``stop`` was called."""
        return self._stop_reason is not None

    def pause(self) -> None:
        """Stop ticking; the mission keeps its place, and its actuators hold still."""
        self._change_mode(RunModeEvent.PAUSE)

    @property
    def paused(self) -> bool:
        """True from ``pause`` to ``resume``."""
        return self._mode is not RunMode.TICKING

    def hold(self, *, held: bool) -> None:
        """Pause, and neither tick nor step, whatever anybody asks for, until held no longer; it is paused then."""
        self._change_mode(RunModeEvent.HOLD if held else RunModeEvent.RELEASE)

    def step(self) -> None:
        """Tick once while paused; nothing while held."""
        if self._mode is not RunMode.HELD:
            self._steps.put(None)
            self._woken.set()

    def resume(self) -> None:
        """Go on after ``pause``; nothing while held."""
        self._change_mode(RunModeEvent.RESUME)

    def _change_mode(self, event: RunModeEvent) -> None:
        with self._mode_lock:  # a resume that was under way must not undo the hold of a stop
            self._mode = TRANSITIONS[self._mode, event]
        self._woken.set()

    # --- the loop -----------------------------------------------------------------------------------------------------

    def emit_start(self, *, file: str, robot: str, params: Mapping[str, object]) -> None:
        """Begin the stream of events."""
        self.stream.emit(
            Started(self.time(), self.mission, file, robot, {name: str(value) for name, value in params.items()})
        )
        self._tick_snapshot.emit_changes()

    def loop(self) -> Result:
        """Tick until the tree succeeds or fails, or ``stop`` is called; then halt what runs. Does not raise."""
        due = self.run.now()
        held = False
        while self._stop_reason is None:
            mode = self._mode
            step = mode is not RunMode.HELD and not self._steps.empty()
            if step:
                self._steps.get()
            elif mode is not RunMode.TICKING:
                if not held:
                    # A sentence is not broken off for a pause.
                    self.run.safe_stop(self.root.claims - SOUND_KINDS)
                    held = True
                self.idle(STOP_POLL_INTERVAL)
                self._woken.clear()
                due = self.run.now()
                self.run.record_heartbeat()
                self._guard_paused(due)
                if self._alarm:
                    self._change_mode(RunModeEvent.ALARM)
                continue
            held = False
            self._woken.clear()
            if self.tick(late=max(0.0, self.run.now() - due)) is not Status.RUNNING:
                break
            due = self._wait(due)
        return self._make_result()

    def _wait(self, due: float) -> float:
        """Wait until the next tick is due, or until woken or stopped; return when the next scheduled tick is due.

        The schedule is absolute: a tick that came early because it was woken moves nothing, and ticks that were missed
        are counted, not made up for.
        """
        now = self.run.now()
        if now >= due:
            missed = int((now - due) / self._period)
            self.overruns += missed
            due += (missed + 1) * self._period
        while self._stop_reason is None and (left := due - self.run.now()) > 0:
            woken = self.run.wait(min(left, STOP_POLL_INTERVAL))
            self.run.record_heartbeat()
            if woken:
                break
        return due

    def tick(self, *, late: float = 0.0) -> Status:
        """Tick the tree once, which was due ``late`` seconds ago, and return its status."""
        self.run.tick += 1
        self._tick_snapshot.begin()
        try:
            self._run_guard()
            status = self._halt_for_alarm() if self._alarm else self.root.execute_tick()
        finally:
            self._tick_snapshot.end("tick", late)
        if self.stream.has_listeners:
            told = late if late > self._period else None
            self.stream.emit(Ticked(self.time(), self.run.tick, status_word(self.root), told))
        self.run.record_heartbeat()
        if self._after_tick is not None:
            self._after_tick()
        return status

    def _guard_paused(self, now: float) -> None:
        """Have the guard look while the mission is paused: at once when the base feels something, or now and then."""
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
        """Halt the tree because of the alarm, in as many ticks as it needs; then it has failed."""
        if not self._halt_tree():
            return Status.RUNNING
        self.root.feedback_message, self._alarm = self._alarm, ""
        self.root.publish(Status.FAILURE)
        return Status.FAILURE

    def halt(self) -> bool:
        """Halt the tree; True once it is at rest. Leaves may need several ticks: they are given up after HALT_TIME."""
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
        """Do over again what was done at a ``moment``; its time must be that of the run's clock.

        All that the parts of the robot are asked then is for the caller to answer as in the moment's ``answers``.
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
        """Let the time from one tick to the next pass, whatever wakes: for ticks by hand in simulated time."""
        due = self.run.now() + self._period
        while (left := due - self.run.now()) > 0:
            self._woken.clear()
            self.run.wait(left)

    def time(self) -> float:
        """Seconds since the start of the run; from any thread."""
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
        """End the stream of events."""
        self.stream.emit(Ended(self.time(), result.mission, result.result, result.reason, result.seconds, result.ticks))
