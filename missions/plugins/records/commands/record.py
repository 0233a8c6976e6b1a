"""``mission record``: what a record holds, mending one that was not closed, pieces of it, and files made of it."""

import json
import shlex
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import Any

import click

from missions.cli.commands import LazyGroup
from missions.cli.options import SECONDS
from missions.cli.outputs import check_folder, written_message
from missions.cli.printable import format_columns
from missions.library.private_files import ExistsError
from missions.plugins.records.recording.export import to_csv, to_folder, to_jsonl
from missions.plugins.records.recording.info import record_lines
from missions.plugins.records.recording.run_record import open_record
from missions.plugins.records.recording.validation import InvalidRecordError

RECORD = click.argument("path", metavar="RECORD", type=click.Path(path_type=Path))
FORCE = click.option("--force", is_flag=True, help="Write over what is there.")


@click.group(
    "record",
    cls=LazyGroup,
    epilog="Example: mission record info monday.mcap",
)
def command() -> None:
    """Look into records of runs, play and decide them again, repair them, and take things out of them.

    `mission run MISSION --record FILE.mcap` makes one.
    """


@contextmanager
def _report_errors() -> Iterator[None]:
    """Tell what goes wrong with a record or a file."""
    try:
        yield
    except (InvalidRecordError, ExistsError) as error:
        raise click.ClickException(str(error)) from error
    except BrokenPipeError:
        raise
    except OSError as error:
        raise click.ClickException(f"{error.filename or 'the file'}: {error.strerror or error}") from error


@command.command(name="list", epilog="Example: mission record list")
@click.argument("folder", required=False, type=click.Path(exists=True, file_okay=False, path_type=Path))
def list_command(folder: Path | None) -> None:
    """List the records in a folder, the newest first; else those that are kept by default, of runs on robots.

    Those are kept for 30 days, and 2 GB of them. `mission run --no-record` keeps nothing; `record: false` in
    defaults.yaml, or MISSION_RECORD=no in the environment, nothing of any run, unless --record asks for it.
    """
    from missions.plugins.records.recording.record_list import list_entry  # noqa: PLC0415 - it needs mcap, as open_record says
    from missions.plugins.records.retention import list_records, records_folder  # noqa: PLC0415

    where = records_folder() if folder is None else folder
    with _report_errors():
        rows = [_row(list_entry(path)) for path in list_records(where)]
    if not rows:
        click.echo(f"no records in {where}")
        return
    click.echo(
        format_columns(
            ("began", "mission", "robot", "seconds", "MB", "result", "record"), rows, left=LEFT_ALIGNED_COLUMNS
        )
    )
    click.echo(f"\nin {where}")


LEFT_ALIGNED_COLUMNS = frozenset({"began", "mission", "robot", "result", "record"})


def _row(entry_facts: Mapping[str, Any]) -> tuple[str, ...]:
    """Return what the list says of a record."""
    began = datetime.fromtimestamp(entry_facts["began"]).astimezone()
    result = entry_facts.get("result") or "cut off"
    reason = f": {entry_facts['reason']}" if entry_facts.get("reason") else ""
    simulated = f" ({entry_facts['simulated']})" if entry_facts.get("simulated") else ""
    return (
        f"{began:%Y-%m-%d %H:%M}",
        entry_facts.get("mission", "-"),
        f"{entry_facts.get('robot', '-')}{simulated}",
        f"{entry_facts.get('seconds', 0.0):.0f}",
        f"{entry_facts['bytes'] / 1e6:.1f}",
        entry_facts.get("trouble") or f"{result}{reason}",
        entry_facts["name"],
    )


@command.command(epilog="Example: mission record info monday.mcap")
@RECORD
def info(path: Path) -> None:
    """Say what a record is of, what is in it, what is missing, and what can be done with it."""
    with _report_errors():
        for line in record_lines(open_record(path)):
            click.echo(line)


@command.command(epilog="Example: mission record repair monday.mcap")
@RECORD
def repair(path: Path) -> None:
    """Close a record whose run was killed, in place, so that every program opens it.

    It may be stopped at any moment, and done again: nothing that can be read is lost.
    """
    with _report_errors():
        open_record(path)  # says in words what is none of ours
        from missions.plugins.records.recording.repair import repair_record as mend_file  # noqa: PLC0415 - it needs mcap, as open_record says

        mended = mend_file(path)
        until = open_record(path).end_time
    if mended.already_closed:
        click.echo(f"{path} was closed properly: there is nothing to mend")
        return
    skipped = f", without {mended.skipped_spans} damaged stretches" if mended.skipped_spans else ""
    click.echo(f"mended {path}: it is whole up to {until:.2f} s{skipped}\n  try: mission record info {path}")


