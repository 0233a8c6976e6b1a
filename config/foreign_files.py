"""Recognition of files of other programs by their content, with the commands that can use them."""

import json
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from config.file_io import open_regular, read_regular

MAX_HEAD_BYTES = 65_536
"""Number of bytes at the start of a file by which it is recognised. JSON files are read completely."""

MAX_JSON_BYTES = 20_000_000


class ForeignFile(NamedTuple):
    """Recognised file: ``description`` with an article, and ``usage`` with {0} for its path.

    ``form`` is the format name for ``mission servo import`` or ``play``; empty for all other files.
    """

    description: str
    usage: str
    form: str = ""


Data = Mapping[str, Any]

_RECORD = "record the movement by hand: mission servo record NAME --robot FILE"
_PLAY = "mission servo play {0} --robot FILE --dry-run"
_IMPORT = "mission servo import {0} -o my_robot.yaml"
_UNUSED = "nothing here reads it"
_JOINTS = "nothing here reads it; `mission robot new` makes a robot file of the servos that are plugged in"
_DATASET = f"its movements cannot be played; {_RECORD}"

_MAGIC: tuple[tuple[int, bytes, str, str], ...] = (
    (0, b"\x89PNG", "a picture (PNG)", _UNUSED),
    (0, b"\xff\xd8\xff", "a picture (JPEG)", _UNUSED),
    (0, b"GIF8", "a picture (GIF)", _UNUSED),
    (0, b"BM", "a picture (BMP)", _UNUSED),
    (8, b"WEBP", "a picture (WebP)", _UNUSED),
    (8, b"WAVE", "a sound (WAV)", "mission hear --for 'yes, no' --wav {0}"),
    (8, b"AVI ", "a film (AVI)", _UNUSED),
    (4, b"ftyp", "a film (MP4)", _UNUSED),
    (0, b"\x1aE\xdf\xa3", "a film (Matroska)", _UNUSED),
    (0, b"OggS", "a sound (Ogg)", _UNUSED),
    (0, b"ID3", "a sound (MP3)", _UNUSED),
    (0, b"%PDF", "a PDF document", _UNUSED),
    (0, b"PK\x03\x04", "a zip archive", "unpack it; a workbook has to end in .xlsx or .ods"),
    (0, b"\x1f\x8b", "a compressed archive (gzip)", "unpack it"),
    (0, b"7z\xbc\xaf\x27\x1c", "an archive (7z)", "unpack it"),
    (0, b"BZh", "a compressed archive (bzip2)", "unpack it"),
    (0, b"\xfd7zXZ", "a compressed archive (xz)", "unpack it"),
    (0, b"Rar!", "an archive (RAR)", "unpack it"),
    (257, b"ustar", "an archive (tar)", "unpack it"),
    (0, b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "an old Office document", "a workbook has to end in .xls"),
    (0, b"PAR1", "a table in Parquet, as the episodes of a LeRobot dataset", _DATASET),
    (0, b"ARROW1", "a table in Arrow, as LeRobot datasets of old", _DATASET),
    (0, b"#ROSBAG", "a bag of ROS 1", _DATASET),
    (0, b"SQLite format 3", "a database (SQLite), as bags of ROS 2 are", _DATASET),
    (0, b"\x89HDF", "an HDF5 file, as recordings of ALOHA are", _DATASET),
    (0, b"\x93NUMPY", "an array of NumPy", _DATASET),
    (0, b"\x80\x04", "a pickle of Python", "nothing here opens one: it may run any program"),
    (0, b"\x80\x05", "a pickle of Python", "nothing here opens one: it may run any program"),
    (0, b"\x7fELF", "a program", _UNUSED),
    (0, b"glTF", "a 3-D model (glTF)", _UNUSED),
    (0, b"BLENDER", "a scene of Blender", _RECORD),
    (0, b"Kaydara FBX", "an animation (FBX)", _RECORD),
    (0, b"Vocaloid Motion Data", "a dance of MikuMikuDance (VMD)", _RECORD),
)

