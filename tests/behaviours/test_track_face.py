"""Following a face as a leaf: whom it follows, how long it goes on without, and that head and base are stopped."""

import math

import pytest

from behaviours.leaf import FAILURE, RUNNING
from behaviours.robot import Robot
from behaviours.tracking.follow import RuleBases
from behaviours.tracking.track import COAST_TIME, TrackFace
from config.controller import load_controller
from config.library import shipped_files
from drivers.api import COMMAND_TIMEOUT, ZERO_VELOCITY, BaseState, HeadPose, Pose2D, Source, Steering, Velocity
from drivers.errors import DeviceFault
from missions.plugins.testing.recorders import OFFLINE_ERROR, STOP, LeafTestBench, face, good, none, stale

LEFT, RIGHT = 0.3, -0.3


@pytest.fixture(scope="module")
def rules() -> RuleBases:
    return RuleBases.from_mapping(load_controller(shipped_files("controllers")["face"]).values)


def tracking(bench: LeafTestBench, rules: RuleBases, **arguments: object) -> TrackFace:
    return bench.put(TrackFace("track_face"), controller=rules, **arguments)


def show(bench: LeafTestBench, *, yaw: float = 0.0, pitch: float = 0.0, number: int = 1) -> None:
    """Show one face, seen now."""
    bench.sight.seen = [face(bench.clock.now(), number=number, yaw=yaw, pitch=pitch)]


def follow(bench: LeafTestBench, leaf: TrackFace, *, yaw: float, pitch: float = 0.0, ticks: int = 20) -> None:
    """Tick with a face in view, seen at each tick, while the head goes where it is told."""
    for _ in range(ticks):
        show(bench, yaw=yaw, pitch=pitch)
        assert bench.tick(leaf) is RUNNING
        bench.head.reading = good(looks(bench)[-1])


def looks(bench: LeafTestBench) -> list[HeadPose]:
    return [command for command in bench.head.commands if isinstance(command, HeadPose)]


# --- following -------------------------------------------------------------------------------------------------------


def test_track_face_moves_the_head_and_not_the_base_near_the_middle(rules: RuleBases) -> None:
    bench = LeafTestBench()
    leaf = tracking(bench, rules)
    follow(bench, leaf, yaw=LEFT, pitch=-0.2)
    assert looks(bench)[-1].pan == pytest.approx(LEFT, abs=0.02)
    assert looks(bench)[-1].tilt == pytest.approx(-0.2, abs=0.02)
    assert bench.base.commands == [Velocity(0.0, 0.0)] * 20
    assert leaf.reason == "face 1, 0 deg off"


def test_track_face_turns_the_base_near_the_head_limit_up_to_max_turn(rules: RuleBases) -> None:
    bench = LeafTestBench()
    leaf = tracking(bench, rules, max_turn=0.5)
    follow(bench, leaf, yaw=1.5, ticks=40)
    turns = [command.angular for command in bench.base.commands if isinstance(command, Velocity)]
    assert turns[-1] == 0.5
    assert turns == sorted(turns)


def test_a_robot_without_a_base_follows_with_the_head_alone(rules: RuleBases) -> None:
    bench = LeafTestBench()
    bench.robot = Robot(head_part=bench.head, sight_part=bench.sight)
    leaf = tracking(bench, rules)
    follow(bench, leaf, yaw=LEFT)
    assert looks(bench)[-1].pan == pytest.approx(LEFT, abs=0.02)
    assert bench.halt(leaf)
    assert bench.base.commands == []


def test_track_face_stores_the_face_while_tracking(rules: RuleBases) -> None:
    bench = LeafTestBench()
    leaf = tracking(bench, rules, output_variable="visitor")
    bench.tick(leaf)
    assert bench.run.variables == {}
    show(bench)
    bench.tick(leaf)
    assert bench.run.variables == {"visitor": bench.sight.seen[0]}


def test_track_face_starts_at_the_current_head_pose(rules: RuleBases) -> None:
    bench = LeafTestBench()
    bench.head.reading = good(HeadPose(0.8, -0.1))
    leaf = tracking(bench, rules)
    show(bench, yaw=0.8, pitch=-0.1)
    bench.tick(leaf)
    assert looks(bench) == [HeadPose(0.8, -0.1)]


