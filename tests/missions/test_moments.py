"""The moments of a run: time stands still in each, and from what was told in them all can be decided over again."""

from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import pytest
from py_trees.common import Status

from behaviours.driving.motion import DriveLeaf
from behaviours.leaf import Leaf
from behaviours.robot import Robot
from behaviours.run import RunState
from drivers.api import BaseState, JointState, Pose2D, Reading, Reflexes, Sides, Steering, Velocity
from drivers.clock import ManualClock
from drivers.errors import DriverError
from missions.executive.events import Event, NodeChanged, ReflexFired, Ticked
from missions.executive.executive import (
    GUARD_INTERVAL,
    HALT_TIMEOUT,
    SAMPLE_INTERVAL_TICKS,
    STOP_POLL_INTERVAL,
    Executive,
)
from missions.executive.guard import BaseGuard
from missions.executive.proxied_robot import with_proxies
from missions.executive.stream import EventStream
from missions.executive.tick_cache import TickCache
from missions.executive.tick_record import Answer, TickRecord
from missions.plugins.testing.recorders import LeafTestBench, good
from missions.plugins.testing.recorders.bench import RecordedBase
from missions.request import RunRequest
from missions.runner import Runner

REST = BaseState(Pose2D(0.0, 0.0, 0.0), Velocity(0.0, 0.0), battery_percent=80.0)
PERIOD = 0.05


class Slow(DriveLeaf):
    """A drive that takes ``ticks`` ticks to stop."""

    tag = "slow_drive"
    ticks = 3
    halt_limit = 2 * HALT_TIMEOUT

    def halting(self) -> bool:
        self.ticks -= 1
        return self.ticks > 0


class Dawdle(Leaf):
    """A leaf that takes ``takes`` seconds of each tick, and keeps the times that it reads."""

    tag = "dawdle"
    takes = 0.03

    def update(self) -> Status:
        clock = self.run.clock
        assert isinstance(clock, ManualClock)
        self.read = [self.run.now()]
        clock.advance(self.takes)
        self.read.append(self.run.now())
        return Status.RUNNING


class Interrupted(Leaf):
    """A leaf in which somebody presses Ctrl-C."""

    def update(self) -> Status:
        raise KeyboardInterrupt


class Scene:
    """An executive with one leaf and a base, all of whose moments and events are kept."""

    def __init__(
        self, leaf: Leaf, base: RecordedBase | None = None, clock: ManualClock | None = None, *, arm: bool = False
    ) -> None:
        self.bench = LeafTestBench(clock)
        self.base = self.bench.base if base is None else base
        self.base.reading = good(REST)
        self.leaf = leaf
        self.moments: list[TickRecord] = []
        self.events: list[Event] = []
        stream, answers, run = EventStream([self.events.append]), TickCache(), self.bench.run
        robot = with_proxies(Robot(base_part=self.base, arm_part=self.bench.arm if arm else None), answers)
        self.bench.put(leaf)
        leaf.robot, leaf.key, leaf.line = robot, "1", 3
        guard = BaseGuard(robot.base, Reflexes(), run, stream)
        self.executive = Executive(leaf, run, stream, guard=guard, cache=answers)
        self.executive.observe(self.moments.append)
        run.wait = lambda seconds: bool(self.bench.clock.advance(seconds))

    def feel(self, **felt: Any) -> None:
        self.base.reading = good(replace(REST, **felt))

    def tick(self, *, late: float = 0.0) -> Status:
        self.bench.clock.advance(PERIOD)
        return self.executive.tick(late=late)

    @property
    def run(self) -> RunState:
        return self.bench.run

    @property
    def changes(self) -> list[tuple[int, str, str]]:
        return [(event.tick, event.status, event.reason) for event in self.events if isinstance(event, NodeChanged)]


@pytest.fixture
def driving() -> Scene:
    return Scene(_drive(DriveLeaf("drive")))


# --- time stands still ------------------------------------------------------------------------------------------------


def test_time_is_constant_within_a_tick() -> None:
    leaf = Dawdle("dawdle")
    scene = Scene(leaf)
    scene.tick()
    assert leaf.read == [100.05, 100.05]
    assert leaf.started_at == 100.05
    assert scene.run.now() == scene.run.clock.now() == pytest.approx(100.08)
    assert scene.moments[0].t == 100.05


def test_node_changes_have_the_time_of_their_occurrence() -> None:
    scene = Scene(Dawdle("dawdle"))
    scene.tick()
    assert [event.t for event in scene.events if isinstance(event, NodeChanged | Ticked)] == [pytest.approx(100.08)] * 2


def test_time_continues_after_an_aborted_tick() -> None:
    scene = Scene(Interrupted("interrupted"))
    with pytest.raises(KeyboardInterrupt):
        scene.tick()
    scene.bench.clock.advance(1.0)
    assert scene.run.now() == pytest.approx(101.05)


# --- what a moment holds ----------------------------------------------------------------------------------------------


