"""The bias of a gyro: learnt at rest, never from a turn."""

from math import radians
from random import Random

import pytest

from drivers.base.gyro_bias import GATE, GyroBias

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


def test_a_base_that_is_lifted_and_turned_is_followed_though_its_encoders_stand() -> None:
    bias = GyroBias()
    assert pass_time(bias, 2 * GATE, 1.0, still=True) == pytest.approx(2 * GATE)
    assert bias.rate == 0.0


def test_without_encoders_a_rate_that_changes_is_no_bias() -> None:
    bias = GyroBias(encoders=False)
    for step in range(50):
        bias.correct(0.05 * (step % 2) * PERIOD, 0.05 * (step % 2), PERIOD, still=True)
    assert bias.rate == 0.0


def test_it_settles_once_and_only_where_the_gyro_drifts() -> None:
    steady, drifting = GyroBias(), GyroBias()
    pass_time(steady, 0.0, PERIOD, still=True)
    assert not steady.settling
    pass_time(drifting, radians(3.0), PERIOD, still=True)
    assert drifting.settling
    pass_time(drifting, radians(3.0), 1.0, still=True)
    assert not drifting.settling
