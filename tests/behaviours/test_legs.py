"""Leaves for legs beside walking: stand, sit, play a gait, get up, on the twin of a humanoid."""

from pathlib import Path

import pytest

from behaviours.run import DEAD_RECKONING_REASON
from config.diagnostics import InvalidFileError
from drivers.api import Attitude
from drivers.witmotion.twin import ImuTwin
from missions.request import RunRequest
from missions.runner import Runner

UPRIGHT = Attitude(0.0, 0.0, 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 9.8))
ON_ITS_FACE = Attitude(0.0, 1.5, 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 9.8))
ON_ITS_SIDE = Attitude(1.5, 0.1, 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 9.8))


def ordered(folder: Path, steps: str, robot: str = "humanoid") -> Runner:
    (folder / "m.yaml").write_text(f"mission: m\ntree:\n  sequence:\n{steps}")
    order = RunRequest(str(folder / "m.yaml"), robot=robot, simulate="fast", world="empty", eyes="truth")
    return Runner(order)


def ran(folder: Path, steps: str, robot: str = "humanoid") -> tuple[str, str]:
    result = ordered(folder, steps, robot).run()
    return result.result, result.reason


def lying(runner: Runner, found: Attitude, *, since: float, until: float) -> None:
    """Let the trunk lean so between two times: somebody throws it over, and it gets up."""
    twins = runner.twins
    assert twins is not None
    imu = twins.parts["imu"]
    assert isinstance(imu, ImuTwin)
    imu._measure = lambda now: found if since <= now < until else UPRIGHT  # type: ignore[method-assign]


UP = """
gesture: up
keyframes:
  - {at: 1 s, left_shoulder_pitch: 40 deg, right_shoulder_pitch: 40 deg, left_knee: 30 deg, right_knee: 30 deg}
  - {at: 2 s, left_shoulder_pitch: 0 deg, right_shoulder_pitch: 0 deg, left_knee: 0 deg, right_knee: 0 deg}
"""


def test_legs_sit_stand_and_walk_off_from_the_sit(tmp_path: Path) -> None:
    knee = "{joint: left_knee, angle: 108 deg, tolerance: 5 deg}"
    steps = f"    - stand:\n    - sit:\n    - joint_at: {knee}\n    - walk: 20 cm\n"
    assert ran(tmp_path, steps) == ("success", DEAD_RECKONING_REASON)


@pytest.mark.parametrize("act", ["stand:", "sit:", "play_gait: stroll"])
def test_base_on_wheels_refuses_leg_leaves(tmp_path: Path, act: str) -> None:
    with pytest.raises(InvalidFileError, match="has no legs"):
        ran(tmp_path, f"    - {act}\n", robot="turtlebot2")


def test_stand_fails_from_a_pose_far_from_the_stand(tmp_path: Path) -> None:
    chair = "{left_hip_pitch: 89 deg, right_hip_pitch: 89 deg, left_knee: 109 deg, right_knee: 109 deg}"
    result, reason = ran(tmp_path, f"    - move_joints: {{to: {chair}}}\n    - stand:\n")
    assert result == "failure"
    assert "from where a walk begins" in reason


def test_play_gait_runs_its_cycles_between_two_stands(tmp_path: Path) -> None:
    runner = ordered(tmp_path, "    - play_gait: {gait: stroll, cycles: 4}\n")
    result = runner.run()
    assert result.result == "success"
    assert runner.twins is not None
    state = runner.twins.parts["base"].state().value
    assert state.posture == "standing"
    assert runner.twins.pose().x == pytest.approx(3 * 0.12, abs=0.04)  # two steps of 60 mm a cycle, grown and shrunk


def test_halted_play_gait_ends_in_a_stand(tmp_path: Path) -> None:
    steps = "    - play_gait: stroll\n      timeout: 6 s\n"
    runner = ordered(tmp_path, steps)
    assert runner.run().result == "failure"
    assert runner.twins is not None
    assert runner.twins.parts["base"].state().value.posture == "standing"


def test_a_gait_out_of_reach_is_refused_with_the_joint_before_anything_moves(tmp_path: Path) -> None:
    (tmp_path / "leap.yaml").write_text("gait: leap\nwalk: {step: 60 mm, height: 455 mm}\n")
    result, reason = ran(tmp_path, f"    - play_gait: {tmp_path / 'leap.yaml'}\n")
    assert result == "failure"
    assert "leap: left_knee at" in reason


def test_get_up_from_the_front_enables_the_base(tmp_path: Path) -> None:
    (tmp_path / "up.yaml").write_text(UP)
    steps = f"    - wait: 2 s\n    - fallen:\n    - get_up: {{front: {tmp_path / 'up.yaml'}}}\n    - stand:\n"
    runner = ordered(tmp_path, steps)
    lying(runner, ON_ITS_FACE, since=1.0, until=4.0)
    result = runner.run()
    assert (result.result, result.reason) == ("success", "")


@pytest.mark.parametrize(
    ("found", "given", "why"),
    [
        (UPRIGHT, "front", "it has not fallen"),
        (ON_ITS_FACE, "back", "it lies on its face: give the movement `front`"),
        (ON_ITS_SIDE, "front", "it lies on its side"),
    ],
)
def test_get_up_fails_with_its_reason(tmp_path: Path, found: Attitude, given: str, why: str) -> None:
    (tmp_path / "up.yaml").write_text(UP)
    runner = ordered(tmp_path, f"    - wait: 2 s\n    - get_up: {{{given}: {tmp_path / 'up.yaml'}}}\n")
    lying(runner, found, since=1.0, until=9.0)
    result = runner.run()
    assert result.result == "failure"
    assert why in result.reason


def test_failed_get_up_leaves_the_base_latched(tmp_path: Path) -> None:
    (tmp_path / "up.yaml").write_text(UP)
    runner = ordered(tmp_path, f"    - wait: 2 s\n    - get_up: {{front: {tmp_path / 'up.yaml'}}}\n")
    lying(runner, ON_ITS_FACE, since=1.0, until=99.0)
    result = runner.run()
    assert "it did not get up" in result.reason
    assert runner.twins is not None
    assert runner.twins.parts["base"].latched == "it has fallen"
