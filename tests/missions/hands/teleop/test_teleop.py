"""Driving by hand with keys: in simulated time, from the keys that a terminal sends to the wheels of a base."""

from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.api import COMMAND_TIMEOUT, HeadPose, Sides, Source, Velocity
from drivers.base.twin import BaseTwin
from drivers.clock import ManualClock
from drivers.errors import NotConnected
from drivers.sim.timeline import Timeline
from missions.control.pilot import HEAD_STEP, MAX_SHARE, MIN_SHARE, SPEED_KEYS, DriveInput, Pilot
from missions.plugins.teleop.hand_driving import (
    COMMAND_INTERVAL,
    DRIVE_KEYS,
    KEY_HOLD_TIME,
    KEYS_HELP,
    REPEAT_HOLD_TIME,
    HeldKeys,
    drive_by_hand,
)
from missions.plugins.testing.recorders import ENABLE, STOP, RecordedBase, RecordedHead

FULL, TURNING = 0.5, 1.9
"""The limits of the twin: m/s, rad/s."""


class Drive:
    """A base in simulated time, at which somebody types: keys by the time at which they come, and then Escape."""

    def __init__(
        self,
        *keys: tuple[float, str],
        seconds: float = 3.0,
        held_up: tuple[float, float] = (inf, inf),
        away: tuple[float, float] = (inf, inf),
    ) -> None:
        self.timeline = Timeline()
        self.clock = self.timeline.clock
        self.base = BaseTwin(self.clock, max_linear=FULL, max_angular=TURNING, linear_acceleration=5.0)
        self.base.open()
        self.timeline.call_every(BaseTwin.STEP_INTERVAL, self._step)
        self.keys = [*sorted(keys, key=lambda key: key[0]), (seconds, "escape")]
        self.held_up, self.away = held_up, away
        self.speeds: list[tuple[float, float, float]] = []
        """How fast it truly went and turned, by the time."""
        self.shown: list[str] = []
        drive_by_hand(Pilot(self.base), self.typed, None, self.clock, self.shown.append)

    def typed(self, seconds: float) -> str:
        if self.clock.now() >= self.held_up[0]:  # the whole program stands still, and not the base
            self.timeline.run_until(self.held_up[1])
            self.held_up = (inf, inf)
        due, key = self.keys[0]
        self.timeline.run_until(min(self.clock.now() + seconds, max(due, self.clock.now())))
        if self.clock.now() < due:
            return ""
        del self.keys[0]
        return key

    def _step(self) -> None:
        now = self.clock.now()
        if now >= self.away[0]:
            self.base.plug.unplug()
        if now >= self.away[1]:
            self.base.plug.plug_in()
            self.away = (inf, inf)
        self.base.step()
        velocity = self.base.body.velocity
        self.speeds.append((self.clock.now(), velocity.linear, velocity.angular))

    def speed(self, start: float, end: float = inf) -> list[float]:
        return [ahead for time, ahead, _ in self.speeds if start <= time <= end]


def held(key: str, start: float, end: float, *, delay: float = 0.5, period: float = 0.033) -> list[tuple[float, str]]:
    """The keys that a terminal sends while one is held: it repeats after a delay."""
    repeats = int((end - start - delay) / period) + 1 if end - start >= delay else 0
    return [(start, key), *((start + delay + number * period, key) for number in range(repeats))]


# --- which keys are held ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("delay", [0.25, 0.5, 0.66])
def test_held_key_drives_through_its_repeat_delay(delay: float) -> None:
    drive = Drive(*held("i", 0.2, 2.2, delay=delay))
    assert min(drive.speed(0.6, 2.2)) == pytest.approx(0.5 * FULL)


def test_the_base_stops_when_the_keys_stop() -> None:
    drive = Drive(*held("i", 0.2, 1.2))
    assert min(drive.speed(0.6, 1.2)) > 0.2
    assert (
        max(drive.speed(1.2 + REPEAT_HOLD_TIME + COMMAND_INTERVAL + 0.25)) == 0.0
    )  # and it brakes for an eighth of a second


