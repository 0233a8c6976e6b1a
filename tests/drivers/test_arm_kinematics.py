"""Inverse kinematics of arms: every solution leads to the hand, and one of them is the pose that it was made of."""

import numpy as np
import pytest

from drivers.errors import BadRequest
from drivers.legs.arm_ik import ARM_REASONS, hand, solve_arm, within
from drivers.legs.body import SIDES, Side, body_of
from drivers.legs.declared import LegsKeys
from drivers.legs.kinematics import forward
from drivers.legs.leg_ik import SLACK
from missions.library.drivers import robot_named
from tests.drivers.test_legs_kinematics import described
from tests.tries import tries

MANY = tries(2500, most=25_000)
"""Poses of each of four arms."""


@pytest.mark.parametrize("name", ["humanoid", "op3"])
@pytest.mark.parametrize("side", SIDES)
def test_every_solution_leads_back_to_the_hand_of_any_pose(name: str, side: Side) -> None:
    body, low, high = described(name)
    arm = list(body.arms[side])
    q = np.zeros((MANY, len(low)))
    q[:, arm] = np.random.default_rng(7).uniform(low[arm], high[arm], (MANY, len(arm)))
    place = hand(body, forward(body, q), side)
    found = solve_arm(body, side, place, q[:, arm[2]])
    off = np.abs(np.exp(1j * found.angles) - np.exp(1j * q[:, None, arm])).max(axis=-1)
    assert np.nanmin(off, axis=1).max() < 1e-5  # stretched, an elbow is known to the root of what places are
    kept = within(found, low[arm] - 1e-6, high[arm] + 1e-6)
    assert kept.reachable.all()
    for angles in np.moveaxis(found.angles, 1, 0):
        there = np.isfinite(angles).all(axis=1)
        again = q[there]
        again[:, arm] = angles[there]
        assert np.abs(hand(body, forward(body, again), side) - place[there]).max() < 1e-9


@pytest.mark.parametrize(
    ("name", "place", "why"),
    [
        ("humanoid", (0.3, 0.15, 0.3), "too far from the shoulder"),
        ("humanoid", (0.0, 0.15, 0.3), "too near to the shoulder"),
        ("humanoid", (0.0, 0.35, 0.3), "lies on an axis"),
        ("humanoid", (np.nan, 0.0, 0.0), "not a finite"),
        ("humanoid", (0.0, 0.35, 0.31), "too near to the axis"),
        ("op3", (-0.001, 0.15, 0.111), "lies on an axis"),
        ("op3", (0.0, 0.5, 0.3), "too far from the shoulder"),
        ("op3", (-0.001, 0.0885, 0.102), "too near to the shoulder"),
    ],
)
def test_a_place_that_no_hand_can_have_is_refused_with_the_reason(
    name: str, place: tuple[float, float, float], why: str
) -> None:
    body, low, high = described(name)
    arm = list(body.arms["left"])
    found = within(solve_arm(body, "left", np.array(place)), low[arm], high[arm])
    assert why in ARM_REASONS[int(found.reason)]
    assert np.isnan(found.angles).all()


def test_a_hand_by_a_hair_too_near_to_the_axis_has_angles_that_are_numbers() -> None:
    body, _, _ = described("op3")
    pitch, roll, elbow = body.arms["left"]
    body.offset[roll][0] = 0.02  # which no arm of ours has: the hand keeps that far from the pitch axis
    out = 0.02 + body.offset[elbow][0] + body.end[elbow][0]
    near = body.offset[pitch] + np.array([out - SLACK / 2, 0.15, 0.0])
    found = solve_arm(body, "left", near)
    assert found.reachable.any()
    assert np.isfinite(found.angles[found.reachable]).all()


@pytest.mark.parametrize("twist", [np.nan, np.inf])
def test_a_twist_that_is_no_number_is_refused(twist: float) -> None:
    body, _, _ = described("humanoid")
    places = np.array([[-0.2, 0.15, 0.3], [-0.2, 0.15, 0.3]])
    found = solve_arm(body, "left", places, np.array([twist, 0.0]))
    assert {ARM_REASONS[reason] for reason in found.reason[0]} == {"not a finite place, or twist"}
    assert found.reachable[1].any()


def test_a_place_that_only_joints_beyond_their_limits_reach_is_told_so() -> None:
    body, low, high = described("humanoid")
    arm = list(body.arms["left"])
    behind = solve_arm(body, "left", np.array([-0.2, 0.15, 0.3]))
    assert behind.reachable.any()
    assert "beyond its limits" in ARM_REASONS[int(within(behind, low[arm], high[arm]).reason)]


def test_an_arm_without_a_closed_form_is_named_with_its_axes() -> None:
    keys = robot_named("humanoid").keys(LegsKeys)
    assert keys is not None
    body = body_of(keys.body)
    body.axis[body.index["left_elbow"]] = [1.0, 0.0, 0.0]
    with pytest.raises(BadRequest, match=r"left_elbow \(x\) has no angles in closed form"):
        solve_arm(body, "left", np.zeros(3))
