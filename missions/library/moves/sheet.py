"""Spreadsheets as columns of numbers with headings; errors have their row and column.

``.csv`` is separated by commas, semicolons or tabs; ``.xls``, ``.xlsx`` and ``.ods`` need the extra ``sheets``. Rows
that begin with ``#`` are comments; the first other row has the headings.
"""

import csv
import io
import json
import os
import re
import resource
import subprocess
import sys
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from math import isfinite
from pathlib import Path
from typing import NamedTuple

from config.diagnostics import Diagnostic, InvalidFileError, Mark, SourceText, add_diagnostic, suggest_from
from config.file_io import open_regular, record_read
from config.library import SHEET_SUFFIXES
from config.units import quoted_value
from config.yaml_nodes import read_source

# Headings of a sheet: the name of a joint or of the time, followed by a unit.

UNIT_WORDS = {
    **dict.fromkeys(("deg", "degs", "degree", "degrees", "°", "º", "grad"), "deg"),
    **dict.fromkeys(("rad", "rads", "radian", "radians"), "rad"),
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds", "sek", "sekunde", "sekunden"), "s"),
    **dict.fromkeys(("ms", "msec", "millisecond", "milliseconds", "millisekunde", "millisekunden"), "ms"),
}
"""Unit for each of its spellings in a heading, English and German."""

TIME_HEADING = "time"
"""Heading of the time column, in seconds unless it has another unit."""

TIME_NAMES = (TIME_HEADING, "t", "zeit", "timestamp", "seconds", "sekunden")
"""Names of time columns; all except the first need a unit."""

_BRACKETS = re.compile(r"(.*?)\s*[(\[{<]\s*([^()\[\]{}<>]*?)\s*[)\]}>]\s*")
_BEHIND = re.compile(r"(.*?)(?:[\s_,;:/.-]+(?:in\s+)?([A-Za-z]+)|\s*([°º]))\s*")


class Heading(NamedTuple):
    """Heading of a column: name and ``unit``, which is deg, rad, s or ms, another unit as written, or empty."""

    name: str
    unit: str


def parse_heading(text: str, names: Collection[str] = ()) -> Heading:
    """Return name and unit of a heading such as "elbow (deg)".

    A heading that is one of ``names`` is a name without a unit.
    """
    if text in names:
        return Heading(text, "")
    if found := _BRACKETS.fullmatch(text):
        unit = found[2].lower().rstrip(".")
        return Heading(found[1].strip(), UNIT_WORDS.get(unit, unit))
    if found := _BEHIND.fullmatch(text):
        unit = UNIT_WORDS.get((found[2] or found[3]).lower(), "")
        if unit in ("deg", "rad") or (unit and found[1].strip().lower() in TIME_NAMES):
            return Heading(found[1].strip(" _,;:/.-"), unit)
    return Heading(text, "")


def find_joint(name: str, joints: Collection[str]) -> str:
    """Return the joint of a heading, ignoring case and separators; empty if there is none."""
    if name in joints:
        return name
    spelt = {joint.lower(): joint for joint in joints}
    return spelt.get(re.sub(r"[\s./-]+", "_", name.strip()).lower(), "")


def time_unit(text: str) -> str:
    """Return the unit of a time column, s or ms; empty for another column."""
    name, unit = parse_heading(text)
    if name.lower() == TIME_HEADING and unit in ("", "s", "ms"):
        return unit or "s"
    return unit if name.lower() in TIME_NAMES and unit in ("s", "ms") else ""


def is_unit_word(text: str) -> bool:
    """Return whether a cell contains a unit, with or without brackets."""
    return text.strip("()[]{}<> .").lower() in UNIT_WORDS


# Reads one sheet of a workbook in its own process, and prints it as JSON: ``python workbook.py FILE [SHEET]``.
#
# The library for workbooks crashes on some damaged files, and may allocate any amount of memory.
# The output is ``{"sheets": [names], "sheet": name, "rows": [[cells], ...]}``, with null as the rows of a missing
# sheet, or ``{"error": reason}``. The default is the first sheet that is not hidden.

