"""Times of exposure rise, and a stamp that cannot be right is replaced."""

import pytest

from perception.exposure_clock import ExposureClock


def test_exposures_rise_and_are_early_by_the_delay() -> None:
    clock = ExposureClock()
    found = [clock.expose(1.0 + 0.05 * n, 0.03, 1.1 + 0.05 * n) for n in range(10)]
    assert [one.time for one in found] == pytest.approx([0.97 + 0.05 * n for n in range(10)])
    assert all(one.stamp == one.time and one.doubt == 0.0 for one in found)


def test_stamp_in_the_future_is_replaced_and_holds_up_no_other() -> None:
    clock = ExposureClock()
    for n in range(10):
        clock.expose(1.0 + 0.05 * n, 0.0, 1.1 + 0.05 * n)
    wrong = clock.expose(1.5 + 0.2, 0.0, 1.6)
    assert wrong.time == pytest.approx(1.5)
    assert wrong.doubt > 0.1
    after = clock.expose(1.55, 0.0, 1.65)
    assert (after.time, after.stamp, after.doubt) == (1.55, 1.55, 0.0)


def test_late_picture_keeps_its_stamp() -> None:
    clock = ExposureClock()
    for n in range(10):
        clock.expose(1.0 + 0.05 * n, 0.0, 1.1 + 0.05 * n)
    late = clock.expose(1.5, 0.0, 1.9)
    assert (late.time, late.doubt) == (1.5, 0.0)


def test_stamps_always_rise_and_large_steps_back_are_doubted() -> None:
    clock = ExposureClock()
    first, jittered, wrong = (clock.expose(stamp, 0.0, None) for stamp in (1.0, 0.99, 0.8))
    assert first.stamp < jittered.stamp < wrong.stamp < 1.001
    assert (jittered.time, jittered.doubt) == (0.99, 0.0)
    assert (wrong.time, wrong.doubt > 0.1) == (0.8, True)
