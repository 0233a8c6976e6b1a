"""What all leaves that drive have in common: who else has the wheels, what the base refuses, how hard it brakes."""

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from behaviours.driving.go_to import GoTo
from behaviours.driving.motion import REACTION_TIME, Arc, BaseMotion, Cruise, DriveLeaf, StopLeaf, TurnLeaf
from behaviours.leaf import FAILURE, RUNNING, SUCCESS
from behaviours.robot import Robot
from drivers.api import BaseLimits, BaseState, Pose2D, Sides, Source, Steering, Velocity
from drivers.base.limits import VelocityLimits
from missions.plugins.testing.recorders import STOP, LeafTestBench, RecordedBase, good
from tests.behaviours.test_base import Track

STILL = Velocity(0.0, 0.0)
SIDE = Sides(left=True)
HERE = BaseState(Pose2D(0.0, 0.0, 0.0), STILL)
BY_HAND = Steering(Source.TELEOP, Velocity(0.1, 0.0), Velocity(0.1, 0.0))
BACKING = Steering(Source.SAFETY, Velocity(-0.1, 0.0), Velocity(-0.1, 0.0), "backing off: bumper left")


def motions(bench: LeafTestBench) -> list[BaseMotion]:
    return [
        bench.put(DriveLeaf("drive"), distance=1.0),
        bench.put(TurnLeaf("turn"), angle=1.0),
        bench.put(Arc("arc"), radius=0.5),
        bench.put(GoTo("go_to"), x=1.0, y=1.0),
        bench.put(Cruise("velocity"), speed=0.2),
    ]


NUMBERS = range(5)


def at(x: float, heading: float = 0.0) -> BaseState:
    return BaseState(Pose2D(x, 0.0, heading), STILL)


# --- who else has the wheels -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("number", NUMBERS)
def test_motions_wait_without_commands_during_teleoperation(number: int) -> None:
    bench = LeafTestBench()
    leaf = motions(bench)[number]
    bench.tick(leaf)
    bench.base.commands.clear()
    bench.base.steers = BY_HAND
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == "teleoperation has control"
    assert bench.base.commands == []
    bench.base.steers = Steering(None, STILL, STILL)
    assert bench.tick(leaf) is RUNNING
    assert len(bench.base.commands) == 1


@pytest.mark.parametrize("number", NUMBERS)
def test_motions_fail_with_the_reason_of_the_latch(number: int) -> None:
    bench = LeafTestBench()
    leaf = motions(bench)[number]
    bench.tick(leaf)
    bench.base.latched = "button 0 was pressed"
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "the base is stopped: button 0 was pressed"
    assert bench.base.commands[-1] == STOP


@pytest.mark.parametrize("number", NUMBERS)
def test_motions_fail_with_the_cause_of_a_motion_fault_and_can_restart(number: int) -> None:
    bench = LeafTestBench()
    leaf = motions(bench)[number]
    bench.tick(leaf)
    because = "commanded 0.2 m/s for 1.0 s, encoders report 0 m: blocked or not connected"
    bench.base.steers = Steering(Source.MISSION, Velocity(0.2, 0.0), STILL, because, because)
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == because
    assert bench.base.commands[-1] == STOP
    bench.base.steers = Steering(None, STILL, STILL)
    assert bench.tick(leaf) is RUNNING


def test_a_fault_of_a_persons_command_does_not_fail_a_mission() -> None:
    bench = LeafTestBench()
    leaf = motions(bench)[0]
    bench.tick(leaf)
    bench.base.steers = Steering(Source.TELEOP, Velocity(0.2, 0.0), STILL, "blocked", "blocked")
    assert bench.tick(leaf) is RUNNING


def test_interrupted_drive_continues_along_its_line() -> None:
    bench = LeafTestBench()
    leaf = bench.put(DriveLeaf("drive"), distance=1.0)
    bench.tick(leaf)
    bench.base.steers, bench.base.reading = BY_HAND, good(at(0.6))
    bench.tick(leaf)
    bench.base.steers = Steering(None, STILL, STILL)
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == "0.60 of 1.00 m"
    assert bench.base.commands[-1] == Velocity(0.2, 0.0)