MAX_MEMORY_BYTES = 2_000_000_000
"""Memory limit of the process that reads a workbook, in bytes."""

MAX_ROWS = 100_000
"""Maximum number of a spreadsheet's rows; one more is read, to detect a sheet that is too long."""


def main(path: str, sheet: str | None = None) -> None:
    """Print a workbook's ``sheet``, or its first sheet, as JSON."""
    from python_calamine import CalamineError, CalamineWorkbook  # noqa: PLC0415 - an extra

    resource.setrlimit(resource.RLIMIT_AS, (MAX_MEMORY_BYTES, MAX_MEMORY_BYTES))
    try:
        with CalamineWorkbook.from_path(path) as book:
            names = book.sheet_names
            visible = [each.name for each in book.sheets_metadata if str(each.visible).endswith(".Visible")]
            name = next(iter(visible or names), None) if sheet is None else sheet
            found = book.get_sheet_by_name(name) if name in names else None
            rows = None if found is None else found.to_python(skip_empty_area=False, nrows=MAX_ROWS + 1)
        answer: dict[str, object] = {"sheets": names, "sheet": name, "rows": rows}
    except (OSError, CalamineError) as error:
        answer = {"error": str(error)}
    # Dates and times are returned as texts, although workbooks store them as numbers.
    json.dump(answer, sys.stdout, default=str)


if __name__ == "__main__":
    main(*sys.argv[1:3])


MAX_BYTES = 20_000_000

READING_TIMEOUT = 60.0
"""Seconds within which a workbook must have been read."""

_COMMA = re.compile(r"[-+]?[0-9]*,[0-9]+(?:[eE][-+]?[0-9]+)?")

_SEPARATOR = re.compile(r"sep=([,;\t])\s*$", re.MULTILINE)

Cell = float | str
"""Cell of a spreadsheet: a number or a text; an empty cell is an empty text."""


@dataclass(slots=True)
class Sheet:
    """A spreadsheet: ``headings`` are the column numbers by name, ``rows`` the rows below, each with its number.

    Rows and columns count from 1. ``faults`` collects the errors.
    """

    name: str
    heading_row: int  # the row with the headings
    tab: str = ""  # name of the sheet in the workbook
    other_tabs: Sequence[str] = ()  # other sheets of the workbook
    headings: dict[str, int] = field(default_factory=dict)
    rows: list[tuple[int, Sequence[Cell]]] = field(default_factory=list)
    faults: list[Diagnostic] = field(default_factory=list)

    def fault(self, row: int, column: int, message: str, suggestion: str = "") -> None:
        """Report an error in a cell. Raises InvalidFileError if there are too many."""
        add_diagnostic(self.faults, Diagnostic(SourceText(self.name, ""), Mark(row, column), message, suggestion))

    @property
    def is_workbook(self) -> bool:
        """True if the sheet comes from a workbook, and not from a file of separated values."""
        return bool(self.tab)

    @property
    def remark(self) -> str:
        """Note for the user that the workbook has other sheets, which are not read; empty if it has none."""
        others = ", ".join(f"'{name}'" for name in self.other_tabs)
        how = "a move file names another: tab: NAME"
        return f"sheet '{self.tab}' is read, and not {others}; {how}" if others else ""

    def raise_faults(self) -> None:
        """Raise InvalidFileError if there are errors; the first one names the sheet of the workbook."""
        if self.faults and self.other_tabs:
            first = self.faults[0]
            hint = "; ".join(filter(None, (first.suggestion, self.remark)))
            self.faults[0] = replace(first, suggestion=hint)
        if self.faults:
            raise InvalidFileError(self.faults)

    def read_numbers(self, heading: str) -> list[float]:
        """Return the column under ``heading``; a cell without a number is an error, and becomes 0."""
        column = self.headings[heading]
        cells = [(row, cells[column - 1] if column <= len(cells) else "") for row, cells in self.rows]
        commas = [(row, cell) for row, cell in cells if isinstance(cell, str) and _COMMA.fullmatch(cell)]
        if commas:
            row, cell = commas[0]
            more = f", and {len(commas) - 1} more below it" if len(commas) > 1 else ""
            self.fault(
                row, column, f"{quoted_value(cell)} has a decimal comma{more}", "write numbers with a point: 0.25"
            )
        return [0.0 if (row, cell) in commas else self._number(row, column, cell) for row, cell in cells]

    def _number(self, row: int, column: int, cell: Cell) -> float:
        found = _number_in(cell)
        if found is None:
            merged = "of merged cells the first one has the value: write it in each" if self.is_workbook else ""
            self.fault(
                row,
                column,
                *(("an empty cell", merged) if cell == "" else (f"{quoted_value(cell)} is not a number", "")),
            )
        return found or 0.0


