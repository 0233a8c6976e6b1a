"""Movements out of files of every kind, and every mistake at its line, or its row and column."""

from math import cos, degrees, pi, radians, sin
from pathlib import Path

import pytest

from config.diagnostics import InvalidFileError, SourceText
from config.gesture import GestureConfig, parse_gesture
from config.yaml_writer import gesture_text
from drivers.api import Gesture, Keyframe
from drivers.api.sections import ArmKeys
from drivers.servos.models import MODELS
from missions.library.drivers import parse_robot
from missions.library.moves.load import load_move
from tests.missions.hands.moves.workbooks import Row, write_ods, write_xlsx

ARM = parse_robot(
    SourceText(
        "robot.yaml",
        "robot: r\narm:\n  driver: dynamixel\n  port: x\n  joints:\n"
        "    elbow: {id: 1, limits: [0 deg, 120 deg]}\n    wrist: {id: 2, model: MX-28}\n",
    )
).arm
TICK = MODELS["AX-12A"].tick


@pytest.fixture
def arm() -> ArmKeys:
    assert ARM is not None
    return ARM


@pytest.fixture
def sheet(tmp_path: Path) -> Path:
    return tmp_path / "reach.csv"


def described(sheet: Path, rows: str, joints: str, *rest: str) -> Path:
    """Write a sheet and a move file for it."""
    sheet.write_text(rows, encoding="utf-8")
    file = sheet.with_suffix(".yaml")
    lines = ["move: reach", f"sheet: {sheet.name}", *rest, "joints:", *(f"  {line}" for line in joints.splitlines())]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return file


def mistakes(path: Path, *, rate: float | None = 10.0, arm: ArmKeys | None = None) -> list[str]:
    """Return the mistakes, each as FILE:row:column: words."""
    with pytest.raises(InvalidFileError) as caught:
        load_move(path, rate=rate, arm=arm)
    faults = caught.value.diagnostics
    return [
        f"{Path(fault.source.name).name}:{fault.mark.line}:{fault.mark.column}: {fault.message}" for fault in faults
    ]


def test_sheet_columns_become_joints_at_the_given_rate(sheet: Path) -> None:
    sheet.write_text("elbow,wrist\n0,0.25\n0.5,0.25\n1.25,-0.5\n", encoding="utf-8")
    assert load_move(sheet, rate=50.0) == Gesture(
        "reach",
        "",
        (
            Keyframe(0.0, {"elbow": 0.0, "wrist": 0.25}),
            Keyframe(0.02, {"elbow": 0.5, "wrist": 0.25}),
            Keyframe(0.04, {"elbow": 1.25, "wrist": -0.5}),
        ),
        "cubic",
    )


def test_time_column_sets_the_keyframe_times(sheet: Path) -> None:
    sheet.write_text("elbow,time\n0,3.5\n0.5,3.75\n1,4.5\n", encoding="utf-8")
    move = load_move(sheet)
    assert [frame.time for frame in move.keyframes] == [0.0, 0.25, 1.0]
    assert all(frame.positions.keys() == {"elbow"} for frame in move.keyframes)


def test_all_spreadsheet_formats_load_the_same_move(tmp_path: Path, arm: ArmKeys) -> None:
    rows: list[Row] = [("time", "elbow", "wrist"), (0.0, 0.0, 0.25), (0.5, 0.5, 0.25), (1.0, 1.25, -0.5)]
    text = "\n".join(";".join(str(cell) for cell in row) for row in rows)
    (tmp_path / "two_joints.csv").write_text(text, encoding="utf-8")
    old = tmp_path / "old.yaml"
    here = Path(__file__).parent / "two_joints.xls"
    old.write_text(
        f"move: two_joints\nsheet: {here}\ntab: moves\njoints: {{elbow: {{column: elbow}}, wrist: {{column: wrist}}}}\n"
    )
    moves = [
        load_move(path, arm=arm)
        for path in (
            tmp_path / "two_joints.csv",
            write_xlsx(tmp_path / "two_joints.xlsx", {"a": rows}),
            write_ods(tmp_path / "two_joints.ods", {"a": rows}),
            old,
        )
    ]
    assert all(move == moves[0] for move in moves)
    assert moves[0].keyframes[2] == Keyframe(1.0, {"elbow": 1.25, "wrist": -0.5})


