"""A humanoid that was thrown on its face in physics gets up by the movement that ships, or stays down and says why."""

from pathlib import Path

import numpy as np
import pytest

from behaviours.keyframe_playback import lay_out
from drivers.legs.body import body_of
from drivers.legs.declared import LegsKeys
from drivers.legs.gait_check import clearance
from drivers.legs.kinematics import forward_kinematics
from missions.library import lookups
from missions.library.drivers import load_named_robot
from missions.plugins.testing.mission_run import MissionRun, run_mission
from tests.tries import tries

MISSION = "mission: up\ntree:\n  sequence:\n    - wait: 4.5 s\n    - fallen:\n{steps}"
PUSHED = "world: rough\nphysics: {{friction: {friction}, masses: 5 %, servo_delay: {delay} ms, {push}}}\n"
FROM_BEHIND = "pushes: [{at: 2 s, speed: 1.6 m/s}]"


def thrown(folder: Path, *steps: str, friction: float = 0.9, delay: int = 10, seed: int = 0) -> MissionRun:
    (folder / "up.yaml").write_text(MISSION.format(steps="".join(f"    - {step}\n" for step in steps)))
    (folder / "rough.yaml").write_text(PUSHED.format(friction=friction, delay=delay, push=FROM_BEHIND))
    mission, world = str(folder / "up.yaml"), str(folder / "rough.yaml")
    return run_mission(mission, robot="humanoid", world=world, seed=seed, eyes="truth", physics=True, timeout="40 s")


@pytest.mark.parametrize(("friction", "delay"), [(0.7, 25), (1.1, 0), (0.9, 10)][: tries(2, most=3)])
def test_humanoid_gets_up_from_its_face(tmp_path: Path, friction: float, delay: int) -> None:
    ran = thrown(tmp_path, "get_up: {front: get_up_front}", "wait: 3 s", "stand:", friction=friction, delay=delay)
    assert (ran.result, ran.reason) == ("success", "")


def test_get_up_with_an_unsuitable_movement_fails(tmp_path: Path) -> None:
    (tmp_path / "kick.yaml").write_text("gesture: kick\nkeyframes:\n  - {at: 1 s, left_knee: 60 deg}\n")
    ran = thrown(tmp_path, f"get_up: {{front: {tmp_path / 'kick.yaml'}}}")
    assert (ran.result, ran.reason) == ("failure", "it did not get up")


def test_get_up_movement_is_free_of_collisions_and_within_joint_speeds() -> None:
    robot, movement = load_named_robot("humanoid"), lookups.find_gesture("get_up_front")
    legs = robot.keys(LegsKeys)
    assert robot.arm is not None
    assert legs is not None
    speeds = {joint: limits.speed for joint, limits in robot.arm.limits.items()}
    frames = movement.keyframes
    playing = lay_out(frames[0].positions, frames, speeds, interpolation=movement.interpolation)
    assert playing.duration == pytest.approx(frames[-1].time, abs=0.05)
    poses = [playing.at(0.02 * n) for n in range(int(playing.duration / 0.02))]
    body = body_of(legs.body)
    angles = np.array([[pose.get(joint, 0.0) for joint in body.joints] for pose in poses])
    gaps, pairs = clearance(body, forward_kinematics(body, angles))
    assert gaps.min() > 0.009, pairs[int(gaps.min(axis=0).argmin())]
