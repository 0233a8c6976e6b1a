"""The arm of a robot file: joints in angles or in steps of their servos, and groups of them."""

import math
from pathlib import Path

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from config.diagnostics import Diagnostic, InvalidFileError, SourceText
from config.gesture import limit_error
from config.library import shipped_files
from drivers.servos.declared import DYNAMIXEL_MODELS, UNSUPPORTED_HINT, DynamixelKeys, JointKeys, Ticks
from drivers.servos.make import joint_specs as specs
from drivers.servos.models import MODELS
from missions.library.drivers import load_robot, parse_robot

TICK = math.radians(300) / 1024


def arm_of(joints: str, rest: str = "") -> DynamixelKeys:
    """Read an arm; the joints stand from line 6 on, at column 5."""
    text = f"robot: r\narm:\n  driver: dynamixel\n  port: x\n  joints:\n{joints}{rest}"
    arm = parse_robot(SourceText("robot.yaml", text)).keys(DynamixelKeys)
    assert arm is not None
    return arm


def joint_of(line: str) -> JointKeys:
    (joint,) = arm_of(f"    elbow: {line}\n").joints.values()
    return joint


def mistakes(joints: str, rest: str = "") -> list[Diagnostic]:
    with pytest.raises(InvalidFileError) as caught:
        arm_of(joints, rest)
    return list(caught.value.diagnostics)


def test_old_joint_keys_keep_their_meaning() -> None:
    joint = joint_of("{id: 6}")
    assert joint == JointKeys(id=6)
    assert (joint.model, joint.zero, joint.reverse, joint.lower, joint.upper) == ("AX-12A", 0.0, False, -2.6, 2.6)
    assert (joint.speed, joint.torque) == (2.0, 1.0)
    full = joint_of("{id: 6, model: AX-18A, zero: 10 deg, limits: [0 deg, 130 deg], reverse: true, torque: 60 %}")
    assert (full.model, full.reverse, full.ticks) == ("AX-18A", True, None)
    measured = (full.zero, full.lower, full.upper, full.torque)
    assert measured == pytest.approx((math.radians(10), 0.0, math.radians(130), 0.6))
    assert joint_of("{id: 6, model: AX-12+}").model == "AX-12A"


def test_arm_rate_defaults_to_100_hz_and_can_be_set() -> None:
    assert arm_of("    elbow: {id: 6}\n").rate == 100.0
    assert arm_of("    elbow: {id: 6}\n", "  rate: 40 Hz\n").rate == 40.0
    (fault,) = mistakes("    elbow: {id: 6}\n", "  rate: 2 kHz\n")
    assert (fault.mark.line, fault.mark.column) == (7, 9)


def test_joint_limits_default_to_the_servo_range() -> None:
    ex = joint_of("{id: 6, model: EX-106+}")
    assert ex.upper == pytest.approx(math.radians(250.92 / 2), abs=2e-3)
    turned = joint_of("{id: 6, zero: 90 deg, reverse: true}")
    assert turned.lower == pytest.approx(-(511 * TICK - math.pi / 2))
    assert turned.upper == 2.6


@given(st.sampled_from(sorted(DYNAMIXEL_MODELS)), st.integers(-100, 100), st.booleans())
def test_joint_without_limits_is_valid_for_the_driver(model: str, zero: int, reverse: bool) -> None:
    arm = arm_of(f"    elbow: {{id: 6, model: {model}, zero: {zero} deg, reverse: {str(reverse).lower()}}}\n")
    assert specs(arm)["elbow"].errors() == []


def test_limits_beyond_the_servo_are_reported_with_position() -> None:
    (fault,) = mistakes("    elbow: {id: 6, limits: [-160 deg, 90 deg]}\n")
    assert (fault.mark.line, fault.mark.column) == (6, 28)
    assert fault.message == (
        "'limits': from that zero, an AX-12A reaches from -150.0 deg to 149.7 deg, not -160 deg to 90 deg"
    )
    (fault,) = mistakes("    elbow: {id: 6, zero: 100 deg, limits: [-90 deg, 90 deg]}\n")
    assert "from -250.0 deg to 49.7 deg" in fault.message
    (fault,) = mistakes("    elbow: {id: 6, zero: 400 deg}\n")
    assert (fault.mark.line, fault.mark.column) == (6, 26)