def test_tapped_key_drives_no_longer_than_the_key_hold_time() -> None:
    drive = Drive((0.2, "i"))
    assert max(drive.speed(0.2)) > 0.2
    assert max(drive.speed(0.2 + KEY_HOLD_TIME + COMMAND_INTERVAL + 0.25)) == 0.0


def test_base_stops_for_a_silent_line_but_not_for_a_short_gap() -> None:
    keys = held("i", 0.2, 3.0)
    drive = Drive(*(key for key in keys if key[0] <= 1.0 or 1.25 <= key[0] <= 2.0), seconds=4.0)
    assert min(drive.speed(0.6, 2.0)) > 0.2
    assert max(drive.speed(2.6)) == 0.0


@pytest.mark.parametrize("key", ["k", "s", "other", "5"])
def test_unassigned_key_stops_at_once(key: str) -> None:
    drive = Drive((0.2, "i"), (0.5, key))
    assert max(drive.speed(0.45, 0.5)) > 0.2
    assert max(drive.speed(0.5 + COMMAND_INTERVAL + 0.15)) == 0.0


@pytest.mark.parametrize(("key", "push"), DRIVE_KEYS.items())
def test_each_key_drives_in_its_direction(key: str, push: DriveInput) -> None:
    drive = Drive((0.2, key), seconds=0.9)
    _, ahead, turn = drive.speeds[-3]
    assert (ahead, turn) == pytest.approx((push.ahead * FULL / 2, push.left * TURNING / 2), abs=0.02)


def test_repeat_hold_time_applies_after_a_repeated_key() -> None:
    keys = HeldKeys()
    keys.press("i", 10.0)
    assert keys.push(10.0 + KEY_HOLD_TIME) == DriveInput(1, 0)
    assert keys.push(10.01 + KEY_HOLD_TIME) is None
    keys.press("i", 20.0)
    keys.press("i", 20.05)
    assert keys.push(20.05 + REPEAT_HOLD_TIME) == DriveInput(1, 0)
    assert keys.push(20.06 + REPEAT_HOLD_TIME) is None
    keys.press("u", 20.1)
    keys.press("q", 20.15)  # changes the speed, not the way
    assert keys.push(20.1 + KEY_HOLD_TIME) == DriveInput(1, 1)


@given(
    st.lists(
        st.tuples(st.floats(0.0, 0.5), st.sampled_from([*DRIVE_KEYS, *SPEED_KEYS, "k", " ", "left", "x"])), max_size=40
    )
)
def test_base_stops_after_the_last_key_of_any_sequence(typed: list[tuple[float, str]]) -> None:
    keys, now = HeldKeys(), 0.0
    for wait, key in typed:
        now += wait
        keys.press(key, now)
    assert keys.push(now + KEY_HOLD_TIME + 0.01) is None


def test_the_help_names_every_key() -> None:
    assert [key for key in (*DRIVE_KEYS, *SPEED_KEYS, "space", "Enter", "Esc") if key not in KEYS_HELP] == []


@pytest.mark.parametrize(("waited", "latched"), [("i" * 75, False), ("i" * 40 + " " + "i" * 30 + "\r", True)])
def test_delayed_keys_do_not_drive_but_still_latch(waited: str, latched: bool) -> None:
    keys = [(0.2, "i"), (0.7, "i"), *((0.75, "enter" if key == "\r" else key) for key in waited)]
    drive = Drive(*keys, held_up=(0.72, 5.0), seconds=6.5)
    assert max(drive.speed(0.5, 0.7)) > 0.2
    assert max(drive.speed(1.5)) == 0.0
    assert bool(drive.base.latched) is latched


def test_key_held_through_a_reconnect_must_be_pressed_again() -> None:
    drive = Drive(*held("i", 0.2, 3.0), *held("i", 3.6, 4.5), away=(1.0, 2.5), seconds=5.0)
    assert min(drive.speed(0.6, 1.0)) > 0.2
    assert max(drive.speed(1.6, 3.5)) == 0.0
    assert any("release the input, then start again" in line for line in drive.shown)
    assert min(drive.speed(4.2, 4.5)) > 0.2