def test_drive_returns_after_teleoperation_beyond_its_goal() -> None:
    bench = LeafTestBench()
    leaf = bench.put(DriveLeaf("drive"), distance=1.0)
    bench.tick(leaf)
    bench.base.steers, bench.base.reading = BY_HAND, good(at(1.5))
    bench.tick(leaf)
    bench.base.steers = Steering(None, STILL, STILL)
    bench.tick(leaf)
    assert bench.base.commands[-1] == Velocity(-0.2, 0.0)


def test_turn_returns_after_teleoperation_beyond_its_goal() -> None:
    bench = LeafTestBench()
    leaf = bench.put(TurnLeaf("turn"), angle=1.0, speed=0.5)
    bench.tick(leaf)
    bench.base.steers, bench.base.reading = BY_HAND, good(at(0.0, heading=2.0))
    bench.tick(leaf)
    bench.base.steers = Steering(None, STILL, STILL)
    bench.tick(leaf)
    assert bench.base.commands[-1] == Velocity(0.0, -0.5)


def test_drive_interrupted_during_its_stop_is_not_at_the_goal() -> None:
    bench = LeafTestBench()
    leaf = bench.put(DriveLeaf("drive"), distance=1.0)
    bench.tick(leaf)
    bench.base.reading = good(replace(at(1.0), velocity=Velocity(0.1, 0.0)))
    assert bench.tick(leaf) is RUNNING
    bench.base.steers, bench.base.reading = BY_HAND, good(at(0.2))
    bench.tick(leaf)
    bench.base.steers = Steering(None, STILL, STILL)
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == "0.20 of 1.00 m"


def test_past_bump_fails_a_drive_while_the_base_backs_off() -> None:
    bench = LeafTestBench()
    drive, turn = bench.put(DriveLeaf("drive"), distance=1.0), bench.put(TurnLeaf("turn"), angle=1.0)
    bench.base.steers = BACKING
    assert bench.tick(drive) is FAILURE
    assert drive.reason == "bumped into something"
    assert bench.tick(turn) is RUNNING
    assert turn.reason == "backing off: bumper left"


def test_stop_succeeds_whoever_has_the_wheels_and_whatever_the_base_feels() -> None:
    bench = LeafTestBench()
    bench.base.steers, bench.base.latched = BY_HAND, "a cliff"
    bench.base.reading = good(replace(HERE, wheel_drop=SIDE, cliff=SIDE))
    leaf = bench.put(StopLeaf("stop"))
    assert bench.tick(leaf) is RUNNING
    assert bench.tick(leaf, after=REACTION_TIME) is SUCCESS


# --- what the base refuses -------------------------------------------------------------------------------------------


class Refusing(RecordedBase):
    """A base that lets nothing through while it ``refuses``."""

    refuses = True

    def drive(self, velocity: Velocity, *, source: Source = Source.MISSION) -> Velocity:
        super().drive(velocity, source=source)
        return STILL if self.refuses else velocity


def refused(bench: LeafTestBench) -> tuple[TurnLeaf, Refusing]:
    leaf, base = bench.put(TurnLeaf("turn"), angle=1.0), Refusing(bench.clock)
    base.steers = Steering(Source.MISSION, Velocity(0.0, 1.0), STILL, "at an edge")
    leaf.robot = Robot(base_part=base)
    return leaf, base


def test_motion_refused_beyond_the_reaction_time_fails() -> None:
    bench = LeafTestBench()
    leaf, base = refused(bench)
    assert bench.tick(leaf) is RUNNING
    assert bench.tick(leaf, after=REACTION_TIME) is RUNNING
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "the base does not move: at an edge"
    assert base.commands[-1] == STOP


def test_briefly_refused_motion_continues() -> None:
    bench = LeafTestBench()
    leaf, base = refused(bench)
    for _ in range(4):
        for base.refuses in (True, True, False):
            assert bench.tick(leaf, after=0.1) is RUNNING


