"""Files of other programs: imported or played where their meaning is clear, else refused with one line."""

import json
from collections.abc import Callable
from math import degrees
from pathlib import Path

import pytest

from config.diagnostics import InvalidFileError, SourceText
from config.library import SHEET_SUFFIXES, wrong_kind_error
from drivers.servos.declared import DynamixelKeys
from drivers.servos.feetech import FeetechKeys
from drivers.servos.joint import Joint, JointSpec
from drivers.servos.joint_setup import find_mismatch
from drivers.servos.models import MODELS
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from missions.library.drivers import load_robot, parse_robot
from missions.library.moves.load import load_move
from tests.drivers.lines import direct_bus
from tests.missions.command import Outcome, command

Mission = Callable[[str], Outcome]


@pytest.fixture
def mission(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Mission:
    monkeypatch.chdir(tmp_path)
    return lambda line: command(capsys, *line.split())


ARBOTIX = """\
port: /dev/ttyUSB1
rate: 15
joints:
  turret: {id: 11, neutral: 500, max_angle: 90, min_angle: -100, max_speed: 45}
  tilt: {id: 12, invert: true}
  claw: {type: prismatic, id: 13}
controllers:
  all: {type: follow_controller, joints: [turret, tilt]}
"""

INTERBOTIX = """\
port: /dev/ttyDXL
joint_order: [waist, elbow]
motors:
  waist: {ID: 1, Baud_Rate: 3, Drive_Mode: 0, Min_Position_Limit: 0, Max_Position_Limit: 4095, Secondary_ID: 255}
  elbow: {ID: 4, Baud_Rate: 3, Drive_Mode: 1, Min_Position_Limit: 700, Max_Position_Limit: 3000, Secondary_ID: 255}
"""

SHADOWS = INTERBOTIX + "shadows:\n  waist: {shadow_list: [elbow], calibrate: true}\n"

WORKBENCH = """\
first:
  ID: 1
  Return_Delay_Time: 0
  Operating_Mode: 3
wheel:
  ID: 2
  Operating_Mode: 1
"""

DUAL = """\
two:
  controller: {module: joint_position_controller_dual_motor, type: JointPositionControllerDual}
  joint_name: waist
  motor_master: {id: 1, init: 512, min: 0, max: 1023}
  motor_slave: {id: 4, calibration_offset: 3}
"""

PYPOT = json.dumps(
    {"framerate": 2, "positions": {"0.5": {"elbow": [20, 0.0], "wrist": [5, 1]}, "0.0": {"elbow": [-10.0, 0.0]}}}
)

MOTION = """\
joint:
  names: [elbow, wrist]
motion:
  names: [up, down]
  up: {step: [0.5, 0.1], time_from_start: 1.0}
  down: {step: [0.0, 0.0], time_from_start: 2.5}
"""

OLD = json.dumps({"homing_offset": [5], "drive_mode": [0], "start_pos": [1], "end_pos": [2], "calib_mode": ["DEGREE"],
                  "motor_names": ["elbow"]})  # fmt: skip
NEW = json.dumps(
    {name: {"id": number, "drive_mode": 0, "homing_offset": 7, "range_min": 900, "range_max": 3100}
     for number, name in enumerate(("pan", "lift"), 1)}
)  # fmt: skip

ARM = "robot: bench\narm:\n  driver: dynamixel\n  port: /dev/x\n  joints:\n    elbow: {id: 1}\n    wrist: {id: 2}\n"


# --- import -----------------------------------------------------------------------------------------------------------


def test_arbotix_import_converts_degrees_and_neutral_step(mission: Mission) -> None:
    Path("crane.yaml").write_text(ARBOTIX)
    outcome = mission("servo import crane.yaml -o crane_robot.yaml")
    assert outcome.code == 0, outcome.err
    assert "joint 'claw' is left out: it is a prismatic" in outcome.err
    assert "an ArbotiX board is not an adapter" in outcome.err
    arm = load_robot(Path("crane_robot.yaml")).keys(DynamixelKeys)
    assert arm is not None
    turret, tilt = arm.joints["turret"], arm.joints["tilt"]
    assert (turret.id, round(degrees(turret.lower)), round(degrees(turret.upper))) == (11, -100, 90)
    assert turret.servo_model.ticks(turret.zero) == 500
    assert degrees(turret.speed) == pytest.approx(45, abs=0.01)
    assert (tilt.reverse, tilt.servo_model.ticks(tilt.zero), round(degrees(tilt.upper))) == (True, 512, 150)


@pytest.mark.parametrize(
    ("joint", "model", "words"),
    [
        ("ticks: 4096, range: 250.92", "MX-28", "has a range of 250.92 deg, an MX-28 360 deg"),
        ("range: 250.92", "AX-12A", "has a range of 250.92 deg, an AX-12A 300 deg"),
    ],
)
def test_arbotix_joint_with_the_range_of_another_model_is_refused(
    mission: Mission, joint: str, model: str, words: str
) -> None:
    Path("crane.yaml").write_text(f"joints:\n  pan: {{id: 1, {joint}}}\n")
    outcome = mission(f"servo import crane.yaml --model {model}")
    assert (outcome.code, outcome.out) == (2, "")
    assert words in outcome.err


def test_servos_with_a_homing_offset_are_not_imported(mission: Mission) -> None:
    told = "joint 'elbow' has Homing_Offset 512"
    for name, text in (("wx.yaml", INTERBOTIX), ("bench.yaml", "elbow: {ID: 4, Drive_Mode: 1}\n")):
        Path(name).write_text(text.replace("Drive_Mode: 1", "Drive_Mode: 1, Homing_Offset: 512"))
        outcome = mission(f"servo import {name} --model XM430-W350")
        assert (outcome.code, outcome.out) == (2, "")
        assert told in outcome.err


def test_interbotix_needs_the_model_and_keeps_the_steps(mission: Mission) -> None:
    Path("wx.yaml").write_text(INTERBOTIX)
    outcome = mission("servo import wx.yaml")
    assert outcome.code == 2
    assert "a file of an Interbotix arm (ROS): say what its servos are" in outcome.err
    outcome = mission("servo import wx.yaml --model XM430-W350 -o wx_robot.yaml")
    assert outcome.code == 0, outcome.err
    assert "joint 'elbow': the servo is reversed" in outcome.err
    arm = load_robot(Path("wx_robot.yaml")).keys(DynamixelKeys)
    assert arm is not None
    ticks = {name: joint.ticks for name, joint in arm.joints.items()}
    assert [(each.init, each.min, each.max) for each in ticks.values() if each] == [(2048, 0, 4095), (2048, 3396, 1096)]
    assert arm.joints["elbow"].reverse


def test_dynamixel_workbench_import_reports_missing_limits(mission: Mission) -> None:
    Path("bench.yaml").write_text(WORKBENCH)
    outcome = mission("servo import bench.yaml --model XL430-W250")
    assert outcome.code == 0, outcome.err
    assert "first: {id: 1, model: XL430-W250}" in outcome.out
    assert "joint 'first': its limits are not in the file" in outcome.err
    assert "'wheel' is left out: operating mode 1" in outcome.err


def test_lerobot_calibration_is_imported_as_an_arm(mission: Mission) -> None:
    wheel = {"id": 7, "drive_mode": 0, "homing_offset": 0, "range_min": 0, "range_max": 4095}
    Path("mine.json").write_text(json.dumps({**json.loads(NEW), "base_left_wheel": wheel}))
    outcome = mission("servo import mine.json -o so101_robot.yaml")
    assert outcome.code == 0, outcome.err
    assert "motor 'base_left_wheel' is left out" in outcome.err
    arm = load_robot(Path("so101_robot.yaml")).keys(FeetechKeys)
    assert arm is not None
    assert arm.port == "/dev/ttyACM0"
    assert Path(arm.calibration).expanduser() == Path("mine.json").absolute()
    assert {name: joint.id for name, joint in arm.servos.items()} == {"pan": 1, "lift": 2}
    outcome = mission("servo import mine.json --model XL330-M288")
    assert outcome.code != 0
    assert "is not driven here" in outcome.err


@pytest.mark.parametrize(
    "text",
    [
        SHADOWS,
        INTERBOTIX.replace("Max_Position_Limit: 3000, Secondary_ID: 255", "Max_Position_Limit: 3000, Secondary_ID: 1"),
        WORKBENCH.replace("ID: 2\n", "ID: 4\n  Secondary_ID: 1\n"),
        DUAL,
    ],
)
def test_two_servos_on_one_joint_are_refused_with_both_ids(mission: Mission, text: str) -> None:
    Path("pair.yaml").write_text(text)
    outcome = mission("servo import pair.yaml --model MX-28 -o pair_robot.yaml")
    assert outcome.code != 0
    assert "has two servos (1 and 4), which have to turn together" in outcome.err
    assert not Path("pair_robot.yaml").exists()


@pytest.mark.parametrize("shadows", ["[elbow]", "elbow", "1"])
def test_invalid_shadows_are_refused(mission: Mission, shadows: str) -> None:
    Path("wx.yaml").write_text(f"{INTERBOTIX}shadows: {shadows}\n")
    outcome = mission("servo import wx.yaml --model XM430-W350 -o wx_robot.yaml")
    assert outcome.code == 2
    assert "'shadows' must be a mapping by motor" in outcome.err
    assert not Path("wx_robot.yaml").exists()


@pytest.mark.parametrize("name", ["elbow_mimic", "elbow_shadow", "shadow_elbow", "elbow_Slave"])
def test_a_robot_file_with_the_second_servo_of_a_joint_is_refused(name: str) -> None:
    with pytest.raises(InvalidFileError, match=f"'elbow' and '{name}' seem to be two servos on one joint"):
        parse_robot(SourceText("reactor.yaml", ARM.replace("wrist:", f"{name}:")))
    parse_robot(SourceText("reactor.yaml", ARM.replace("elbow:", "hip:").replace("wrist:", f"{name}:")))


def test_shadowing_servo_is_refused_as_a_joint() -> None:
    servo = VirtualServo(3, model="XM430-W350")
    servo.set("shadow_id", 2)
    bus, _, _ = direct_bus(VirtualServoBus([servo]))
    joint = Joint("shoulder", JointSpec(3, "XM430-W350"), MODELS["XM430-W350"])
    assert "obeys the commands of servo 2" in find_mismatch(bus, joint)
    assert "leave joint shoulder out" in joint.hint


# --- play -------------------------------------------------------------------------------------------------------------


def test_a_move_of_pypot_is_played_in_degrees(mission: Mission) -> None:
    Path("hello.json").write_text(PYPOT)
    Path("bench.yaml").write_text(ARM)
    outcome = mission("servo play hello.json --robot bench.yaml --dry-run")
    assert outcome.code == 0, outcome.err
    move = load_move(Path("hello.json"))
    assert [frame.time for frame in move.keyframes] == [0.0, 0.5]
    assert [round(degrees(frame.positions["elbow"])) for frame in move.keyframes] == [-10, 20]
    assert [round(degrees(frame.positions["wrist"])) for frame in move.keyframes] == [5, 5]
    outcome = mission("servo play hello.json --robot so101 --dry-run")
    assert outcome.code != 0
    assert "there is no joint 'elbow'" in outcome.err


def test_a_movement_of_dynamixel_workbench_is_played_in_radians(mission: Mission) -> None:
    Path("wave.yaml").write_text(MOTION)
    Path("bench.yaml").write_text(ARM)
    assert mission("servo play wave.yaml --robot bench.yaml --dry-run").code == 0
    move = load_move(Path("wave.yaml"))
    assert [(frame.time, frame.positions["elbow"]) for frame in move.keyframes] == [(0.0, 0.5), (1.5, 0.0)]


MTN = (
    b"type=motion\nversion=1.01\nenable=0 1 1 0\npage_begin\nname=Nod \xb1\ncompliance=5 5 5 5\n"
    b"play_param=0 0 1 2.0 32\nstep=512 300 700 512 0.000 0.500\nstep=512 612 512 512 0.500 2.000\npage_end\n"
    b"page_begin\nname=\npage_end\n"
)
"""A motion of RoboPlus, as a Bioloid has it; not UTF-8."""


def test_roboplus_motion_is_played_by_servo_ids(mission: Mission) -> None:
    Path("nod.mtn").write_bytes(MTN)
    Path("bench.yaml").write_text(ARM.replace("{id: 2}", "{id: 2, reverse: true, zero: 10 deg}"))
    assert mission("servo play nod.mtn --robot bench.yaml --dry-run").code == 0
    arm = load_robot(Path("bench.yaml")).keys(DynamixelKeys)
    frames = load_move(Path("nod.mtn"), arm=arm).keyframes
    assert [frame.time for frame in frames] == [0.0, 1.0, 1.25]
    tick = degrees(MODELS["AX-12A"].tick)
    assert [degrees(frame.positions["elbow"]) for frame in frames] == pytest.approx([-212 * tick, *[100 * tick] * 2])
    assert [degrees(frame.positions["wrist"]) for frame in frames] == pytest.approx([10 - 188 * tick, 10.0, 10.0])
    told = mission("servo import nod.mtn").err
    assert "nod.mtn is a motion file of RoboPlus (Bioloid, .mtn): mission servo play nod.mtn" in told


@pytest.mark.parametrize(("driver", "model"), [("feetech", "STS3215"), ("dynamixel", "MX-28")])
def test_a_motion_of_roboplus_moves_no_servos_with_other_steps(mission: Mission, driver: str, model: str) -> None:
    Path("nod.mtn").write_bytes(MTN)
    Path("bench.yaml").write_text(ARM.replace("dynamixel", driver).replace("}", f", model: {model}}}"))
    outcome = mission("servo play nod.mtn --robot bench.yaml --dry-run")
    assert outcome.code == 2
    assert f"servo 1 is an {model}: it does not have the 1024 steps of an AX" in outcome.err


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        (b"enable=0 1 1 0", b"enable=0 1 1 1", "no joint of the arm has the ID 3"),
        (b"step=512 300", b"step=512 16384", "servo 1, an AX-12A, has no step 16384"),
        (b"name=\n", b"name=Bow\nstep=1 2 3 4 0 1\n", "it has 2 pages ('Nod \xb1', 'Bow')"),
        (b"0.000 0.500", b"x y", "could not convert"),
        (b"0 1 2.0 32", b"0 1 0 32", "played 0 times as fast"),
        (b"play_param=0 0 1 2.0 32", b"play_param=0", "cannot be parsed"),
    ],
)
def test_unsuitable_roboplus_motion_is_refused(mission: Mission, before: bytes, after: bytes, words: str) -> None:
    Path("nod.mtn").write_bytes(MTN.replace(before, after))
    Path("bench.yaml").write_text(ARM)
    outcome = mission("servo play nod.mtn --robot bench.yaml --dry-run")
    assert outcome.code == 2
    assert words in outcome.err