# --- what they do -----------------------------------------------------------------------------------------------------


def pilot() -> tuple[Pilot, RecordedBase, RecordedHead]:
    clock = ManualClock()
    base, head = RecordedBase(clock), RecordedHead(clock)
    return Pilot(base, head), base, head


def test_space_latches_and_enter_enables() -> None:
    drive = Drive(*held("i", 0.2, 1.0), (1.05, " "), *held("i", 1.2, 1.8), (1.9, "enter"), *held("i", 2.0, 2.9))
    assert max(drive.speed(1.3, 2.0)) == 0.0
    assert max(drive.speed(2.0)) > 0.2
    assert any("stopped by hand: Enter enables" in line for line in drive.shown)


def test_enter_alone_sets_nothing_in_motion() -> None:
    drive = Drive((0.2, "i"), (0.3, " "), (0.35, "enter"))
    assert max(drive.speed(0.6)) == 0.0


def test_speeds_begin_at_half_and_stay_within_the_limits() -> None:
    by, base, _ = pilot()
    by.steer(DriveInput(1, -1))
    assert base.commands == [(Source.TELEOP, Velocity(0.25, -base.limits.turn / 2))]
    for _ in range(40):
        by.press("q")
    assert (by.ahead, by.turn) == (MAX_SHARE, MAX_SHARE)
    for _ in range(40):
        by.press("x")
    assert (by.ahead, by.turn) == pytest.approx((MIN_SHARE, MAX_SHARE))
    assert by.status_line().startswith("5/100 %")


def test_letting_go_stops_once_and_keeps_the_wheels_for_a_moment() -> None:
    by, base, _ = pilot()
    by.steer(DriveInput(1, 0))
    by.steer(None)
    by.steer(None)
    assert base.commands[1:] == [STOP, (Source.TELEOP, Velocity(0.0, 0.0))]


def test_the_arrows_turn_the_head_step_by_step() -> None:
    by, _, head = pilot()
    for key in ("left", "left", "up"):
        by.press(key)
    assert head.commands[-1] == HeadPose(pan=2 * HEAD_STEP, tilt=-HEAD_STEP)


def test_base_drives_with_a_missing_or_disconnected_head() -> None:
    by, base, head = pilot()
    head.trouble = NotConnected("head: the cable is out")
    by.press("left")
    assert by.status_line().endswith("head: the cable is out")
    without = Pilot(base)
    without.press("left")
    without.steer(DriveInput(1, 0))
    assert len(base.commands) == 1


def test_disconnected_base_is_reported_and_drives_after_reconnect() -> None:
    by, base, _ = pilot()
    base.trouble = NotConnected("base: /dev/kobuki: no such device")
    by.steer(DriveInput(1, 0))
    assert "no such device" in by.status_line()
    base.trouble = None
    by.steer(DriveInput(1, 0))
    assert base.commands == [(Source.TELEOP, Velocity(0.25, 0.0))]
    assert "no such device" not in by.status_line()


def test_enter_key_enables_the_base() -> None:
    by, base, _ = pilot()
    by.press("enter")
    assert base.commands == [ENABLE]


def test_status_line_shows_source_limitation_contacts_and_battery() -> None:
    drive = Drive(seconds=0.1)
    by = Pilot(drive.base)
    drive.base.press(cliff=Sides(left=True))
    drive.timeline.run_until(0.2)
    by.steer(DriveInput(1, 0))
    drive.timeline.run_until(0.3)
    assert by.status_line() == "50 % | +0.00 m/s   +0 deg/s | teleop: cliff left | cliff left | battery 100 %"


def test_a_command_lives_longer_than_the_time_between_two() -> None:
    assert COMMAND_TIMEOUT > 3 * COMMAND_INTERVAL