def test_tick_record_has_ordered_answers_and_lateness(driving: Scene) -> None:
    driving.tick(late=0.01)
    (moment,) = driving.moments
    assert (moment.kind, moment.tick, moment.t, moment.late, moment.overheld) == ("tick", 1, 100.05, 0.01, None)
    questions = [f"{part}.{what}" for part, what, _, _ in moment.answers]
    assert questions[:2] == ["base.latched", "base.state"]
    assert "base.drive" in questions


def test_tick_duration_is_measured_in_real_time() -> None:
    scene = Scene(Dawdle("dawdle"))
    scene.tick()
    assert scene.moments[0].spent == pytest.approx(0.03)


def test_lateness_is_an_event_only_beyond_a_period(driving: Scene) -> None:
    driving.tick(late=0.04)
    driving.tick(late=0.06)
    assert [event.late for event in driving.events if isinstance(event, Ticked)] == [None, 0.06]
    assert [moment.late for moment in driving.moments] == [0.04, 0.06]


def test_unused_parts_are_sampled_periodically() -> None:
    scene = Scene(Dawdle("dawdle"))
    for _ in range(2 * SAMPLE_INTERVAL_TICKS + 1):
        scene.tick()
    asked_for = [{what for _, what, _, _ in moment.answers} for moment in scene.moments]
    assert [number for number, questions in enumerate(asked_for, 1) if "steering" in questions] == [
        1,
        1 + SAMPLE_INTERVAL_TICKS,
        1 + 2 * SAMPLE_INTERVAL_TICKS,
    ]


@pytest.mark.parametrize(("moving", "ticks"), [(True, [1, 4, 7, 10, 11]), (False, [1, 1 + SAMPLE_INTERVAL_TICKS])])
def test_moving_joints_are_sampled_more_often(moving: bool, ticks: list[int]) -> None:
    scene = Scene(Dawdle("dawdle"), arm=True)
    state = JointState(0.1, 0.5, 0.2, 0.0, 12.0, 35.0, moving=moving, torque=True)
    scene.bench.arm.readings = {"elbow": good(state)}
    for _ in range(SAMPLE_INTERVAL_TICKS + 1):
        scene.tick()
    asked_for = [{(part, what) for part, what, _, _ in moment.answers} for moment in scene.moments]
    assert [number for number, questions in enumerate(asked_for, 1) if ("arm", "states") in questions] == ticks
    assert sum(("base", "steering") in questions for questions in asked_for) == 2


def test_answers_are_not_recorded_without_listeners(driving: Scene) -> None:
    stream, answers = EventStream(), TickCache()
    robot = with_proxies(Robot(base_part=driving.base), answers)
    driving.leaf.robot = robot
    executive = Executive(driving.leaf, driving.run, stream, cache=answers)
    executive.tick()
    assert (answers.is_recording, answers.answers, answers.is_open) == (False, [], False)


def test_while_paused_the_guard_looks_once_a_second_and_at_once_when_the_base_feels_something(driving: Scene) -> None:
    clock = driving.bench.clock
    looks = iter(range(1000))

    def wait(timeout: float | None = None) -> bool:
        clock.advance(STOP_POLL_INTERVAL if timeout is None else timeout)
        number = next(looks)
        if number == 50:
            driving.feel(bumper=Sides(left=True))
        if number == 52:
            driving.base.latched = "a person said so"
        if number == 70:
            driving.executive.stop("enough")
        return False

    driving.executive.idle = wait  # so that no time passes but the clock's
    driving.tick()
    driving.executive.pause()
    driving.executive.loop()
    *quiet, bumped, latched = [moment.t for moment in driving.moments if moment.kind == "look"]
    gaps = [after - before for before, after in pairwise(quiet)]
    assert gaps == pytest.approx([GUARD_INTERVAL] * 2, abs=1.1 * STOP_POLL_INTERVAL)
    assert (bumped - quiet[0], latched - bumped) == pytest.approx((50 * STOP_POLL_INTERVAL, 2 * STOP_POLL_INTERVAL))
    assert [event.condition for event in driving.events if isinstance(event, ReflexFired)] == ["bumper", "latched"]
    assert driving.moments[-1].kind == "halt"


def test_each_part_of_the_halting_is_a_moment() -> None:
    scene = Scene(_drive(Slow("slow")))
    scene.tick()
    scene.executive.stop("enough")
    scene.executive.loop()
    assert [(moment.kind, moment.tick) for moment in scene.moments] == [
        ("tick", 1),
        ("halt", 1),
        ("halt", 2),
        ("halt", 3),
    ]


def test_tick_record_names_the_leaf_that_blocked_the_tick() -> None:
    leaf = Dawdle("dawdle")
    scene = Scene(leaf)
    scene.run.overrun = leaf, 1, 97.08
    assert scene.tick() is Status.FAILURE
    assert scene.moments[0].overheld == ("1", 3.0)
    scene.tick()
    assert scene.moments[1].overheld is None


# --- to decide over again ---------------------------------------------------------------------------------------------


