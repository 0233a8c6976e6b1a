"""When a battery counts as low: confirmed twice, not for a dip, and not while it charges."""

from hypothesis import given
from hypothesis import strategies as st

from missions.executive.guard import CONFIRM_TIME, HYSTERESIS_PERCENT, BatteryWatch


def test_one_low_reading_is_no_low_battery() -> None:
    watch = BatteryWatch(25.0, 10.0)
    watch.update(20.0, 0.0, charging=False)
    watch.update(20.0, CONFIRM_TIME - 0.01, charging=False)
    assert not watch.low
    watch.update(20.0, CONFIRM_TIME, charging=False)
    assert (watch.low, watch.critical) == (True, False)


def test_a_dip_under_load_is_forgotten() -> None:
    watch = BatteryWatch(25.0, 10.0)
    for second in range(10):
        watch.update(20.0 if second % 2 else 26.0, float(second), charging=False)
    assert not watch.low


def test_low_battery_has_hysteresis() -> None:
    watch = BatteryWatch(25.0, 10.0)
    for now in (0.0, CONFIRM_TIME):
        watch.update(24.0, now, charging=False)
    watch.update(25.0 + HYSTERESIS_PERCENT - 0.1, 3.0, charging=False)
    assert watch.low
    watch.update(25.0 + HYSTERESIS_PERCENT, 4.0, charging=False)
    assert not watch.low


def test_charging_battery_is_not_low() -> None:
    watch = BatteryWatch(25.0, 10.0)
    for now in (0.0, CONFIRM_TIME):
        watch.update(5.0, now, charging=False)
    assert (watch.low, watch.critical) == (True, True)
    watch.update(5.0, 3.0, charging=True)
    assert (watch.low, watch.critical) == (False, False)
    watch.update(5.0, 4.0, charging=False)
    assert not watch.critical


def test_a_threshold_of_0_is_never_reached() -> None:
    watch = BatteryWatch(0.0, 0.0)
    for second in range(10):
        watch.update(0.0, float(second), charging=False)
    assert (watch.low, watch.critical) == (False, False)


@given(st.lists(st.tuples(st.floats(0.01, 5.0), st.floats(0.0, 100.0), st.booleans()), max_size=60))
def test_a_battery_is_low_only_after_two_readings_below_and_none_above_between(
    readings: list[tuple[float, float, bool]],
) -> None:
    watch, now, below = BatteryWatch(25.0, 10.0), 0.0, list[float]()
    for seconds, percent, charging in readings:
        was, now = watch.low, now + seconds
        watch.update(percent, now, charging=charging)
        below = [*below, now] if percent < 25.0 and not charging else []
        if watch.low and not was:
            assert below[-1] - below[0] >= CONFIRM_TIME
        assert not (watch.low and charging)
        assert watch.low or not watch.critical or percent < 25.0 + HYSTERESIS_PERCENT
