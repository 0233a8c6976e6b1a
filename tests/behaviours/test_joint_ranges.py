"""What an arm has: names, groups and limits, and every mistake with them in one go."""

import math

import pytest

from behaviours.joint_ranges import JointRanges
from drivers.api import JointLimits
from drivers.errors import BadRequest

REACH = JointRanges(
    {name: JointLimits(-1.0, 1.0, speed=2.0) for name in ("left_elbow", "left_wrist", "right_elbow", "neck")},
    {"left_arm": ("left_elbow", "left_wrist"), "elbows": ("left_elbow", "right_elbow")},
)


def test_no_name_means_all_joints_in_the_order_of_the_robot_file() -> None:
    assert REACH.resolve(()) == ("left_elbow", "left_wrist", "right_elbow", "neck")


def test_groups_are_spelt_out_and_each_joint_comes_once() -> None:
    assert REACH.resolve(("neck", "left_arm", "elbows")) == ("neck", "left_elbow", "left_wrist", "right_elbow")


def test_unknown_joint_names_are_reported_with_suggestions() -> None:
    with pytest.raises(BadRequest) as caught:
        REACH.resolve(("left_arms", "neck", "tail"))
    assert str(caught.value) == (
        "the arm has no joint or group 'left_arms' (did you mean 'left_arm'?); the arm has no joint or group 'tail'"
    )


def test_a_group_is_no_joint() -> None:
    assert REACH.missing_joints(("neck", "left_arm")) == [
        "'left_arm' is a group of joints, and here each needs its own angle"
    ]


def test_limit_violations_are_reported_once_per_joint() -> None:
    poses = [{"neck": 1.0}, {"neck": 1.5, "left_elbow": -2.0}, {"neck": 9.0, "nek": 0.0}]
    assert REACH.limit_violations(poses) == [
        "the arm has no joint 'nek' (did you mean 'neck'?)",
        "neck at 85.9 deg is outside its limits (-57.3 deg to 57.3 deg)",
        "left_elbow at -114.6 deg is outside its limits (-57.3 deg to 57.3 deg)",
    ]


def test_nan_angle_is_a_limit_violation() -> None:
    assert REACH.limit_violations([{"neck": math.nan}]) == [
        "neck at nan deg is outside its limits (-57.3 deg to 57.3 deg)"
    ]


def test_speed_violations_are_reported() -> None:
    assert REACH.speed_violations({"neck": 2.0, "left_wrist": 3.0}) == [
        "left_wrist at 171.9 deg/s exceeds its maximum speed (114.6 deg/s)"
    ]


def test_partly_similar_joint_names_are_not_suggested() -> None:
    reach = JointRanges({"elbow": JointLimits(-1.0, 1.0, 1.0), "shoulder_lift": JointLimits(-1.0, 1.0, 1.0)})
    assert reach.missing_joints(["right_elbow", "right_shoulder_roll"]) == [
        "the arm has no joints 'right_elbow', 'right_shoulder_roll'",
    ]
