"""The ``head`` section of a robot file: both kinds of head, and every mistake in one at its place."""

from math import radians
from pathlib import Path

import pytest

from config.diagnostics import InvalidFileError, SourceText
from drivers.api.sections import HeadKeys
from drivers.arduino.declared import ArduinoKeys, PanKeys, TiltKeys
from drivers.servos.declared import NeckJointKeys, NeckKeys
from missions.library.drivers import load_robot, parse_robot

ARM = """
arm:
  driver: dynamixel
  port: /dev/u2d2
  joints:
    neck_pan: {id: 11, limits: [-60 deg, 60 deg]}
    neck_tilt: {id: 12}
"""


def head_of(section: str, rest: str = "") -> HeadKeys | None:
    return parse_robot(SourceText("mine.yaml", f"robot: mine\nhead:\n{section}\n{rest}")).head


def faults_of(section: str, rest: str = "") -> list[str]:
    with pytest.raises(InvalidFileError) as caught:
        head_of(section, rest)
    return [f"{fault.mark.line}: {fault.message}" for fault in caught.value.diagnostics]


def test_rodney_parameters_are_accepted_unchanged() -> None:
    head = head_of("""
  driver: arduino
  port: /dev/nano
  pan: {servo: 0, joint: head_pan, limits: [-1.570796 rad, 1.570796 rad]}
  tilt: {servo: 1, joint: head_tilt, flip: true, limits: [-1.39626 rad, 0.349066 rad], trim: -45 deg}
""")
    assert head == ArduinoKeys(
        port="/dev/nano",
        baud=57_600,
        boot=2.0,
        speed=2.0,
        acceleration=7.0,
        pan=PanKeys(servo=0, joint="head_pan", limits=(-1.570796, 1.570796)),
        tilt=TiltKeys(servo=1, joint="head_tilt", limits=(-1.39626, 0.349066), flip=True, trim=-radians(45)),
    )


def test_a_neck_is_two_joints_of_the_arm() -> None:
    head = head_of(
        """
  driver: dynamixel
  speed: 90 deg/s
  acceleration: 300 deg/s^2
  pan: {joint: neck_pan}
  tilt: {joint: neck_tilt, limits: [-40 deg, 20 deg], trim: 3 deg}
""",
        ARM,
    )
    assert head == NeckKeys(
        speed=radians(90),
        acceleration=radians(300),
        pan=NeckJointKeys(joint="neck_pan"),
        tilt=NeckJointKeys(joint="neck_tilt", limits=(radians(-40), radians(20)), trim=radians(3)),
    )


def test_mistakes_in_the_head_of_servos_stand_at_their_places() -> None:
    assert faults_of("""
  driver: arduino
  port: /dev/nano
  acceleration: 400 deg/s
  pan: {servo: 4, trim: 46 deg}
  tilt: {servo: 1, limits: [95 deg, 100 deg], joint: ""}
""") == [
        "6: 'acceleration' needs a turn acceleration such as '200 deg/s^2', got a turn rate: '400 deg/s'",
        "7: 'servo' must be at most 3",
        "7: 'trim' must be at most 45 deg",
        "8: 'limits': servo 1 reaches only -90 deg to 90 deg, outside of these limits",
        "8: 'joint' needs a text",
    ]
    assert faults_of("  driver: arduino\n  port: x\n  pan: {servo: 1}\n  tilt: {servo: 1}") == [
        "3: 'pan' and 'tilt' are both on servo 1"
    ]


def test_mistakes_in_a_neck_stand_at_their_places() -> None:
    assert faults_of("  driver: dynamixel\n  pan: {joint: neck_pam}\n  tilt: {joint: neck_tilt, servo: 1}", ARM) == [
        "4: 'joint' cannot be 'neck_pam'",
        "5: 'tilt' has no key 'servo'",
    ]
    assert faults_of("  driver: dynamixel\n  pan: {joint: neck_pan}\n  tilt: {joint: neck_pan}", ARM) == [
        "3: 'pan' and 'tilt' are both joint 'neck_pan'"
    ]
    assert faults_of(
        "  driver: dynamixel\n  pan: {joint: neck_pan, limits: [70 deg, 80 deg]}\n  tilt: {joint: neck_tilt}", ARM
    ) == ["4: 'limits': joint 'neck_pan' reaches only -60 deg to 60 deg, outside of these limits"]
    assert faults_of("  driver: dynamixel\n  pan: {joint: a}\n  tilt: {joint: b}") == [
        "4: a head of Dynamixel servos needs two joints of an arm: this robot has no arm",
        "5: a head of Dynamixel servos needs two joints of an arm: this robot has no arm",
    ]


def test_shipped_robots_define_a_head_acceleration() -> None:
    for path in (Path(__file__).parents[2] / "config" / "robots").glob("*.yaml"):
        head = load_robot(path).head
        assert head is None or 1.0 < head.acceleration < 50.0
