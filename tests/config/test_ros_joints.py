"""Joints as ROS's dynamixel_controllers describes them: ten of them, mirrored ones, and everything that is none."""

import math
from pathlib import Path

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from config.diagnostics import Diagnostic, InvalidFileError, SourceText
from drivers.servos.declared import DynamixelKeys, JointKeys, Ticks
from drivers.servos.models import MODELS
from missions.library.drivers import parse_robot
from missions.plugins.setup.servo.foreign_joints import PAIRED_MESSAGE
from missions.plugins.setup.servo.joint_import import RosJoints, load_ros_joints, robot_text, ros_joints_of

TEN = Path(__file__).parent / "ten_joints.ros.yaml"

PLAIN = "elbow_controller:\n  joint_name: elbow\n  motor: {id: 5, init: 512, min: 0, max: 1023}\n"


def read(text: str, model: str = "AX-12A") -> RosJoints:
    return ros_joints_of(SourceText("tilt.yaml", text), model=model)


def joint_of(text: str, model: str = "AX-12A") -> JointKeys:
    (joint,) = read(text, model).joints.values()
    return joint


def mistakes(text: str) -> list[Diagnostic]:
    with pytest.raises(InvalidFileError) as caught:
        read(text)
    return list(caught.value.diagnostics)


def test_ten_joints_come_by_their_names_and_ids() -> None:
    found = load_ros_joints(TEN)
    assert list(found.joints) == [
        *("waist_turn", "waist_bend", "shoulder_pan", "shoulder_lift", "upper_roll"),
        *("elbow", "forearm_roll", "wrist_bend", "wrist_roll", "gripper"),
    ]
    assert [joint.id for joint in found.joints.values()] == [*range(1, 11)]
    assert {name for name, joint in found.joints.items() if joint.reverse} == {
        "waist_bend",
        "shoulder_lift",
        "wrist_bend",
    }


def test_init_is_zero_and_min_and_max_are_the_limits() -> None:
    joints = load_ros_joints(TEN).joints
    tick = math.radians(300) / 1024
    elbow = joints["elbow"]
    assert (elbow.zero, elbow.lower, elbow.upper) == pytest.approx((-307 * tick, 0.0, 443 * tick))
    bend = joints["waist_bend"]
    assert (bend.zero, bend.lower, bend.upper) == pytest.approx((0.0, -204 * tick, 34 * tick))
    assert bend.ticks == Ticks(init=512, min=716, max=478)


def test_the_lower_of_speed_and_top_speed_is_the_limit() -> None:
    joints = load_ros_joints(TEN).joints
    assert (joints["waist_turn"].speed, joints["forearm_roll"].speed) == (1.0, 2.0)
    assert joint_of(PLAIN).speed == 1.0
    assert (joints["gripper"].torque, joints["waist_turn"].torque) == (0.6, 1.0)


def test_unsupported_ros_parameter_is_noted() -> None:
    (note,) = load_ros_joints(TEN).notes
    assert note.message == "'joint_compliance_slope' is left out: the compliance of a servo stays as it is"
    assert note.source.line(note.mark.line) == "    joint_compliance_slope: 64"


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        (f"{PLAIN}  joint_sped: 2\n", 4, "'joint_sped' is left out: dynamixel_controllers has no such key"),
        (PLAIN.replace("id: 5", "id: 5, ids: 6"), 3, "'ids' is left out: dynamixel_controllers has no such key"),
        (
            f"{PLAIN}arm:\n  controller: {{type: TrajectoryActionController}}\n  joint_trajectory_action_node: {{}}\n",
            5,
            "controller 'arm' is left out: a 'TrajectoryActionController' leads other controllers, and is not a joint",
        ),
    ],
)
def test_invalid_ros_entries_are_skipped_with_a_note(text: str, line: int, message: str) -> None:
    found = read(text)
    assert list(found.joints) == ["elbow"]
    assert [(note.mark.line, note.message) for note in found.notes] == [(line, message)]


@pytest.mark.parametrize("kind", ["JointPositionControllerDual", "JointPositionControllerDualMotor", "Whatever", ""])
def test_two_servos_on_one_joint_are_refused_whatever_their_controller_is_called(kind: str) -> None:
    controller = f"  controller: {{type: {kind}}}\n" if kind else ""
    pair = "  joint_name: shoulder\n  motor_master: {id: 2, init: 512, min: 0, max: 1023}\n  motor_slave: {id: 3}\n"
    (mistake,) = mistakes(f"{PLAIN}two:\n{controller}{pair}")
    assert "joint 'shoulder' has two servos (2 and 3)" in mistake.message


@given(st.integers(0, 1023), st.integers(0, 1023), st.integers(0, 1023), st.floats(-1.0, 1.0))
def test_a_goal_means_the_same_step_of_the_servo_as_in_ros(init: int, low: int, high: int, goal: float) -> None:
    assume(low != high)
    joint = joint_of(f"c:\n  joint_name: j\n  motor: {{id: 5, init: {init}, min: {low}, max: {high}}}\n")
    raw = init + round((goal if low < high else -goal) / (math.radians(300) / 1024))
    ours = MODELS["AX-12A"].ticks(joint.zero + (-goal if joint.reverse else goal))
    assert ours == pytest.approx(min(max(raw, 0), 1023), abs=1)


