"""What is left in the battery of a simulated base, the voltage under load, and what its motors draw."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.kobuki.feedback import METRES_PER_TICK
from drivers.kobuki.odometry import EMPTY_VOLTAGE, FULL_VOLTAGE, battery_percent
from drivers.sim import base_body
from drivers.sim import battery as simulated
from drivers.sim.base_body import OVERLOAD_CURRENT, motor_current
from drivers.sim.battery import CAPACITY, CHARGE_CURRENT, INTERNAL_RESISTANCE, Battery


def test_idle_battery_keeps_its_charge() -> None:
    battery = Battery(42.0)
    for second in range(1000):
        battery.advance(float(second), 5.0, docked=False)
    assert (battery.percent, battery.reported_percent, battery.is_charging) == (42.0, 42.0, False)
    assert battery_percent(battery.voltage) == pytest.approx(42.0)


def test_battery_drains_by_the_drawn_current_and_the_drain_factor() -> None:
    real, fast = Battery(drain=1.0), Battery(drain=10.0)
    for battery in (real, fast):
        battery.advance(0.0, 1.0, docked=False)
        battery.advance(CAPACITY / 20, 1.0, docked=False)
    assert (real.percent, fast.percent) == pytest.approx((95.0, 50.0))


@given(st.lists(st.floats(0.0, 1000.0), min_size=1, max_size=20), st.floats(0.0, 100.0), st.booleans())
def test_battery_charge_is_bounded_and_independent_of_the_update_rate(
    pauses: list[float], percent: float, docked: bool
) -> None:
    often, once = Battery(percent, drain=3.0), Battery(percent, drain=3.0)
    now = 0.0
    for battery in (often, once):
        battery.advance(now, 2.0, docked=docked)
    for pause in pauses:
        now += pause
        often.advance(now, 2.0, docked=docked)
        assert 0.0 <= often.percent <= 100.0
    once.advance(now, 2.0, docked=docked)
    assert often.percent == pytest.approx(once.percent, abs=1e-6)


def test_load_lowers_voltage_and_reported_percent_but_not_the_charge() -> None:
    battery = Battery(50.0, drain=1.0, resistance=INTERNAL_RESISTANCE)
    battery.advance(0.0, 0.0, docked=False)
    rested, told = battery.voltage, battery.reported_percent
    battery.advance(0.0, 4.0, docked=False)
    assert battery.voltage == pytest.approx(rested - 4.0 * INTERNAL_RESISTANCE)
    assert battery.reported_percent == pytest.approx(battery_percent(battery.voltage))
    assert battery.reported_percent < told - 10.0
    assert battery.percent == 50.0


def test_docked_battery_charges_until_it_is_full() -> None:
    battery = Battery(0.0, resistance=INTERNAL_RESISTANCE)
    battery.advance(0.0, 2.0, docked=True)
    assert battery.is_charging
    assert battery.voltage > Battery(0.0).voltage
    battery.advance(1.5 * 3600, 2.0, docked=True)
    assert battery.percent == pytest.approx(100.0, abs=3.0)
    battery.advance(CAPACITY / CHARGE_CURRENT + 3600, 2.0, docked=True)
    battery.advance(CAPACITY / CHARGE_CURRENT + 3601, 2.0, docked=True)
    assert (battery.percent, battery.is_charging) == (100.0, False)
    assert battery.voltage == pytest.approx(FULL_VOLTAGE)


@pytest.mark.parametrize(
    "wrong", [{"percent": 101.0}, {"percent": -1.0}, {"percent": float("nan")}, {"drain": -1.0}, {"resistance": -0.1}]
)
def test_invalid_battery_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        Battery(**wrong)


def test_motor_current_rises_with_speed_and_stall_time() -> None:
    assert motor_current(0.0) == motor_current(0.0, 1.0) == 0.0
    assert motor_current(0.1) < motor_current(0.5) < 1.0
    assert motor_current(-0.5) == motor_current(0.5)
    assert motor_current(0.3, 0.02) < OVERLOAD_CURRENT <= motor_current(0.3, 0.2) == motor_current(0.3, 9.0)


def test_simulated_body_and_battery_match_a_kobuki() -> None:
    assert base_body.ENCODER_STEP == METRES_PER_TICK
    assert (simulated.EMPTY_VOLTAGE, simulated.FULL_VOLTAGE) == (EMPTY_VOLTAGE, FULL_VOLTAGE)
