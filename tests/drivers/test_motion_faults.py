"""Motion faults on all bases: none drives on for long, none hangs; and no base that obeys is stopped."""

import pytest

from behaviours.leaf import SUCCESS
from tests.drivers.motion_faults import BASES, FAULTS, MotionCase, draw, play
from tests.tries import tries


@pytest.mark.parametrize("seed", range(tries(40, most=500)))
def test_a_fault_stops_the_base_within_a_second_and_ends_the_motion(seed: int) -> None:
    ending = play(draw(seed, faulty=True))
    assert not ending.missed, ending


@pytest.mark.parametrize("seed", range(tries(40, most=500)))
def test_a_base_that_slips_climbs_or_reports_rarely_is_not_stopped(seed: int) -> None:
    ending = play(draw(seed, faulty=False))
    assert ending.status is SUCCESS, ending


def test_the_campaign_draws_every_base_and_every_fault() -> None:
    cases = [draw(seed, faulty=True) for seed in range(500)]
    assert {case.fault for case in cases} == set(FAULTS)
    assert {case.base for case in cases} == set(BASES)


@pytest.mark.parametrize("drift", [0.6, -3.0, 5.0])
@pytest.mark.parametrize("base", ["kobuki, twin", "kobuki, wire", "ros2, wire"])
def test_a_turn_ends_though_the_gyro_drifts(base: str, drift: float) -> None:
    ending = play(MotionCase(1, base, "turn", 0.0, 1.57, 1.0, fault="gyro drift", amount=drift * 0.01745))
    assert ending.status is SUCCESS, ending
    assert ending.beyond < 0.05


@pytest.mark.parametrize("base", ["kobuki, wire", "create3, wire", "rover with encoders, wire"])
@pytest.mark.parametrize("fault", ["blocked", "e-stop", "encoders lost", "reversed"])
def test_it_fails_and_says_why_within_two_seconds(base: str, fault: str) -> None:
    ending = play(MotionCase(1, base, "drive", 0.5, 0.0, 0.2, fault=fault))
    assert ending.seconds < 2.0
    assert ending.reason.startswith("commanded ")


def test_a_create3_that_backs_no_farther_fails_and_says_why_within_two_seconds() -> None:
    ending = play(MotionCase(1, "create3, wire", "drive", -0.3, 0.0, 0.2, fault="backup limit"))
    assert ending.seconds < 2.5
    assert "commanded -0.2 m/s" in ending.reason
