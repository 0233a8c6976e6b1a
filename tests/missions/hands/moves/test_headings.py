"""Headings with units, and sheets as people have them: titles, rows of units, further worksheets, German words."""

from math import degrees, pi
from pathlib import Path

import pytest

from config.diagnostics import InvalidFileError
from drivers.api.sections import ArmKeys
from missions.library.moves.load import load_move
from missions.library.moves.sheet import Heading, find_joint, parse_heading, time_unit
from tests.missions.hands.moves.test_load import ARM
from tests.missions.hands.moves.workbooks import Row, write_ods, write_xlsx


@pytest.fixture
def arm() -> ArmKeys:
    assert ARM is not None
    return ARM


def told(path: Path, arm: ArmKeys, *, rate: float | None = 10.0) -> list[tuple[str, str]]:
    """Return the mistakes and what is suggested."""
    with pytest.raises(InvalidFileError) as caught:
        load_move(path, rate=rate, arm=arm)
    return [(fault.message, fault.suggestion) for fault in caught.value.diagnostics]


def written(tmp_path: Path, text: str, encoding: str = "utf-8") -> Path:
    path = tmp_path / "sheet.csv"
    path.write_bytes(text.encode(encoding))
    return path


@pytest.mark.parametrize(
    ("text", "heading"),
    [
        ("Shoulder Pan (deg)", Heading("Shoulder Pan", "deg")),
        ("elbow [°]", Heading("elbow", "deg")),
        ("elbow (Grad)", Heading("elbow", "deg")),
        ("elbow{degrees}", Heading("elbow", "deg")),
        ("elbow_deg", Heading("elbow", "deg")),
        ("elbow deg", Heading("elbow", "deg")),
        ("elbow in Grad", Heading("elbow", "deg")),
        ("elbow, rad", Heading("elbow", "rad")),
        ("elbow/rad", Heading("elbow", "rad")),
        ("elbow °", Heading("elbow", "deg")),
        ("elbow (ticks)", Heading("elbow", "ticks")),
        ("time (ms)", Heading("time", "ms")),
        ("Zeit in s", Heading("Zeit", "s")),
        ("elbow", Heading("elbow", "")),
        ("left_s", Heading("left_s", "")),
        ("ROAD", Heading("ROAD", "")),
    ],
)
def test_a_heading_is_a_name_and_a_unit(text: str, heading: Heading) -> None:
    assert parse_heading(text) == heading


def test_joint_named_like_a_unit_keeps_its_name() -> None:
    assert parse_heading("elbow_rad", ["elbow_rad"]) == Heading("elbow_rad", "")
    assert find_joint("Shoulder-Pan", ["shoulder_pan"]) == "shoulder_pan"
    assert find_joint("shoulder", ["shoulder_pan"]) == ""
    assert [time_unit(text) for text in ("time", "Time (s)", "t [ms]", "zeit", "elbow (s)")] == ["s", "s", "ms", "", ""]


@pytest.mark.parametrize("heading", ["elbow (deg)", "Elbow [°]", "elbow_deg", "ELBOW (Grad)", "elbow in degrees"])
def test_degrees_in_the_heading_are_degrees(tmp_path: Path, arm: ArmKeys, heading: str) -> None:
    path = written(tmp_path, f"time;{heading}\n0;1.5\n1;90\n")
    for its in (arm, None):
        frames = load_move(path, arm=its).keyframes
        joint = next(iter(frames[0].positions))
        assert joint.lower() == "elbow"
        assert [degrees(frame.positions[joint]) for frame in frames] == pytest.approx([1.5, 90])


def test_hint_for_an_unknown_joint_keeps_the_unit(tmp_path: Path, arm: ArmKeys) -> None:
    path = written(tmp_path, "time,Elbo (deg),Wrist (deg)\n0,1.0,0.5\n0.5,1.5,1.2\n")
    ((message, hint),) = told(path, arm)
    assert message == "there is no joint 'Elbo'"
    assert hint == "did you mean 'elbow (deg)'?"
    followed = written(tmp_path, path.read_text().replace("Elbo (deg)", hint.split("'")[1]))
    frames = load_move(followed, arm=arm).keyframes
    assert degrees(frames[1].positions["elbow"]) == pytest.approx(1.5)
    assert degrees(frames[1].positions["wrist"]) == pytest.approx(1.2)


