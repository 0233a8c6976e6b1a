"""Spreadsheets of every kind, and everything that may be wrong with one, each at its row and column."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.diagnostics import InvalidFileError
from missions.library.moves import sheet as sheets
from missions.library.moves import sheet as workbook
from missions.library.moves.sheet import read_sheet
from tests.missions.hands.moves.workbooks import Row, write_ods, write_xlsx

ROWS: list[Row] = [("time", "elbow", "wrist"), (0.0, 0.0, 0.25), (0.5, 0.5, 0.25), (1.0, 1.25, -0.5)]
XLS = Path(__file__).parent / "two_joints.xls"

Write = Callable[[Path, Mapping[str, Sequence[Row]]], Path]
WRITERS: list[tuple[str, Write]] = [("xlsx", write_xlsx), ("ods", write_ods)]


def csv(folder: Path, text: str) -> Path:
    path = folder / "move.csv"
    path.write_text(text, encoding="utf-8")
    return path


def mistakes(path: Path, tab: str | None = None) -> list[tuple[int, int, str]]:
    with pytest.raises(InvalidFileError) as caught:
        read_sheet(path, tab)
    assert all(fault.source.name == str(path) for fault in caught.value.diagnostics)
    return [(fault.mark.line, fault.mark.column, fault.message) for fault in caught.value.diagnostics]


@pytest.mark.parametrize(
    "text",
    [
        "time,elbow,wrist\n0,0,0.25\n0.5,0.5,.25\n1,1.25,-0.5\n",
        "time;elbow;wrist\r\n0;0;0.25\r\n0.5;5e-1;0.25\r\n1;+1.25;-0.5\r\n",
        "\ufeff# ours\n\ntime\telbow\twrist\n0\t0\t0.25\n# half way\n 0.5 \t0.5\t0.25\n1\t1.25\t-0.5\n\n\t\t\n",
        '"time","elbow","wrist"\n"0","0","0.25"\n0.5,0.5,0.25,,\n1,1.25,-0.5\n',
    ],
)
def test_values_separated_by_commas_semicolons_or_tabs_are_columns(tmp_path: Path, text: str) -> None:
    sheet = read_sheet(csv(tmp_path, text))
    assert list(sheet.headings) == ["time", "elbow", "wrist"]
    assert sheet.read_numbers("elbow") == [0.0, 0.5, 1.25]
    assert sheet.read_numbers("wrist") == [0.25, 0.25, -0.5]
    assert sheet.faults == []


@pytest.mark.parametrize(("kind", "write"), WRITERS)
def test_workbook_is_read_from_the_first_or_the_named_sheet(tmp_path: Path, kind: str, write: Write) -> None:
    path = write(tmp_path / f"move.{kind}", {"moves": ROWS, "more": [("wrist",), (1.5,)]})
    assert read_sheet(path).read_numbers("elbow") == [0.0, 0.5, 1.25]
    assert read_sheet(path, "more").read_numbers("wrist") == [1.5]
    assert mistakes(path, "mor") == [(1, 1, "unknown sheet 'mor'")]


def test_an_old_workbook_is_read_too() -> None:
    assert read_sheet(XLS, "moves").read_numbers("wrist") == [0.25, 0.25, -0.5]
    assert mistakes(XLS) == [(1, 1, "it needs a row of headings, and rows of numbers below it")]


@pytest.mark.parametrize(("kind", "write"), WRITERS)
def test_fault_positions_match_the_spreadsheet_rows_and_columns(tmp_path: Path, kind: str, write: Write) -> None:
    path = tmp_path / f"move.{kind}"
    sheet = read_sheet(write(path, {"moves": [("# ours",), (None, "elbow"), (None, "x"), (None, 2.0)]}))
    assert (sheet.heading_row, sheet.headings) == (2, {"elbow": 2})
    assert sheet.read_numbers("elbow") == [0.0, 2.0]
    assert [(fault.place, fault.message) for fault in sheet.faults] == [(f"{path}:3:2", "'x' is not a number")]


def test_every_cell_without_a_number_is_a_fault(tmp_path: Path) -> None:
    sheet = read_sheet(csv(tmp_path, "a,b\n1,nan\n,inf\n1_0,true\n0x1,2024-01-05\n"))
    assert sheet.read_numbers("a") == [1.0, 0.0, 0.0, 0.0]
    assert sheet.read_numbers("b") == [0.0, 0.0, 0.0, 0.0]
    assert [(fault.mark.line, fault.mark.column, fault.message) for fault in sheet.faults] == [
        (3, 1, "an empty cell"),
        (4, 1, "'1_0' is not a number"),
        (5, 1, "'0x1' is not a number"),
        (2, 2, "'nan' is not a number"),
        (3, 2, "'inf' is not a number"),
        (4, 2, "'true' is not a number"),
        (5, 2, "'2024-01-05' is not a number"),
    ]


def test_decimal_commas_are_refused_in_words_and_once_a_column(tmp_path: Path) -> None:
    sheet = read_sheet(csv(tmp_path, "a;b\n0,5;1\n-1,25;2\n,5;3e2\n"))
    assert sheet.read_numbers("a") == [0.0, 0.0, 0.0]
    assert sheet.read_numbers("b") == [1.0, 2.0, 300.0]
    (fault,) = sheet.faults
    assert (fault.mark.line, fault.mark.column) == (2, 1)
    assert fault.message == "'0,5' has a decimal comma, and 2 more below it"
    assert fault.suggestion == "write numbers with a point: 0.25"


def test_decimal_commas_between_commas_are_cells_too_many(tmp_path: Path) -> None:
    path = csv(tmp_path, "a,b\n0,5,1,25\n0.5,1.25\n")
    with pytest.raises(InvalidFileError) as caught:
        read_sheet(path)
    (fault,) = caught.value.diagnostics
    assert (fault.mark.line, fault.mark.column, fault.message) == (2, 3, "a cell without a heading")
    assert fault.suggestion == "a comma within a number makes two cells of it: write a point"


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("", [(1, 1, "it needs a row of headings, and rows of numbers below it")]),
        ("a,b\n", [(1, 1, "it needs a row of headings, and rows of numbers below it")]),
        ("# a\n# b\n", [(1, 1, "it needs a row of headings, and rows of numbers below it")]),
        ("a,b,a\n1,2,3\n", [(1, 3, "repeated heading 'a'"), (2, 3, "a cell without a heading")]),
        ("a,0.5\n1,2\n", [(1, 2, "'0.5' is not a heading"), (2, 2, "a cell without a heading")]),
        ("a,b\n1,2\n\n3,4\n", [(3, 1, "an empty row")]),
        ("a,,b\n1,2,3\n", [(2, 2, "a cell without a heading")]),
    ],
)
def test_malformed_sheet_is_reported_with_position(
    tmp_path: Path, text: str, found: list[tuple[int, int, str]]
) -> None:
    assert mistakes(csv(tmp_path, text)) == found


def test_file_that_is_not_a_spreadsheet_is_refused(tmp_path: Path) -> None:
    assert mistakes(tmp_path / "move.txt") == [
        (1, 1, "not a spreadsheet: its name must end in .csv, .xls, .xlsx, .ods"),
    ]
    assert mistakes(tmp_path / "gone.csv") == [(1, 1, "cannot be read: No such file or directory")]
    assert mistakes(tmp_path / "gone.xlsx") == [(1, 1, "cannot be read: No such file or directory")]
    (quoted,) = mistakes(csv(tmp_path, 'a,b\n"1,2\n'))
    assert quoted[2].startswith("invalid separated values: ")


@pytest.mark.parametrize("kind", ["xls", "xlsx", "ods"])
def test_a_damaged_workbook_is_refused_and_not_choked_on(tmp_path: Path, kind: str) -> None:
    path = tmp_path / f"move.{kind}"
    path.write_bytes(b"not a workbook")
    ((row, column, message),) = mistakes(path)
    assert (row, column) == (1, 1)
    assert message.startswith("not a valid workbook: ")


@pytest.mark.parametrize("size", [4096, 4608])
def test_truncated_workbook_is_refused(tmp_path: Path, size: int) -> None:
    path = tmp_path / "move.xls"
    path.write_bytes(XLS.read_bytes()[:size])
    assert mistakes(path, "moves") == [(1, 1, "not a valid workbook")]


def test_workbook_that_exhausts_memory_is_refused(tmp_path: Path) -> None:
    damaged = bytearray(XLS.read_bytes())
    damaged[1950] = 127  # of the number of its first row
    path = tmp_path / "move.xls"
    path.write_bytes(damaged)
    assert mistakes(path, "moves") == [(1, 1, "not a valid workbook")]


def test_workbook_that_exceeds_the_reading_timeout_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sheets, "READING_TIMEOUT", 0.0)
    assert mistakes(XLS, "moves") == [(1, 1, "not a valid workbook")]


def test_missing_sheets_extra_gives_the_install_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_xlsx(tmp_path / "move.xlsx", {"moves": ROWS})
    monkeypatch.setattr(sheets, "find_spec", lambda _: None)
    with pytest.raises(InvalidFileError) as caught:
        read_sheet(path)
    (fault,) = caught.value.diagnostics
    assert (fault.message, fault.suggestion) == ("it needs python-calamine", "pip install 'missiontree[sheets]'")


def test_a_workbook_may_be_large_but_not_endless(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_xlsx(tmp_path / "move.xlsx", {"moves": ROWS})
    monkeypatch.setattr(workbook, "MAX_ROWS", 3)
    assert mistakes(path) == [(1, 1, "more than 3 rows")]
    monkeypatch.setattr(sheets, "MAX_BYTES", 100)
    assert mistakes(path) == [(1, 1, "larger than 100 bytes")]


@given(st.lists(st.lists(st.text("ab01.,;\t\n\"'#- "), max_size=4), max_size=5))
def test_any_text_is_numbers_or_faults(tmp_path_factory: pytest.TempPathFactory, rows: list[list[str]]) -> None:
    path = tmp_path_factory.mktemp("any") / "move.csv"
    path.write_text("\n".join(",".join(row) for row in rows), encoding="utf-8")
    assert outcome(path) in {"numbers", "faults"}


def outcome(path: Path, tab: str | None = None) -> str:
    """Read everything in a sheet, and say how that went."""
    try:
        sheet = read_sheet(path, tab)
    except InvalidFileError as error:
        return "faults" if error.diagnostics else "nothing"
    whole = all(len(sheet.read_numbers(heading)) == len(sheet.rows) > 0 for heading in sheet.headings)
    return "faults" if sheet.faults else "numbers" if whole else "nothing"