def read_sheet(path: Path, tab: str | None = None) -> Sheet:
    """Read a spreadsheet; of a workbook the sheet ``tab``, or the first. Raises InvalidFileError."""
    kind = path.suffix.lower()
    if kind not in SHEET_SUFFIXES:
        raise _file_error(path, f"not a spreadsheet: its name must end in {', '.join(SHEET_SUFFIXES)}")
    name, others = "", list[str]()
    if kind == ".csv":
        written = _read_separated(path)
    else:
        written, name, others = _read_workbook(path, tab)
    if len(written) > MAX_ROWS:
        raise _file_error(path, f"more than {MAX_ROWS:,} rows")
    rows = [
        (number, cells) for number, cells in enumerate(written, 1) if not str(next(iter(cells), "")).startswith("#")
    ]
    filled = [place for place, (_, cells) in enumerate(rows) if any(cell != "" for cell in cells)]
    sheet = Sheet(str(path), rows[filled[0]][0] if filled else 1, name, others)
    stands = True  # whether to stop before the rows: their errors would follow from this one
    if len(filled) < 2:
        sheet.heading_row = 1
        sheet.fault(1, 1, "it needs a row of headings, and rows of numbers below it")
    elif _is_title(rows[filled[0]][1], (second_row := rows[filled[1]])[1]):
        hint = f"remove the rows above row {second_row[0]}: the headings come first, each with its unit: 'elbow (deg)'"
        sheet.fault(sheet.heading_row, 1, "a title, and no row of headings", hint)
    else:
        _take_headings(sheet, rows[filled[0]][1])
        stands = _has_units(sheet, *second_row)
    if stands:
        sheet.raise_faults()
    for number, cells in rows[filled[0] + 1 : filled[-1] + 1]:
        _take_row(sheet, number, cells)
    sheet.raise_faults()
    return sheet


def _is_title(first: Sequence[Cell], second: Sequence[Cell]) -> bool:
    """Return whether the first row is a title: it has one cell, or the second row has headings."""
    texts = [cell for cell in second if cell != "" and _number_in(cell) is None and not _COMMA.fullmatch(str(cell))]
    alone = sum(cell != "" for cell in first) == 1 and sum(cell != "" for cell in second) > 1
    headed = len(texts) > 1 and len(texts) == sum(cell != "" for cell in second)
    units = [is_unit_word(str(cell)) for cell in texts]
    return (alone and not all(units)) or (headed and not any(units))


def _has_units(sheet: Sheet, row: int, cells: Sequence[Cell]) -> bool:
    """Return True if ``cells`` is a row of units below the headings, and report it as an error."""
    cells_by_heading = [
        (heading, str(cells[column - 1])) for heading, column in sheet.headings.items() if column <= len(cells)
    ]
    units = [(heading, cell) for heading, cell in cells_by_heading if cell and is_unit_word(cell)]
    found = bool(units) and all(cell == "" or _number_in(cell) is None for cell in cells)
    if found:
        examples = ", ".join(f"'{heading} ({cell.strip('()[] ')})'" for heading, cell in units[:2])
        sheet.fault(
            row, 1, "a row of units", f"write each unit behind its heading, as in {examples}, and remove the row"
        )
    return found


