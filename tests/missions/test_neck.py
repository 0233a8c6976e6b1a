"""A robot whose head is two Dynamixel servos on the arm's bus, in simulated time and over the wire."""

import re
from collections.abc import Callable
from math import degrees
from pathlib import Path

import pytest

from config.library import find_file
from missions.plugins.setup import head_connection
from missions.request import RunRequest
from missions.runner import Runner
from tests.missions.command import Outcome, command

SHIPPED = find_file("robots", "turtlebot2_arm").read_text()
NECK = """\
head:
  driver: dynamixel
  speed: 100 deg/s
  pan: {joint: neck_pan, limits: [-80 deg, 80 deg]}
  tilt: {joint: neck_tilt, limits: [-60 deg, 20 deg]}

"""
JOINTS = """\
  joints:
    neck_pan: {id: 11, zero: 5 deg, limits: [-90 deg, 90 deg]}
    neck_tilt: {id: 12, reverse: true, limits: [-70 deg, 70 deg]}
"""

MISSION = """\
mission: look_about
tree:
  sequence:
    - look: {pan: 40 deg, tilt: -10 deg}
    - look_at: {x: 2 m, y: 0.5 m, z: 1.1 m}
    - nod: 1
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a robot that has a neck, and a mission for it."""
    monkeypatch.chdir(tmp_path)
    robot = re.sub(r"(?s)head:\n.*?\n\n", NECK, SHIPPED, count=1).replace("  joints:\n", JOINTS)
    Path("necked.yaml").write_text(robot)
    Path("look_about.yaml").write_text(MISSION)
    return tmp_path


def test_servo_neck_turns_in_simulated_time(folder: Path) -> None:
    runner = Runner(RunRequest(str(folder / "look_about.yaml"), robot=str(folder / "necked.yaml"), simulate="fast"))
    assert runner.run().result == "success"
    assert runner.twins is not None
    assert runner.twins.head is not None
    pose = runner.twins.head.true_pose(runner.twins.timeline.clock.now())
    assert (degrees(pose.pan), degrees(pose.tilt)) == pytest.approx((14.4, 0.0), abs=1.1)


def test_servo_neck_finds_a_person_in_simulated_time(folder: Path) -> None:
    Path("find.yaml").write_text("mission: find\ntree:\n  find_face:\n    pause: 200 ms\n    scans: 1\n")
    order = RunRequest(str(folder / "find.yaml"), robot=str(folder / "necked.yaml"), simulate="fast", eyes="truth")
    assert Runner(order).run().result == "success"


@pytest.fixture
def mission(capsys: pytest.CaptureFixture[str]) -> Callable[..., Outcome]:
    return lambda *arguments: command(capsys, *arguments)


@pytest.mark.real_time
def test_servo_neck_turns_over_a_virtual_bus(folder: Path, mission: Callable[..., Outcome]) -> None:
    outcome = mission("head", "look", "--robot", str(folder / "necked.yaml"), "--simulate", "--pan", "25")
    assert (outcome.code, outcome.out) == (0, "looks at +25, +0 deg\n")


def test_missing_servo_bus_of_a_neck_is_reported_with_a_hint(
    folder: Path, mission: Callable[..., Outcome], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(head_connection, "CONNECT_TIMEOUT", 0.5)
    outcome = mission("head", "where", "--robot", str(folder / "necked.yaml"), "--port", "/dev/no_such_bus")
    assert outcome.code == 3
    assert "/dev/no_such_bus: no such device" in outcome.err
    assert "try: " in outcome.err


@pytest.mark.real_time
def test_trim_of_a_servo_neck_is_saved_in_the_robot_file(folder: Path, mission: Callable[..., Outcome]) -> None:
    path = folder / "necked.yaml"
    before = path.read_text()
    outcome = mission("head", "trim", "--robot", str(path), "--simulate", "--tilt", "-4", "--keep")
    assert outcome.code == 0
    assert path.read_text() == before.replace("tilt: {joint", "tilt: {trim: -4 deg, joint")
