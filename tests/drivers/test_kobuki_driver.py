"""The Kobuki driver: its rules in simulated time against the virtual base, then as a whole over a pseudo-terminal."""

import errno
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import pairwise
from math import inf, nan, pi, radians

import pytest
import serial
from hypothesis import given
from hypothesis import strategies as st

from drivers.api import (
    COMMAND_TIMEOUT,
    ZERO_VELOCITY,
    Base,
    BaseState,
    DeviceStatus,
    Health,
    Pose2D,
    Quality,
    Sides,
    Velocity,
    ignore,
)
from drivers.base.diff_drive import DiffDriveBase
from drivers.base.limits import VelocityLimits
from drivers.clock import Clock, ManualClock
from drivers.errors import BadRequest, DeviceFault, NotConnected
from drivers.kobuki.commands import OUTPUTS_AT_START, BaseControl, Extra, GetGains, KobukiSound, SetGains
from drivers.kobuki.driver import (
    IDLE_POLL_INTERVAL,
    OFFLINE_AFTER,
    STOP_REPEATS,
    KobukiIdentity,
    KobukiProtocol,
    kobuki_base,
)
from drivers.kobuki.feedback import FEEDBACK, METRES_PER_TICK, Core, Inertia, KobukiGains
from drivers.kobuki.odometry import KobukiOdometry, KobukiStateBuilder, battery_percent
from drivers.kobuki.virtual import VirtualKobuki
from drivers.kobuki.wire import BAUD, HEADER, KobukiFrameFinder, KobukiSubpayload, decode, encode
from drivers.sim.base_body import BODY_COMMAND_TIMEOUT
from drivers.sim.timeline import Timeline
from drivers.sim.wheels import SimulatedWheels
from drivers.transport import ports
from drivers.transport.link import LinkHandler, SerialLink
from drivers.virtual.patient_clock import PatientClock
from drivers.virtual.terminal import PseudoTerminal
from tests.drivers.cranked import HandWire, pass_until
from tests.waiting import wait_until

NOWHERE = BaseState(Pose2D(0.0, 0.0, 0.0), ZERO_VELOCITY)

# --- odometry, limits, senses: plain arithmetic -----------------------------------------------------------------------


def test_odometry_starts_at_zero_for_any_first_report() -> None:
    odometry = KobukiOdometry()
    odometry.update(Core(time_ms=60000, left_encoder=999, right_encoder=5), Inertia(heading_cdeg=-17000), 3.0)
    assert odometry.pose == Pose2D(0.0, 0.0, 0.0)


@given(st.lists(st.tuples(st.integers(-3000, 3000), st.integers(-3000, 3000)), max_size=60), st.integers(0, 0xFFFF))
def test_encoder_wraps_are_counted(moves: list[tuple[int, int]], start: int) -> None:
    odometry = KobukiOdometry()
    left = right = start
    odometry.update(Core(left_encoder=left, right_encoder=right), Inertia(), 0.0)
    for number, (more_left, more_right) in enumerate(moves, 1):
        left, right = left + more_left, right + more_right
        core = Core(time_ms=20 * number & 0xFFFF, left_encoder=left & 0xFFFF, right_encoder=right & 0xFFFF)
        odometry.update(core, Inertia(), 0.02 * number)
    assert odometry.pose.x == pytest.approx((left + right - 2 * start) / 2 * METRES_PER_TICK, abs=1e-9)


@given(st.lists(st.integers(-17000, 17000), max_size=60), st.integers(-18000, 17999))
def test_the_heading_does_not_wrap(turns: list[int], start: int) -> None:
    odometry = KobukiOdometry()
    odometry.commanded = True  # at rest a small turn is taken for drift of the gyro
    heading = start
    odometry.update(Core(), Inertia(heading), 0.0)
    for number, turn in enumerate(turns, 1):
        heading += turn
        odometry.update(Core(time_ms=20 * number), Inertia((heading + 18000) % 36000 - 18000), 0.02 * number)
    assert odometry.pose.heading == pytest.approx(radians((heading - start) / 100))


@pytest.mark.parametrize(("time_ms", "now"), [(5000, 5.0), (20, 5.0), (40000, 0.02)])
def test_a_long_gap_makes_no_jump(time_ms: int, now: float) -> None:
    odometry = KobukiOdometry()
    odometry.update(Core(), Inertia(), 0.0)
    odometry.update(Core(time_ms=time_ms, left_encoder=9000, right_encoder=9000), Inertia(9000), now)
    assert (odometry.pose, odometry.velocity) == (Pose2D(0.0, 0.0, 0.0), ZERO_VELOCITY)
    odometry.update(Core(time_ms=time_ms + 20, left_encoder=9010, right_encoder=9010), Inertia(9000), now + 0.02)
    assert odometry.pose.x == pytest.approx(10 * METRES_PER_TICK)
    assert odometry.velocity.linear == pytest.approx(10 * METRES_PER_TICK / 0.02)