def test_old_pypot_move_uses_its_frame_rate(mission: Mission) -> None:
    rows = [{"elbow": [0, 0]}, {"elbow": [10, 0]}]
    Path("hello.json").write_text(json.dumps({"framerate": 50.0, "positions": rows}))
    Path("bench.yaml").write_text(ARM)
    assert mission("servo play hello.json --robot bench.yaml --dry-run").code == 0
    assert [frame.time for frame in load_move(Path("hello.json")).keyframes] == [0.0, 0.02]


@pytest.mark.parametrize(
    "text",
    [
        json.dumps({"framerate": 0, "positions": [{"elbow": [1, 0]}]}),
        json.dumps({"framerate": 2, "positions": {"soon": {"elbow": [1, 0]}}}),
        json.dumps({"framerate": 2, "positions": {"0": {"elbow": [None, 0]}}}),
        json.dumps({"framerate": 2, "positions": {}}),
        json.dumps({"framerate": 2, "positions": {"0": {"elbow": [1e9, 0]}, "1": {"elbow": [0, 0]}}}),
        json.dumps({"framerate": 2, "positions": {"0": {"elbow": [float("nan"), 0]}, "1": {"elbow": [0, 0]}}}),
        MOTION.replace("step: [0.5, 0.1]", "step: [0.5]"),
    ],
)
def test_a_damaged_movement_moves_nothing(mission: Mission, text: str) -> None:
    Path("odd.json").write_text(text)
    Path("bench.yaml").write_text(ARM)
    outcome = mission("servo play odd.json --robot bench.yaml --dry-run")
    assert outcome.code not in (0, 70)
    assert "Traceback" not in outcome.err


