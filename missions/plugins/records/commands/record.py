"""``mission record``: list, inspect, repair, cut, export and compare records."""

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
FORCE = click.option("--force", is_flag=True, help="Replace existing files.")


@click.group(
    "record",
    cls=LazyGroup,
    epilog="Example: mission record info monday.mcap",
)
def command() -> None:
    """Inspect, play, rerun, repair, cut and export records of runs.

    `mission run MISSION --record FILE.mcap` creates one.
    """


@contextmanager
def _report_errors() -> Iterator[None]:
    """Turn errors of records and files into click.ClickException."""
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
    """List the records in a folder, newest first.

    Without FOLDER, those recorded by default.

    Runs on a robot are recorded by default, and kept for 30 days, at most 2 GB. `mission run --no-record` records
    nothing. `record: false` in defaults.yaml, or MISSION_RECORD=no in the environment, turns default records off.
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
            ("started", "mission", "robot", "seconds", "MB", "result", "record"), rows, left=LEFT_ALIGNED_COLUMNS
        )
    )
    click.echo(f"\nin {where}")


LEFT_ALIGNED_COLUMNS = frozenset({"started", "mission", "robot", "result", "record"})


def _row(entry_facts: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the table row of a record, from its list entry."""
    began = datetime.fromtimestamp(entry_facts["began"]).astimezone()
    result = entry_facts.get("result") or "not recorded"
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
    """Show the contents of a record.

    Prints mission, result, topics, files, losses, and commands to type next.
    """
    with _report_errors():
        for line in record_lines(open_record(path)):
            click.echo(line)


@command.command(epilog="Example: mission record repair monday.mcap")
@RECORD
def repair(path: Path) -> None:
    """Close the record of a killed run in place, so that every program can open it.

    You can interrupt and repeat it at any time: no readable data are lost.
    """
    with _report_errors():
        open_record(path)  # raises a clear error for other files
        from missions.plugins.records.recording.repair import repair_record as mend_file  # noqa: PLC0415 - it needs mcap, as open_record says

        mended = mend_file(path)
        until = open_record(path).end_time
    if mended.already_closed:
        click.echo(f"{path} is closed already: nothing to repair")
        return
    skipped = f", without {mended.skipped_spans} damaged ranges" if mended.skipped_spans else ""
    click.echo(f"repaired {path}: complete up to {until:.2f} s{skipped}\n  try: mission record info {path}")


@command.command(epilog="Example: mission record export monday.mcap --csv tables")
@RECORD
@click.option(
    "--csv",
    "tables",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="FOLDER",
    help="Write a table for each topic.",
)
@click.option(
    "--jsonl",
    "lines",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="Write a line of JSON for each message.",
)
@click.option(
    "--folder",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="FOLDER",
    help="Write the pictures, the files of the run, and a table for each topic.",
)
@FORCE
def export(path: Path, tables: Path | None, lines: Path | None, folder: Path | None, force: bool) -> None:
    """Export a record as tables, as lines of JSON, or as a folder of files."""
    if tables is lines is folder is None:
        raise click.UsageError(f"no output given\n  try: mission record export {shlex.quote(str(path))} --csv tables")
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
@click.option("--json", "as_what", flag_value="json", help="Print JSON: degrees, seconds, joules.")
@click.option("--csv", "as_what", flag_value="csv", help="Print CSV for a spreadsheet.")
def joints(path: Path, as_what: str | None) -> None:
    """Show error, motor work and servo temperature of each joint.

    `mission record export FILE --csv FOLDER` writes all samples to state_arm.csv; `mission record report` plots them.
    """
    from missions.plugins.records.report import tables as joint_tables  # noqa: PLC0415 - a report needs more than the others do
    from missions.plugins.records.report.joints import joint_figures, joint_samples  # noqa: PLC0415

    with _report_errors():
        record = open_record(path)
        figures = joint_figures(record, joint_samples(record))
    if as_what == "json":
        click.echo(json.dumps(joint_tables.as_json(figures), indent=2, ensure_ascii=False))
    elif as_what == "csv":
        click.echo(joint_tables.as_csv(figures), nl=False)
    else:
        for line in joint_tables.lines_of(figures):
            click.echo(line)


@command.command(epilog="Example: mission record compare monday.mcap tuesday.mcap")
@RECORD
@click.argument("other", metavar="OTHER", type=click.Path(path_type=Path))
@click.option("--json", "json_wanted", is_flag=True, help="Print JSON: seconds, metres, radians; joints in degrees.")
def compare(path: Path, other: Path, json_wanted: bool) -> None:
    """Compare two runs of one mission on one robot.

    Shows the first different decision, both results, the running time of each leaf, the errors of the joints, and the
    paths of the base. A leaf with another result is a different decision; a longer one is not.
    """
    from missions.plugins.records.comparison import output as words  # noqa: PLC0415 - as for joints
    from missions.plugins.records.comparison.runs import IncomparableError, compare_runs  # noqa: PLC0415

    try:
        with _report_errors():
            comparison = compare_runs(open_record(path), open_record(other))
    except IncomparableError as error:
        raise click.UsageError(str(error)) from error
    if json_wanted:
        click.echo(json.dumps(words.as_json(comparison), indent=2, ensure_ascii=False))
        return
    for line in words.lines_of(comparison):
        click.echo(line)


@command.command(epilog="Example: mission record cut monday.mcap 2s 5s -o piece.mcap")
@RECORD
@click.argument("start", metavar="FROM", type=SECONDS)
@click.argument("end", metavar="TO", type=SECONDS)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    required=True,
    help="Output file.",
)
@FORCE
def cut(path: Path, start: float, end: float, output: Path, force: bool) -> None:
    """Copy a time range of a record to a new file.

    The range is for example from 10s to 20s; the state at its beginning is included.

    A copy without the beginning cannot be used by `mission record rerun`, since decisions depend on the past.
    """
    with _report_errors():
        record = open_record(path)
        if not start < end:
            raise click.UsageError(f"the range ends before it begins: from {start:g} s to {end:g} s")
        if start > record.end_time:
            raise click.UsageError(f"{path} ends at {record.end_time:.2f} s, before {start:g} s")
        if output.exists() and output.samefile(path):
            raise click.UsageError(f"{output} is the record itself\n  try: another file with -o")
        from missions.plugins.records.recording.cut import cut_record as cut_piece  # noqa: PLC0415 - it needs mcap, as open_record says

        count = cut_piece(record, start, end, output, force=force)
    message = written_message(output, subject=f"{count} messages to ")
    click.echo(f"{message}\n  try: mission record info {output}")