def test_a_quarter_circle_between_two_reports_is_a_chord() -> None:
    odometry = KobukiOdometry()
    odometry.update(Core(), Inertia(), 0.0)
    odometry.update(Core(time_ms=20, left_encoder=1000, right_encoder=2000), Inertia(9000), 0.02)
    assert odometry.pose.x == pytest.approx(odometry.pose.y)
    assert odometry.pose.x == pytest.approx(1500 * METRES_PER_TICK / 2**0.5)


LIMITS = VelocityLimits(max_linear=0.5, max_angular=1.9, linear_acceleration=0.5, angular_acceleration=3.5)


@given(st.floats(-5, 5), st.floats(-9, 9))
def test_limiting_keeps_the_shape_of_the_path(linear: float, angular: float) -> None:
    limited = LIMITS.clamp(Velocity(linear, angular))
    assert abs(limited.linear) <= 0.5 + 1e-9
    assert abs(limited.angular) <= 1.9 + 1e-9
    assert limited.linear * angular == pytest.approx(limited.angular * linear, abs=1e-9)


@given(*[st.floats(-0.5, 0.5)] * 2, *[st.floats(-1.9, 1.9)] * 2, st.floats(0, 0.1))
def test_a_ramp_changes_no_faster_than_allowed_and_arrives(
    linear: float, goal_linear: float, angular: float, goal_angular: float, seconds: float
) -> None:
    current, goal = Velocity(linear, angular), Velocity(goal_linear, goal_angular)
    after = LIMITS.approach(current, goal, seconds)
    assert abs(after.linear - linear) <= 1.2 * 0.5 * seconds + 1e-9
    assert abs(after.angular - angular) <= 1.2 * 3.5 * seconds + 1e-9
    for _ in range(60):
        current = LIMITS.approach(current, goal, 0.05)
    assert current == goal


def test_braking_is_harder_than_speeding_up() -> None:
    assert LIMITS.approach(ZERO_VELOCITY, Velocity(0.5, 0.0), 0.1).linear == pytest.approx(0.05)
    assert LIMITS.approach(Velocity(0.5, 0.0), ZERO_VELOCITY, 0.1).linear == pytest.approx(0.44)


@pytest.mark.parametrize("wrong", [0.0, -1.0, nan, inf])
def test_a_limit_must_be_a_positive_number(wrong: float) -> None:
    with pytest.raises(ValueError, match="max_angular must be a positive number"):
        VelocityLimits(0.5, wrong, 0.5, 3.5)


def test_the_battery_is_read_by_the_documented_line() -> None:
    assert [battery_percent(volts) for volts in (12.0, 13.2, 14.85, 16.5, 16.8)] == pytest.approx(
        [0, 5, 52.5, 100, 100]
    )


def test_aged_battery_is_full_when_charging_ends() -> None:
    senses = KobukiStateBuilder()
    inertia = Inertia()
    aged = senses.update(Core(battery_decivolts=162), inertia, 0.0)
    assert aged is not None
    assert aged.battery_percent < 95
    full = senses.update(Core(time_ms=20, battery_decivolts=162, charger=18), inertia, 0.02)
    assert full is not None
    assert (full.battery_percent, full.charging) == (100.0, False)


def test_sensor_bits_map_to_their_sides() -> None:
    state = KobukiStateBuilder().update(Core(bumper=4, cliff=1, wheel_drop=2, buttons=0b101, charger=6), Inertia(), 0.0)
    assert state is not None
    assert (state.bumper, state.cliff) == (Sides(left=True), Sides(right=True))
    assert state.wheel_drop == Sides(left=True)
    assert (state.buttons, state.charging) == (frozenset({0, 2}), True)


# --- the driver's rules, in simulated time ----------------------------------------------------------------------------


class DirectLink(SerialLink):
    """A link without port and thread: a virtual base at its other end, driven by a clock that stands still."""

    def __init__(self, device: VirtualKobuki, clock: ManualClock) -> None:
        super().__init__("base", "/dev/kobuki", BAUD)
        self.device = device
        self.clock = clock
        self.sent: list[bytes] = []
        self.talker: LinkHandler | None = None
        self.plugged = True
        self.before_close: Callable[[], None] = ignore

    def open(self, handler: LinkHandler) -> None:
        self.talker = handler
        handler.on_connected()

    def close(self) -> None:
        self.before_close()
        if self.talker is not None:
            self.talker.on_closing()
        self.talker = None

    @property
    def online(self) -> bool:
        return self.talker is not None and self.plugged

    def health(self) -> Health:
        return Health(self.online, "" if self.online else "base: /dev/kobuki: no such device")

    def write(self, data: bytes) -> None:
        if not self.online:
            raise NotConnected("base: /dev/kobuki: not there")
        self.sent.append(data)
        self.device.feed(data, self.clock.now())

    def run(self, seconds: float, *, each: Callable[[], object] = lambda: None) -> None:
        """Let time pass in steps of 10 ms, calling ``each`` at every one."""
        for _ in range(round(seconds / 0.01)):
            now = self.clock.advance(0.01)
            said = self.device.poll(now)
            if self.talker is not None and self.plugged:
                if said:
                    self.talker.on_data(said)
                self.talker.on_poll()
            each()

    def velocities(self) -> list[tuple[float, float]]:
        """All velocities sent so far, as the base understands them."""
        return [part.velocity for part in self.commands() if isinstance(part, BaseControl)]

    def commands(self) -> list[object]:
        kinds = {BaseControl.ID: BaseControl}
        payloads = KobukiFrameFinder().feed(b"".join(self.sent))
        return [part for payload in payloads for part in decode(payload, kinds).parts]