def test_published_ros_example_gives_its_ticks() -> None:
    assert MODELS["AX-12A"].ticks(1.0 + joint_of(PLAIN).zero) == 708
    turned = joint_of(PLAIN.replace("min: 0, max: 1023", "min: 1023, max: 0"))
    assert MODELS["AX-12A"].ticks(turned.zero - 1.0) == 316


@pytest.mark.parametrize(("init", "low", "high"), [(100, 205, 819), (900, 819, 205)])
def test_unreachable_init_is_noted_with_its_line(init: int, low: int, high: int) -> None:
    found = read(f"c:\n  joint_name: j\n  motor:\n    id: 5\n    init: {init}\n    min: {low}\n    max: {high}\n")
    (note,) = found.notes
    ends = f"'min' {low} and 'max' {high}"
    assert note.message == f"'init' {init} lies outside {ends}: the joint cannot go to its 0"
    assert note.source.line(note.mark.line) == f"    init: {init}"
    assert list(found.joints) == ["j"]


def test_ticks_use_the_model_of_the_caller() -> None:
    joint = joint_of("c:\n  joint_name: j\n  motor: {id: 5, init: 2048, min: 1024, max: 3072}\n", "MX-28")
    assert (joint.model, joint.zero, joint.lower, joint.upper) == ("MX-28", 0.0, -math.pi / 2, math.pi / 2)


def test_ticks_beyond_the_servo_are_clamped_with_a_note() -> None:
    found = read(PLAIN.replace("min: 0, max: 1023", "min: -20, max: 4095"))
    assert found.joints["elbow"].ticks == Ticks(init=512, min=0, max=1023)
    assert [(note.mark.line, note.mark.column, note.message) for note in found.notes] == [
        (3, 34, "'min' is 0 and not -20: an AX-12A has 0..1023"),
        (3, 44, "'max' is 1023 and not 4095: an AX-12A has 0..1023"),
    ]


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        (
            "two:\n  joint_name: a\n  motor_master: {id: 1, init: 5, min: 0, max: 9}\n  motor_slave: {id: 2}\n",
            3,
            PAIRED_MESSAGE.format("a", 1, 2),
        ),
        (
            "wheel:\n  controller: {type: JointTorqueController}\n  joint_name: a\n  motor: {id: 1}\n",
            2,
            "controller 'wheel': a 'JointTorqueController' turns a wheel, and takes no positions",
        ),
        ("x:\n  controller: {type: Magic}\n", 2, "controller 'x': a 'Magic' is unknown"),
        (PLAIN.replace("init: 512, ", ""), 3, "'motor' needs 'init'"),
        (PLAIN.replace("init: 512", "init: 2048"), 3, "'init' must be at most 1023"),
        (PLAIN.replace("1023", "0"), 3, "'min' and 'max' are both 0: the joint could not move"),
        (PLAIN.replace("id: 5", "id: 300"), 3, "'id' must be at most 253"),
        (f"{PLAIN}  joint_speed: 0\n", 4, "'joint_speed' must be at least 0.02"),
        (f"{PLAIN}  joint_torque_limit: 1.5\n", 4, "'joint_torque_limit' must be at most 1.0"),
        ("x:\n  joint_name: a\n", 2, "controller 'x' needs 'motor'"),
        ("namespace: arm\n", 1, "controller 'namespace' must be a mapping of keys to values, such as 'name: value'"),
        ("{}\n", 1, "no joint controllers found"),
        (PLAIN + PLAIN.replace("_controller", ""), 5, "joint 'elbow' belongs to controller 'elbow_controller' already"),
        (
            PLAIN + PLAIN.replace("elbow", "wrist"),
            6,
            "servo 5 belongs to controller 'elbow_controller' already",
        ),
    ],
)
def test_ros_joint_fault_is_reported_with_its_line(text: str, line: int, message: str) -> None:
    assert (line, message) in [(fault.mark.line, fault.message) for fault in mistakes(text)]


def test_all_mistakes_of_all_controllers_come_at_once() -> None:
    faults = mistakes("a:\n  joint_name: a\n  motor: {id: 1}\nb:\n  motor: {id: 2, init: 5, min: 0, max: 9}\n")
    assert [fault.message for fault in faults] == [
        "'motor' needs 'init'",
        "'motor' needs 'min'",
        "'motor' needs 'max'",
        "controller 'b' needs 'joint_name'",
    ]


def test_ros_joints_become_an_equal_robot_file() -> None:
    joints = load_ros_joints(TEN).joints
    text = robot_text("ten", joints, port="/dev/u2d2")
    arm = parse_robot(SourceText("ten.yaml", text)).keys(DynamixelKeys)
    assert arm is not None
    assert arm.joints == joints
    assert "    waist_bend: {id: 2, model: AX-12A, ticks: {init: 512, min: 716, max: 478}, speed: 0.8 rad/s" in text
