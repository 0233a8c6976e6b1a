"""The progress monitor: a base that does not do what it was told is stopped, one that does is left alone."""

from collections.abc import Callable
from math import radians

import pytest

from drivers.api import ZERO_VELOCITY, BaseState, Pose2D, Sides, Source, Velocity
from drivers.base.limits import VelocityLimits
from drivers.base.motion_fault import MAX_FAULTS, RELEASE_TIMEOUT
from drivers.base.progress_monitor import NO_DATA_TIMEOUT, Instruments, ProgressMonitor
from drivers.base.velocity_multiplexer import VelocityMultiplexer
from drivers.sim.wheels import SimulatedWheels

PERIOD = 0.02
AHEAD, LEFT = Velocity(0.2, 0.0), Velocity(0.0, 1.0)

Report = Callable[[SimulatedWheels], BaseState]
"""What a base reports of its wheels."""


def odometry(wheels: SimulatedWheels) -> BaseState:
    """Report where the wheels truly are."""
    return BaseState(wheels.pose, wheels.velocity)


def mirrored(wheels: SimulatedWheels) -> BaseState:
    """Report the opposite of all motion."""
    pose = wheels.pose
    return BaseState(Pose2D(-pose.x, -pose.y, -pose.heading), ZERO_VELOCITY)


def nothing(wheels: SimulatedWheels) -> BaseState:
    """Report no motion, whatever the wheels do."""
    del wheels
    return BaseState(Pose2D(0.0, 0.0, 0.0), ZERO_VELOCITY)


class Bench:
    """A multiplexer with its monitor, over ``wheels`` that report every ``interval`` seconds, ``late`` seconds late."""

    def __init__(
        self,
        report: Report = odometry,
        *,
        interval: float = PERIOD,
        late: float = 0.0,
        wheels: SimulatedWheels | None = None,
    ) -> None:
        self.mux = VelocityMultiplexer(
            VelocityLimits(0.5, 1.9, 0.5, 3.5), monitor=ProgressMonitor(Instruments("encoders", "gyro"))
        )
        self.wheels = wheels or SimulatedWheels()
        self.report, self.interval, self.late = report, interval, late
        self.now, self.felt = 0.0, report(self.wheels)
        self.under_way: list[tuple[float, BaseState]] = []
        self.reported_at = 0.0

    def drive(self, velocity: Velocity | None, seconds: float, source: Source = Source.MISSION) -> str:
        """Command a velocity for so long; return the fault, or nothing."""
        for _ in range(round(seconds / PERIOD)):
            self.now += PERIOD
            self.wheels.advance(self.now)
            if self.now - self.reported_at >= self.interval - 1e-9:
                self.reported_at = self.now
                self.under_way.append((self.now + self.late, self.report(self.wheels)))
            while self.under_way and self.under_way[0][0] <= self.now + 1e-9:
                self.felt = self.under_way.pop(0)[1]
                self.mux.on_report(self.now)
                self.mux.on_state(self.felt, self.now)
            if velocity is not None:
                self.mux.request(velocity, self.now, self.felt, source)
            sent = self.mux.next_velocity(self.now, self.felt)
            self.wheels.command(sent.linear, sent.angular, self.now)
        return self.mux.steering.fault

    def time_to_fault(self, velocity: Velocity, most: float = 5.0) -> float:
        """Return after how many seconds a command is stopped."""
        began = self.now
        while not self.drive(velocity, PERIOD):
            assert self.now - began < most, "no fault was found"
        return self.now - began


@pytest.mark.parametrize("velocity", [AHEAD, Velocity(-0.2, 0.0), LEFT, Velocity(0.0, -1.0), Velocity(0.2, 0.4)])
@pytest.mark.parametrize("report", [nothing, mirrored])
def test_blocked_or_reversed_base_is_stopped_within_1_3_seconds(velocity: Velocity, report: Report) -> None:
    bench = Bench(report, wheels=SimulatedWheels(dead_time=0.1))
    assert bench.time_to_fault(velocity) <= 1.3
    assert bench.mux.next_velocity(bench.now, bench.felt) == ZERO_VELOCITY
    assert "commanded" in bench.mux.steering.fault
    assert bench.mux.steering.reason == bench.mux.steering.fault