class Bench:
    """A driver over a ``DirectLink``, and everything it said."""

    def __init__(self, device: VirtualKobuki | None = None) -> None:
        self.clock = ManualClock(100.0)
        self.device = device or VirtualKobuki(wheels=SimulatedWheels(acceleration=1e6))
        self.link = DirectLink(self.device, self.clock)
        self.notices: list[DeviceStatus] = []
        self.changes = 0
        self.base = kobuki_base(self.link, self.clock, report=self.notices.append, changed=self.count)
        self.base.open()
        self.link.run(0.1)

    def count(self) -> None:
        self.changes += 1

    @property
    def identity(self) -> KobukiIdentity:
        assert isinstance(self.base.protocol, KobukiProtocol)
        return self.base.protocol.identity

    def drive(self, seconds: float, linear: float, angular: float = 0.0) -> None:
        """Renew a command all the time for so long."""
        self.link.run(seconds, each=lambda: self.base.drive(Velocity(linear, angular)))

    def value(self) -> BaseState:
        reading = self.base.state()
        assert reading.value is not None
        assert reading.good
        return reading.value


def test_the_driver_is_a_base() -> None:
    base: Base = Bench().base
    assert base.name == "base"


def test_unopened_base_sends_nothing_and_has_no_state() -> None:
    clock = ManualClock()
    base = kobuki_base(DirectLink(VirtualKobuki(), clock), clock)
    reading = base.state()
    assert (reading.value, reading.quality) == (None, Quality.NONE)
    assert base.heading_at(0.0) is None
    assert not base.health().online
    with pytest.raises(NotConnected):
        base.drive(Velocity(0.1, 0.0))
    base.stop()
    base.rest()
    base.close()
    base.close()


def test_the_command_is_renewed_after_every_report() -> None:
    bench = Bench()
    bench.drive(0.02, 0.2, 0.0)
    before = len(bench.link.velocities())
    bench.drive(1.0, 0.2, 0.0)
    assert len(bench.link.velocities()) - before == 50


def test_stop_is_repeated_often_at_first_and_rarely_later() -> None:
    bench = Bench()
    bench.drive(1.0, 0.2, 0.0)
    bench.base.stop()
    before = len(bench.link.velocities())
    bench.link.run(0.4)
    assert bench.link.velocities()[before:] == [(0.0, 0.0)] * 20 * STOP_REPEATS
    bench.link.run(0.6)
    before = len(bench.link.velocities())
    bench.link.run(2.0)
    assert bench.link.velocities()[before:] == [(0.0, 0.0)] * 10


def test_idle_base_obeys_with_the_next_report() -> None:
    bench = Bench()
    bench.link.run(1.0)
    bench.base.drive(Velocity(0.2, 0.0))
    bench.link.run(0.02)
    assert bench.link.velocities()[-1][0] > 0.0


def test_start_follows_the_ramp_on_its_arc() -> None:
    bench = Bench()
    bench.drive(0.5, 0.4, 0.8)
    going = [velocity for velocity in bench.link.velocities() if velocity != (0.0, 0.0)]
    assert going[-1][0] == pytest.approx(0.5 * 0.5, abs=0.02)
    assert all(later[0] - sooner[0] <= 0.5 * 0.02 + 0.003 for sooner, later in pairwise(going))
    assert all(angular == pytest.approx(2 * linear, abs=0.03) for linear, angular in going)


def test_too_fast_velocity_is_scaled_down() -> None:
    accepted = Bench().base.drive(Velocity(1.0, 1.0))
    assert accepted == Velocity(0.5, 0.5)


@pytest.mark.parametrize("wrong", [Velocity(nan, 0.0), Velocity(0.0, inf)])
def test_non_finite_velocity_is_refused(wrong: Velocity) -> None:
    with pytest.raises(BadRequest, match="cannot drive at"):
        Bench().base.drive(wrong)


def test_velocity_expires_without_renewal() -> None:
    bench = Bench()
    bench.drive(1.0, 0.3)
    assert bench.link.velocities()[-1][0] == pytest.approx(0.3)
    bench.link.run(COMMAND_TIMEOUT - 0.03)
    assert bench.link.velocities()[-1][0] == pytest.approx(0.3)
    bench.link.run(0.06)
    assert bench.link.velocities()[-1] == (0.0, 0.0)
    assert bench.device.wheels.velocity == ZERO_VELOCITY