def _take_headings(sheet: Sheet, cells: Sequence[Cell]) -> None:
    for column, cell in enumerate(cells, 1):
        if cell == "":
            continue
        if isinstance(cell, float) or _number_in(cell) is not None:
            sheet.fault(
                sheet.heading_row,
                column,
                f"{quoted_value(cell)} is not a heading",
                "the first row has the names of the columns",
            )
        elif cell in sheet.headings:
            sheet.fault(sheet.heading_row, column, f"repeated heading {quoted_value(cell)}")
        else:
            sheet.headings[cell] = column


def _take_row(sheet: Sheet, row: int, cells: Sequence[Cell]) -> None:
    filled = [column for column, cell in enumerate(cells, 1) if cell != ""]
    stray = next((column for column in filled if column not in sheet.headings.values()), None)
    if not filled:
        sheet.fault(row, 1, "an empty row", "remove it: every row is a moment")
    elif stray is not None:
        hint = "a comma within a number makes two cells of it: write a point"
        if sheet.is_workbook:
            hint = "each column needs a heading of its own, also below merged cells"
        sheet.fault(row, stray, "a cell without a heading", hint)
    else:
        sheet.rows.append((row, cells))


def _read_separated(path: Path) -> list[list[Cell]]:
    """Read a file of separated values; all cells are texts."""
    text = read_source(path).text
    first = next((line for line in text.splitlines() if line.strip() and not line.startswith("#")), "")
    separator = max(",;\t", key=first.count)
    if separator_line := _SEPARATOR.match(text):  # Excel's line "sep=;", which is turned into a comment
        separator, text = separator_line[1], f"#{text}"
    try:
        rows = csv.reader(io.StringIO(text, newline=""), delimiter=separator, strict=True)
        return [[cell.strip() for cell in row] for row in rows]
    except csv.Error as error:
        raise _file_error(path, f"invalid separated values: {error}") from error


def _read_workbook(path: Path, tab: str | None) -> tuple[list[list[Cell]], str, list[str]]:
    """Read one sheet of a workbook; return its rows, its name, and the other sheets if ``tab`` is None."""
    if find_spec("python_calamine") is None:
        raise _file_error(path, "it needs python-calamine", "pip install 'missiontree[sheets]'")
    try:
        with open_regular(path) as file:
            if os.fstat(file.fileno()).st_size > MAX_BYTES:
                raise _file_error(path, f"larger than {MAX_BYTES:,} bytes")
        reader = [sys.executable, "-P", __file__, str(path), *([] if tab is None else [tab])]
        process = subprocess.run(reader, capture_output=True, check=True, timeout=READING_TIMEOUT)  # noqa: S603 - ourselves
        record_read(path)
    except OSError as error:
        raise _file_error(path, f"cannot be read: {error.strerror}") from error
    except subprocess.SubprocessError as error:
        raise _file_error(path, "not a valid workbook") from error
    answer = json.loads(process.stdout)
    if "error" in answer:
        raise _file_error(path, f"not a valid workbook: {answer['error']}")
    if answer["rows"] is None:
        raise _file_error(path, f"unknown sheet {quoted_value(tab)}", suggest_from(tab or "", answer["sheets"]))
    others = [name for name in answer["sheets"] if name != answer["sheet"]] if tab is None else []
    return [[_cell(value) for value in row] for row in answer["rows"]], str(answer["sheet"]), others


def _cell(value: object) -> Cell:
    """Return the contents of a workbook cell; dates and booleans become texts."""
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else str(value).strip()


def _number_in(cell: Cell) -> float | None:
    """Return the finite number in a cell; None if it has none."""
    try:
        value = float(cell)
    except ValueError:
        return None
    return value if isfinite(value) and str(cell).isascii() and "_" not in str(cell) else None


def _file_error(path: Path, message: str, suggestion: str = "") -> InvalidFileError:
    return InvalidFileError([Diagnostic(SourceText(str(path), ""), Mark(), message, suggestion)])