# --- how it brakes ---------------------------------------------------------------------------------------------------


@settings(max_examples=25, deadline=None)
@given(acceleration=st.floats(0.1, 1.0), speed=st.floats(0.1, 0.5))
def test_drive_with_gentle_braking_ends_within_a_centimetre(acceleration: float, speed: float) -> None:
    bench = LeafTestBench()
    leaf = bench.put(DriveLeaf("drive"), distance=1.0, speed=speed)
    track = Track(leaf, bench, limits=VelocityLimits(0.5, 1.9, acceleration, 3.5))
    assert track.pass_time(60.0) is SUCCESS
    assert track.pose.x == pytest.approx(1.0, abs=0.01)


def test_turn_with_gentle_acceleration_ends_within_a_degree() -> None:
    bench = LeafTestBench()
    leaf = bench.put(TurnLeaf("turn"), angle=math.pi, speed=1.5)
    track = Track(leaf, bench, limits=VelocityLimits(0.5, 1.9, 0.5, 0.6))
    assert track.pass_time(60.0) is SUCCESS
    assert track.pose.heading == pytest.approx(math.pi, abs=math.radians(1))


def test_the_harder_a_base_brakes_the_later_a_drive_slows_down() -> None:
    speeds = []
    for acceleration in (0.1, 0.5, 2.0):
        bench = LeafTestBench()
        bench.base.limits = BaseLimits(0.5, 1.9, acceleration, 3.5)
        leaf = bench.put(DriveLeaf("drive"), distance=1.0, speed=0.5)
        bench.tick(leaf)
        bench.base.reading = good(at(0.8))
        bench.tick(leaf)
        command = bench.base.commands[-1]
        assert isinstance(command, Velocity)
        speeds.append(command.linear)
    assert speeds == sorted(set(speeds))


# --- what it stores, and what it does until it is halted -------------------------------------------------------------


def test_drive_and_turn_store_their_travelled_distance() -> None:
    bench = LeafTestBench()
    drive, turn = bench.put(DriveLeaf("drive"), distance=-1.0), bench.put(TurnLeaf("turn"), angle=math.pi / 2)
    for leaf, wanted in ((drive, -1.0), (turn, math.pi / 2)):
        leaf.output_variable = "gone"
        track = Track(leaf, bench)
        assert track.pass_time(20.0) is SUCCESS
        state = track.base.reading.value
        assert state is not None
        believed = state.pose.x if leaf is drive else state.pose.heading
        assert bench.run.variables["gone"] == pytest.approx(believed)
        assert believed == pytest.approx(wanted, abs=0.01)


@pytest.mark.parametrize(
    ("values", "felt", "fails"),
    [
        ({"speed": 0.2}, replace(HERE, bumper=SIDE), True),
        ({"speed": 0.2}, replace(HERE, cliff=SIDE), True),
        ({"speed": -0.2}, replace(HERE, cliff=SIDE), False),
        ({"speed": -0.2}, replace(HERE, bumper=SIDE), False),
        ({"speed": -0.2, "turn": 0.5}, replace(HERE, cliff=SIDE), True),
        ({"turn": 0.5}, replace(HERE, bumper=SIDE), False),
        ({"turn": 0.5}, replace(HERE, cliff=SIDE), True),
        ({"speed": -0.2}, replace(HERE, wheel_drop=SIDE), True),
    ],
)
def test_velocity_is_sent_every_tick_until_an_obstacle(
    values: dict[str, float], felt: BaseState, *, fails: bool
) -> None:
    bench = LeafTestBench()
    leaf = bench.put(Cruise("velocity"), **values)
    wanted = Velocity(values.get("speed", 0.0), values.get("turn", 0.0))
    for _ in range(3):
        assert bench.tick(leaf) is RUNNING
    assert bench.base.commands == [wanted] * 3
    bench.base.reading = good(felt)
    assert bench.tick(leaf) is (FAILURE if fails else RUNNING)
    if not fails:
        assert bench.halt(leaf)
    assert bench.base.commands[-1] == STOP
