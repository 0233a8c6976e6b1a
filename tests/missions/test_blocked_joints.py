"""Behaviours whose joints, or whose head, do not get where they are sent: in simulated time, on robots that ship."""

import re
from pathlib import Path

import pytest

from missions.executive.events import NodeChanged
from missions.plugins.testing.mission_run import MissionRun, run_mission

ENDS_WITHIN = 3.0
"""Seconds from the fault until the behaviour has ended: 10 degrees at its pace, 0.8 s without progress, a tick."""

BEHAVIOURS = {
    "move_joints": "move_joints: {to: {elbow_flex: 60 deg}, speed: 40 deg/s}",
    "sweep": "sweep: {joints: elbow_flex, between: [-40 deg, 40 deg], period: 4 s}",
    "mirror": "mirror: {leader: wrist_flex, follower: elbow_flex}",
    "follow_joint": "follow_joint: {leader: wrist_flex, follower: elbow_flex}",
}
LOOKS = {
    "look": "look: 40 deg",
    "nod": "nod: 1",
    "sweep_head": "sweep_head: 30 deg",
}
NECK = """
robot: necked
arm:
  driver: dynamixel
  port: /dev/servos
  joints:
    pan: {id: 1, model: XL430-W250, limits: [-90 deg, 90 deg]}
    tilt: {id: 2, model: XL430-W250, limits: [-60 deg, 60 deg]}
head:
  driver: dynamixel
  speed: 90 deg/s
  pan: {joint: pan}
  tilt: {joint: tilt}
"""
ROS2_HEAD = """
robot: tiago
ros2: {router: tcp/127.0.0.1:7447}
head:
  driver: ros2
  speed: 60 deg/s
  pan: {joint: head_1_joint, limits: [-70 deg, 70 deg]}
  tilt: {joint: head_2_joint, limits: [-40 deg, 40 deg]}
"""
HOBBY = """
robot: hobby
head:
  driver: arduino
  port: /dev/head
  pan: {servo: 0, limits: [-80 deg, 80 deg]}
  tilt: {servo: 1, limits: [-60 deg, 20 deg], flip: true}
"""


def ran(tmp_path: Path, behaviour: str, *given: str, robot: str | Path = "so101", seconds: float = 10.0) -> MissionRun:
    mission = tmp_path / "m.yaml"
    mission.write_text(f"mission: m\ntree:\n  {behaviour}\n")
    if not Path(robot).suffix and "\n" in str(robot):
        robot_file = tmp_path / "robot.yaml"
        robot_file.write_text(str(robot))
        robot = robot_file
    return run_mission(mission, robot=robot, given=list(given), timeout=f"{seconds} s")


def success_of(found: MissionRun) -> str:
    """Return what the behaviour said as it succeeded."""
    return next(event.reason for event in found.events if isinstance(event, NodeChanged) and event.status == "success")


@pytest.mark.parametrize("name", BEHAVIOURS)
@pytest.mark.parametrize("fault", ["blocked", "frozen"])
def test_blocked_arm_joint_fails_the_behaviour_with_its_angles(tmp_path: Path, name: str, fault: str) -> None:
    given = [f"arm {fault} elbow_flex at 1 s"]
    if "leader" in BEHAVIOURS[name]:
        given.append("arm turned wrist_flex to 50 deg at 1.5 s")
    found = ran(tmp_path, BEHAVIOURS[name], *given)
    assert found.result == "failure", found.reason
    assert re.search(r"joint elbow_flex: commanded .* rad, at .* rad for .* s: blocked\?", found.reason)
    assert found.seconds < 1.5 + ENDS_WITHIN


@pytest.mark.parametrize("name", ["move_joints", "sweep"])
def test_reversed_joint_fails_the_behaviour(tmp_path: Path, name: str) -> None:
    found = ran(tmp_path, BEHAVIOURS[name], "arm reversed elbow_flex at 1 s")
    assert (found.result, "joint elbow_flex: commanded" in found.reason) == ("failure", True), found.reason
    assert found.seconds < 1.0 + ENDS_WITHIN


@pytest.mark.parametrize("robot", [NECK, ROS2_HEAD], ids=["neck", "ros2"])
@pytest.mark.parametrize("name", LOOKS)
@pytest.mark.parametrize("fault", ["blocked", "frozen", "reversed"])
def test_faulty_head_with_feedback_fails_the_behaviour(tmp_path: Path, name: str, fault: str, robot: str) -> None:
    found = ran(tmp_path, LOOKS[name], f"head {fault} at 0.1 s", robot=robot)
    assert found.result == "failure", (found.result, found.reason)
    assert re.search("commanded|rests at|turned by", found.reason)
    assert found.seconds < 0.1 + ENDS_WITHIN


@pytest.mark.parametrize("name", ["look", "nod"])
def test_success_of_a_head_without_feedback_is_marked_unmeasured(tmp_path: Path, name: str) -> None:
    found = ran(tmp_path, LOOKS[name], "head blocked at 0.1 s", robot=HOBBY)
    assert found.result == "success"
    assert "(not measured)" in success_of(found)


def test_success_of_a_head_with_feedback_is_not_marked_unmeasured(tmp_path: Path) -> None:
    found = ran(tmp_path, LOOKS["look"], robot=NECK)
    assert found.result == "success"
    assert "measured" not in success_of(found)
