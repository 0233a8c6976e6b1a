"""Reads one sheet of a workbook in a process of its own, and prints it as JSON: ``python workbook.py FILE [SHEET]``.

The library that reads workbooks ends its process over some that are damaged, and may ask for any amount of memory.
What is printed is ``{"sheets": [names], "sheet": name, "rows": [[cells], ...]}``, with null for the rows of a sheet
that is not there, or ``{"error": why}``. Without a name it is the first sheet that is not hidden.
"""

import json
import resource
import sys

MEMORY = 2_000_000_000
"""Bytes that it may take."""

MAX_ROWS = 100_000
"""One row more is read of a longer sheet."""


def main(path: str, sheet: str | None = None) -> None:
    """Print the sheet, or the first one."""
    from python_calamine import CalamineError, CalamineWorkbook  # noqa: PLC0415 - an extra

    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    try:
        with CalamineWorkbook.from_path(path) as book:
            names = book.sheet_names
            visible = [each.name for each in book.sheets_metadata if str(each.visible).endswith(".Visible")]
            name = next(iter(visible or names), None) if sheet is None else sheet
            found = book.get_sheet_by_name(name) if name in names else None
            rows = None if found is None else found.to_python(skip_empty_area=False, nrows=MAX_ROWS + 1)
        told: dict[str, object] = {"sheets": names, "sheet": name, "rows": rows}
    except (OSError, CalamineError) as error:
        told = {"error": str(error)}
    # Dates and the like are told as texts: they are no numbers, whatever a spreadsheet counts them as.
    json.dump(told, sys.stdout, default=str)


if __name__ == "__main__":
    main(*sys.argv[1:3])
