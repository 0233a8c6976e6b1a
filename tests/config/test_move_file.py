"""Move files: which columns and which points of a body make which joint."""

from math import radians
from pathlib import Path

import pytest

from config.diagnostics import Diagnostic, InvalidFileError, SourceText
from config.move import JointSource, MoveConfig, is_move, parse_move

WHOLE = """\
move: reach
summary: A reach.
sheet: reach.xlsx
tab: Camera
rate: 50 Hz
unit: deg
dead_band: 0.5 deg
joints:
  elbow: {column: L_ELBOW, sign: -1, offset: 90 deg}
  wrist: {points: [elbow, wrist, hand]}
  shoulder: {points: [hip, shoulder, elbow], plane: yz, sign: 1}
"""


def read(text: str, joints: tuple[str, ...] | None = None) -> MoveConfig:
    return parse_move(SourceText("move.yaml", text), Path("folder"), joints)


def mistakes(text: str, joints: tuple[str, ...] | None = None) -> list[Diagnostic]:
    with pytest.raises(InvalidFileError) as caught:
        read(text, joints)
    return list(caught.value.diagnostics)


def test_move_file_defines_the_source_of_each_joint() -> None:
    move = read(WHOLE)
    assert (move.name, move.summary, move.sheet) == ("reach", "A reach.", Path("folder/reach.xlsx"))
    assert (move.tab, move.rate, move.degrees, move.dead_band) == ("Camera", 50.0, True, radians(0.5))
    assert move.joints == {
        "elbow": JointSource("L_ELBOW", sign=-1, offset=radians(90)),
        "wrist": JointSource(points=("elbow", "wrist", "hand")),
        "shoulder": JointSource(points=("hip", "shoulder", "elbow"), plane="yz"),
    }


def test_omitted_move_keys_stay_unset() -> None:
    move = read("move: m\nsheet: m.csv\njoints: {elbow: {column: elbow}}\n")
    assert (move.tab, move.rate, move.degrees, move.dead_band) == (None, None, False, None)
    assert move.joints["elbow"] == JointSource("elbow")


def test_joint_source_lists_its_column_headings() -> None:
    joints = read(WHOLE).joints
    assert joints["elbow"].headings == ["L_ELBOW"]
    assert joints["wrist"].headings[:4] == ["elbow_x", "elbow_y", "elbow_z", "wrist_x"]
    assert joints["shoulder"].headings == ["hip_y", "hip_z", "shoulder_y", "shoulder_z", "elbow_y", "elbow_z"]


def test_move_file_is_distinguished_from_a_gesture() -> None:
    assert is_move(SourceText("x", WHOLE))
    assert is_move(SourceText("x", "# a sheet\nsheet: x.csv\n"))
    assert not is_move(SourceText("x", "gesture: move\nsummary: sheet\nkeyframes:\n  - {at: 1 s, sheet: 1 deg}\n"))


def test_all_move_file_faults_are_reported_with_position() -> None:
    faults = mistakes(
        "move: m\n"
        "tempo: 50 Hz\n"
        "sheet: m.csv\n"
        "rate: 50\n"
        "unit: grad\n"
        "joints:\n"
        "  a: {}\n"
        "  b: {column: b, points: [x, y, z]}\n"
        "  c: {points: [x, y]}\n"
        "  d: {points: [x, y, x]}\n"
        "  e: {column: e, sign: 2, plane: xy}\n"
        "  f: {points: [x, y, z], plane: zy, offset: 3}\n"
        "  g: wrist\n"
    )
    assert [(fault.mark.line, fault.mark.column, fault.message) for fault in faults] == [
        (2, 1, "a move file has no key 'tempo'"),
        (4, 7, "'rate' needs a frequency such as '20 Hz': '50' has no unit (units: Hz)"),
        (5, 7, "'unit' cannot be 'grad'"),
        (7, 6, "joint 'a' needs either 'column' or 'points'"),
        (8, 6, "joint 'b' needs either 'column' or 'points'"),
        (9, 15, "'points' needs three points, such as [shoulder, elbow, wrist]"),
        (10, 15, "'points' needs three points, such as [shoulder, elbow, wrist]"),
        (11, 24, "'sign' cannot be '2'"),
        (11, 27, "joint 'e' has no key 'plane'"),
        (12, 33, "'plane' cannot be 'zy'"),
        (12, 45, "'offset' needs an angle such as '30 deg': '3' has no unit (units: deg, rad)"),
        (13, 6, "joint 'g' must be a mapping of keys to values, such as 'name: value'"),
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("move: m\njoints: {a: {column: a}}\n", "a move file needs 'sheet'"),
        ("sheet: m.csv\njoints: {a: {column: a}}\n", "a move file needs 'move'"),
        ("move: m\nsheet: m.csv\n", "a move file needs 'joints'"),
        ("move: m\nsheet: m.csv\njoints: {}\n", "'joints' needs at least one joint"),
    ],
)
def test_a_move_needs_a_name_a_sheet_and_joints(text: str, message: str) -> None:
    assert [fault.message for fault in mistakes(text)] == [message]


def test_unknown_joint_gives_a_suggestion() -> None:
    (fault,) = mistakes(WHOLE, ("elbow", "wrist", "shoulder_roll"))
    assert (fault.mark.line, fault.message) == (11, "there is no joint 'shoulder'")
    assert fault.suggestion == "did you mean 'shoulder_roll'?"