def test_hint_for_a_heading_without_unit_mentions_radians(tmp_path: Path, arm: ArmKeys) -> None:
    path = written(tmp_path, "time,Elbow\n0,1.0\n1,1.5\n")
    ((_, hint),) = told(path, arm)
    assert hint == "did you mean 'elbow'? without a unit it has radians: 'elbow (deg)' has degrees"


def test_hint_for_angles_beyond_the_limits_suggests_degrees(tmp_path: Path, arm: ArmKeys) -> None:
    path = written(tmp_path, "time,elbow\n0,10\n1,90\n")
    ((message, hint),) = told(path, arm)
    assert "outside its limits" in message
    assert hint == "are these degrees? then head the column 'elbow (deg)'"


def test_a_column_without_a_unit_beside_degrees_is_refused(tmp_path: Path, arm: ArmKeys) -> None:
    (message, hint) = ("'wrist' has no unit, and 'elbow (deg)' has degrees", "'wrist (deg)' or 'wrist (rad)'")
    path = written(tmp_path, "time,elbow (deg),wrist\n0,10,1\n1,90,1.5\n")
    ((said, cure),) = told(path, arm)
    assert (said, hint in cure) == (message, True)
    move = tmp_path / "reach.yaml"
    text = "move: reach\nsheet: sheet.csv\njoints:\n  elbow: {column: elbow (deg)}\n  wrist: {column: wrist}\n"
    move.write_text(text)
    assert told(move, arm)[0][0] == message
    move.write_text(f"{text}unit: deg\n")
    assert degrees(load_move(move, arm=arm).keyframes[1].positions["wrist"]) == pytest.approx(1.5)


@pytest.mark.parametrize("behind", ["_mrad", ".pos", " ticks"])
def test_hint_for_an_unknown_heading_suffix_lists_the_angle_units(tmp_path: Path, arm: ArmKeys, behind: str) -> None:
    ((_, hint),) = told(written(tmp_path, f"time,elbow{behind}\n0,0.1\n1,0.2\n"), arm)
    assert hint == "a column of it is headed 'elbow (deg)' or 'elbow (rad)', and has its angles in that unit"


def test_unit_that_is_not_an_angle_is_refused(tmp_path: Path, arm: ArmKeys) -> None:
    for unit in ("ticks", "%", "mm", "rev"):
        ((message, hint), *_) = told(written(tmp_path, f"time,elbow ({unit})\n0,0.1\n1,0.2\n"), arm)
        assert message == f"'{unit}' is not a unit of angle"
        assert "'elbow (deg)' or 'elbow (rad)'" in hint


def test_a_move_file_heeds_the_unit_of_a_heading(tmp_path: Path, arm: ArmKeys) -> None:
    written(tmp_path, "time,Arm (deg)\n0,0\n1,90\n")
    move = tmp_path / "reach.yaml"
    move.write_text("move: reach\nsheet: sheet.csv\njoints:\n  elbow: {column: Arm (deg)}\n")
    assert load_move(move, arm=arm).keyframes[1].positions["elbow"] == pytest.approx(pi / 2)


def test_two_columns_of_one_joint_are_refused(tmp_path: Path, arm: ArmKeys) -> None:
    ((message, _),) = told(written(tmp_path, "elbow (deg),Elbow (rad)\n1,1\n"), arm)
    assert message == "joint 'elbow' has a column already: 'elbow (deg)'"


@pytest.mark.parametrize(
    ("heading", "times"), [("time (ms)", [0.0, 0.5]), ("Time [s]", [0.0, 500.0]), ("Zeit (s)", [0.0, 500.0])]
)
def test_times_have_the_unit_of_their_heading(tmp_path: Path, arm: ArmKeys, heading: str, times: list[float]) -> None:
    path = written(tmp_path, f"{heading},elbow\n0,0.1\n500,0.2\n")
    assert [frame.time for frame in load_move(path, arm=arm).keyframes] == times


@pytest.mark.parametrize("heading", ["Zeit", "t", "timestamp"])
def test_hint_for_an_unknown_time_heading_suggests_the_name(tmp_path: Path, arm: ArmKeys, heading: str) -> None:
    ((_, hint), *_) = told(written(tmp_path, f"{heading},elbow\n0,0.1\n1,0.2\n"), arm)
    assert hint == "a column of times is headed 'time (s)' or 'time (ms)'"