@dataclass
class Answering(RecordedBase):
    """A base that only knows what was answered in a moment."""

    left: list[Answer] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__(ManualClock())
        del self.latched, self.limits

    def __getattr__(self, name: str) -> Any:
        if name in ("latched", "limits"):
            return self.answer(name)
        raise AttributeError(name)

    def answer(self, what: str) -> Any:
        place = next(place for place, (_, each, _, _) in enumerate(self.left) if each == what)
        value = self.left.pop(place)[3]
        if isinstance(value, DriverError):
            raise value
        return value

    def state(self) -> Reading[BaseState]:
        found: Reading[BaseState] = self.answer("state")
        return found

    def steering(self) -> Steering:
        found: Steering = self.answer("steering")
        return found

    def drive(self, velocity: Velocity, **named: object) -> Velocity:
        del velocity, named
        found: Velocity = self.answer("drive")
        return found


def repeated(scene: Scene, leaf: Leaf) -> Scene:
    """Return a scene in which all that happened in another was decided over again."""
    base, clock = Answering(), ManualClock()
    again = Scene(leaf, base, clock)
    for moment in scene.moments:
        base.left = [*moment.answers]
        clock.advance_to(moment.t)
        again.executive.replay_tick(moment)
    return again


def assert_alike(scene: Scene, again: Scene) -> None:
    assert again.changes == scene.changes
    assert [(moment.kind, moment.tick, moment.t) for moment in again.moments] == [
        (moment.kind, moment.tick, moment.t) for moment in scene.moments
    ]


def test_a_drive_is_decided_over_again() -> None:
    scene = Scene(_drive(DriveLeaf("drive")))
    for number in range(40):
        scene.feel(pose=Pose2D(min(1.0, 0.1 * number), 0.0, 0.0))
        if scene.tick() is not Status.RUNNING:
            break
    assert scene.changes[-1][1] == "success"
    assert_alike(scene, repeated(scene, _drive(DriveLeaf("drive"))))


def test_rerun_repeats_an_alarm_and_its_halt() -> None:
    scene = Scene(_drive(Slow("slow")))
    scene.tick()
    scene.feel(battery_percent=5.0)
    while scene.tick() is Status.RUNNING:
        pass
    assert scene.changes[-1][1:] == ("failure", "battery critical: 5 %")
    assert_alike(scene, repeated(scene, _drive(Slow("slow"))))


def test_rerun_repeats_an_abandoned_halt() -> None:
    endless = Slow("slow")
    endless.ticks = 1000
    scene = Scene(_drive(endless))
    scene.tick()
    scene.executive.stop("enough")
    scene.executive.loop()
    assert scene.moments[-1].t - scene.moments[1].t >= HALT_TIMEOUT
    again = Slow("slow")
    again.ticks = 1000
    assert_alike(scene, repeated(scene, _drive(again)))


def test_rerun_repeats_the_failure_of_a_blocking_leaf() -> None:
    leaf = Dawdle("dawdle")
    scene = Scene(leaf)
    scene.tick()
    scene.run.overrun = leaf, 2, 97.04
    scene.tick()
    reason = scene.changes[-1][2]
    assert reason == "dawdle (line 3): blocked the tick for 3.1 s"
    quick = Dawdle("dawdle")
    quick.takes = 0.0
    assert_alike(scene, repeated(scene, quick))


def test_a_refused_command_is_refused_over_again() -> None:
    scene = Scene(_drive(DriveLeaf("drive")))
    scene.base.trouble = DriverError("the wheels are stuck")
    assert scene.tick() is Status.FAILURE
    assert scene.changes[-1][2] == "the wheels are stuck"
    assert_alike(scene, repeated(scene, _drive(DriveLeaf("drive"))))


def _drive(leaf: DriveLeaf) -> DriveLeaf:
    leaf.distance = 1.0
    return leaf


# --- a whole run ------------------------------------------------------------------------------------------------------


def _played(*, recorded: bool) -> tuple[list[NodeChanged], list[TickRecord], list[Ticked]]:
    events: list[Event] = []
    moments: list[TickRecord] = []
    order = RunRequest("greet", simulate="fast", eyes="truth")
    runner = Runner(order, listeners=[events.append])
    runner.observe(moments.append if recorded else None)
    runner.run()
    changes = [event for event in events if isinstance(event, NodeChanged)]
    return changes, moments, [event for event in events if isinstance(event, Ticked)]


def test_tick_listener_does_not_change_the_run() -> None:
    without, none, _ = _played(recorded=False)
    changes, moments, ticks = _played(recorded=True)
    assert changes == without
    assert none == []
    assert [(moment.kind, moment.tick) for moment in moments] == [("tick", event.tick) for event in ticks]
    assert {part for moment in moments for part, _, _, _ in moment.answers} == {
        "base",
        "head",
        "arm",
        "sight",
        "voice",
        "screen",
    }


def test_in_simulated_time_no_tick_is_late() -> None:
    _, moments, _ = _played(recorded=True)
    assert max(moment.late for moment in moments) < 1e-9
    assert min(moment.spent for moment in moments) > 0.0
