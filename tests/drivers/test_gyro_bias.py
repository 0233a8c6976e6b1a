"""The bias of a gyro: learnt at rest, never from a turn."""

from math import radians
from random import Random

import pytest

from drivers.base.gyro_bias import MAX_BIAS_CHANGE, MAX_SETTLING_TIME, RELEARN_AFTER, GyroBias

PERIOD = 0.02


def pass_time(bias: GyroBias, rate: float, seconds: float, *, still: bool, noise: float = 0.0) -> float:
    """Let a gyro measure ``rate`` for so long; return by how much it has turned without the bias."""
    chance, turned = Random(1), 0.0  # noqa: S311 - noise is no secret
    for _ in range(round(seconds / PERIOD)):
        measured = rate + chance.gauss(0.0, noise)
        turned += bias.correct(measured * PERIOD, measured, PERIOD, still=still)[0]
    return turned


@pytest.mark.parametrize("drift", [0.0, 0.6, -2.0, 5.0])
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_bias_is_learnt_at_rest_and_taken_off_a_turn(drift: float, noise: float) -> None:
    bias = GyroBias()
    pass_time(bias, radians(drift), 2.0, still=True, noise=noise)
    assert bias.rate == pytest.approx(radians(drift), abs=0.003)
    assert pass_time(bias, radians(drift) + 0.5, 2.0, still=False) == pytest.approx(1.0, abs=0.01)


def test_a_slow_turn_teaches_nothing() -> None:
    bias = GyroBias()
    assert pass_time(bias, radians(2.0), 10.0, still=False) == pytest.approx(radians(20.0))
    assert bias.rate == 0.0


def test_lifted_and_turned_base_is_followed_without_encoder_motion() -> None:
    bias = GyroBias()
    assert pass_time(bias, 2 * MAX_BIAS_CHANGE, 1.0, still=True) == pytest.approx(2 * MAX_BIAS_CHANGE)
    assert bias.rate == 0.0


def test_changing_rate_without_encoders_is_not_a_bias() -> None:
    bias = GyroBias(encoders=False)
    for step in range(50):
        bias.correct(0.05 * (step % 2) * PERIOD, 0.05 * (step % 2), PERIOD, still=True)
    assert bias.rate == 0.0


def test_gyro_settles_once_and_only_with_drift() -> None:
    steady, drifting = GyroBias(), GyroBias()
    pass_time(steady, 0.0, PERIOD, still=True)
    assert not steady.settling
    pass_time(drifting, radians(3.0), PERIOD, still=True)
    assert drifting.settling
    pass_time(drifting, radians(3.0), 1.0, still=True)
    assert not drifting.settling


@pytest.mark.parametrize("drift", [0.015, -0.05])
def test_bias_is_learnt_from_paired_messages(drift: float) -> None:
    bias = GyroBias(encoders=False)
    for step in range(100):
        bias.correct(drift * PERIOD, drift, 0.006 if step % 2 else 2 * PERIOD - 0.006, still=True)
    assert not bias.settling
    assert bias.rate == pytest.approx(drift, rel=0.1)


@pytest.mark.parametrize("measured", [True, False])
def test_a_rounded_heading_teaches_the_bias(measured: bool) -> None:
    bias, drift, told = GyroBias(encoders=False), 0.015, 0.0
    for step in range(1, 300):
        before, told = told, round(drift * step * PERIOD, 3)
        turn = told - before
        corrected = bias.correct(turn, drift if measured else turn / PERIOD, PERIOD, still=True)
    assert not bias.settling
    assert bias.rate == pytest.approx(drift, abs=0.005)
    assert corrected == (0.0, 0.0), "a base at rest reports that it is"


@pytest.mark.parametrize("encoders", [True, False])
def test_settling_ends_although_the_bias_cannot_be_learnt(encoders: bool) -> None:
    bias, chance = GyroBias(encoders=encoders), Random(2)  # noqa: S311 - noise is no secret
    for _ in range(round(1.1 * MAX_SETTLING_TIME / PERIOD)):
        rate = chance.choice((-1.0, 1.0)) * chance.uniform(0.02, 0.11)
        bias.correct(rate * PERIOD, rate, PERIOD, still=True)
    assert not bias.settling


@pytest.mark.parametrize("rate", [0.05, -0.1])
def test_slow_turn_without_encoders_is_not_added_to_a_known_bias(rate: float) -> None:
    bias = GyroBias(encoders=False)
    pass_time(bias, 0.015, 10.0, still=True)
    assert pass_time(bias, rate + 0.015, 10.0, still=True) == pytest.approx(10.0 * rate, rel=0.02)
    assert bias.rate == pytest.approx(0.015, abs=0.001)
    assert bias.correct(rate * PERIOD, rate, PERIOD, still=True)[1] != 0.0, "it reports that it turns"


def test_permanently_changed_bias_is_learnt_again() -> None:
    bias = GyroBias(encoders=False)
    pass_time(bias, 0.0, 10.0, still=True)
    pass_time(bias, 0.05, RELEARN_AFTER + 2.0, still=True)
    assert bias.rate == pytest.approx(0.05, abs=0.002)


def test_slowly_changing_bias_is_followed() -> None:
    bias = GyroBias(encoders=False)
    for step in range(3000):
        rate = 0.001 * step * PERIOD
        bias.correct(rate * PERIOD, rate, PERIOD, still=True)
    assert bias.rate == pytest.approx(0.06, abs=0.005)