@pytest.mark.parametrize("above", ["Wave of the arm\n", "Wave,,\n\n", "Versuch 3,Anna\n", "Angles in degrees\n"])
def test_a_title_row_is_named_with_the_row_of_headings(tmp_path: Path, arm: ArmKeys, above: str) -> None:
    path = written(tmp_path, f"{above}time,elbow,wrist\n0,0.1,0.2\n1,0.2,0.3\n")
    ((message, hint),) = told(path, arm)
    assert message == "a title, and no row of headings"
    assert f"above row {above.count(chr(10)) + 1}" in hint
    assert "each with its unit: 'elbow (deg)'" in hint


@pytest.mark.parametrize("units", ["s,deg,deg", "(s),(deg),(deg)", "s,°,°", "[s],Grad,", "s,deg,ticks"])
def test_a_row_of_units_goes_into_the_headings(tmp_path: Path, arm: ArmKeys, units: str) -> None:
    path = written(tmp_path, f"time,elbow,wrist\n{units}\n0,1,2\n1,2,3\n")
    ((message, hint),) = told(path, arm)
    assert message == "a row of units"
    assert "'time (s)', 'elbow (" in hint


def test_blank_rows_a_mark_at_the_beginning_and_a_line_of_excel_are_borne(tmp_path: Path, arm: ArmKeys) -> None:
    text = "sep=;\r\n\r\ntime;elbow (deg)\r\n0;10\r\n1;20\r\n\r\n"
    path = written(tmp_path, text, "utf-8-sig")
    assert degrees(load_move(path, arm=arm).keyframes[1].positions["elbow"]) == pytest.approx(20)
    ((message, hint),) = told(written(tmp_path, "time;elbow\n0;0.1\n\n1;0.2\n"), arm)
    assert (message, hint) == ("an empty row", "remove it: every row is a moment")
    ((message, hint),) = told(written(tmp_path, "Zeit (s);elbow (Grad)\n0;1,5\n1;2,5\n"), arm)
    assert "has a decimal comma" in message
    assert hint == "write numbers with a point: 0.25"
    ((message, hint),) = told(written(tmp_path, "time;elbow\n0;1\n", "utf-16"), arm)
    assert message.startswith("not UTF-8")
    assert hint == "save the file as UTF-8"


GOOD: list[Row] = [("time", "elbow (deg)"), (0.0, 10.0), (1.0, 20.0)]


@pytest.mark.parametrize("write", [write_xlsx, write_ods])
def test_further_worksheets_are_named(tmp_path: Path, arm: ArmKeys, write: object) -> None:
    path = tmp_path / ("book.xlsx" if write is write_xlsx else "book.ods")
    write(path, {"first": GOOD, "second": GOOD})  # type: ignore[operator]
    move = load_move(path, arm=arm)
    assert move.summary == "sheet 'first' is read, and not 'second'; a move file names another: tab: NAME"
    write(path, {"notes": [("About this",), ("file",)], "angles": GOOD})  # type: ignore[operator]
    ((message, hint), *_) = told(path, arm)
    assert message
    assert "sheet 'notes' is read, and not 'angles'" in hint
    write(path, {"empty": [], "angles": GOOD})  # type: ignore[operator]
    ((_, hint),) = told(path, arm)
    assert "not 'angles'" in hint


def test_hidden_sheet_is_read_only_if_named(tmp_path: Path, arm: ArmKeys) -> None:
    path = write_xlsx(tmp_path / "book.xlsx", {"old": [("time", "elbow"), (0.0, 1.0)], "new": GOOD}, hidden={"old"})
    move = load_move(path, arm=arm)
    assert degrees(move.keyframes[0].positions["elbow"]) == pytest.approx(10)
    assert "sheet 'new' is read, and not 'old'" in move.summary


def test_empty_cells_give_a_hint_about_merged_cells(tmp_path: Path, arm: ArmKeys) -> None:
    path = write_xlsx(tmp_path / "book.xlsx", {"a": [("time", "elbow"), (0.0, 0.1), (1.0, None)]})
    ((message, hint),) = told(path, arm)
    assert message == "an empty cell"
    assert "of merged cells the first one has the value" in hint
    path = write_xlsx(tmp_path / "book.xlsx", {"a": [("time", "elbow", None), (0.0, 0.1, 0.2), (1.0, 0.1, 0.2)]})
    ((message, hint), *_) = told(path, arm)
    assert message == "a cell without a heading"
    assert "also below merged cells" in hint