def test_move_file_sets_sign_offset_and_unit_of_columns(sheet: Path) -> None:
    file = described(
        sheet,
        "L_ELBOW,other\n10,0\n100,0\n",
        "elbow: {column: L_ELBOW, sign: -1, offset: 90 deg}",
        "summary: As filmed.",
        "rate: 2 Hz",
        "unit: deg",
    )
    move = load_move(file, rate=50.0)
    assert (move.name, move.summary, move.interpolation) == ("reach", "As filmed.", "cubic")
    assert [frame.time for frame in move.keyframes] == [0.0, 0.5]
    assert [degrees(frame.positions["elbow"]) for frame in move.keyframes] == pytest.approx([80, -10])


def arm_of_points(bends: list[float], *, lift: float = 0.3) -> str:
    """Return rows of a shoulder at the origin, an elbow 0.3 to its side, and a wrist that bends away from it."""
    rows = ["shoulder_x,shoulder_y,shoulder_z,elbow_x,elbow_y,elbow_z,wrist_x,wrist_y,wrist_z"]
    for bend in bends:
        wrist = (0.25 * sin(bend), lift + 0.25 * cos(bend), 0.0)
        rows.append(",".join(str(value) for value in (0, 0, 0, 0, lift, 0, *wrist)))
    return "\n".join(rows) + "\n"


def test_body_points_become_joint_angles(sheet: Path) -> None:
    bends = [0.0, 0.3, 1.0, 1.5]
    file = described(
        sheet, arm_of_points(bends), "elbow: {points: [shoulder, elbow, wrist], sign: -1, offset: 180 deg}"
    )
    move = load_move(file, rate=25.0)
    assert [frame.positions["elbow"] for frame in move.keyframes] == pytest.approx(bends, abs=1e-6)
    assert [frame.time for frame in move.keyframes] == pytest.approx([0.0, 0.04, 0.08, 0.12])


def test_seen_along_an_axis_only_the_other_two_count(sheet: Path) -> None:
    rows = "hip_y,hip_z,shoulder_y,shoulder_z,elbow_y,elbow_z\n0,-1,0,0,0.3,-0.3\n0,-1,0,0,0.3,0\n"
    file = described(sheet, rows, "elbow: {points: [hip, shoulder, elbow], plane: yz}")
    assert [frame.positions["elbow"] for frame in load_move(file, rate=1.0).keyframes] == pytest.approx(
        [pi / 4, pi / 2]
    )


def test_noise_below_a_step_of_the_servo_moves_nothing(sheet: Path, arm: ArmKeys) -> None:
    noise = [0.5, 0.5 + 0.9 * TICK, 0.5 - 0.9 * TICK, 0.5 + 1.1 * TICK]
    sheet.write_text("elbow,wrist\n" + "".join(f"{angle},{angle}\n" for angle in noise), encoding="utf-8")
    frames = load_move(sheet, rate=10.0, arm=arm).keyframes
    assert [frame.positions["elbow"] for frame in frames] == [0.5, 0.5, 0.5, noise[3]]
    assert [frame.positions["wrist"] for frame in frames] == noise  # an MX-28 has finer steps
    assert [frame.positions["elbow"] for frame in load_move(sheet, rate=10.0).keyframes] == noise


def test_move_file_can_set_the_dead_band(sheet: Path, arm: ArmKeys) -> None:
    file = described(sheet, "e\n0.5\n0.55\n0.7\n", "elbow: {column: e}", "dead_band: 0.1 rad")
    assert [frame.positions["elbow"] for frame in load_move(file, rate=1.0, arm=arm).keyframes] == [0.5, 0.5, 0.7]


def test_limb_without_length_is_reported_with_its_row(sheet: Path) -> None:
    rows = arm_of_points([0.1, 0.2]) + "0,0,0,0,0,0,0.2,0.3,0\n" + "0,0,0,1,0,0,1,0,0\n"
    file = described(sheet, rows, "elbow: {points: [shoulder, elbow, wrist]}")
    assert mistakes(file) == [
        "reach.csv:4:4: joint 'elbow': two of its points coincide, and in 1 more row",
    ]


def test_angles_beyond_the_limits_are_reported_at_the_first_row(sheet: Path, arm: ArmKeys) -> None:
    sheet.write_text("wrist,elbow\n0,0\n0,2.2\n4,-0.1\n", encoding="utf-8")
    assert mistakes(sheet, arm=arm) == [
        "reach.csv:3:2: 'elbow' at 126.051 deg is outside its limits, 0 deg to 120 deg, and in 1 more row",
        "reach.csv:4:1: 'wrist' at 229.183 deg is outside its limits, -148.969 deg to 148.969 deg",
    ]
    assert load_move(sheet, rate=10.0).keyframes[2].positions["wrist"] == 4.0


