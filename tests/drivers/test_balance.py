"""What a walk is helped by: goals that are set ahead of soft servos, and corrections for what is felt of the trunk."""

import numpy as np
import pytest

from drivers.legs.balance import BalanceController, BalanceGains
from drivers.legs.body import body_of
from drivers.legs.compensation import Compensation, static_torques
from drivers.legs.declared import LegsKeys
from drivers.legs.engine import AttitudeEstimate, LegPosture, WalkingEngine
from drivers.servos.models import MODELS, motor_physics
from missions.library.drivers import load_named_robot


@pytest.fixture(scope="module")
def engine() -> WalkingEngine:
    keys = load_named_robot("humanoid").keys(LegsKeys)
    assert keys is not None
    return WalkingEngine(body_of(keys.body), keys.stride)


def posture(engine: WalkingEngine) -> LegPosture:
    engine.reset()
    return engine.step()


def test_bent_knees_carry_the_body_and_torques_are_mirrored(engine: WalkingEngine) -> None:
    held = static_torques(engine.body, posture(engine))[engine.body.leg_indices].reshape(2, 6)
    thigh = 0.2 * np.sin(engine.ready_angles[3] / 2)
    above = engine.body.total_mass - 2 * (0.25 + 0.25 + 0.3)  # kg that both knees carry, without shanks and feet
    assert -held[0, 3] == pytest.approx(above * 9.81 / 2 * thigh, rel=0.25)
    assert np.abs(held[0] - held[1]).max() < 1e-6


def test_goals_compensate_for_servo_compliance_at_rest(engine: WalkingEngine) -> None:
    body, still = engine.body, posture(engine)
    motor = motor_physics(MODELS["EX-106+"])
    ahead = Compensation(body, dict.fromkeys(body.leg_joints, motor)).goals(still) - still.angles
    held = static_torques(body, still)[body.leg_indices]
    assert ahead == pytest.approx(held / motor.stiffness)


def test_forward_lean_is_countered_by_ankles_and_a_longer_step(engine: WalkingEngine) -> None:
    balance = BalanceController(engine.stride, engine.walker.manner.com_height, BalanceGains(step=0.8))
    upright = balance(AttitudeEstimate(0.0, 0.0), posture(engine))
    assert (upright.ankle, upright.step) == ((0.0, 0.0), (0.0, 0.0))
    ahead = balance(AttitudeEstimate(0.0, 0.1, 0.0, 0.5), posture(engine))
    assert ahead.ankle[1] > 0
    assert ahead.step[0] > 0
    right = balance(AttitudeEstimate(0.2, 0.0), posture(engine))
    assert right.step[1] < 0
    assert abs(right.ankle[0]) <= 0.1