# --- whom ------------------------------------------------------------------------------------------------------------


def test_track_face_takes_the_largest_face_and_keeps_it(rules: RuleBases) -> None:
    bench = LeafTestBench()
    leaf = tracking(bench, rules)
    now = bench.clock.now()
    first, second = face(now, number=1, yaw=LEFT), face(now, number=2, yaw=RIGHT)
    bench.sight.seen = [first, second]
    bench.tick(leaf)
    bench.sight.seen = [second, first]
    bench.tick(leaf)
    assert leaf.result == first


def test_track_face_takes_the_largest_face_after_a_loss(rules: RuleBases) -> None:
    bench = LeafTestBench()
    leaf = tracking(bench, rules)
    show(bench, number=1)
    bench.tick(leaf)
    bench.sight.seen = [face(bench.clock.now(), number=3), face(bench.clock.now(), number=2)]
    bench.tick(leaf)
    assert leaf.result == bench.sight.seen[0]


def test_track_face_switches_to_a_visible_face_after_its_patience(rules: RuleBases) -> None:
    bench = LeafTestBench()
    leaf = tracking(bench, rules, patience=0.5)
    lost = face(bench.clock.now(), number=1)
    for _ in range(20):
        bench.sight.seen = [lost, face(bench.clock.now(), number=2)]
        assert bench.tick(leaf) is RUNNING
    assert leaf.reason == "face 2, 0 deg off"


# --- without a face --------------------------------------------------------------------------------------------------


def test_track_face_fails_without_a_face_after_its_patience(rules: RuleBases) -> None:
    bench = LeafTestBench()
    leaf = tracking(bench, rules, patience=1.0)
    show(bench)
    bench.tick(leaf, after=0.0)
    assert bench.tick(leaf, after=0.9) is RUNNING
    assert leaf.reason == "no face for 0.9 s"
    assert bench.tick(leaf, after=0.2) is FAILURE
    assert leaf.reason == "no face for 1 s"
    assert bench.head.commands[-1] == STOP
    assert bench.base.commands[-1] == STOP


def test_patience_counts_from_the_start_without_any_face(rules: RuleBases) -> None:
    bench = LeafTestBench()
    leaf = tracking(bench, rules, patience=1.0)
    bench.sight.seen = [face(bench.clock.now() - 5.0)]
    assert bench.tick(leaf, after=0.0) is RUNNING
    assert looks(bench) == []
    assert bench.tick(leaf, after=1.0) is RUNNING
    assert bench.tick(leaf, after=0.1) is FAILURE


def test_briefly_lost_face_is_tracked_on_and_then_the_base_stops(rules: RuleBases) -> None:
    bench = LeafTestBench()
    leaf = tracking(bench, rules)
    follow(bench, leaf, yaw=1.3)
    bench.sight.seen = ()
    assert bench.tick(leaf, after=0.8 * COMMAND_TIMEOUT) is RUNNING
    assert bench.base.commands[-1] != Velocity(0.0, 0.0)
    told = len(looks(bench))
    assert bench.tick(leaf, after=COAST_TIME) is RUNNING
    assert bench.base.commands[-1] == Velocity(0.0, 0.0)
    assert len(looks(bench)) == told


# --- stopping and trouble --------------------------------------------------------------------------------------------


def test_a_halt_stops_head_and_base_once(rules: RuleBases) -> None:
    bench = LeafTestBench()
    leaf = tracking(bench, rules)
    follow(bench, leaf, yaw=LEFT)
    assert bench.halt(leaf)
    assert bench.halt(leaf)
    for part in (bench.head, bench.base):
        assert part.commands[-1] == STOP
        assert part.commands.count(STOP) == 1


def test_a_lost_head_is_waited_for_and_the_base_is_not_driven(rules: RuleBases) -> None:
    bench = LeafTestBench()
    leaf = tracking(bench, rules)
    bench.head.trouble = OFFLINE_ERROR
    bench.head.reading = none()
    show(bench, yaw=1.4)
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == "waiting: the cable is out"
    assert bench.base.commands == []
    bench.head.trouble = None
    bench.head.reading = good(HeadPose(0.0, 0.0))
    follow(bench, leaf, yaw=LEFT)
    assert looks(bench)[-1].pan == pytest.approx(LEFT, abs=0.02)


