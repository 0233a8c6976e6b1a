"""Where a base will be: by its ramps, and by what it has been told and not begun."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from behaviours.tracking.ahead import LONGEST, Ahead, Turning


def test_a_base_that_was_told_nothing_goes_on_as_it_does() -> None:
    ahead = Ahead(lag=0.1, acceleration=2.0)
    assert ahead.at(1.5, Turning(0.5, 1.0, 1.0)).heading == pytest.approx(1.0)
    before = ahead.at(0.9, Turning(0.5, 1.0, 1.0))
    assert (before.heading, before.rate) == pytest.approx((0.4, 1.0))


def test_it_speeds_up_to_what_it_was_told_after_its_lag() -> None:
    ahead = Ahead(lag=0.2, acceleration=2.0)
    ahead.tell(1.0, 1.0)
    still = Turning(0.0, 0.0, 1.0)
    assert ahead.at(1.2, still) == Turning(0.0, 0.0, 1.2)
    found = ahead.at(1.5, still)  # 0.3 s at 2 rad/s^2
    assert (found.heading, found.rate) == pytest.approx((0.09, 0.6), abs=0.001)
    found = ahead.at(1.9, still)  # 0.5 s up to 1 rad/s, then 0.2 s at that
    assert (found.heading, found.rate) == pytest.approx((0.45, 1.0), abs=0.001)


def test_the_newest_that_has_begun_is_in_force() -> None:
    ahead = Ahead(lag=0.1, acceleration=1000.0)
    for n in range(100):
        ahead.tell(n * 0.05, n / 100)
    assert ahead.at(4.92, Turning(0.0, 0.0, 4.9)).rate == pytest.approx(0.96)  # told at 4.8


def test_what_somebody_else_commands_is_forgotten() -> None:
    ahead = Ahead(lag=0.0, acceleration=9.0)
    ahead.tell(1.0, 1.0)
    ahead.forget()
    assert ahead.at(1.5, Turning(0.0, 0.0, 1.0)) == Turning(0.0, 0.0, 1.5)


def test_it_looks_no_farther_ahead_than_is_of_use() -> None:
    ahead = Ahead(lag=0.0, acceleration=1.0)
    assert ahead.at(100.0, Turning(0.0, 1.0, 0.0)).heading == pytest.approx(LONGEST)


@given(
    st.lists(st.tuples(st.floats(0.0, 0.9), st.floats(-2.0, 2.0)), max_size=8),
    st.floats(-2.0, 2.0),
    st.floats(0.0, 1.0),
    st.floats(0.1, 10.0),
)
def test_it_never_turns_faster_than_told_nor_changes_faster_than_it_can(
    told: list[tuple[float, float]], rate: float, time: float, acceleration: float
) -> None:
    ahead = Ahead(lag=0.1, acceleration=acceleration)
    for when, turn in sorted(told):
        ahead.tell(when, turn)
    found = ahead.at(time, Turning(0.0, rate, 0.0))
    assert abs(found.rate - rate) <= acceleration * time + 1e-9
    limits = [rate, *(turn for _, turn in told)]
    assert min(limits) - 1e-9 <= found.rate <= max(limits) + 1e-9
    assert abs(found.heading) <= max(map(abs, limits)) * time + 1e-9
    mirrored = Ahead(lag=0.1, acceleration=acceleration)
    for when, turn in sorted(told):
        mirrored.tell(when, -turn)
    assert mirrored.at(time, Turning(0.0, -rate, 0.0)).heading == pytest.approx(-found.heading)
