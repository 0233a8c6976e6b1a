"""Leaves that are not ticked because a composite stands still: their actuators come to rest, and the leaf goes on."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from behaviours.docking import DockLeaf
from behaviours.driving.go_to import GoTo
from behaviours.head import LookLeaf
from behaviours.head_motion import Nod, SweepHead
from behaviours.joints import MoveJoints, Torque
from behaviours.leaf import FAILURE, RUNNING, SUCCESS, Leaf
from behaviours.ros2 import Navigate, NavigateThrough, Ros2Action
from behaviours.scan import Scan
from behaviours.sight import FindFace
from behaviours.sweep_joints import SweepLeaf
from drivers.api import COMMAND_TIMEOUT, BaseState, GoalState, HeadPose, Pose2D, Progress, Velocity
from drivers.errors import NotConnected
from missions.executive.composites import ReactiveSequence
from missions.executive.parent import set_children
from missions.plugins.testing.recorders import HOLD, LeafTestBench, good

PLACES = {"kitchen": (1.0, 2.0, 0.5, "map")}
RUNS, CANCELLED = Progress(GoalState.RUNNING), Progress(GoalState.CANCELLED, "it was cancelled")

AGAIN: tuple[tuple[type[Leaf], dict[str, object]], ...] = (
    (Navigate, {"to": "kitchen"}),
    (NavigateThrough, {"through": ["kitchen"]}),
    (GoTo, {"x": 1.0, "y": 1.0}),
    (DockLeaf, {}),
)


@pytest.fixture
def bench() -> LeafTestBench:
    made = LeafTestBench()
    made.robot = replace(made.robot, places=PLACES)
    made.ros2.nav2 = True
    made.base.reading = good(BaseState(Pose2D(0.0, 0.0, 0.0), Velocity(0.0, 0.0)))
    return made


def begun(bench: LeafTestBench, leaf: type[Leaf], arguments: dict[str, object]) -> Any:
    it = bench.put(leaf(leaf.tag), **arguments)
    assert bench.tick(it) is RUNNING
    return it


def stands_still(bench: LeafTestBench, leaf: Leaf, seconds: float, *, tick: float = 0.05) -> None:
    """Let a composite above the leaf stand still for so long."""
    end = bench.clock.now() + seconds - 1e-6
    while bench.clock.now() < end:
        bench.run.last_tick_at = bench.clock.now()
        bench.clock.advance(tick)
        bench.run.tick += 1
        assert leaf.pass_time() is RUNNING


def begins(bench: LeafTestBench) -> int:
    return sum(str(command).startswith(("('begin'", "('navigate'")) for command in bench.ros2.commands)


def cancels(bench: LeafTestBench) -> int:
    return sum(str(command).startswith("('cancel'") for command in bench.ros2.commands)


@pytest.mark.parametrize("tick", [0.05, 0.1, 1.0])
@pytest.mark.parametrize(("leaf", "arguments"), [*AGAIN, (Ros2Action, {"action": "/drive"})])
def test_ros2_action_is_cancelled_if_its_leaf_is_not_ticked(
    leaf: type[Leaf], arguments: dict[str, object], tick: float, bench: LeafTestBench
) -> None:
    it = begun(bench, leaf, arguments)
    if tick < COMMAND_TIMEOUT:
        stands_still(bench, it, tick, tick=tick)
        assert cancels(bench) == 0  # a sensor that misses one tick interrupts nothing
    stands_still(bench, it, COMMAND_TIMEOUT, tick=tick)
    assert cancels(bench) == 1
    stands_still(bench, it, 2.0, tick=tick)
    assert cancels(bench) == 1


class SensorGuard(Leaf):
    """Is the way free?"""

    tag = "sensor_guard"
    instant = True
    needs = frozenset({"range"})
    silent = False

    def update(self) -> Any:
        return self.suspend("range finder") if self.silent else SUCCESS


@pytest.mark.parametrize(("leaf", "arguments"), AGAIN)
def test_silent_sensor_guard_cancels_the_ros2_action(
    leaf: type[Leaf], arguments: dict[str, object], bench: LeafTestBench
) -> None:
    guard, drives = bench.put(SensorGuard("free")), bench.put(leaf(leaf.tag), **arguments)
    tree = ReactiveSequence("guarded")
    tree.run, tree.scope = bench.run, bench.run.variables
    set_children(tree, [guard, drives])
    assert bench.tick(tree) is RUNNING
    guard.silent = True
    for _ in range(5):
        assert bench.tick(tree, after=0.1) is RUNNING
    assert cancels(bench) == 1
    guard.silent, bench.ros2.goal_progress = False, CANCELLED
    assert bench.tick(tree) is RUNNING
    assert begins(bench) == 2


@pytest.mark.parametrize("end", [GoalState.CANCELLED, GoalState.FAILED])
@pytest.mark.parametrize(("leaf", "arguments"), AGAIN)
def test_cancelled_ros2_action_restarts_after_its_end(
    leaf: type[Leaf], arguments: dict[str, object], end: GoalState, bench: LeafTestBench
) -> None:
    it = begun(bench, leaf, arguments)
    stands_still(bench, it, 1.0)
    bench.ros2.goal_progress = Progress(GoalState.CANCELLING)
    assert bench.tick(it) is RUNNING
    assert begins(bench) == 1
    bench.ros2.goal_progress = Progress(end, "it was cancelled")
    assert bench.tick(it) is RUNNING
    assert begins(bench) == 2
    bench.ros2.goal_progress = RUNS
    assert bench.tick(it) is RUNNING
    stands_still(bench, it, 1.0)
    assert cancels(bench) == 2
    bench.ros2.goal_progress = CANCELLED
    assert bench.tick(it) is RUNNING
    bench.ros2.goal_progress = Progress(GoalState.SUCCEEDED)
    assert bench.tick(it) is SUCCESS
    assert begins(bench) == 3


def test_an_action_of_any_kind_is_not_repeated(bench: LeafTestBench) -> None:
    it = begun(bench, Ros2Action, {"action": "/drive_distance"})
    stands_still(bench, it, 1.0)
    bench.ros2.goal_progress = CANCELLED
    assert bench.tick(it) is FAILURE
    assert it.feedback_message == "cancelled, since it was not ticked while a sensor was silent"
    assert begins(bench) == 1


@pytest.mark.parametrize(("leaf", "arguments"), [*AGAIN, (Ros2Action, {"action": "/drive"})])
def test_ros2_action_finished_before_the_cancel_is_not_restarted(
    leaf: type[Leaf], arguments: dict[str, object], bench: LeafTestBench
) -> None:
    it = begun(bench, leaf, arguments)
    stands_still(bench, it, 1.0)
    bench.ros2.goal_progress = Progress(GoalState.SUCCEEDED)
    assert bench.tick(it) is SUCCESS
    assert begins(bench) == 1


@pytest.mark.parametrize(("leaf", "arguments"), AGAIN)
@pytest.mark.parametrize(
    ("comes", "said"),
    [
        (Progress(GoalState.UNKNOWN, "its server is gone"), "its server is gone"),
        (Progress(GoalState.CANCELLING), "has not ended"),
    ],
)
def test_ros2_action_that_outlives_its_cancel_fails(
    leaf: type[Leaf], arguments: dict[str, object], comes: Progress, said: str, bench: LeafTestBench
) -> None:
    it = begun(bench, leaf, arguments)
    stands_still(bench, it, 4.0)
    bench.ros2.goal_progress = comes
    assert bench.tick(it) is FAILURE
    assert said in it.feedback_message
    assert begins(bench) == 1


@pytest.mark.parametrize(("leaf", "arguments"), AGAIN)
def test_base_latched_during_a_pause_fails_the_action(
    leaf: type[Leaf], arguments: dict[str, object], bench: LeafTestBench
) -> None:
    it = begun(bench, leaf, arguments)
    stands_still(bench, it, 1.0)
    bench.base.latched, bench.ros2.goal_progress = "the stop button", CANCELLED
    assert bench.tick(it) is FAILURE
    assert begins(bench) == 1


@pytest.mark.parametrize(("leaf", "arguments"), AGAIN)
def test_ros2_node_lost_during_a_pause_is_waited_for(
    leaf: type[Leaf], arguments: dict[str, object], bench: LeafTestBench
) -> None:
    it = begun(bench, leaf, arguments)
    stands_still(bench, it, 1.0)
    bench.ros2.goal_progress, bench.ros2.trouble = CANCELLED, NotConnected("ros2: no server of it")
    assert bench.tick(it) is RUNNING
    bench.ros2.trouble = None
    assert bench.tick(it) is RUNNING
    bench.ros2.goal_progress = Progress(GoalState.SUCCEEDED)
    assert bench.tick(it) is SUCCESS
    assert cancels(bench) == 1


def test_go_to_fails_instead_of_driving_once_nav2_is_gone(bench: LeafTestBench) -> None:
    it = begun(bench, GoTo, {"x": 1.0, "y": 1.0})
    stands_still(bench, it, 1.0)
    bench.ros2.goal_progress, bench.ros2.nav2 = CANCELLED, False
    bench.base.commands.clear()
    assert bench.tick(it) is FAILURE
    assert "has disconnected" in it.feedback_message
    assert not any(isinstance(command, Velocity) and command != Velocity(0.0, 0.0) for command in bench.base.commands)


MOVES: tuple[tuple[type[Leaf], dict[str, object]], ...] = (
    (MoveJoints, {"to": {"elbow": 1.0}}),
    (SweepLeaf, {"joints": ("elbow",), "between": (0.0, 0.5)}),
)


@pytest.mark.parametrize(("leaf", "arguments"), MOVES)
def test_moving_joints_are_held_during_a_pause(
    leaf: type[Leaf], arguments: dict[str, object], bench: LeafTestBench
) -> None:
    it = begun(bench, leaf, arguments)
    bench.arm.commands.clear()
    stands_still(bench, it, 0.1)
    assert bench.arm.commands == []
    stands_still(bench, it, 1.0)
    assert bench.arm.commands == [(HOLD, "elbow")]
    bench.arm.place({"elbow": 0.2})
    assert bench.tick(it) is RUNNING
    assert len(bench.arm.commands) == 2  # it goes on


def test_limp_joints_stay_limp_during_a_pause(bench: LeafTestBench) -> None:
    bench.arm.place({"elbow": 0.0})
    it = begun(bench, Torque, {"stiff": False, "joints": ("elbow",)})
    bench.arm.commands.clear()
    stands_still(bench, it, 1.0)
    assert bench.arm.commands == []
    assert bench.safe_stops == []


HEADS: tuple[tuple[Callable[..., Leaf], dict[str, object]], ...] = (
    (LookLeaf, {"pan": 1.0}),
    (Scan, {}),
    (Nod, {}),
    (SweepHead, {}),
    (FindFace, {}),
)


@pytest.mark.parametrize(("leaf", "arguments"), HEADS)
def test_head_stops_during_a_pause_and_resumes(
    leaf: type[Leaf], arguments: dict[str, object], bench: LeafTestBench
) -> None:
    bench.head.reading = good(HeadPose(0.0, 0.0))
    it = begun(bench, leaf, arguments)
    stands_still(bench, it, 1.0)
    assert bench.safe_stops == [frozenset({"head"})]
    bench.head.commands.clear()
    bench.head.reading = replace(bench.head.reading, stamp=bench.clock.now())
    assert bench.tick(it) is RUNNING
    assert bench.head.commands


def test_a_nod_makes_up_for_a_pause(bench: LeafTestBench) -> None:
    bench.head.reading = good(HeadPose(0.0, 0.0))
    it = begun(bench, Nod, {})
    stands_still(bench, it, 4.0)
    assert bench.tick(it) is RUNNING
    assert it.feedback_message == "1 of 2"


def test_plugin_leaf_without_on_pause_is_safe_stopped(bench: LeafTestBench) -> None:
    class Wave(Leaf):
        """Wave."""

        tag = "wave_it"
        drives = frozenset({"arm", "base", "voice"})

    it = begun(bench, Wave, {})
    stands_still(bench, it, 1.0)
    assert bench.safe_stops == [frozenset({"arm"})]
    bench.tick(it)
    stands_still(bench, it, 1.0)
    assert bench.safe_stops == [frozenset({"arm"})] * 2


def test_exception_in_on_pause_safe_stops_the_leaf(bench: LeafTestBench) -> None:
    class Broken(Leaf):
        """Wave."""

        tag = "broken"
        drives = frozenset({"arm"})

        def on_pause(self) -> None:
            raise ValueError

    it = begun(bench, Broken, {})
    stands_still(bench, it, 1.0)
    assert bench.safe_stops == [frozenset({"arm"})]
    assert bench.tick(it) is RUNNING


def test_suspended_leaf_is_safe_stopped(bench: LeafTestBench) -> None:
    class Feeling(Leaf):
        """Reach for something that is felt."""

        tag = "feeling"
        drives = frozenset({"arm"})
        silent = False

        def update(self) -> Any:
            return self.suspend("gripper") if self.silent else RUNNING

    it = begun(bench, Feeling, {})
    it.silent = True
    for _ in range(3):
        bench.tick(it, after=0.1)
    assert bench.safe_stops == []
    for _ in range(5):
        bench.tick(it, after=0.1)
    assert bench.safe_stops == [frozenset({"arm"})]