def test_all_faults_of_a_sheet_are_reported_together(sheet: Path, arm: ArmKeys) -> None:
    sheet.write_text("time,elbow,wrist\n0,x,0\n0.1,,1\n0.2,0.3,1;2\n", encoding="utf-8")
    assert mistakes(sheet, arm=arm) == [
        "reach.csv:2:2: 'x' is not a number",
        "reach.csv:3:2: an empty cell",
        "reach.csv:4:3: '1;2' is not a number",
    ]
    sheet.write_text("elbw,hand_x,wrist\n0,0,0\n", encoding="utf-8")
    with pytest.raises(InvalidFileError) as caught:
        load_move(sheet, rate=10.0, arm=arm)
    assert [(fault.mark.column, fault.message, fault.suggestion) for fault in caught.value.diagnostics] == [
        (
            1,
            "there is no joint 'elbw'",
            "did you mean 'elbow'? without a unit it has radians: 'elbow (deg)' has degrees",
        ),
        (2, "there is no joint 'hand_x'", "a move file says of which points a joint is made"),
    ]


def test_times_have_to_rise(sheet: Path) -> None:
    sheet.write_text("time,elbow\n0,0\n0.1,0\n0.1,0\n0.05,0\n", encoding="utf-8")
    assert mistakes(sheet) == [
        "reach.csv:4:1: 0.1 s is not later than the 0.1 s of the row before",
        "reach.csv:5:1: 0.05 s is not later than the 0.1 s of the row before",
    ]
    sheet.write_text("time,elbow\n0,0\nlate,0\n", encoding="utf-8")
    assert mistakes(sheet) == ["reach.csv:3:1: 'late' is not a number"]


def test_rows_without_times_need_a_rate(sheet: Path) -> None:
    sheet.write_text("# ours\nelbow\n0\n", encoding="utf-8")
    assert mistakes(sheet, rate=None) == ["reach.csv:2:1: it has no times"]
    sheet.write_text("time\n0\n", encoding="utf-8")
    assert mistakes(sheet, rate=None) == ["reach.csv:1:1: there is no column of a joint"]


def test_missing_columns_of_a_move_file_are_reported(sheet: Path, arm: ArmKeys) -> None:
    file = described(
        sheet, "elbov,a_x,a_y\n0,0,0\n", "elbow: {column: elbow}\nwrist: {points: [a, b, c], plane: xy}", "rate: 1 Hz"
    )
    found = mistakes(file, arm=arm)
    assert found[0] == "reach.csv:1:1: there is no column 'elbow', of which joint 'elbow' is made"
    assert [line.split("'")[1] for line in found[1:]] == ["b_x", "b_y", "c_x", "c_y"]


def test_move_file_faults_are_reported_before_sheet_faults(sheet: Path, arm: ArmKeys) -> None:
    file = described(sheet, "e\nx\n", "elbw: {column: e}")
    assert mistakes(file, arm=arm) == ["reach.yaml:4:3: there is no joint 'elbw'"]
    sheet.unlink()
    assert mistakes(file) == ["reach.csv:1:1: cannot be read: No such file or directory"]


def test_a_gesture_file_is_a_movement_too(tmp_path: Path, arm: ArmKeys) -> None:
    file = tmp_path / "nod.yaml"
    file.write_text("gesture: nod\nkeyframes:\n  - {at: 1 s, wrist: 200 deg}\n", encoding="utf-8")
    assert load_move(file) == Gesture("nod", "", (Keyframe(1.0, {"wrist": radians(200)}),), "minimum_jerk")
    (fault,) = mistakes(file, arm=arm)
    assert fault.startswith("nod.yaml:3:22: 'wrist' at 200 deg is outside its limits")
    assert mistakes(tmp_path / "gone.yaml") == ["gone.yaml:1:1: cannot be read: No such file or directory"]


def test_move_can_be_stored_as_a_gesture_file(sheet: Path) -> None:
    sheet.write_text("elbow,wrist\n0,0.25\n0.5,0.25\n1.25,-0.5\n", encoding="utf-8")
    move = load_move(sheet, rate=50.0)
    frames = tuple((frame.time, frame.positions) for frame in move.keyframes)
    kept = parse_gesture(
        SourceText("x", gesture_text(GestureConfig(move.name, "", frames, move.interpolation)))
    ).movement
    assert kept.keyframes[1] == Keyframe(0.02, {"elbow": 0.5})
    assert (kept.name, kept.interpolation, len(kept.keyframes)) == ("reach", "cubic", 3)
