"""CSV export and others: records as CSV tables, lines of JSON, or a folder of files."""

import csv
import json
import re
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from io import TextIOWrapper
from pathlib import Path
from typing import Any

from config.file_io import PRIVATE_MODE, replace_file, save_file
from missions.library.private_files import new_file, new_folder, path_inside
from missions.plugins.records.recording.run_record import RunRecord, start_time_ns
from missions.plugins.records.recording.validation import InvalidRecordError, parse_message, reject_malformed

TOPICS_WITHOUT_TABLE = frozenset({"/camera", "/camera/marks"})
"""Topics of a record that are not exported as tables."""

ENCODING_ERRORS = "backslashreplace"
"""Error handler for lone surrogates, which UTF-8 cannot encode; JSON escapes them in the same way."""

MAX_COLUMNS, MAX_TABLES = 2000, 200
"""Maximum number of tables, as ``MAX_COLUMNS`` is of columns; our records have a few dozen."""

_UNSAFE_CHARACTERS = re.compile(r"[/\\\x00-\x1f\x7f]")
"""Characters that no file name may have."""

_FORMULA_PREFIXES = ("=", "+", "-", "@", "\t", "\r")
"""First characters of texts that a spreadsheet evaluates as a formula."""

OMITTED_FIELDS = frozenset({("/moments", "answers")})
"""Fields that are left out of exported tables, by topic; the replies of a tick are many and nested."""


def to_jsonl(record: RunRecord, output: Path, *, force: bool = False) -> int:
    """Write every message as a line ``{"topic": ..., "t": ..., "message": ...}``; return the number of lines.

    Raises ExistsError, InvalidRecordError, OSError.
    """
    count = 0
    with new_file(output, force=force) as file:
        for topic, t, data in _messages(record):
            line = json.dumps({"topic": topic, "t": t, "message": data}, ensure_ascii=False)
            file.write(line.encode(errors=ENCODING_ERRORS) + b"\n")
            count += 1
    return count


def to_csv(record: RunRecord, folder: Path, *, force: bool = False) -> list[Path]:
    """Write one CSV table per topic; return their paths. Raises ExistsError, InvalidRecordError, OSError.

    The first column is the time in seconds of the run. Nested fields are joined by dots, as in ``pose.position.x``;
    lists are JSON.
    """
    new_folder(folder, force=force)
    columns: dict[str, dict[str, None]] = {}  # in the order of their first use
    for topic, _, data in _messages(record):
        if topic not in TOPICS_WITHOUT_TABLE:
            known = columns.setdefault(topic, {})
            known.update(dict.fromkeys(_row(topic, data)))
            if len(known) > MAX_COLUMNS:
                raise InvalidRecordError(f"{record.path}: a table of {topic:.80} has more than {MAX_COLUMNS} columns")
    if len(columns) > MAX_TABLES:
        raise InvalidRecordError(f"{record.path}: has more than {MAX_TABLES} topics")
    paths = {topic: folder / f"{_UNSAFE_CHARACTERS.sub('_', topic.strip('/')):.100}.csv" for topic in sorted(columns)}
    with ExitStack() as files:
        tables = {
            topic: csv.DictWriter(
                TextIOWrapper(
                    files.enter_context(replace_file(path, PRIVATE_MODE)),
                    "utf-8",
                    ENCODING_ERRORS,
                    "",
                    write_through=True,
                ),
                ["t", *columns[topic]],
            )
            for topic, path in paths.items()
        }
        for table in tables.values():
            table.writeheader()
        for topic, t, data in _messages(record):
            if topic in tables:
                tables[topic].writerow({"t": t, **_row(topic, data)})
    return list(paths.values())


def to_folder(record: RunRecord, folder: Path, *, force: bool = False) -> tuple[int, int, int]:
    """Write pictures, files and tables into subfolders; return the number of each.

    Raises ExistsError, InvalidRecordError, OSError.
    """
    new_folder(folder, force=force)
    pictures, files = folder / "pictures", folder / "files"
    for each in (pictures, files):
        each.mkdir(mode=0o700, exist_ok=True)
    count = 0
    for stamp, jpeg in record.frames():
        save_file(pictures / f"{stamp:010.3f}.jpg", jpeg, PRIVATE_MODE, durable=False)
        count += 1
    for name, data in record.files.items():
        path = files / path_inside(name)
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        save_file(path, data, PRIVATE_MODE, durable=False)
    return count, len(record.files), len(to_csv(record, folder / "tables", force=force))


def _messages(record: RunRecord) -> Iterator[tuple[str, float, Any]]:
    """Yield topic, time in seconds of the run, and content of each message."""
    began = start_time_ns(record.header)
    for topic, time, data in record.container.messages():
        with reject_malformed(record.path):
            message = parse_message(data)
        yield topic, message.pop("t", (time - began) / 1e9), message


def _row(topic: str, data: Mapping[str, Any], prefix: str = "") -> dict[str, object]:
    """Return the cells of a message by column name of the CSV table."""
    cells: dict[str, object] = {}
    for name, value in data.items():
        if isinstance(value, dict):
            cells |= _row(topic, value, f"{prefix}{name}.")
        elif (topic, name) not in OMITTED_FIELDS:
            cell = json.dumps(value, ensure_ascii=False) if isinstance(value, list) else safe_cell(value)
            cells[prefix + name] = cell
    return cells


def safe_cell(value: object) -> object:
    """Return a cell value, with an apostrophe before a text that a spreadsheet would evaluate."""
    if not isinstance(value, str) or not value.startswith(_FORMULA_PREFIXES) or value in ("-", "-inf"):
        return value
    return f"'{value}"
