"""The filter of one angle."""

from math import pi, radians

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perception.geometry import wrap_angle
from perception.tracks import INITIAL_NOISE, AngleFilter


@given(st.floats(-1, 1), st.lists(st.floats(0.01, 0.3), min_size=20, max_size=40))
def test_a_steady_rate_is_learnt_at_any_frame_times(rate: float, gaps: list[float]) -> None:
    motion, time = AngleFilter(0.0), 0.0
    for gap in gaps:
        time += gap
        motion.update(rate * time, gap)
    assert motion.rate == pytest.approx(rate, abs=0.05)
    assert motion.angle == pytest.approx(rate * time, abs=0.02)


def test_noise_is_smoothed() -> None:
    rng = np.random.default_rng(3)
    motion, errors = AngleFilter(0.0), []
    for noise in rng.normal(0, INITIAL_NOISE, 400):
        motion.update(float(noise), 0.05)
        errors.append(motion.angle)
    assert np.std(errors[50:]) < 0.9 * INITIAL_NOISE


def test_reversed_motion_is_followed_within_half_a_second() -> None:
    motion, angle = AngleFilter(0.0), 0.0
    for step in range(60):
        angle += radians(20) * 0.05 * (1 if step < 50 else -1)
        motion.update(angle, 0.05)
    assert motion.rate == pytest.approx(-radians(20), abs=radians(3))


def test_jump_gives_no_rate_but_continued_motion_does() -> None:
    motion = AngleFilter(0.0)
    for angle in (0.0, 0.0, 12.0, 12.0, 12.0):
        motion.update(radians(angle), 0.05)
        assert abs(motion.rate) < radians(2)
    assert motion.angle == pytest.approx(radians(12))
    for step in range(1, 6):
        motion.update(radians(12 + 6 * step), 0.05)
    assert motion.rate == pytest.approx(radians(120), abs=radians(10))


def test_an_angle_past_half_a_turn_does_not_jump() -> None:
    motion = AngleFilter(pi - 0.02)
    for step in range(1, 40):
        motion.update(wrap_angle(pi - 0.02 + 0.01 * step), 0.05)
    assert motion.angle == pytest.approx(pi - 0.02 + 0.39, abs=0.01)
    assert motion.rate == pytest.approx(0.2, abs=0.02)


def test_two_measurements_at_one_time_are_averaged() -> None:
    motion = AngleFilter(0.0)
    motion.update(0.01, 0.0)
    assert motion.angle == pytest.approx(0.005)
    assert motion.rate == 0


def test_a_measurement_from_the_past_is_refused() -> None:
    with pytest.raises(ValueError, match="time stamps go back"):
        AngleFilter(0.0).update(0.0, -0.1)


@pytest.mark.parametrize(("noise", "turned", "known"), [(0.05, 0.0, True), (0.6, 0.0, False), (0.05, 3.0, False)])
def test_start_of_a_walk_is_known_if_the_picture_is_exact(noise: float, turned: float, known: bool) -> None:
    motion = AngleFilter(0.0)
    for n in range(40):
        motion.update(radians(noise) * (-1) ** n, 0.05)
    motion.update(radians(1), 0.05, radians(turned))
    assert (motion.rate > radians(15)) is known