# --- refused with one line --------------------------------------------------------------------------------------------

XML = '<?xml version="1.0"?>\n'
REFUSED = {
    "nod.mtnx": (f'{XML}<Root type="Motion" version="2"></Root>'.encode(), "RoboPlus 2.0"),
    "arm.urdf": (f'{XML}<robot name="a"><link name="b"/><joint name="c" type="fixed"/></robot>'.encode(), "URDF"),
    "arm.urdf.xacro": (f'{XML}<robot xmlns:xacro="http://ros.org/wiki/xacro" name="a"/>'.encode(), "xacro"),
    "arm.srdf": (f'{XML}<robot name="a"><group name="arm"/></robot>'.encode(), "MoveIt"),
    "world.sdf": (f'{XML}<sdf version="1.7"><model name="a"/></sdf>'.encode(), "SDF"),
    "arm.xml": (b'<mujoco model="a"></mujoco>', "MuJoCo"),
    "hello.xar": (f'{XML}<ChoregrapheProject xmlns="x"><Box/></ChoregrapheProject>'.encode(), "Choregraphe"),
    "walk.motion": (b"#WEBOTS_MOTION,V1.0,ShoulderR\n00:00:000,Pose1,0.1\n", "Webots"),
    "walk.bvh": (b"HIERARCHY\nROOT Hips\n{\n  OFFSET 0 0 0\n}\nMOTION\n", "BVH"),
    "tree.xml": (b'<root BTCPP_format="4"><BehaviorTree ID="A"/></root>', "BehaviorTree.CPP"),
    "start.launch": (b"<launch><node/></launch>", "launch file of ROS"),
    "limits.yaml": (b"joint_limits:\n  elbow: {has_velocity_limits: true}\n", "joint limits of MoveIt"),
    "kinematics.yaml": (b"arm:\n  kinematics_solver: kdl\n", "kinematics of MoveIt"),
    "moveit.yaml": (b"moveit_simple_controller_manager:\n  controller_names: [arm]\n", "configuration of MoveIt"),
    "params.yaml": (b"controller_manager:\n  ros__parameters: {update_rate: 100}\n", "parameter file of ROS 2"),
    "poppy.json": (json.dumps({"controllers": {}, "motorgroups": {}, "motors": {"a": {"id": 1}}}).encode(), "pypot"),
    "old.json": (OLD.encode(), "from before June 2025"),
    "info.json": (b'{"codebase_version": "v2.1", "features": {}, "fps": 30}', "LeRobot dataset"),
    "episodes.jsonl": (b'{"episode_index": 0, "tasks": []}\n{"episode_index": 1, "tasks": []}\n', "LeRobot dataset"),
    "chunk.parquet": (b"PAR1\x15\x04\x00", "Parquet"),
    "run.bag": (b"#ROSBAG V2.0\n\x00", "bag of ROS 1"),
    "run.db3": (b"SQLite format 3\x00", "SQLite"),
    "episode.hdf5": (b"\x89HDF\r\n\x1a\n", "HDF5"),
    "actions.npy": (b"\x93NUMPY\x01\x00", "NumPy"),
    "actions.pkl": (b"\x80\x04\x95", "pickle"),
    "arm.zip": (b"PK\x03\x04\x14\x00", "zip archive"),
    "arm.tar.gz": (b"\x1f\x8b\x08\x00", "gzip"),
    "arm.png": (b"\x89PNG\r\n\x1a\n", "a picture"),
    "arm.jpg": (b"\xff\xd8\xff\xe0", "a picture"),
    "arm.mp4": (b"\x00\x00\x00\x18ftypisom", "a film"),
    "arm.wav": (b"RIFF\x00\x00\x00\x00WAVEfmt ", "a sound"),
    "manual.pdf": (b"%PDF-1.7\n", "PDF"),
    "dance.vmd": (b"Vocaloid Motion Data 0002\x00", "MikuMikuDance"),
    "dance.fbx": (b"Kaydara FBX Binary  \x00", "FBX"),
    "arm.py": (b"#!/usr/bin/env python3\nprint(1)\n", "a program"),
    "fd.txt": (b"ID,Address,Name,Value\n1,5,ID,1\n", "is not recognised"),
    "notes.txt": (b"Zuerst den Arm heben.\n", "is not recognised"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_other_foreign_file_is_refused_with_one_line(mission: Mission, name: str) -> None:
    content, what = REFUSED[name]
    Path(name).write_bytes(content)
    for line in (f"servo play {name} --dry-run", f"servo import {name}", f"run {name} --simulate fast"):
        outcome = mission(line)
        assert outcome.code == 2, line
        (told,) = (each for each in outcome.err.splitlines() if name in each)
        assert what in told, line
        assert outcome.out == "", line


@pytest.mark.parametrize("name", ["nod.mtnx", "arm.urdf", "old.json", "poppy.json", "arm.png", "fd.txt"])
def test_no_other_file_is_restored_into_servos(mission: Mission, name: str) -> None:
    content, what = REFUSED[name]
    Path(name).write_bytes(content)
    outcome = mission(f"servo home --restore --into {name} --robot so101 --simulate --yes")
    assert outcome.code == 2
    assert what in outcome.err.splitlines()[-1]
    assert Path(name).read_bytes() == content


def test_a_folder_with_a_dataset_is_named(mission: Mission) -> None:
    Path("data/meta").mkdir(parents=True)
    Path("data/meta/info.json").write_text("{}")
    assert "is a LeRobot dataset" in mission("servo play data --dry-run").err


def test_own_files_and_spreadsheets_are_not_foreign(tmp_path: Path) -> None:
    for name, text in (("move.yaml", "gesture: a\nkeyframes:\n  - {at: 1 s, elbow: 0 deg}\n"), ("robot.yaml", ARM)):
        (tmp_path / name).write_text(text)
    assert wrong_kind_error("moves", tmp_path / "move.yaml") == ""
    assert wrong_kind_error("robots", tmp_path / "robot.yaml") == ""
    for suffix in SHEET_SUFFIXES:
        (tmp_path / f"sheet{suffix}").write_bytes(b"PK\x03\x04")
        assert wrong_kind_error("moves", tmp_path / f"sheet{suffix}") == ""


@pytest.mark.parametrize("name", ["arm.csv", "arm.xlsx"])
def test_a_sheet_is_called_a_spreadsheet_where_none_is_read(mission: Mission, name: str) -> None:
    Path(name).write_bytes(b"PK\x03\x04" if name.endswith("x") else b"time,elbow\n0,1\n")
    for line in (f"servo import {name}", f"check {name}", f"run {name} --simulate fast"):
        assert f"{name} is a spreadsheet: mission servo play {name} --robot FILE" in mission(line).err, line


def test_import_of_a_robot_file_is_refused(mission: Mission) -> None:
    Path("reactor.yaml").write_text(ARM)
    assert "reactor.yaml is a robot: " in mission("servo import reactor.yaml").err.splitlines()[-1]