@command.command(epilog="Example: mission record export monday.mcap --csv tables")
@RECORD
@click.option(
    "--csv", "tables", type=click.Path(path_type=Path, file_okay=False), metavar="FOLDER", help="A table per topic."
)
@click.option(
    "--jsonl", "lines", type=click.Path(path_type=Path, dir_okay=False), metavar="FILE", help="A line per message."
)
@click.option(
    "--folder",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="FOLDER",
    help="The pictures, the files of the run, and a table per topic.",
)
@FORCE
def export(path: Path, tables: Path | None, lines: Path | None, folder: Path | None, force: bool) -> None:
    """Write a record for other programs: as tables, as lines of JSON, or as a folder of files."""
    if tables is lines is folder is None:
        raise click.UsageError(f"say what to write, such as --csv FOLDER: mission record export {path} --csv tables")
    for option, place in (("--csv", tables), ("--folder", folder)):
        if place is not None:
            check_folder(place, option, f"{option} {shlex.quote(str(place.with_suffix('')))}")
    with _report_errors():
        record = open_record(path)
        if tables is not None:
            count = len(to_csv(record, tables, force=force))
            click.echo(written_message(tables, subject=f"{count} tables to "))
        if lines is not None:
            count = to_jsonl(record, lines, force=force)
            click.echo(written_message(lines, subject=f"{count} lines to "))
        if folder is not None:
            pictures, files, made = to_folder(record, folder, force=force)
            click.echo(written_message(folder, subject=f"{pictures} pictures, {files} files and {made} tables to "))


@command.command(epilog="Example: mission record joints monday.mcap")
@RECORD
@click.option("--json", "as_what", flag_value="json", help="As JSON: degrees, seconds, joules.")
@click.option("--csv", "as_what", flag_value="csv", help="As a table for a spreadsheet.")
def joints(path: Path, as_what: str | None) -> None:
    """Say how well each joint kept to its goal, what its motor did, and how warm its servo was.

    `mission record export FILE --csv FOLDER` has every sample, in state_arm.csv; `mission record report` draws them.
    """
    from missions.plugins.records.report import tables as joint_tables  # noqa: PLC0415 - a report needs more than the others do
    from missions.plugins.records.report.joints import joint_figures, joint_samples  # noqa: PLC0415

    with _report_errors():
        record = open_record(path)
        found = joint_figures(record, joint_samples(record))
    if as_what == "json":
        click.echo(json.dumps(joint_tables.as_json(found), indent=2, ensure_ascii=False))
    elif as_what == "csv":
        click.echo(joint_tables.as_csv(found), nl=False)
    else:
        for line in joint_tables.lines_of(found):
            click.echo(line)


@command.command(epilog="Example: mission record compare monday.mcap tuesday.mcap")
@RECORD
@click.argument("other", metavar="OTHER", type=click.Path(path_type=Path))
@click.option("--json", "json_wanted", is_flag=True, help="As JSON: seconds, metres, radians; joints in degrees.")
def compare(path: Path, other: Path, json_wanted: bool) -> None:
    """Put two runs of one mission on one robot side by side.

    Says where their trees first decide differently, how they ended, how long each leaf took, how far joints were off
    their goals, and where the base went. That a leaf takes longer is no decision; that it ends otherwise is one.
    """
    from missions.plugins.records.comparison import output as words  # noqa: PLC0415 - as for joints
    from missions.plugins.records.comparison.runs import IncomparableError, compare_runs  # noqa: PLC0415

    try:
        with _report_errors():
            found = compare_runs(open_record(path), open_record(other))
    except IncomparableError as error:
        raise click.UsageError(str(error)) from error
    if json_wanted:
        click.echo(json.dumps(words.as_json(found), indent=2, ensure_ascii=False))
        return
    for line in words.lines_of(found):
        click.echo(line)


@command.command(epilog="Example: mission record cut monday.mcap 2s 5s -o piece.mcap")
@RECORD
@click.argument("start", metavar="FROM", type=SECONDS)
@click.argument("end", metavar="TO", type=SECONDS)
@click.option(
    "-o", "--output", type=click.Path(path_type=Path, dir_okay=False), metavar="FILE", required=True, help="Where to."
)
@FORCE
def cut(path: Path, start: float, end: float, output: Path, force: bool) -> None:
    """Cut a piece out of a record, such as from 10s to 20s, with what held when it begins.

    What cuts off the beginning cannot be run again by `mission record rerun`: a tree remembers.
    """
    with _report_errors():
        record = open_record(path)
        if not start < end:
            raise click.UsageError(f"the piece ends before it begins: from {start:g} s to {end:g} s")
        if start > record.end_time:
            raise click.UsageError(f"{path} ends at {record.end_time:.2f} s, before {start:g} s")
        if output.exists() and output.samefile(path):
            raise click.UsageError(f"{output} is the record itself: name another file with -o")
        from missions.plugins.records.recording.cut import cut_record as cut_piece  # noqa: PLC0415 - it needs mcap, as open_record says

        count = cut_piece(record, start, end, output, force=force)
    told = written_message(output, subject=f"{count} messages to ")
    click.echo(f"{told}; to look into it: mission record info {output}")