def test_the_reason_names_command_time_source_and_overcurrent() -> None:
    bench = Bench(lambda _: BaseState(Pose2D(0.0, 0.0, 0.0), ZERO_VELOCITY, overcurrent=Sides(left=True)))
    bench.time_to_fault(AHEAD)
    fault = bench.mux.steering.fault
    assert fault.startswith("commanded 0.2 m/s for ")
    assert "encoders report 0 m: blocked or not connected; overcurrent on the left wheel" in fault


def test_stalled_encoders_stop_the_base_within_a_second() -> None:
    bench = Bench()
    assert not bench.drive(AHEAD, 2.0)
    lost = bench.felt
    bench.report = lambda _: BaseState(lost.pose, ZERO_VELOCITY)
    assert bench.time_to_fault(AHEAD) <= 1.0


@pytest.mark.parametrize("interval", [PERIOD, 0.1, 1 / 3])
@pytest.mark.parametrize("late", [0.0, 0.15])
@pytest.mark.parametrize("dead_time", [0.0, 0.25])
@pytest.mark.parametrize("acceleration", [0.6, 2.0])
def test_obedient_base_is_not_stopped(interval: float, late: float, dead_time: float, acceleration: float) -> None:
    wheels = SimulatedWheels(dead_time=dead_time, acceleration=acceleration, slip=0.2)
    bench = Bench(interval=interval, late=late, wheels=wheels)
    for velocity in (
        AHEAD, Velocity(-0.2, 0.0), LEFT, Velocity(0.0, -1.5), Velocity(0.3, 0.6), Velocity(-0.5, -0.2), ZERO_VELOCITY,
        Velocity(0.02, 0.0), Velocity(0.0, radians(4)), Velocity(0.5, 0.0),
    ):  # fmt: skip
        assert not bench.drive(velocity, 1.7)
        bench.drive(ZERO_VELOCITY, 0.1)


def test_dead_reckoning_is_not_monitored() -> None:
    bench = Bench(lambda _: BaseState(Pose2D(0.0, 0.0, 0.0), ZERO_VELOCITY, reckoned=True))
    assert not bench.drive(AHEAD, 5.0)


def test_computer_delay_is_not_a_fault_of_the_base() -> None:
    bench = Bench()
    assert not bench.drive(AHEAD, 1.5)
    bench.wheels.command(0.0, 0.0, bench.now + 0.4)  # the base's own watchdog
    bench.now += 1.5
    assert not bench.drive(AHEAD, 3.0)


def test_a_moving_base_without_reports_is_stopped() -> None:
    monitor = ProgressMonitor()
    state = BaseState(Pose2D(0.0, 0.0, 0.0), ZERO_VELOCITY)
    faults = [monitor.update(step * PERIOD, AHEAD, state) for step in range(round(1.2 * NO_DATA_TIMEOUT / PERIOD))]
    assert faults[-1] is not None
    assert "no report" in faults[-1].reason


def test_exception_in_the_monitor_stops_the_base() -> None:
    class Broken(ProgressMonitor):
        def update(self, now: float, sent: Velocity, state: BaseState | None) -> None:
            raise ZeroDivisionError(now, sent, state)

    bench = Bench()
    bench.mux.monitor = Broken()
    assert "the progress monitor failed" in bench.drive(AHEAD, 0.1)
    assert bench.mux.next_velocity(bench.now, bench.felt) == ZERO_VELOCITY


def test_renewed_commands_do_not_restart_a_stopped_base_but_fresh_ones_do() -> None:
    bench = Bench(nothing)
    bench.time_to_fault(AHEAD)
    bench.report = odometry
    where = bench.wheels.pose
    assert bench.drive(AHEAD, 3.0)
    assert bench.wheels.pose.x == pytest.approx(where.x, abs=0.05)
    bench.mux.stop(Source.MISSION)
    assert bench.mux.steering.fault == ""
    assert not bench.drive(AHEAD, 1.0)
    assert bench.mux.steering.allowed == AHEAD


