"""Whether a body falls: told by its capture point before it lies; without an IMU, by knees that bear nothing."""

from random import Random

import numpy as np
import pytest

from drivers.api import JointState
from drivers.legs.actions import make_posture
from drivers.legs.compensation import static_torques
from drivers.legs.engine import CONTROL_INTERVAL, AttitudeEstimate, WalkingEngine
from drivers.legs.fall_detection import FALLEN_LEAN, FallDetector
from tests.drivers.test_balance import engine

__all__ = ["engine"]

STALL = 10.0
"""Nm of the servos that tell the loads."""


class Standing:
    """A body in its stand, whose joints tell what they bear, with noise; time passes in turns of the driver."""

    def __init__(self, engine: WalkingEngine) -> None:
        self.falls, self.now, self.angles = FallDetector(engine), 0.0, engine.ready_angles
        self.held = static_torques(engine.body, make_posture(engine.body, engine.ready_angles, (True, True)))
        self.places, self.chance = engine.body.leg_indices, Random(1)  # noqa: S311 - noise, not a secret

    def feel(self, seconds: float, felt: AttitudeEstimate, *, afoot: bool = True) -> bool:
        return self._pass(seconds, felt, 0.0, afoot=afoot)

    def bear(self, seconds: float, share: float, *, torque: bool = True) -> bool:
        return self._pass(seconds, None, share, torque=torque)

    def _pass(
        self, seconds: float, felt: AttitudeEstimate | None, share: float, *, afoot: bool = True, torque: bool = True
    ) -> bool:
        for _ in range(round(seconds / CONTROL_INTERVAL)):
            self.now += CONTROL_INTERVAL
            loads = share * self.held[self.places] / STALL
            states = [
                JointState(angle, 0.0, angle, load + self.chance.gauss(0, 0.02), 12.0, 30.0, False, torque)
                for angle, load in zip(self.angles.tolist(), loads.tolist(), strict=True)
            ]
            self.falls.update(felt, states, self.now, legs_led=afoot)
        return self.falls.fallen


@pytest.fixture
def body(engine: WalkingEngine) -> Standing:
    return Standing(engine)


def test_fall_is_detected_before_the_body_leans_far(body: Standing) -> None:
    assert not body.feel(1.0, AttitudeEstimate(0.03, 0.05, 0.2, 0.2))
    lean = 0.05
    while not body.feel(CONTROL_INTERVAL, AttitudeEstimate(0.0, lean, 0.0, 3 * lean)):
        lean += 3 * lean * CONTROL_INTERVAL
    assert lean < FALLEN_LEAN / 2


def test_a_jerk_of_a_landing_foot_is_no_fall(body: Standing) -> None:
    for _ in range(20):
        assert not body.feel(0.03, AttitudeEstimate(0.1, 0.1, 2.0, 0.0))
        assert not body.feel(0.03, AttitudeEstimate(0.1, 0.1))


def test_sitting_body_may_lean_until_it_lies(body: Standing) -> None:
    assert not body.feel(1.0, AttitudeEstimate(0.0, 0.6), afoot=False)
    assert body.feel(CONTROL_INTERVAL, AttitudeEstimate(0.0, FALLEN_LEAN + 0.01), afoot=False)


def test_raised_body_stands_again(body: Standing) -> None:
    assert body.feel(0.5, AttitudeEstimate(1.4, 0.0))
    assert body.feel(0.4, AttitudeEstimate(0.0, 0.0))
    assert not body.feel(0.2, AttitudeEstimate(0.0, 0.0))


def test_unloaded_legs_count_as_fallen_until_loaded_again(body: Standing) -> None:
    assert not body.bear(5.0, 1.0)
    assert not body.bear(1.0, 0.0)  # a jump is no fall
    assert not body.bear(2.0, 0.6)
    assert body.bear(4.0, 0.05)
    assert body.falls.lean is None
    assert not body.bear(4.0, 1.0)


@pytest.mark.parametrize("seed", range(2))
def test_never_loaded_legs_detect_no_fall(body: Standing, seed: int) -> None:
    body.chance.seed(seed)
    assert not body.bear(15.0, 0.0)  # it hangs in a frame, or its servos are virtual


def test_vanishing_knee_friction_is_not_a_fall(body: Standing) -> None:
    assert not body.bear(5.0, 0.3)  # 0.05 of each, while they bend in a frame
    assert not body.bear(5.0, 0.0)


def test_limp_legs_and_straight_knees_detect_no_fall(body: Standing) -> None:
    assert not body.bear(3.0, 1.0)
    assert not body.bear(5.0, 0.0, torque=False)
    body.angles = np.zeros(12)
    assert not body.bear(5.0, 0.0)