@pytest.mark.parametrize(
    ("written", "meant"),
    [("AX12", "AX-12"), ("ax-12a", "AX-12A"), ("EX-106", "EX-106+"), ("XL430", "XL430-W250"), ("MX28", "MX-28")],
)
def test_unknown_servo_model_gives_a_suggestion(written: str, meant: str) -> None:
    (fault,) = mistakes(f"    elbow: {{id: 6, model: {written}}}\n")
    assert (fault.mark.line, fault.mark.column) == (6, 27)
    assert fault.message == f"'model' cannot be '{written}'"
    assert fault.suggestion == f"did you mean '{meant}'?; {UNSUPPORTED_HINT}"


def test_ticks_define_zero_direction_and_limits() -> None:
    joint = joint_of("{id: 5, ticks: {init: 512, min: 0, max: 1023}}")
    assert (joint.zero, joint.reverse, joint.ticks) == (0.0, False, Ticks(init=512, min=0, max=1023))
    assert (joint.lower, joint.upper) == pytest.approx((-2.618, 2.613), abs=1e-3)
    flipped = joint_of("{id: 5, ticks: {init: 512, min: 1023, max: 0}}")
    assert flipped.reverse
    assert (flipped.lower, flipped.upper) == pytest.approx((-2.613, 2.618), abs=1e-3)


@given(
    st.sampled_from(sorted(DYNAMIXEL_MODELS)),
    st.integers(0, 1023),
    st.integers(0, 1023),
    st.integers(0, 1023),
    st.floats(0, 1),
)
def test_ticks_mean_the_same_servo_positions_as_in_ros(
    model: str, init: int, low: int, high: int, share: float
) -> None:
    assume(low != high)
    arm = arm_of(f"    elbow: {{id: 6, model: {model}, ticks: {{init: {init}, min: {low}, max: {high}}}}}\n")
    spec, tick = specs(arm)["elbow"], MODELS[model].tick
    assert spec.errors() == []
    goal = spec.lower + share * (spec.upper - spec.lower)
    ros = init + round(goal / tick) if low < high else init - round(goal / tick)
    assert MODELS[model].ticks(spec.zero + spec.direction * goal) == pytest.approx(ros, abs=1)
    assert MODELS[model].ticks(spec.zero + spec.direction * spec.lower) == low
    assert MODELS[model].ticks(spec.zero + spec.direction * spec.upper) == high


@pytest.mark.parametrize(
    ("ticks", "line", "message"),
    [
        ("{init: 512, min: 0}", 27, "'ticks' needs 'max'"),
        ("{init: 512, min: 0, max: 1024}", 52, "'max' must be at most 1023"),
        ("{init: 512, min: 7, max: 7}", 27, "'ticks': 'min' and 'max' are both 7"),
        ("{init: 512, min: 0, max: 9, mid: 4}", 55, "'ticks' has no key 'mid'"),
        ("512", 27, "'ticks' must be a mapping of keys to values, such as 'name: value'"),
        ("{init: 5 deg, min: 0, max: 9}", 34, "'init' needs a whole number"),
    ],
)
def test_invalid_ticks_are_reported(ticks: str, line: int, message: str) -> None:
    fault, *_ = mistakes(f"    elbow: {{id: 6, ticks: {ticks}}}\n")
    assert (fault.mark.line, fault.mark.column, fault.message) == (6, line, message)


def test_joint_with_both_angles_and_ticks_is_refused() -> None:
    line = "    elbow: {id: 6, zero: 9 deg, limits: [0 deg, 1 deg], reverse: true, ticks: {init: 5, min: 0, max: 9}}\n"
    assert [fault.message for fault in mistakes(line)] == [
        "'zero' is already defined by 'ticks'",
        "'limits' is already defined by 'ticks'",
        "'reverse' is already defined by 'ticks'",
    ]


def test_a_group_is_a_name_for_several_joints() -> None:
    arm = arm_of("    a: {id: 1}\n    b: {id: 2}\n    c: {id: 3}\n", "  groups: {ends: [c, a]}\n")
    assert arm.groups == {"ends": ("c", "a")}
    assert arm_of("    a: {id: 1}\n").groups == {}


