"""Foresight: what a target does is foretold as well as it could be so far, and no wilder."""

from collections.abc import Callable
from math import cos, degrees, pi, radians, sin, sqrt

import pytest

from behaviours.tracking.motion_prediction import MotionPredictor

AHEAD = 0.15
ABLE = 7.0


def error(path: Callable[[float], float], rate: Callable[[float], float], *, seconds: float = 6.0) -> float:
    """Return by how much (degrees RMS) a target is foretold wrongly in the last two seconds."""
    foresight, off = MotionPredictor(ABLE), []
    for n in range(int(seconds * 20)):
        time = n / 20
        angle, _ = foresight.predict(time, path(time), rate(time), AHEAD)
        if time > seconds - 2:
            off.append((angle - path(time + AHEAD)) ** 2)
    return degrees(sqrt(sum(off) / len(off)))


def test_steady_walk_is_predicted_exactly() -> None:
    foresight = MotionPredictor(ABLE)
    for n in range(40):
        found = foresight.predict(n / 20, 0.3 * n / 20, 0.3, AHEAD)
        assert found == pytest.approx((0.3 * (n / 20 + AHEAD), 0.3), abs=radians(0.5))


def test_slow_swing_is_predicted_better_than_by_a_straight_line() -> None:
    amplitude, omega = radians(10), pi  # once in 2 s
    found = error(lambda t: amplitude * sin(omega * t), lambda t: amplitude * omega * cos(omega * t))
    straight = degrees(amplitude) / sqrt(2) * (omega * AHEAD) ** 2 / 2
    assert found < 0.6 * straight


def test_a_swing_too_fast_for_anything_is_not_followed() -> None:
    amplitude, omega = radians(10), 8 * pi  # once in 0.25 s
    foresight = MotionPredictor(ABLE)
    angles = [
        foresight.predict(n / 20, amplitude * sin(omega * n / 20), amplitude * omega * cos(omega * n / 20), AHEAD)[0]
        for n in range(120)
    ]
    assert max(map(abs, angles[80:])) < radians(3)


@pytest.mark.parametrize("period", [0.25, 0.4, 0.5])
@pytest.mark.parametrize("able", [3.5, 7.0])
def test_too_fast_swing_is_predicted_at_its_middle(period: float, able: float) -> None:
    foresight, omega = MotionPredictor(able), 2 * pi / period
    for n in range(120):
        time, noise = n / 20, radians(0.2) * sin(97.0 * n)
        angle, rate = foresight.predict(time, radians(5 + 10 * sin(omega * time)) + noise, cos(omega * time), AHEAD)
        if time > 3:
            assert degrees(angle) == pytest.approx(5.0, abs=0.6)
            assert degrees(rate) == pytest.approx(0.0, abs=0.1)


def test_walk_is_predicted_soon_after_standing_or_jumping() -> None:
    for before in (0.0, 12.0):  # degrees; a second before the walk
        foresight, angle, rate = MotionPredictor(ABLE), 0.0, 0.0
        for n in range(87):
            place = before if n < 60 else max(0.0, 20 * (n - 80) / 20)
            going = 20.0 if n > 81 else 0.0  # the filter knows the rate a picture later
            angle, rate = foresight.predict(n / 20, radians(place), radians(going), AHEAD)
        assert degrees(angle) == pytest.approx(20 * (6 / 20 + AHEAD), abs=1.0)
        assert degrees(rate) == pytest.approx(20.0, abs=5.0)


def test_rate_noise_of_a_steady_walk_is_smoothed() -> None:
    noise = [radians(8) * (-1) ** n for n in range(200)]
    found = error(lambda t: 0.35 * t, lambda t: 0.35 + noise[round(t * 20)])
    assert found < degrees(radians(8) * AHEAD) * 0.7


def test_single_jump_does_not_disturb_the_prediction() -> None:
    foresight = MotionPredictor(ABLE)
    for n in range(60):
        angle = foresight.predict(n / 20, 0.0 if n < 40 else 0.4, 0.0, AHEAD)[0]
    assert angle == pytest.approx(0.4, abs=radians(0.5))


def test_the_same_picture_seen_twice_counts_once() -> None:
    once, twice = MotionPredictor(ABLE), MotionPredictor(ABLE)
    for n in range(60):
        seen = (n / 20, 0.2 * sin(n / 5), 0.4 * cos(n / 5), AHEAD)
        first = once.predict(*seen)
        twice.predict(*seen)
        assert twice.predict(*seen) == first


def test_predictor_restarts_after_a_long_absence() -> None:
    foresight = MotionPredictor(ABLE)
    for n in range(60):
        foresight.predict(n / 20, 0.2 * sin(n), 0.0, AHEAD)
    assert foresight.predict(60.0, 1.0, 0.1, AHEAD) == pytest.approx((1.0 + 0.1 * AHEAD, 0.1), abs=radians(0.5))


def test_walk_after_jumps_is_trusted_unless_the_camera_turned() -> None:
    rates = {}
    for camera in ((0.0, 0.0), (0.0, radians(3)), (radians(3), 0.0)):
        foresight, rate = MotionPredictor(ABLE), 0.0
        for n in range(63):  # what was foretold of a target that jumped was wrong; then it stood for 1 s, and walks
            place, going = ((-1) ** (n // 4), 20.0 * (-1) ** (n // 4)) if n < 40 else (max(0.0, n - 59), 0.0)
            going = 20.0 if n >= 60 else going
            _, rate = foresight.predict(
                n / 20, radians(place), radians(going), AHEAD, camera if n == 60 else (0.0, 0.0)
            )
        rates[camera] = degrees(rate)
    trusted, *distrusted = rates.values()
    assert trusted == pytest.approx(20.0, abs=6.0)
    assert max(distrusted) < trusted - 3.0
