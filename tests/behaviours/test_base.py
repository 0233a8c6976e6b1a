"""Driving, turning and stopping: what the base is told, and where a base with a Kobuki's lags really ends up."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from py_trees.common import Status

from behaviours.driving.motion import CRAWL_SPEED, REACTION_TIME, DriveLeaf, StopLeaf, TurnLeaf
from behaviours.leaf import FAILURE, RUNNING, SUCCESS, Leaf
from behaviours.robot import Robot
from drivers.api import BaseState, Pose2D, Quality, Reading, Sides, Source, Velocity
from drivers.base.limits import VelocityLimits
from drivers.base.velocity_multiplexer import VelocityMultiplexer
from drivers.clock import ManualClock
from drivers.errors import DeviceFault
from drivers.kobuki.feedback import METRES_PER_TICK, Core, Inertia
from drivers.kobuki.odometry import KobukiOdometry
from drivers.sim.wheels import SimulatedWheels
from missions.plugins.testing.recorders import OFFLINE_ERROR, STOP, LeafTestBench, RecordedBase, good, none, stale

REPORT = 0.02
"""Seconds between two reports of a Kobuki."""

STILL = Velocity(0.0, 0.0)

SIDE = Sides(left=True)
BUMPED = good(BaseState(Pose2D(0.0, 0.0, 0.0), STILL, bumper=SIDE))
AT_A_CLIFF = good(BaseState(Pose2D(0.0, 0.0, 0.0), STILL, cliff=SIDE))
LIFTED = good(BaseState(Pose2D(0.0, 0.0, 0.0), STILL, wheel_drop=SIDE))


def at(
    x: float = 0.0, y: float = 0.0, heading: float = 0.0, *, linear: float = 0.0, angular: float = 0.0
) -> Reading[BaseState]:
    return good(BaseState(Pose2D(x, y, heading), Velocity(linear, angular)))


def driving(bench: LeafTestBench, distance: float = 1.0, **arguments: object) -> DriveLeaf:
    return bench.put(DriveLeaf("drive"), distance=distance, **arguments)


def turning(bench: LeafTestBench, degrees: float = 90.0, **arguments: object) -> TurnLeaf:
    return bench.put(TurnLeaf("turn"), angle=math.radians(degrees), **arguments)


def both(bench: LeafTestBench) -> list[Leaf]:
    return [driving(bench), turning(bench)]


def told(bench: LeafTestBench) -> Velocity:
    velocity = bench.base.commands[-1]
    assert isinstance(velocity, Velocity)
    return velocity


# --- what it tells the base ------------------------------------------------------------------------------------------


def test_drive_keeps_its_speed_and_slows_down_towards_the_goal() -> None:
    bench = LeafTestBench()
    leaf = driving(bench, speed=0.3)
    speeds = []
    for x in (0.0, 0.5, 0.8, 0.9, 0.95, 0.99):
        bench.base.reading = at(x)
        assert bench.tick(leaf) is RUNNING
        speeds.append(told(bench).linear)
    assert speeds[:2] == [0.3, 0.3]
    assert speeds == sorted(speeds, reverse=True)
    assert speeds[-1] == CRAWL_SPEED
    assert leaf.reason == "0.99 of 1.00 m"


def test_a_negative_distance_goes_backwards() -> None:
    bench = LeafTestBench()
    bench.tick(driving(bench, -1.0))
    assert told(bench) == Velocity(-0.2, 0.0)


def test_drive_steers_back_to_its_heading() -> None:
    bench = LeafTestBench()
    for distance in (1.0, -1.0):
        leaf = driving(bench, distance)
        bench.base.reading = at(heading=0.5)
        bench.tick(leaf)
        bench.base.reading = at(heading=0.6)
        bench.tick(leaf)
        assert told(bench).angular == pytest.approx(-0.2)
        bench.base.reading = at(heading=-2.0)
        bench.tick(leaf)
        assert told(bench).angular == 0.5


def test_distance_is_measured_along_the_heading_at_the_start() -> None:
    bench = LeafTestBench()
    bench.base.reading = at(2.0, 3.0, math.pi / 2)
    leaf = driving(bench)
    bench.tick(leaf)
    bench.base.reading = at(5.0, 3.6, math.pi / 2)
    bench.tick(leaf)
    assert leaf.reason == "0.60 of 1.00 m"


def test_turn_rotates_on_the_spot_in_the_direction_of_its_sign() -> None:
    bench = LeafTestBench()
    bench.tick(turning(bench, 90.0, speed=1.0))
    assert told(bench) == Velocity(0.0, 1.0)
    bench.tick(turning(bench, -90.0, speed=1.0))
    assert told(bench) == Velocity(0.0, -1.0)


def test_a_turn_may_go_round_more_than_once() -> None:
    bench = LeafTestBench()
    leaf = turning(bench, 720.0)
    bench.tick(leaf)
    bench.base.reading = at(heading=math.radians(500))
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == "500 of 720 deg"


@pytest.mark.parametrize("kind", ["drive", "turn"])
def test_drive_and_turn_stop_once_at_the_goal_and_succeed_at_standstill(kind: str) -> None:
    bench = LeafTestBench()
    leaf = driving(bench) if kind == "drive" else turning(bench)
    bench.tick(leaf)
    bench.base.commands.clear()
    goal = {"x": 1.0} if kind == "drive" else {"heading": math.pi / 2}
    for speed, status in ((0.1, RUNNING), (0.05, RUNNING), (0.0, SUCCESS)):
        moving = {"linear": speed} if kind == "drive" else {"angular": speed}
        bench.base.reading = at(**goal, **moving)
        assert bench.tick(leaf) is status
    assert bench.base.commands == [STOP]


@pytest.mark.parametrize("kind", ["drive", "turn"])
def test_nothing_to_do_succeeds_at_once_and_moves_nothing(kind: str) -> None:
    bench = LeafTestBench()
    assert bench.tick(driving(bench, 0.0) if kind == "drive" else turning(bench, 0.0)) is SUCCESS
    assert bench.base.commands == [STOP]


# --- what it feels ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("felt", "reason"), [(BUMPED, "bumped into something"), (AT_A_CLIFF, "a cliff ahead")])
def test_obstacle_ahead_fails_forward_drives_but_not_backward_ones(felt: Reading[BaseState], reason: str) -> None:
    bench = LeafTestBench()
    forwards, backwards = driving(bench), driving(bench, -1.0)
    bench.tick(forwards)
    bench.base.reading = felt
    assert bench.tick(forwards) is FAILURE
    assert forwards.reason == reason
    assert bench.base.commands[-1] == STOP
    assert bench.tick(backwards) is RUNNING


def test_turn_runs_with_a_pressed_bumper_but_fails_at_a_cliff() -> None:
    bench = LeafTestBench()
    bench.base.reading = BUMPED
    assert bench.tick(turning(bench)) is RUNNING
    bench.base.reading = AT_A_CLIFF
    leaf = turning(bench)
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "a cliff ahead: the only way is straight back"


def test_a_dropped_wheel_fails_every_motion() -> None:
    bench = LeafTestBench()
    bench.base.reading = LIFTED
    for leaf in (driving(bench), driving(bench, -1.0), turning(bench)):
        assert bench.tick(leaf) is FAILURE
        assert leaf.reason == "a wheel has dropped"
    assert bench.base.commands == [STOP] * 3


@pytest.mark.parametrize("reading", [stale(BaseState(Pose2D(0.3, 0.0, 0.3), Velocity(0.2, 0.2))), none()])
def test_drive_and_turn_wait_without_commands_for_fresh_odometry(reading: Reading[BaseState]) -> None:
    for number in range(2):
        bench = LeafTestBench()
        leaf = both(bench)[number]
        bench.tick(leaf)
        bench.base.reading = reading
        bench.base.commands.clear()
        assert bench.tick(leaf) is RUNNING
        assert leaf.reason == "waiting for the base to report"
        assert bench.base.commands == []
        bench.base.reading = at(0.4, heading=0.4)
        assert bench.tick(leaf) is RUNNING
        assert leaf.reason in {"0.40 of 1.00 m", "23 of 90 deg"}


def test_drive_starts_at_the_first_reported_pose() -> None:
    bench = LeafTestBench()
    bench.base.reading = none()
    leaf = driving(bench)
    bench.tick(leaf)
    bench.base.reading = at(5.0)
    bench.tick(leaf)
    assert leaf.reason == "0.00 of 1.00 m"


# --- how it is stopped -----------------------------------------------------------------------------------------------


def test_a_halt_stops_the_base_once() -> None:
    for number in range(2):
        bench = LeafTestBench()
        leaf = both(bench)[number]
        bench.tick(leaf)
        bench.base.commands.clear()
        assert bench.halt(leaf)
        assert bench.halt(leaf)
        assert bench.base.commands == [STOP]


def test_a_lost_base_is_waited_for_and_still_stopped_when_halted() -> None:
    bench = LeafTestBench()
    for leaf in both(bench):
        bench.base.commands.clear()
        bench.base.trouble = OFFLINE_ERROR
        assert bench.tick(leaf) is RUNNING
        assert leaf.reason == "waiting: the cable is out"
        bench.base.trouble = None
        assert bench.tick(leaf) is RUNNING
        bench.base.trouble = OFFLINE_ERROR
        assert bench.tick(leaf) is RUNNING
        assert bench.halt(leaf)
        assert bench.base.commands[1:] == [STOP]
        bench.base.trouble = None


def test_drive_and_turn_fail_and_stop_on_a_device_fault() -> None:
    bench = LeafTestBench()
    for leaf in both(bench):
        bench.base.trouble = DeviceFault("base: motor overload")
        bench.base.commands.clear()
        assert bench.tick(leaf) is FAILURE
        assert leaf.reason == "base: motor overload"
        assert bench.base.commands == [STOP]


@pytest.mark.parametrize("ending", [SUCCESS, FAILURE, Status.INVALID])
def test_a_second_run_starts_where_the_base_is_then(ending: Status) -> None:
    bench = LeafTestBench()
    leaf = driving(bench)
    bench.tick(leaf)
    bench.base.reading = {SUCCESS: at(1.0), FAILURE: BUMPED, Status.INVALID: at(0.3)}[ending]
    if ending is Status.INVALID:
        bench.halt(leaf)
    else:
        assert bench.tick(leaf) is ending
    bench.base.reading = at(4.0)
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == "0.00 of 1.00 m"
    assert told(bench) == Velocity(0.2, 0.0)


# --- stop ------------------------------------------------------------------------------------------------------------


def test_stop_sends_one_stop_and_succeeds_at_standstill() -> None:
    bench = LeafTestBench()
    leaf = bench.put(StopLeaf("stop"))
    bench.base.reading = at(linear=0.3)
    assert bench.tick(leaf) is RUNNING
    bench.base.reading = at(angular=0.3)
    assert bench.tick(leaf, after=1.0) is RUNNING
    bench.base.reading = at()
    assert bench.tick(leaf) is SUCCESS
    assert bench.base.commands == [STOP]


def test_stop_waits_for_the_reaction_time() -> None:
    bench = LeafTestBench()
    leaf = bench.put(StopLeaf("stop"))
    assert bench.tick(leaf) is RUNNING
    assert bench.tick(leaf, after=REACTION_TIME) is SUCCESS


def test_stop_waits_for_reports() -> None:
    bench = LeafTestBench()
    leaf = bench.put(StopLeaf("stop"))
    bench.base.reading = none()
    bench.tick(leaf)
    assert bench.tick(leaf, after=5.0) is RUNNING
    assert leaf.reason == "waiting for the base to report"
    assert bench.halt(leaf)
    assert bench.base.commands == [STOP, STOP]


# --- a base with a Kobuki's lags -------------------------------------------------------------------------------------


KOBUKI = VelocityLimits(0.5, math.radians(110), 0.5, math.radians(200))


class LaggingBase(RecordedBase):
    """A Kobuki as the driver shows it: ramps, a dead time, reports that count in ticks and hundredths of a degree."""

    def __init__(self, clock: ManualClock, dead_time: float, limits: VelocityLimits = KOBUKI) -> None:
        super().__init__(clock)
        self.limits = limits.as_base_limits
        self.wheels = SimulatedWheels(dead_time=dead_time)
        self.silent = False
        self._mux = VelocityMultiplexer(limits)
        self._odometry = KobukiOdometry()
        self.report()

    def drive(self, velocity: Velocity, *, source: Source = Source.MISSION) -> Velocity:
        super().drive(velocity, source=source)
        return self._mux.request(velocity, self.clock.now(), self.reading.value, source)

    def stop(self, *, source: Source | None = None) -> None:
        super().stop(source=source)
        self._mux.stop(source)
        self.wheels.command(0.0, 0.0, self.clock.now())

    def report(self) -> None:
        now = self.clock.now()
        self.wheels.advance(now)
        if self.silent:
            self.reading = Reading(self.reading.value, self.reading.stamp, Quality.STALE)
        else:
            self._measure(now)
        if self.reading.value is not None:
            self._mux.on_state(self.reading.value, now)
        wanted = self._mux.next_velocity(now, self.reading.value)
        self._odometry.commanded = wanted != STILL
        self.wheels.command(wanted.linear, wanted.angular, now)

    def _measure(self, now: float) -> None:
        core = Core(
            time_ms=round(1000 * now) & 0xFFFF,
            left_encoder=round(self.wheels.left / METRES_PER_TICK) & 0xFFFF,
            right_encoder=round(self.wheels.right / METRES_PER_TICK) & 0xFFFF,
        )
        heading = round(100 * math.degrees(self.wheels.pose.heading))
        rate = round(100 * math.degrees(self.wheels.velocity.angular))
        self._odometry.update(core, Inertia((heading + 18000) % 36000 - 18000, rate), now)
        self.reading = good(BaseState(self._odometry.pose, self._odometry.velocity))


class Track:
    """A lagging base in the hands of one leaf, ticked every 50 ms."""

    def __init__(
        self, leaf: Leaf, bench: LeafTestBench, dead_time: float = 0.2, limits: VelocityLimits = KOBUKI
    ) -> None:
        self.bench = bench
        self.base = LaggingBase(bench.clock, dead_time, limits)
        self.leaf = leaf
        leaf.robot = Robot(base_part=self.base)
        self.farthest = 0.0
        self._reports = 0

    def pass_time(self, seconds: float, *, ticking: bool = True) -> Status:
        """Let time pass until the leaf has ended, or for ``seconds``."""
        for _ in range(round(seconds / REPORT)):
            self._reports += 1
            self.bench.clock.advance(REPORT)
            self.base.report()
            self.farthest = max(self.farthest, abs(self.base.wheels.pose.x))
            if ticking and self._reports % 5 in {0, 3} and self.bench.tick(self.leaf, after=0.0) is not RUNNING:
                break
        return self.leaf.status

    @property
    def pose(self) -> Pose2D:
        """Where it really is once it has rolled out."""
        self.pass_time(1.0, ticking=False)
        assert self.base.wheels.velocity == STILL
        return self.base.wheels.pose


@settings(max_examples=40, deadline=None)
@given(distance=st.floats(-1.0, 1.0), speed=st.floats(0.05, 0.7), dead_time=st.sampled_from([0.0, 0.1, 0.2]))
def test_a_drive_ends_within_a_centimetre(distance: float, speed: float, dead_time: float) -> None:
    bench = LeafTestBench()
    track = Track(driving(bench, distance, speed=speed), bench, dead_time)
    assert track.pass_time(5.0 + abs(distance) / speed) is SUCCESS
    pose = track.pose
    assert pose.x == pytest.approx(distance, abs=0.01)
    assert track.farthest <= abs(distance) + 0.01
    assert abs(pose.y) < 0.005
    assert abs(pose.heading) < math.radians(1)


@settings(max_examples=40, deadline=None)
@given(angle=st.floats(-400.0, 400.0), speed=st.floats(20.0, 110.0), dead_time=st.sampled_from([0.0, 0.1, 0.2]))
def test_a_turn_ends_within_a_degree(angle: float, speed: float, dead_time: float) -> None:
    bench = LeafTestBench()
    track = Track(turning(bench, angle, speed=math.radians(speed)), bench, dead_time)
    assert track.pass_time(5.0 + abs(angle) / speed) is SUCCESS
    assert math.degrees(track.pose.heading) == pytest.approx(angle, abs=0.25)
    assert track.farthest < 0.005


@pytest.mark.parametrize(("distance", "seconds"), [(0.1, 2.0), (1.0, 7.0), (-1.0, 7.0)])
def test_a_drive_does_not_dawdle(distance: float, seconds: float) -> None:
    bench = LeafTestBench()
    assert Track(driving(bench, distance), bench).pass_time(seconds) is SUCCESS


@settings(max_examples=25, deadline=None)
@given(distance=st.floats(0.3, 2.0), after=st.floats(0.02, 4.0))
def test_base_comes_to_rest_within_its_braking_distance_after_a_halt(distance: float, after: float) -> None:
    bench = LeafTestBench()
    track = Track(driving(bench, distance, speed=0.5), bench)
    track.pass_time(after)
    speed = abs(track.base.wheels.velocity.linear)
    x = track.base.wheels.pose.x
    assert bench.halt(track.leaf, after=0.0)
    # The dead time at its speed, grown meanwhile by the ramp, and braking at 2 m/s^2.
    assert track.pose.x - x <= 0.2 * (speed + 0.1) + (speed + 0.1) ** 2 / 4 + 0.001


def test_drive_pauses_while_odometry_is_silent_and_resumes() -> None:
    bench = LeafTestBench()
    track = Track(driving(bench, 1.0), bench)
    track.pass_time(2.0)
    track.base.silent = True
    told_before = len(track.base.commands)
    # Its last command is good for COMMAND_TIMEOUT, then come the dead time and the braking. (After more than a second
    # the odometry would not count what the base rolled meanwhile.)
    assert track.pass_time(0.8) is RUNNING
    assert track.leaf.reason == "waiting for the base to report"
    assert len(track.base.commands) == told_before
    assert track.base.wheels.velocity == STILL
    track.base.silent = False
    assert track.pass_time(10.0) is SUCCESS
    assert track.pose.x == pytest.approx(1.0, abs=0.01)


def test_four_sides_and_four_turns_make_a_square() -> None:
    bench = LeafTestBench()
    drive = driving(bench, 0.5)
    track = Track(drive, bench)
    turn = turning(bench, 90.0)
    turn.robot = drive.robot
    for _ in range(4):
        for leaf in (drive, turn):
            track.leaf = leaf
            assert track.pass_time(10.0) is SUCCESS
    pose = track.pose
    assert math.hypot(pose.x, pose.y) < 0.01
    assert math.degrees(pose.heading) == pytest.approx(360.0, abs=0.5)
