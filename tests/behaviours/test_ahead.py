"""Where a base will be: by its ramps, and by what it has been told and not begun."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from behaviours.tracking.lag_estimator import BRAKING_FACTOR, LagEstimator, TurnState, ramp
from behaviours.tracking.motion_prediction import MAX_LOOKAHEAD, BasePredictor


def foretelling(lag: float, acceleration: float) -> tuple[BasePredictor, LagEstimator]:
    known = LagEstimator(lag, acceleration)
    return BasePredictor(known), known


def test_turn_rate_is_kept_without_commands() -> None:
    ahead, _ = foretelling(0.1, 2.0)
    assert ahead.at(1.5, TurnState(0.5, 1.0, 1.0)).heading == pytest.approx(1.0)
    before = ahead.at(0.9, TurnState(0.5, 1.0, 1.0))
    assert (before.heading, before.rate) == pytest.approx((0.4, 1.0))


def test_turn_rate_ramps_to_the_command_after_the_lag() -> None:
    ahead, lag = foretelling(0.2, 2.0)
    lag.add_command(1.0, 1.0)
    still = TurnState(0.0, 0.0, 1.0)
    assert ahead.at(1.2, still) == TurnState(0.0, 0.0, 1.2)
    found = ahead.at(1.5, still)  # 0.3 s at 2 rad/s^2
    assert (found.heading, found.rate) == pytest.approx((0.09, 0.6), abs=0.001)
    found = ahead.at(1.9, still)  # 0.5 s up to 1 rad/s, then 0.2 s at that
    assert (found.heading, found.rate) == pytest.approx((0.45, 1.0), abs=0.001)


def test_newest_command_past_the_lag_is_in_force() -> None:
    ahead, lag = foretelling(0.1, 1000.0)
    for n in range(100):
        lag.add_command(n * 0.05, n / 100)
    assert ahead.at(4.92, TurnState(0.0, 0.0, 4.9)).rate == pytest.approx(0.96)  # told at 4.8


def test_forgotten_commands_have_no_effect_on_the_prediction() -> None:
    ahead, lag = foretelling(0.0, 9.0)
    lag.add_command(1.0, 1.0)
    lag.forget_commands()
    assert ahead.at(1.5, TurnState(0.0, 0.0, 1.0)) == TurnState(0.0, 0.0, 1.5)


def test_lookahead_is_limited() -> None:
    ahead, _ = foretelling(0.0, 1.0)
    assert ahead.at(100.0, TurnState(0.0, 1.0, 0.0)).heading == pytest.approx(MAX_LOOKAHEAD)


@given(
    st.lists(st.tuples(st.floats(0.0, 0.9), st.floats(-2.0, 2.0)), max_size=8),
    st.floats(-2.0, 2.0),
    st.floats(0.0, 1.0),
    st.floats(0.1, 10.0),
)
def test_predicted_turn_stays_within_commanded_rate_and_acceleration(
    told: list[tuple[float, float]], rate: float, time: float, acceleration: float
) -> None:
    ahead, lag = foretelling(0.1, acceleration)
    for when, turn in sorted(told):
        lag.add_command(when, turn)
    found = ahead.at(time, TurnState(0.0, rate, 0.0))
    assert abs(found.rate - rate) <= BRAKING_FACTOR * acceleration * time + 1e-9
    limits = [rate, *(turn for _, turn in told)]
    assert min(limits) - 1e-9 <= found.rate <= max(limits) + 1e-9
    assert abs(found.heading) <= max(map(abs, limits)) * time + 1e-9
    mirrored, other = foretelling(0.1, acceleration)
    for when, turn in sorted(told):
        other.add_command(when, -turn)
    assert mirrored.at(time, TurnState(0.0, -rate, 0.0)).heading == pytest.approx(-found.heading)


# --- how long it takes to begin --------------------------------------------------------------------------------------


def reports(true: float, *, hindered: bool = False) -> LagEstimator:
    """Let a base with a lag of ``true`` seconds be told to turn to and fro, and report 50 times a second for 3 s."""
    lag, acceleration = LagEstimator(0.1, 3.5), 3.5
    heading = rate = 0.0
    told = [(n * 0.05, 0.8 if n % 20 < 10 else -0.8) for n in range(60)]
    for n in range(150):
        now = n * 0.02
        for when, turn in told:
            if now - 0.02 < when <= now:
                lag.add_command(when, turn)
        goal = next((turn for when, turn in reversed(told) if when <= now - true), 0.0)
        before, rate = rate, ramp(rate, goal, acceleration * 0.02)
        held = hindered and 40 < n < 60
        heading += 0.0 if held else (before + rate) / 2 * 0.02
        lag.learn(TurnState(heading, 0.0 if held else rate, now))
    return lag


def test_the_lag_of_a_base_is_learnt_within_3_s_also_where_something_holds_the_base_for_a_while() -> None:
    for true in (0.0, 0.1, 0.2, 0.3):
        for hindered in (False, True):
            found = reports(true, hindered=hindered)
            assert found.seconds == pytest.approx(true, abs=0.03), (true, hindered)
            assert found.spread < 0.02


def test_lag_is_not_learnt_without_a_turn() -> None:
    lag = LagEstimator(0.15, 3.5)
    for n in range(100):
        lag.add_command(n * 0.02, 0.0)
        lag.learn(TurnState(0.0, 0.0, n * 0.02))
    assert lag.seconds == 0.15


def test_lag_is_not_learnt_from_unreported_states() -> None:
    lag = LagEstimator(0.15, 3.5)
    for n in range(100):
        lag.add_command(n * 0.02, 0.8 if n % 40 < 20 else -0.8)
        lag.learn(TurnState(0.0, 0.0, n * 0.02, reported=False))
    assert lag.seconds == 0.15


def test_ramp_brakes_harder_than_it_accelerates() -> None:
    assert ramp(1.0, 2.0, 0.1) == pytest.approx(1.1)
    assert ramp(1.0, -1.0, 0.1) == pytest.approx(1.0 - 0.1 * BRAKING_FACTOR)
    assert ramp(1.0, 0.95, 0.1) == pytest.approx(0.95)