_TEXTS: tuple[tuple[str, str, str], ...] = (
    (r"\A#WEBOTS_MOTION\b", "a motion file of Webots", _RECORD),
    (r"\A\s*HIERARCHY\s+ROOT\b", "a motion capture file (BVH)", _RECORD),
    (r"<Root\b[^>]*\btype=.[Mm]otion", "a motion file of RoboPlus 2.0 (.mtnx)", _RECORD),
    (r"<ChoregrapheProject\b|choregraphe/project", "a behaviour of Choregraphe (NAO, Pepper)", _RECORD),
    (r"<robot\b[\s\S]*<(group|group_state|disable_collisions|end_effector)\b", "an SRDF file of MoveIt", _JOINTS),
    (r"xmlns:xacro|<xacro:", "a xacro robot description", _JOINTS),
    (r"<robot\b", "a URDF robot description", _JOINTS),
    (r"<sdf\b", "an SDF file of Gazebo", _JOINTS),
    (r"<mujoco\b", "a model of MuJoCo (MJCF)", _JOINTS),
    (r"<launch\b", "a launch file of ROS", _UNUSED),
    (r"<root\b[^>]*BTCPP_format|<BehaviorTree\b", "a tree of BehaviorTree.CPP",
     "write it as a mission: docs/language.md; mission check MISSION.yaml"),
    (r"<COLLADA\b", "a 3-D model (COLLADA)", _UNUSED),
    (r"<package\b[\s\S]*<name>", "the package.xml of a ROS package", _UNUSED),
    (r"\A\s*(<\?xml|<!DOCTYPE|<html)", "a page or file in XML", _UNUSED),
    (r"\Asolid\s", "a 3-D model (STL)", _UNUSED),
    (r"\A#!", "a program", _UNUSED),
)  # fmt: skip

OLD_LEROBOT_KEYS = frozenset({"motor_names", "homing_offset", "drive_mode", "start_pos", "end_pos"})
"""Keys of LeRobot's calibrations until June 2025."""


def recognise_file(path: Path) -> ForeignFile | None:
    """Return the description of a file of another program, or None if it is unknown or unreadable."""
    if path.is_dir():
        if (path / "meta" / "info.json").is_file():
            return ForeignFile("a LeRobot dataset", _DATASET)
        return None
    try:
        with open_regular(path) as file:
            data = file.read(MAX_HEAD_BYTES) or b""
    except (OSError, ValueError):
        return None
    for place, magic, description, usage in _MAGIC:
        if data[place:].startswith(magic):
            return ForeignFile(description, usage)
    text = data.decode("utf-8-sig", errors="replace")
    if re.search(r"^\s*(type=motion|page_begin)\s*$", text, re.MULTILINE):
        return ForeignFile("a motion file of RoboPlus (Bioloid, .mtn)", _PLAY, "roboplus")
    for pattern, description, usage in _TEXTS:
        if re.search(pattern, text, re.MULTILINE):
            return ForeignFile(description, usage)
    return _recognise_data(read_plain_data(path, text))


def read_plain_data(path: Path, beginning: str = "") -> Any:
    """Return the data of a JSON or YAML file as plain Python values, or None if it is neither.

    Of a file of JSON lines, only the first line is returned, under the key `_lines`. ``beginning`` is the beginning of
    the text, if it is known.
    """
    try:
        if (beginning or "{").lstrip().startswith(("{", "[")):
            text = read_regular(path, MAX_JSON_BYTES).decode("utf-8-sig")
            try:
                return json.loads(text)
            except ValueError:
                try:
                    return {"_lines": json.loads(text.lstrip().partition("\n")[0])}
                except ValueError:
                    pass  # YAML that begins with a bracket
        from config.diagnostics import InvalidFileError  # noqa: PLC0415 - few files are asked for
        from config.yaml_nodes import compose, read_source  # noqa: PLC0415 - as above

        try:
            return _plain(compose(read_source(path)))
        except InvalidFileError:
            return None
    except (OSError, ValueError, RecursionError):
        return None


def _plain(node: Any) -> Any:
    """Return a YAML node as plain Python values."""
    from config.yaml_nodes import Listing, Scalar  # noqa: PLC0415 - as above

    if isinstance(node, Scalar):
        return node.value
    if isinstance(node, Listing):
        return [_plain(item) for item in node.items]
    return {key.text: _plain(value) for key, value in node.entries}


