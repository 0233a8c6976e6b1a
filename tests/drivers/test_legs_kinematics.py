"""The kinematics of a humanoid: forward against closed-form inverse, against differences, and against its mirror."""

from pathlib import Path

import numpy as np
import pytest

from drivers.legs.body import SIDES, Floats, LeggedBody, Side, body_of
from drivers.legs.declared import LegsKeys
from drivers.legs.gait_check import clearance
from drivers.legs.kinematics import centre_jacobian, centre_of_mass, forward_kinematics, jacobian, sole_pose
from drivers.legs.leg_ik import UNREACHABLE_REASONS, solve_leg
from missions.library.drivers import load_robot
from tests.tries import tries

ROBOTS = Path(__file__).parents[2] / "config" / "robots"


def described(name: str) -> tuple[LeggedBody, Floats, Floats]:
    """Return the body of a shipped robot, with the lower and the upper limits of its joints."""
    robot = load_robot(ROBOTS / f"{name}.yaml")
    keys = robot.keys(LegsKeys)
    assert keys is not None
    assert robot.arm is not None
    body = body_of(keys.body)
    reach = [robot.arm.ranges[joint] for joint in body.joints]
    return body, np.array([low for low, _ in reach]), np.array([high for _, high in reach])


@pytest.mark.parametrize("name", ["humanoid", "op3"])
@pytest.mark.parametrize("side", SIDES)
def test_the_inverse_leads_back_to_the_foot_of_any_pose(name: str, side: Side) -> None:
    body, low, high = described(name)
    q = np.random.default_rng(1).uniform(low, high, (tries(4000, most=20_000), len(low)))
    place, turned = sole_pose(body, forward_kinematics(body, q), side)
    found = solve_leg(body, side, place, turned)
    again = q.copy()
    again[:, list(body.legs[side].joints)] = found.angles
    there, rotation = sole_pose(body, forward_kinematics(body, again[found.is_reachable]), side)
    assert np.abs(there - place[found.is_reachable]).max() < 1e-9
    assert np.abs(rotation - turned[found.is_reachable]).max() < 1e-9
    assert found.is_reachable.mean() > 0.999  # OP3's hip is 0.1 mm off: upside down, a stretched leg is too short


@pytest.mark.parametrize("name", ["humanoid", "op3"])
def test_inverse_kinematics_recovers_the_joint_angles(name: str) -> None:
    body, low, high = described(name)
    middle = np.radians(20)
    for side in SIDES:
        leg = list(body.legs[side].joints)
        q = np.zeros((5000, len(low)))
        q[:, leg] = np.random.default_rng(2).uniform(np.maximum(low, -middle), np.minimum(high, middle), q.shape)[
            :, leg
        ]
        knee = leg[3]
        q[:, knee] = np.sign(high[knee] + low[knee]) * np.random.default_rng(3).uniform(0.2, 1.5, 5000)
        found = solve_leg(body, side, *sole_pose(body, forward_kinematics(body, q), side))
        assert np.abs(found.angles - q[:, leg]).max() < 1e-9


SIDEWAYS = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""A foot whose sole looks to the left."""


@pytest.mark.parametrize(
    ("name", "ankle", "turned", "why"),
    [
        ("humanoid", (0.0, 0.055, -0.5), np.eye(3), "too far"),
        ("op3", (0.0001, 0.035, -0.02855), np.eye(3), "too near to the hip"),
        ("humanoid", (0.0, 0.055, 0.0), np.eye(3), "too near to the axis"),
        ("humanoid", (np.nan, 0.055, -0.4), np.eye(3), "not a finite"),
        ("humanoid", (0.0, 0.3, 0.0), SIDEWAYS, "undetermined"),
    ],
)
def test_unreachable_foot_is_refused_with_a_reason(
    name: str, ankle: tuple[float, ...], turned: Floats, why: str
) -> None:
    body, _, _ = described(name)
    leg = body.legs["left"]
    last = leg.joints[-1]
    meeting = np.array([-body.offset[last][0], 0.0, 0.0])  # of the ankle's axes, from the last joint
    found = solve_leg(body, "left", np.array(ankle) + turned @ (leg.sole - meeting), turned)
    assert not found.is_reachable
    assert why in UNREACHABLE_REASONS[int(found.reason)]
    assert np.isnan(found.angles).all()


@pytest.mark.parametrize("name", ["humanoid", "op3"])
def test_mirrored_pose_has_mirrored_kinematics(name: str) -> None:
    body, low, high = described(name)
    q = np.random.default_rng(4).uniform(low, high, (100, len(low)))
    here, image = forward_kinematics(body, q), forward_kinematics(body, body.mirror(q))
    flip = np.array([1.0, -1.0, 1.0])
    assert np.allclose(sole_pose(body, image, "right")[0], flip * sole_pose(body, here, "left")[0], atol=1e-12)
    assert np.allclose(centre_of_mass(body, image), flip * centre_of_mass(body, here), atol=1e-12)
    assert np.array_equal(body.mirror(body.mirror(q)), q)


@pytest.mark.parametrize("name", ["humanoid", "op3"])
def test_the_jacobians_are_the_derivatives(name: str) -> None:
    body, low, high = described(name)
    q = np.random.default_rng(5).uniform(low, high, (5, len(low)))
    link, point, step = body.legs["left"].joints[-1], np.array([0.02, 0.01, -0.05]), 1e-6
    placed = forward_kinematics(body, q)
    moves, masses = jacobian(body, placed, link, point), centre_jacobian(body, placed)
    for joint in range(len(low)):
        nudge = np.zeros(len(low))
        nudge[joint] = step
        ahead, behind = forward_kinematics(body, q + nudge), forward_kinematics(body, q - nudge)
        way = [each.position[:, link] + each.rotation[:, link] @ point for each in (ahead, behind)]
        assert np.allclose(moves[:, :3, joint], (way[0] - way[1]) / (2 * step), atol=1e-8)
        drift = (centre_of_mass(body, ahead) - centre_of_mass(body, behind)) / (2 * step)
        assert np.allclose(masses[:, :, joint], drift, atol=1e-8)


def test_op3_mass_and_stance_match_its_model() -> None:
    body, _, _ = described("op3")
    assert body.total_mass == pytest.approx(3.147, abs=1e-3)
    place, turned = sole_pose(body, forward_kinematics(body, np.zeros(20)), "left")
    assert place == pytest.approx([0.0, 0.048, -0.27915], abs=1e-9)
    assert np.allclose(turned, np.eye(3))


@pytest.mark.parametrize("name", ["humanoid", "op3"])
def test_standing_body_is_collision_free_and_crossed_legs_are_not(name: str) -> None:
    body, _, _ = described(name)
    gaps, names = clearance(body, forward_kinematics(body, np.zeros(len(body.joints))))
    assert gaps.min() > 0, names[int(gaps.argmin())]
    crossed = np.zeros(len(body.joints))
    for side in SIDES:
        roll = body.legs[side].joints[1]
        crossed[roll] = -0.35 * body.axis[roll, 0] * (1 if side == "left" else -1)
    assert clearance(body, forward_kinematics(body, crossed))[0].min() < 0