def test_all_faults_of_groups_are_reported_with_position() -> None:
    groups = "  groups:\n    elbow: [wrist]\n    b: [elbw, wrist, wrist]\n    c: []\n    d: wrist\n    e: [[wrist]]\n"
    faults = mistakes("    elbow: {id: 1}\n    wrist: {id: 2}\n", groups)
    assert [(fault.mark.line, fault.mark.column, fault.message, fault.suggestion) for fault in faults] == [
        (9, 5, "'elbow' is a joint already", ""),
        (10, 9, "group 'b': no joint 'elbw'", "did you mean 'elbow'?"),
        (10, 22, "group 'b' has 'wrist' already", ""),
        (11, 8, "group 'c' needs a list of joints", ""),
        (12, 8, "group 'd' needs a list of joints", ""),
        (13, 9, "group 'e' needs a list of joints", ""),
    ]


def test_id_253_is_no_servo_of_protocol_2_and_not_beside_one() -> None:
    assert arm_of("    a: {id: 253}\n").joints["a"].id == 253
    (fault,) = mistakes("    a: {id: 253, model: XL430-W250}\n")
    assert fault.message == "'id' must be at most 252, not 253"
    (fault,) = mistakes("    a: {id: 253}\n    b: {id: 1, model: XL430-W250}\n")
    assert (fault.mark.line, fault.message) == (6, "joint 'a' cannot have id 253 beside servos of protocol 2.0")


def test_limit_check_tolerates_rounding_of_the_file() -> None:
    assert limit_error("elbow", math.pi / 2 + 5e-7, (0.0, math.pi / 2)) == ""
    assert (
        limit_error("elbow", 2.0, (0.0, math.pi / 2)) == "'elbow' at 114.592 deg is outside its limits, 0 deg to 90 deg"
    )
    assert limit_error("elbow", -0.1, (0.0, 1.0))


@pytest.mark.parametrize("name", ["humanoid", "turtlebot2_arm", "so101", "so101_leader", "koch"])
def test_joints_of_shipped_robots_are_valid_for_their_driver(name: str) -> None:
    arm = load_robot(shipped_files("robots")[name]).keys(DynamixelKeys)
    assert arm is not None
    for joint, spec in specs(arm).items():
        assert spec.errors() == [], joint
        assert spec.speed <= MODELS[spec.model].free_speed, joint


def test_humanoid_file_matches_its_description() -> None:
    robot = load_robot(shipped_files("robots")["humanoid"])
    arm = robot.keys(DynamixelKeys)
    assert arm is not None
    assert sorted(joint.id for joint in arm.joints.values()) == [*range(1, 23)]
    assert [arm.joints[name].id for name in arm.groups["left_arm"]] == [1, 2, 3, 4]
    assert [arm.joints[name].id for name in arm.groups["right_arm"]] == [7, 8, 9, 10]
    assert {arm.joints[name].model for side in ("left_arm", "right_arm") for name in arm.groups[side]} == {"AX-12A"}
    assert {arm.joints[name].model for name in arm.groups["legs"]} == {"RX-64", "EX-106+"}
    assert robot.parts == {"base", "head", "arm", "camera", "voice", "imu"}


def test_the_left_and_the_right_of_the_humanoid_are_mirror_images() -> None:
    arm = load_robot(shipped_files("robots")["humanoid"]).keys(DynamixelKeys)
    assert arm is not None
    for name, left in arm.joints.items():
        if name.startswith("left_"):
            right = arm.joints[name.replace("left_", "right_")]
            assert (right.model, right.lower, right.upper, right.speed) == (
                left.model,
                left.lower,
                left.upper,
                left.speed,
            )
            assert right.reverse != left.reverse


def test_robot_file_reads_the_same_as_its_text(tmp_path: Path) -> None:
    file = tmp_path / "r.yaml"
    file.write_text("robot: r\narm: {driver: dynamixel, port: x, joints: {a: {id: 1}}}\n", encoding="utf-8")
    assert load_robot(file).arm == arm_of("    a: {id: 1}\n")
