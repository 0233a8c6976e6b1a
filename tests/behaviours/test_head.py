"""Looking somewhere, on a head that only takes down what it is told, and on servos that take their time."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from behaviours.head import ARRIVAL_TOLERANCE, SAG_TOLERANCE, SETTLE_TIME, LookAt, LookLeaf, has_arrived, pose_towards
from behaviours.leaf import FAILURE, RUNNING, SUCCESS
from behaviours.robot import Robot
from drivers.api import HeadPose, Reading
from drivers.clock import ManualClock
from drivers.errors import BadRequest
from drivers.sim.servo import Shaft
from missions.plugins.testing.recorders import OFFLINE_ERROR, STOP, LeafTestBench, RecordedHead, good, none, stale

LEFT = HeadPose(1.0, -0.2)


def looking(bench: LeafTestBench, pose: HeadPose = LEFT) -> LookLeaf:
    return bench.put(LookLeaf("look"), pan=pose.pan, tilt=pose.tilt)


class ServoHead(RecordedHead):
    """A head with two servos that stop in whole degrees."""

    def __init__(self, clock: ManualClock) -> None:
        super().__init__(clock)
        self.shafts = [Shaft(0.0, 0.0, math.degrees(self.limits.speed), clock.now()) for _ in range(2)]

    def look(self, target: HeadPose) -> HeadPose:
        accepted = super().look(target)
        self.pose()
        for shaft, angle in zip(self.shafts, (accepted.pan, accepted.tilt), strict=True):
            shaft.goal = round(math.degrees(angle))
        return accepted

    def pose(self) -> Reading[HeadPose]:
        pan, tilt = (math.radians(shaft.advance(self.clock.now())) for shaft in self.shafts)
        return good(HeadPose(pan, tilt))


def test_look_runs_until_the_head_arrives() -> None:
    bench = LeafTestBench()
    leaf = looking(bench)
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == "the head is at +0, +0 deg, on its way to +57, -11 deg"
    bench.head.reading = good(LEFT)
    assert bench.tick(leaf) is SUCCESS
    assert (leaf.reason, leaf.result) == ("looks at +57, -11 deg", LEFT)
    assert bench.head.commands == [LEFT, LEFT]


def test_look_at_the_current_pose_succeeds_at_once() -> None:
    bench = LeafTestBench()
    assert bench.tick(looking(bench, HeadPose(0.0, 0.0))) is SUCCESS


def test_look_beyond_the_limits_ends_at_the_limits() -> None:
    bench = LeafTestBench()
    leaf = looking(bench, HeadPose(3.0, 2.0))
    bench.tick(leaf)
    assert leaf.reason.endswith("on its way to +80, +20 deg, the limit for +172, +115 deg")
    bench.head.reading = good(HeadPose(bench.head.limits.pan[1], bench.head.limits.tilt[1]))
    assert bench.tick(leaf) is SUCCESS
    assert leaf.reason == "looks at +80, +20 deg, the limit for +172, +115 deg"


@pytest.mark.parametrize("reading", [stale(LEFT), none()])
def test_only_a_fresh_reading_is_an_arrival(reading: Reading[HeadPose]) -> None:
    bench = LeafTestBench()
    bench.head.reading = reading
    leaf = looking(bench)
    assert bench.tick(leaf) is RUNNING
    bench.head.reading = good(LEFT)
    assert bench.tick(leaf) is SUCCESS


def test_a_halt_stops_the_head_once() -> None:
    bench = LeafTestBench()
    leaf = looking(bench)
    bench.tick(leaf)
    assert bench.halt(leaf)
    assert bench.halt(leaf)
    assert bench.head.commands == [LEFT, STOP]


def test_look_sends_its_pose_again_after_a_reconnect() -> None:
    bench = LeafTestBench()
    leaf = looking(bench)
    bench.head.trouble = OFFLINE_ERROR
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == "waiting: the cable is out"
    bench.head.trouble = None
    bench.tick(leaf)
    bench.head.trouble = OFFLINE_ERROR
    bench.tick(leaf)
    bench.head.trouble = None
    bench.tick(leaf)
    assert bench.head.commands == [LEFT, LEFT]


def test_look_fails_if_the_head_refuses_the_pose() -> None:
    bench = LeafTestBench()
    bench.head.trouble = BadRequest("head: not a finite number")
    leaf = looking(bench)
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "head: not a finite number"
    assert bench.head.commands == [STOP]


def test_look_starts_again_after_success_and_halt() -> None:
    bench = LeafTestBench()
    leaf = looking(bench)
    bench.head.reading = good(LEFT)
    assert bench.tick(leaf) is SUCCESS
    bench.put(leaf, pan=-1.0)
    assert bench.tick(leaf) is RUNNING
    bench.halt(leaf)
    bench.put(leaf, pan=1.0)
    assert bench.tick(leaf) is SUCCESS


@given(pan=st.floats(-3, 3), tilt=st.floats(-3, 3))
def test_servos_of_whole_degrees_always_arrive(pan: float, tilt: float) -> None:
    bench = LeafTestBench()
    servos = ServoHead(bench.clock)
    leaf = looking(bench, HeadPose(pan, tilt))
    leaf.robot = Robot(head_part=servos)
    ticks = 1
    while bench.tick(leaf) is RUNNING:
        ticks += 1
        assert ticks * 0.05 < 2.0
    goal = servos.limits.clamp(HeadPose(pan, tilt))
    assert servos.pose().value is not None
    assert has_arrived(servos.pose(), goal)


def test_arrived_means_both_axes() -> None:
    goal = HeadPose(0.5, 0.1)
    assert has_arrived(good(HeadPose(0.5 + 0.9 * ARRIVAL_TOLERANCE, 0.1 - 0.9 * ARRIVAL_TOLERANCE)), goal)
    assert not has_arrived(good(HeadPose(0.5 + 1.1 * ARRIVAL_TOLERANCE, 0.1)), goal)
    assert not has_arrived(good(HeadPose(0.5, 0.1 - 1.1 * ARRIVAL_TOLERANCE)), goal)


def test_look_succeeds_once_a_sagging_head_rests() -> None:
    bench = LeafTestBench()
    leaf = looking(bench)
    bench.head.reading = good(HeadPose(LEFT.pan, LEFT.tilt + 0.9 * SAG_TOLERANCE))
    for _ in range(int(SETTLE_TIME / 0.05)):
        assert bench.tick(leaf) is RUNNING
    assert bench.tick(leaf, after=0.1) is SUCCESS


def test_look_fails_with_the_pose_of_a_blocked_head() -> None:
    bench = LeafTestBench()
    leaf = looking(bench)
    bench.head.reading = good(HeadPose(0.5, 0.0))
    while bench.tick(leaf) is RUNNING:
        assert leaf.elapsed < SETTLE_TIME + 0.2
    assert leaf.reason == "the head rests at +29, +0 deg and does not reach +57, -11 deg"
    assert bench.head.commands[-1] == STOP


def test_slow_or_silent_head_is_not_stuck() -> None:
    bench = LeafTestBench()
    leaf = looking(bench)
    for step in range(60):
        bench.head.reading = good(HeadPose(step * 0.005, 0.0))
        assert bench.tick(leaf) is RUNNING
    bench.head.reading = stale(HeadPose(0.3, 0.0))
    for _ in range(60):
        assert bench.tick(leaf) is RUNNING


def pointing(bench: LeafTestBench, x: float, y: float, z: float) -> LookAt:
    return bench.put(LookAt("look_at"), x=x, y=y, z=z)


@pytest.mark.parametrize(
    ("point", "pan", "tilt"),
    [
        ((2.05, 0.0, 1.1), 0.0, 0.0),
        ((2.05, 2.0, 1.1), 45.0, 0.0),
        ((2.05, -2.0, 1.1), -45.0, 0.0),
        ((1.15, 0.0, 0.8), 0.0, 15.26),  # 1.1 m ahead of the eye, 0.3 m below it
        ((0.05, 1.0, 2.1), 90.0, -45.0),
    ],
)
def test_pose_towards_points_at_the_camera_target(point: tuple[float, float, float], pan: float, tilt: float) -> None:
    found = pose_towards((0.05, 0.0, 1.1), point)
    assert found is not None
    assert (math.degrees(found.pan), math.degrees(found.tilt)) == pytest.approx((pan, tilt), abs=0.01)


@given(st.floats(-1.3, 1.3), st.floats(-1.0, 0.3), st.floats(0.05, 20))
def test_pose_towards_recovers_the_direction_of_a_point(pan: float, tilt: float, far: float) -> None:
    eye = (0.1, -0.05, 0.9)
    ahead = far * math.cos(tilt)
    point = (eye[0] + ahead * math.cos(pan), eye[1] + ahead * math.sin(pan), eye[2] - far * math.sin(tilt))
    found = pose_towards(eye, point)
    assert found is not None
    assert (found.pan, found.tilt) == pytest.approx((pan, tilt), abs=1e-6)


def test_look_at_turns_from_where_the_camera_sits() -> None:
    bench = LeafTestBench()
    leaf = pointing(bench, 1.5, 1.0, 1.2)
    leaf.robot = Robot(head_part=bench.head, camera_position=(0.5, 0.0, 1.2))
    assert bench.tick(leaf) is RUNNING
    (command,) = bench.head.commands
    assert isinstance(command, HeadPose)
    assert (command.pan, command.tilt) == pytest.approx((math.pi / 4, 0.0))
    bench.head.reading = good(HeadPose(math.pi / 4, 0.0))
    assert bench.tick(leaf) is SUCCESS


def test_a_point_out_of_reach_is_a_failure_and_moves_nothing() -> None:
    bench = LeafTestBench()
    leaf = pointing(bench, -2.0, 0.0, 1.0)
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == (
        "(-2, 0, 1) m is at +180, +0 deg, beyond the head's limits: pan -80 to 80 deg, tilt -57 to 20 deg"
    )
    leaf = pointing(bench, 0.0, 0.0, 1.0)
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "(0, 0, 1) m is too close to the camera"
    assert bench.head.commands == [STOP, STOP]