def _recognise_data(data: Any) -> ForeignFile | None:
    """Return the description of JSON or YAML data by its keys, or None."""
    if not isinstance(data, Mapping):
        return None
    return next((found for fits, found in _SHAPES if fits(data)), None)


def _has(*keys: str) -> Callable[[Data], bool]:
    """Return a predicate that is true for mappings with all of ``keys``."""
    return lambda data: {*keys} <= data.keys()


def _has_one(*keys: str) -> Callable[[Data], bool]:
    return lambda data: bool({*keys} & data.keys())


def _each_has(*keys: str) -> Callable[[Data], bool]:
    """Return a predicate that is true for mappings whose values all are mappings with all of ``keys``."""
    return lambda data: (
        bool(data) and all(isinstance(part, Mapping) and {*keys} <= part.keys() for part in data.values())
    )


def _some_has(*keys: str) -> Callable[[Data], bool]:
    """Return a predicate that is true for mappings with a value that is a mapping with one of ``keys``."""
    return lambda data: any(isinstance(part, Mapping) and {*keys} & part.keys() for part in data.values())


def _within(key: str, fits: Callable[[Data], bool]) -> Callable[[Data], bool]:
    return lambda data: isinstance(data.get(key), Mapping) and fits(data[key])


def _is_arbotix(data: Data) -> bool:
    joints = data.get("joints")
    return "robot" not in data and isinstance(joints, Mapping) and _each_has("id")(joints)


def _is_motion(data: Data) -> bool:
    """Return True for a movement in the format of dynamixel_workbench."""
    return _within("joint", _has("names"))(data) and _within("motion", _has("names"))(data)


_SHAPES: tuple[tuple[Callable[[Data], bool], ForeignFile], ...] = (
    (_has(*OLD_LEROBOT_KEYS), ForeignFile(
        "a calibration of LeRobot's from before June 2025, whose offsets are in no servo",
        "calibrate the arm with today's lerobot-calibrate, and name its file")),
    (_each_has("id", "homing_offset", "range_min", "range_max"), ForeignFile(
        "a calibration of LeRobot's", f"write calibration: {{0}} in a robot file, or {_IMPORT}", "lerobot")),
    (_has("framerate", "positions"), ForeignFile(
        "a move of pypot (Poppy)", _PLAY, "pypot")),
    (_has("controllers", "motorgroups", "motors"), ForeignFile("a robot configuration of pypot (Poppy)", _JOINTS)),
    (_some_has("motor", "motor_master", "joint_name"), ForeignFile(
        "a file of dynamixel_controllers (ROS)", _IMPORT, "ros")),
    (_is_arbotix, ForeignFile("a file of the ArbotiX driver (ROS)", _IMPORT, "arbotix")),
    (_within("motors", _each_has("ID")), ForeignFile("a file of an Interbotix arm (ROS)", _IMPORT, "interbotix")),
    (_each_has("ID"), ForeignFile("a file of dynamixel_workbench (ROS)", _IMPORT, "workbench")),
    (_is_motion, ForeignFile(
        "a movement of dynamixel_workbench (ROS)", _PLAY, "motion")),
    (_has("serial_ports"), ForeignFile("ports of the servo manager of dynamixel_controllers (ROS)", _UNUSED)),
    (_has("_target_"), ForeignFile("a configuration of LeRobot's", _UNUSED)),
    (_some_has("ros__parameters"), ForeignFile("a parameter file of ROS 2", _JOINTS)),
    (_has("joint_limits"), ForeignFile("joint limits of MoveIt", _JOINTS)),
    (_some_has("kinematics_solver"), ForeignFile("kinematics of MoveIt", _UNUSED)),
    (_has_one("controller_list", "controller_names", "moveit_simple_controller_manager", "planner_configs",
              "planning_plugin"), ForeignFile("a configuration of MoveIt", _UNUSED)),
    (_has("rosbag2_bagfile_information"), ForeignFile("the description of a bag of ROS 2", _DATASET)),
    (_has("codebase_version", "features"), ForeignFile("the description of a LeRobot dataset", _DATASET)),
    (_within("_lines", _has_one("episode_index", "task_index")), ForeignFile("a list of a LeRobot dataset", _DATASET)),
    (_some_has("controller"), ForeignFile("a file of dynamixel_controllers (ROS)", _IMPORT, "ros")),
)  # fmt: skip
