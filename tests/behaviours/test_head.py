"""Looking somewhere, on a head that only takes down what it is told, and on servos that take their time."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from behaviours.head import ARRIVED, Look, arrived
from behaviours.leaf import FAILURE, RUNNING, SUCCESS
from behaviours.robot import Robot
from drivers.api import HeadPose, Reading
from drivers.clock import ManualClock
from drivers.errors import BadRequest
from drivers.sim.servo import Shaft
from tests.recorders import GONE, STOP, Bench, RecordedHead, good, none, stale

LEFT = HeadPose(1.0, -0.2)


def looking(bench: Bench, pose: HeadPose = LEFT) -> Look:
    return bench.put(Look("look"), pan=pose.pan, tilt=pose.tilt)


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


def test_look_runs_until_the_head_is_there() -> None:
    bench = Bench()
    leaf = looking(bench)
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == "the head is on its way"
    bench.head.reading = good(LEFT)
    assert bench.tick(leaf) is SUCCESS
    assert bench.head.commands == [LEFT, LEFT]


def test_look_where_it_looks_already_succeeds_at_once() -> None:
    bench = Bench()
    assert bench.tick(looking(bench, HeadPose(0.0, 0.0))) is SUCCESS


def test_look_beyond_the_limits_ends_at_the_limits() -> None:
    bench = Bench()
    leaf = looking(bench, HeadPose(3.0, 2.0))
    bench.tick(leaf)
    bench.head.reading = good(HeadPose(bench.head.limits.pan[1], bench.head.limits.tilt[1]))
    assert bench.tick(leaf) is SUCCESS


@pytest.mark.parametrize("reading", [stale(LEFT), none()])
def test_only_a_fresh_reading_is_an_arrival(reading: Reading[HeadPose]) -> None:
    bench = Bench()
    bench.head.reading = reading
    leaf = looking(bench)
    assert bench.tick(leaf) is RUNNING
    bench.head.reading = good(LEFT)
    assert bench.tick(leaf) is SUCCESS


def test_a_halt_stops_the_head_once() -> None:
    bench = Bench()
    leaf = looking(bench)
    bench.tick(leaf)
    assert bench.halt(leaf)
    assert bench.halt(leaf)
    assert bench.head.commands == [LEFT, STOP]


def test_a_head_that_comes_back_is_told_again_where_to_look() -> None:
    bench = Bench()
    leaf = looking(bench)
    bench.head.trouble = GONE
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == "waiting: the cable is out"
    bench.head.trouble = None
    bench.tick(leaf)
    bench.head.trouble = GONE
    bench.tick(leaf)
    bench.head.trouble = None
    bench.tick(leaf)
    assert bench.head.commands == [LEFT, LEFT]


def test_a_pose_that_the_head_refuses_is_a_failure() -> None:
    bench = Bench()
    bench.head.trouble = BadRequest("head: not a finite number")
    leaf = looking(bench)
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "head: not a finite number"
    assert bench.head.commands == [STOP]


def test_it_looks_anew_after_success_and_after_a_halt() -> None:
    bench = Bench()
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
    bench = Bench()
    servos = ServoHead(bench.clock)
    leaf = looking(bench, HeadPose(pan, tilt))
    leaf.robot = Robot(head_part=servos)
    ticks = 1
    while bench.tick(leaf) is RUNNING:
        ticks += 1
        assert ticks * 0.05 < 2.0
    goal = servos.limits.clamp(HeadPose(pan, tilt))
    assert servos.pose().value is not None
    assert arrived(servos.pose(), goal)


def test_arrived_means_both_axes() -> None:
    goal = HeadPose(0.5, 0.1)
    assert arrived(good(HeadPose(0.5 + 0.9 * ARRIVED, 0.1 - 0.9 * ARRIVED)), goal)
    assert not arrived(good(HeadPose(0.5 + 1.1 * ARRIVED, 0.1)), goal)
    assert not arrived(good(HeadPose(0.5, 0.1 - 1.1 * ARRIVED)), goal)
