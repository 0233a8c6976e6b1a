"""What ships for the humanoid: movements that its joints can follow, and steps that make sense as steps."""

from itertools import pairwise
from math import cos, degrees, radians

import pytest

from config.library import shipped_files
from drivers.api.sections import ArmKeys
from missions.library.drivers import load_robot
from missions.library.moves.load import load_move


def humanoid() -> ArmKeys:
    arm = load_robot(shipped_files("robots")["humanoid"]).arm
    assert arm is not None
    return arm


def gait() -> list[tuple[float, dict[str, float]]]:
    """Return every keyframe with all joints of the legs, in degrees."""
    poses: list[tuple[float, dict[str, float]]] = [(0.0, dict.fromkeys(humanoid().groups["legs"], 0.0))]
    for frame in load_move(shipped_files("gestures")["gait"], arm=humanoid()).keyframes:
        poses.append((frame.time, poses[-1][1] | {joint: degrees(angle) for joint, angle in frame.positions.items()}))
    return poses


@pytest.mark.parametrize("name", ["gait", "wave"])
def test_humanoid_gestures_stay_within_the_joint_speeds(name: str) -> None:
    arm = humanoid()
    before: dict[str, tuple[float, float]] = {}
    last = 0.0
    for frame in load_move(shipped_files("gestures")[name], arm=arm).keyframes:
        for joint, angle in frame.positions.items():
            _, was = before.get(joint, (0.0, 0.0))
            assert 1.875 * abs(angle - was) <= arm.limits[joint].speed * (frame.time - last), f"{joint} at {frame.time}"
            before[joint] = (frame.time, angle)
        last = frame.time
    assert all(angle == 0.0 for _, angle in before.values())


def test_the_soles_stay_level_and_a_foot_goes_straight_up() -> None:
    for _, pose in gait():
        for side in ("left", "right"):
            assert pose[f"{side}_ankle_pitch"] == pytest.approx(pose[f"{side}_knee"] - pose[f"{side}_hip_pitch"])
            assert pose[f"{side}_ankle_roll"] == pytest.approx(-pose[f"{side}_hip_roll"])
            assert pose[f"{side}_knee"] == pytest.approx(2 * pose[f"{side}_hip_pitch"])


def test_humanoid_leans_over_the_standing_foot_and_lifts_the_other() -> None:
    lifted = []
    for _, pose in gait():
        higher = [side for side in ("left", "right") if pose[f"{side}_knee"] > 41]
        assert len(higher) <= 1
        if higher:
            (up,), down = higher, "left" if higher == ["right"] else "right"
            assert pose[f"{up}_hip_roll"] > 5
            assert pose[f"{down}_hip_roll"] < -5
            lifted.append(up)
    assert lifted == ["right", "left", "right", "left"]


def test_humanoid_hip_rolls_are_opposite_and_feet_do_not_slide() -> None:
    for (_, was), (_, now) in pairwise(gait()):
        assert now["left_hip_roll"] == pytest.approx(-now["right_hip_roll"])
        swaying = now["left_hip_roll"] != was["left_hip_roll"]
        stepping = now["left_knee"] != was["left_knee"] or now["right_knee"] != was["right_knee"]
        assert swaying != stepping


def test_a_step_is_high_enough_to_be_seen() -> None:
    lengths = [2 * 0.17 * cos(radians(pose["left_hip_pitch"])) for _, pose in gait()]
    assert max(lengths) - min(lengths) > 0.05