def test_a_lost_base_leaves_the_head_following(rules: RuleBases) -> None:
    bench = LeafTestBench()
    leaf = tracking(bench, rules)
    bench.base.trouble = OFFLINE_ERROR
    bench.base.reading = none()
    follow(bench, leaf, yaw=LEFT)
    assert looks(bench)[-1].pan == pytest.approx(LEFT, abs=0.02)
    assert leaf.reason == "waiting: the cable is out"


def test_even_a_lost_device_does_not_outlast_the_patience(rules: RuleBases) -> None:
    bench = LeafTestBench()
    leaf = tracking(bench, rules, patience=1.0)
    bench.base.trouble = OFFLINE_ERROR
    assert bench.tick(leaf) is RUNNING
    assert bench.tick(leaf, after=1.1) is FAILURE
    assert leaf.reason == "no face for 1 s"


def test_base_with_stale_odometry_counts_as_standing(rules: RuleBases) -> None:
    bench = LeafTestBench()
    moving = BaseState(Pose2D(0.0, 0.0, 0.5), Velocity(0.0, 1.0))
    leaf = tracking(bench, rules)
    bench.base.reading = stale(moving)
    follow(bench, leaf, yaw=0.5 + LEFT, ticks=40)
    assert looks(bench)[-1].pan == pytest.approx(LEFT, abs=0.02)


def test_track_face_fails_on_a_head_fault_and_stops_head_and_base(rules: RuleBases) -> None:
    bench = LeafTestBench()
    leaf = tracking(bench, rules)
    show(bench)
    bench.head.trouble = DeviceFault("head: servo 1 stalls")
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "head: servo 1 stalls"
    assert bench.head.commands == [STOP]
    assert bench.base.commands == [STOP]


def test_track_face_fails_on_a_non_finite_face_and_stops(rules: RuleBases, caplog: pytest.LogCaptureFixture) -> None:
    bench = LeafTestBench()
    leaf = tracking(bench, rules)
    show(bench, yaw=math.nan)
    assert bench.tick(leaf) is FAILURE
    assert "follow: not finite" in leaf.reason
    assert bench.head.commands == [STOP]
    assert "raised" in caplog.text


@pytest.mark.parametrize("ending", ["lost", "halted"])
def test_a_second_run_knows_nothing_of_the_first(rules: RuleBases, ending: str) -> None:
    bench = LeafTestBench()
    leaf = tracking(bench, rules, patience=1.0)
    follow(bench, leaf, yaw=LEFT)
    bench.sight.seen = ()
    if ending == "lost":
        assert bench.tick(leaf, after=1.1) is FAILURE
    else:
        assert bench.halt(leaf)
    bench.head.commands.clear()
    assert bench.tick(leaf, after=0.05) is RUNNING
    assert leaf.result is None
    assert looks(bench) == []
    assert bench.tick(leaf, after=0.9) is RUNNING
    bench.sight.seen = [face(bench.clock.now(), number=2), face(bench.clock.now(), number=1)]
    bench.tick(leaf, after=0.0)
    assert leaf.result == bench.sight.seen[0]


def test_learnt_base_lag_overrides_the_lag_argument(rules: RuleBases) -> None:
    bench = LeafTestBench()
    for known, expected in ((False, 0.3), (True, 0.18)):
        bench.robot.lag.set_prior(0.18, learnt=known)
        tracking(bench, rules, lag=0.3).initialise()
        assert bench.robot.lag.seconds == expected
        assert bench.robot.lag.acceleration == bench.base.limits.turn_acceleration


def test_track_face_fails_if_the_base_does_not_move(rules: RuleBases) -> None:
    bench = LeafTestBench()
    leaf = tracking(bench, rules)
    assert bench.tick(leaf) is RUNNING
    bench.base.steers = Steering(Source.MISSION, Velocity(0.0, 0.5), ZERO_VELOCITY, "blocked", "blocked")
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "blocked"