@pytest.mark.parametrize("pause", [ZERO_VELOCITY, None])
def test_released_key_clears_the_fault_for_teleoperation(pause: Velocity | None) -> None:
    bench = Bench(nothing)
    while not bench.drive(AHEAD, PERIOD, Source.TELEOP):
        pass
    bench.report = odometry
    assert bench.drive(AHEAD, 1.0, Source.TELEOP)
    assert bench.drive(AHEAD, 0.2), "while a person is held, the mission does not take the wheels"
    bench.drive(pause, RELEASE_TIMEOUT + 0.1, Source.TELEOP)
    assert not bench.drive(AHEAD, 0.5, Source.TELEOP)
    assert bench.mux.steering.allowed == AHEAD


def test_repeated_motion_faults_latch_the_base() -> None:
    bench = Bench(nothing)
    for _ in range(MAX_FAULTS - 1):
        bench.time_to_fault(AHEAD)
        bench.mux.stop(Source.MISSION)
        bench.drive(None, 0.8)
    assert not bench.mux.latched
    bench.drive(AHEAD, 2.0)
    assert "motion faults" in bench.mux.latched
    assert "blocked or not connected" in bench.mux.latched
    bench.mux.enable()
    bench.report = odometry
    assert not bench.drive(AHEAD, 1.0)


def test_lasting_overcurrent_stops_a_slipping_base() -> None:
    bench = Bench(lambda wheels: BaseState(wheels.pose, wheels.velocity, overcurrent=Sides(right=True)))
    assert bench.time_to_fault(AHEAD) == pytest.approx(1.0, abs=0.1)
    assert "overcurrent on the right wheel" in bench.mux.steering.fault


def test_an_overload_is_counted_from_the_start_of_each_motion() -> None:
    loaded = Sides(right=True)
    bench = Bench(lambda wheels: BaseState(wheels.pose, wheels.velocity, overcurrent=loaded))
    for _ in range(4):
        assert not bench.drive(AHEAD, 0.4)
        bench.mux.stop(Source.MISSION)
        assert not bench.drive(None, 0.2)
    assert bench.time_to_fault(AHEAD) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("velocity", [AHEAD, LEFT, Velocity(0.05, 0.0)])
def test_the_next_leaf_moves_the_base_at_once_after_a_fault(velocity: Velocity) -> None:
    bench = Bench(nothing)
    bench.time_to_fault(AHEAD)
    bench.report = odometry
    bench.drive(AHEAD, 0.1)  # until the leaf sees the fault
    bench.mux.stop()  # as a leaf does that fails
    assert bench.mux.request(velocity, bench.now, bench.felt) == velocity
    assert not bench.drive(velocity, 1.0)
    assert bench.mux.steering.allowed == velocity


def test_a_stop_of_the_mission_releases_no_person() -> None:
    bench = Bench(nothing)
    while not bench.drive(AHEAD, PERIOD, Source.TELEOP):
        pass
    bench.report = odometry
    for _ in range(20):
        bench.mux.stop()
        assert bench.drive(AHEAD, 0.1, Source.TELEOP)


def test_immediate_retries_latch_a_blocked_base_at_the_third_fault() -> None:
    bench = Bench(nothing)
    faults = 0
    while not bench.mux.latched:
        assert bench.now < 10.0
        if bench.drive(AHEAD, PERIOD):
            faults += 1
            bench.mux.stop()
    assert faults == MAX_FAULTS - 1
    assert not bench.drive(LEFT, 1.0)
    assert bench.mux.next_velocity(bench.now, bench.felt) == ZERO_VELOCITY


def test_a_person_may_drive_on_while_the_mission_is_held() -> None:
    bench = Bench(nothing)
    bench.time_to_fault(AHEAD)
    assert bench.mux.steering.requested == AHEAD
    bench.report = odometry
    bench.mux.request(AHEAD, bench.now, bench.felt)  # the mission goes on commanding
    assert not bench.drive(LEFT, 0.5, Source.TELEOP)
    assert (bench.mux.steering.allowed, bench.mux.steering.fault) == (LEFT, "")