def test_the_deadman_works_without_reports_too() -> None:
    bench = Bench()
    bench.drive(1.0, 0.3)
    bench.device.frozen = True
    bench.link.run(OFFLINE_AFTER + 0.06)
    assert bench.link.velocities()[-1] == (0.0, 0.0)
    with pytest.raises(NotConnected, match="open but silent"):
        bench.base.drive(Velocity(0.1, 0.0))


def test_stop_is_immediate_and_drops_the_pending_command() -> None:
    bench = Bench()
    bench.drive(1.0, 0.4)
    bench.base.stop()
    assert bench.link.velocities()[-1] == (0.0, 0.0)
    sent = len(bench.link.velocities())
    bench.link.run(0.2)
    assert set(bench.link.velocities()[sent:]) == {(0.0, 0.0)}


def test_base_stops_without_reports() -> None:
    bench = Bench()
    bench.drive(1.0, 0.3)
    bench.device.frozen = True
    bench.drive(OFFLINE_AFTER - 0.02, 0.3)
    bench.link.run(0.08)  # the last command is not old yet
    assert bench.link.velocities()[-1] == (0.0, 0.0)


def test_drive_without_reports_sends_zeros() -> None:
    bench = Bench()
    bench.drive(1.0, 0.3)
    bench.device.frozen = True
    bench.clock.advance(OFFLINE_AFTER + 0.01)  # nobody renews: the link's thread may be stuck
    sent = len(bench.link.velocities())
    with pytest.raises(NotConnected, match="open but silent"):
        bench.base.drive(Velocity(0.3, 0.0))
    assert bench.link.velocities()[sent:] == [(0.0, 0.0)] * STOP_REPEATS


LENGTHS = pytest.mark.parametrize("length", [3, 85, 254, 255])


@LENGTHS
@pytest.mark.parametrize("frozen", [False, True], ids=["with reports", "without reports"])
def test_no_damaged_header_swallows_the_stops(length: int, frozen: bool) -> None:
    bench = Bench()
    bench.drive(1.0, 0.3)
    bench.device.feed(HEADER + bytes([length]), bench.clock.now())  # the bytes that follow are counted as its own
    bench.device.frozen = frozen
    bench.base.stop()
    bench.link.run(0.25 if frozen else 0.12)
    assert bench.device.wheels.velocity == ZERO_VELOCITY


@LENGTHS
def test_no_damaged_header_swallows_the_last_word(length: int) -> None:
    bench = Bench()
    bench.drive(1.0, 0.3)
    bench.device.feed(HEADER + bytes([length]), bench.clock.now())
    bench.base.close()
    bench.link.run(0.02)
    assert bench.device.wheels.velocity == ZERO_VELOCITY


def test_stops_leave_most_of_the_wire_free() -> None:
    bench = Bench()
    bench.drive(1.0, 0.3)
    bench.base.stop()
    bench.link.sent.clear()
    bench.link.run(0.4)
    assert 10 * sum(map(len, bench.link.sent)) / BAUD < 0.4 / 3  # ten bits each


def test_the_last_word_of_the_links_thread_is_to_stand_still() -> None:
    bench = Bench()
    bench.drive(1.0, 0.3)
    sent = len(bench.link.velocities())
    bench.base.on_closing()
    assert set(bench.link.velocities()[sent:]) == {(0.0, 0.0)}


def test_the_port_is_released_though_the_last_zero_cannot_be_sent(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench()
    closed: list[bool] = []

    def refuse(_: bytes) -> None:
        raise ValueError("broken")

    monkeypatch.setattr(bench.link, "write", refuse)
    monkeypatch.setattr(bench.link, "close", lambda: closed.append(True))
    with pytest.raises(ValueError, match="broken"):
        bench.base.close()
    assert closed == [True]


def test_close_ends_with_zeros_despite_concurrent_commands() -> None:
    bench = Bench()
    bench.drive(1.0, 0.4)

    def meanwhile() -> None:
        """What a caller and the link's thread may still do until the link is closed."""
        bench.base.drive(Velocity(0.4, 0.0))
        bench.clock.advance(0.05)
        bench.base.on_poll()

    bench.link.before_close = meanwhile
    bench.base.close()
    assert bench.link.velocities()[-4:] == [(0.0, 0.0)] * 4


def test_odometry_agrees_with_where_the_base_really_is() -> None:
    device = VirtualKobuki()
    device.gyro_offset = 3.0
    bench = Bench(device)
    bench.drive(12.0, 0.2, 0.6)
    true, measured = bench.device.pose(bench.clock.now()), bench.value().pose
    assert true.heading > 2 * pi  # so the gyro has wrapped, and more than once
    assert (measured.x, measured.y) == pytest.approx((true.x, true.y), abs=0.02)
    assert measured.heading == pytest.approx(true.heading, abs=0.02)
    assert bench.value().velocity.linear == pytest.approx(0.2, abs=0.01)
    assert bench.value().velocity.angular == pytest.approx(0.6, abs=0.01)


def test_slipping_wheels_deceive_the_distance_but_not_the_heading() -> None:
    bench = Bench(VirtualKobuki(wheels=SimulatedWheels(slip=0.2)))
    bench.drive(4.0, 0.3)
    bench.drive(1.0, 0.0, 1.0)
    true, measured = bench.device.pose(bench.clock.now()), bench.value().pose
    assert true.x == pytest.approx(0.8 * measured.x, rel=0.02)
    assert measured.heading == pytest.approx(true.heading, abs=0.02)


def test_the_heading_of_a_moment_ago_is_known() -> None:
    bench = Bench()
    bench.drive(2.0, 0.0, 1.0)
    now = bench.clock.now()
    newest, before = bench.base.heading_at(now), bench.base.heading_at(now - 0.5)
    assert newest is not None
    assert before is not None
    assert newest - before == pytest.approx(0.5, abs=0.03)
    assert bench.base.heading_at(now - 60) is None


def test_a_state_grows_stale_and_fresh_again() -> None:
    bench = Bench()
    assert bench.base.state().quality is Quality.GOOD
    bench.device.frozen = True
    bench.link.run(0.15)
    reading = bench.base.state()
    assert reading.quality is Quality.STALE
    assert reading.value is not None
    assert bench.base.health().online  # not yet missed for long enough
    bench.device.frozen = False
    bench.link.run(0.05)
    assert bench.base.state().quality is Quality.GOOD


def test_silence_and_its_end_are_reported_once() -> None:
    bench = Bench()
    bench.device.frozen = True
    bench.link.run(1.0)
    health = bench.base.health()
    assert not health.online
    assert health.detail == "base: /dev/kobuki: open but silent; is the base switched on?"
    assert "switch the base on" in health.hint
    bench.device.frozen = False
    bench.link.run(1.0)
    assert bench.base.health().online
    assert [notice.kind for notice in bench.notices] == ["offline", "online"]


@pytest.mark.parametrize("anew", [False, True], ids=["silent", "unplugged"])
def test_reconnect_policy_depends_on_the_duration_of_the_silence(anew: bool) -> None:
    bench = Bench()
    bench.drive(1.0, 0.2)
    for away, returns, latched in ((0.9, False, ""), (1.5, True, ""), (7.0, True, "it was away for 7 s")):
        before = bench.base.health().reconnected_at
        bench.device.frozen = True
        bench.link.run(away)
        if anew:
            bench.base.on_connected()
        bench.device.frozen = False
        bench.link.run(0.1)
        assert (bench.base.health().reconnected_at != before, bench.base.latched) == (returns, latched)
    with pytest.raises(DeviceFault, match="stopped: it was away for 7 s") as caught:
        bench.base.drive(Velocity(0.2, 0.0))
    assert "enable the base" in caught.value.hint
    bench.link.run(1.0)
    assert bench.value().velocity == ZERO_VELOCITY
    bench.base.enable()
    bench.drive(1.0, 0.2)
    assert bench.value().velocity.linear == pytest.approx(0.2, abs=0.01)


def test_reconnect_resets_the_parser_and_the_state() -> None:
    bench = Bench()
    bench.clock.advance(0.05)
    bench.base.on_connected()  # what was heard a moment ago was heard on the port before
    assert not bench.base.health().online
    bench.link.run(0.1)
    bench.device.frozen = True
    bench.link.run(1.0)
    bench.base.on_data(encode(Core(), Inertia())[:10])  # cut in the middle by the plug
    bench.base.on_connected()
    assert not bench.base.health().online
    with pytest.raises(NotConnected):
        bench.base.drive(Velocity(0.1, 0.0))
    bench.link.run(1.0)
    assert [notice.kind for notice in bench.notices] == ["offline", "offline"]
    bench.device.frozen = False
    bench.link.run(0.1)
    assert bench.base.health().online
    counters = bench.base.health().counters
    assert (counters["checksum_errors"], counters["skipped_bytes"]) == (0, 0)


def test_foreign_bytes_are_distinguished_from_silence() -> None:
    bench = Bench()
    bench.device.frozen = True
    bench.link.run(1.0, each=lambda: bench.base.on_data(b"$GPGGA,"))
    assert "bytes arrive, but no report of a Kobuki" in bench.base.health().detail
    assert bench.base.health().counters["skipped_bytes"] > 0


def test_cliff_stops_forward_motion_at_once_with_one_notice() -> None:
    bench = Bench()
    bench.drive(1.0, 0.4)
    bench.device.cliff = Sides(centre=True)
    bench.drive(0.02, 0.4)
    assert bench.link.velocities()[-1] == (0.0, 0.0)
    assert bench.base.drive(Velocity(0.4, 0.0)) == ZERO_VELOCITY
    bench.drive(0.5, 0.4)
    assert [(notice.kind, notice.message) for notice in bench.notices] == [
        ("fault", "cliff centre: it does not drive forward")
    ]
    bench.drive(0.5, -0.2)
    assert bench.link.velocities()[-1][0] == pytest.approx(-0.2)


def test_cliff_in_several_reports_of_one_read_gives_one_notice() -> None:
    bench = Bench()
    bench.device.cliff = Sides(left=True)
    bench.base.on_data(bench.device.poll(bench.clock.advance(0.1)))
    assert len(bench.notices) == bench.changes == 1


def test_wheel_drop_stops_all_motion_with_one_notice() -> None:
    bench = Bench()
    bench.drive(1.0, -0.2, 0.5)
    bench.device.wheel_drop = Sides(left=True, right=True)
    bench.drive(0.5, -0.2, 0.5)
    assert bench.link.velocities()[-1] == (0.0, 0.0)
    assert [notice.message for notice in bench.notices] == ["wheel drop left and right: it does not drive"]
    assert bench.notices[0].hint


def test_bump_notifies_and_backs_off_from_its_side() -> None:
    bench = Bench()
    bench.drive(1.0, 0.3)
    assert bench.changes == 0
    bench.device.bumper = Sides(left=True)
    bench.drive(0.5, 0.3, 0.5)
    assert bench.changes == 1
    assert bench.link.velocities()[-1][0] < 0.0
    assert bench.link.velocities()[-1][1] < 0.0
    bench.device.bumper = Sides()
    bench.drive(1.0, 0.3)
    assert bench.changes == 2
    assert bench.link.velocities()[-1][0] == pytest.approx(0.3)
    assert bench.notices == []


def test_buttons_and_battery_are_passed_on() -> None:
    bench = Bench()
    bench.device.buttons = frozenset({1})
    bench.device.battery_voltage, bench.device.charger = 14.8, 22
    bench.link.run(0.05)
    state = bench.value()
    assert (state.buttons, state.charging) == (frozenset({1}), True)
    assert state.battery_voltage == pytest.approx(14.8)
    assert state.battery_percent == pytest.approx(5 + 95 * 1.6 / 3.3)
    assert bench.changes == 1


def test_identity_is_requested_until_received() -> None:
    bench = Bench(MuteKobuki())
    bench.link.run(3.0)
    assert bench.identity.missing == Extra.FIRMWARE
    assert isinstance(bench.device, MuteKobuki)
    bench.device.mute = False
    bench.link.run(1.0)
    assert str(bench.identity.firmware) == "1.2.0"
    assert str(bench.identity.hardware) == "1.0.4"
    asked = sum(b"\x09\x02" in data for data in bench.link.sent)
    bench.link.run(2.0)
    assert sum(b"\x09\x02" in data for data in bench.link.sent) == asked


class MuteKobuki(VirtualKobuki):
    """Does not hear the question for its firmware until it is allowed to."""

    mute = True

    def _extras(self, flags: int) -> Iterator[KobukiSubpayload]:
        yield from super()._extras(flags & ~Extra.FIRMWARE if self.mute else flags)


def test_unsupported_firmware_is_reported() -> None:
    bench = Bench(VirtualKobuki(firmware=(2, 0, 1)))
    bench.link.run(1.0)
    assert [(notice.kind, notice.message) for notice in bench.notices] == [("fault", "firmware 2.0.1, not 1.x")]


def test_the_supplies_are_switched_on_with_the_connection() -> None:
    device = VirtualKobuki()
    device.outputs = 0
    assert Bench(device).device.outputs == OUTPUTS_AT_START == 0xF0


@pytest.mark.parametrize("identifier", [3, 5, 6, 13, 16])
def test_short_subpayload_does_not_spoil_the_others(identifier: int) -> None:
    bench = Bench()
    bench.device.shortened = identifier
    bench.device.chatty = True
    bench.drive(1.0, 0.2)
    assert bench.value().pose.x > 0.05
    counters = bench.base.health().counters
    assert counters["malformed_parts"] == counters["unknown_parts"] == 50


def test_a_lost_heading_is_caught_up_with() -> None:
    bench = Bench()
    bench.drive(0.5, 0.0, 1.0)
    bench.device.shortened = Inertia.ID
    bench.drive(0.5, 0.0, 1.0)
    bench.device.shortened = None
    bench.drive(0.1, 0.0, 1.0)
    assert bench.value().pose.heading == pytest.approx(bench.device.pose(bench.clock.now()).heading, abs=0.03)


def test_missing_core_report_counts_as_silence() -> None:
    bench = Bench()
    bench.drive(0.5, 0.2)
    bench.device.shortened = Core.ID
    bench.link.run(0.5)
    assert not bench.base.health().online
    assert bench.link.velocities()[-1] == (0.0, 0.0)


def test_power_cycled_base_does_not_jump() -> None:
    bench = Bench()
    bench.drive(2.0, 0.3, 0.5)
    before = bench.value().pose
    bench.link.device = VirtualKobuki()
    bench.link.device.frozen = True
    bench.link.run(3.0)
    bench.link.device.frozen = False
    bench.link.run(0.5)
    after = bench.value().pose
    assert (after.x, after.y, after.heading) == pytest.approx((before.x, before.y, before.heading), abs=0.1)
    bench.drive(1.0, 0.0, 0.5)
    assert bench.value().pose.heading > after.heading + 0.3


def test_virtual_base_stops_without_commands() -> None:
    device = VirtualKobuki()
    device.poll(0.0)
    device.feed(encode(BaseControl.of(0.3, 0.0)), 0.0)
    device.pose(BODY_COMMAND_TIMEOUT)
    assert device.wheels.velocity.linear == pytest.approx(0.3)
    at_rest = device.pose(BODY_COMMAND_TIMEOUT + 0.5)
    assert device.wheels.velocity == ZERO_VELOCITY
    assert device.pose(10.0) == at_rest


def test_virtual_base_reports_its_gains_on_request() -> None:
    device = VirtualKobuki()
    device.poll(0.0)
    device.feed(encode(SetGains(1, 5, 6, 7), GetGains(), KobukiSound(1000, 10)), 0.01)
    (payload,) = KobukiFrameFinder().feed(device.poll(0.02))
    assert KobukiGains(1, 5, 6, 7) in decode(payload, FEEDBACK).parts
    device.feed(encode(SetGains(0, 5, 6, 7), GetGains()), 0.03)
    (payload,) = KobukiFrameFinder().feed(device.poll(0.04))
    assert KobukiGains() in decode(payload, FEEDBACK).parts


# --- the whole of it, turned by hand and over a pseudo-terminal -------------------------------------------------------


class Rig:
    """A driver with its link, a virtual base, and the notices of both driver and link."""

    clock: Clock
    base: DiffDriveBase

    def __init__(self) -> None:
        self.device = VirtualKobuki()
        self.notices: list[DeviceStatus] = []

    def online(self) -> bool:
        return self.base.health().online

    def moves(self) -> bool:
        self.device.pose(self.clock.now())
        return self.device.wheels.velocity != ZERO_VELOCITY

    def driving(self, linear: float = 0.3) -> bool:
        """Ask for a velocity once, if that is possible, and say whether the base moves."""
        if self.online():
            with suppress(NotConnected):  # gone since we asked
                self.base.drive(Velocity(linear, 0.0))
        return self.moves()

    def x(self) -> float:
        """How far it has come by its own account."""
        return (self.base.state().value or NOWHERE).pose.x

    def kinds(self) -> list[str]:
        return [notice.kind for notice in self.notices]


class HandRig(Rig):
    """On a wire, in simulated time."""

    def __init__(self) -> None:
        super().__init__()
        self.timeline = Timeline()
        self.clock = self.timeline.clock
        self.wire = HandWire(self.device, self.timeline)
        link = self.wire.link("base", report=self.notices.append)
        self.base = kobuki_base(link, self.clock, report=self.notices.append)

    def until(self, holds: Callable[[], object]) -> None:
        pass_until(self.timeline, holds)


@pytest.fixture
def rig() -> HandRig:
    rig = HandRig()
    rig.base.open()
    rig.until(rig.online)
    return rig


def test_base_stops_without_renewal(rig: HandRig) -> None:
    rig.until(rig.driving)
    rig.until(lambda: not rig.moves())


def test_idle_reports_are_read_in_batches_until_a_command(rig: HandRig) -> None:
    reads: list[float] = []
    received = rig.base.on_data

    def counted(data: bytes) -> None:
        reads.append(rig.clock.now())
        received(data)

    rig.base.on_data = counted  # type: ignore[method-assign]
    rig.timeline.run_until(rig.clock.now() + 1.0)
    reads.clear()
    fresh = []
    for _ in range(200):
        rig.timeline.run_until(rig.clock.now() + 0.005)
        fresh.append(rig.base.state().quality)
    assert len(reads) == pytest.approx(1 / IDLE_POLL_INTERVAL, abs=2)
    assert set(fresh) == {Quality.GOOD}
    rig.timeline.run_until(reads[-1] + 0.005)  # it has just begun to doze
    asked = rig.clock.now()
    rig.base.drive(Velocity(0.3, 0.0))
    rig.until(rig.moves)
    assert rig.clock.now() - asked <= 0.03
    reads.clear()
    begun = rig.clock.now()
    while rig.clock.now() < begun + 0.2:
        rig.driving()
        rig.timeline.run_until(rig.clock.now() + 0.005)
    assert len(reads) == pytest.approx(10, abs=2)


def test_silence_at_rest_is_reported_in_time(rig: HandRig) -> None:
    rig.timeline.run_until(rig.clock.now() + 1.0)
    rig.device.frozen = True
    frozen = rig.clock.now()
    rig.until(lambda: rig.base.state().quality is Quality.STALE)
    assert rig.clock.now() - frozen <= 0.1 + IDLE_POLL_INTERVAL
    rig.until(lambda: "offline" in rig.kinds())
    assert rig.clock.now() - frozen <= OFFLINE_AFTER + IDLE_POLL_INTERVAL


def test_a_silent_wire_is_offline_and_comes_back(rig: HandRig) -> None:
    rig.until(rig.driving)
    rig.wire.distort = lambda _: b""
    rig.until(lambda: not rig.online())
    assert "open but silent" in rig.base.health().detail
    rig.until(lambda: not rig.moves())
    rig.wire.distort = bytes
    rig.until(rig.driving)


@pytest.mark.parametrize("error", [ValueError("broken"), SystemExit(1)])
def test_exceptions_in_callbacks_neither_drive_on_nor_block_the_port(rig: HandRig, error: BaseException) -> None:
    def throw(*_: object) -> None:
        raise error

    rig.base.close()
    rig.base = kobuki_base(rig.wire.link("base", report=throw), rig.clock, report=throw, changed=throw)
    rig.base.open()
    rig.until(rig.driving)
    rig.device.bumper = Sides(left=True)
    rig.until(lambda: (rig.base.state().value or NOWHERE).bumper)
    rig.until(lambda: not rig.driving())
    rig.device.bumper = Sides()
    rig.until(rig.driving)
    rig.base.close()
    assert not rig.online()
    rig.until(lambda: not rig.moves())
    assert rig.wire.holder is None


def test_frames_with_a_wrong_checksum_are_counted_and_not_believed(rig: HandRig) -> None:
    rig.wire.distort = lambda said: said[:-1] + bytes([said[-1] ^ 0xFF])
    rig.until(lambda: rig.base.health().counters["checksum_errors"] > 2)
    rig.until(lambda: not rig.online())
    rig.wire.distort = bytes
    rig.until(rig.online)


def test_noise_before_the_header_is_no_trouble(rig: HandRig) -> None:
    rig.wire.distort = lambda said: b"\xaa\x00\xaa" + said
    frames = rig.base.health().counters["frames"]
    rig.until(lambda: rig.base.health().counters["frames"] > frames + 10)
    assert rig.base.health().counters["skipped_bytes"] >= 30 - 3
    rig.until(rig.driving)


class Ported(Rig):
    """On a pseudo-terminal, on threads of their own."""

    def __init__(self) -> None:
        super().__init__()
        self.clock = PatientClock()
        self.terminal = PseudoTerminal("kobuki", self.device, self.clock)
        link = SerialLink("base", self.terminal.path, BAUD, retry_interval=0.05, report=self.notices.append)
        self.base = kobuki_base(link, self.clock, report=self.notices.append)


@pytest.fixture
def ported() -> Iterator[Ported]:
    ported = Ported()
    try:
        yield ported
    finally:
        ported.base.close()
        ported.terminal.close()


@pytest.fixture
def running(ported: Ported) -> Ported:
    ported.terminal.open()
    ported.base.open()
    wait_until(ported.online)
    return ported


def test_base_drives_and_stops(running: Ported) -> None:
    wait_until(lambda: running.driving() and running.x() > 0.02)
    running.base.stop()
    wait_until(lambda: not running.moves())
    reading = running.base.state()
    assert reading.value is not None
    assert reading.value.pose.x == pytest.approx(running.device.pose(running.clock.now()).x, abs=0.1)


def test_closed_base_is_stopped(running: Ported) -> None:
    wait_until(running.driving, pause=0.02)
    running.base.close()
    wait_until(lambda: not running.moves())
    assert not running.online()
    running.base.close()
    running.base.open()
    wait_until(running.online)


def test_base_survives_unplug_and_replug_with_notices(running: Ported) -> None:
    wait_until(lambda: running.driving() and running.x() > 0.02)
    running.terminal.unplug()
    wait_until(lambda: "offline" in running.kinds())
    wait_until(lambda: "no such device" in running.base.health().detail)
    with pytest.raises(NotConnected) as caught:
        running.base.drive(Velocity(0.1, 0.0))
    assert "mission ports" in caught.value.hint
    running.base.stop()
    wait_until(lambda: not running.moves())
    assert running.base.state().quality is Quality.STALE
    before = running.x()
    running.terminal.replug()
    wait_until(running.online)
    assert running.x() == pytest.approx(before, abs=1e-6)
    wait_until(lambda: running.kinds()[-1] == "online")
    assert running.base.health().counters["connections"] == 2
    wait_until(lambda: running.driving() and running.x() > before + 0.02)


def test_base_that_appears_later_is_found(ported: Ported) -> None:
    ported.base.open()
    wait_until(lambda: "no such device" in ported.base.health().detail)
    assert ported.base.health().hint
    ported.terminal.open()
    wait_until(ported.driving, pause=0.02)


def test_busy_port_is_reported_and_opened_once_free(ported: Ported) -> None:
    ported.terminal.open()
    with serial.Serial(ported.terminal.path, BAUD, exclusive=True):
        ported.base.open()
        wait_until(lambda: "in use" in ported.base.health().detail)
        assert "fuser -v" in ported.base.health().hint
    wait_until(ported.online)


def test_forbidden_port_gives_a_hint(ported: Ported, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    ported.terminal.open()
    with monkeypatch.context() as forbidden:  # taken away by hand, for root is never refused
        forbidden.setattr(ports, "SerialPort", refuse)
        ported.base.open()
        wait_until(lambda: "no permission" in ported.base.health().detail)
        assert "sudo" in ported.base.health().hint
    wait_until(ported.online)
