"""``mission record stats``: statistics of recorded runs."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import click

from missions.cli.root import SUCCESS, USAGE
from missions.plugins.records.recording.run_record import open_record
from missions.plugins.records.recording.validation import InvalidRecordError
from missions.plugins.records.statistics.computation import compute_stats
from missions.plugins.records.statistics.figures import Stats, merge_stats
from missions.plugins.records.statistics.table import as_csv, as_json, lines_of


@click.command(epilog="Example: mission record stats monday.mcap tuesday.mcap")
@click.argument(
    "paths",
    metavar="RECORD...",
    nargs=-1,
    required=True,
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
)
@click.option("--json", "as_what", flag_value="json", help="Print everything as JSON; times in seconds.")
@click.option("--csv", "as_what", flag_value="csv", help="Print the nodes as CSV; times in seconds.")
def stats(paths: Sequence[Path], as_what: str | None) -> int:
    """Show statistics of records: runs, results and durations of each node, and the robot's reaction times.

    Records of one mission on one robot are merged. Unreadable records are listed and skipped; the exit code is then
    2.
    """
    unread: list[Path] = []
    merged = merge_stats(_read_stats(paths, unread))
    if as_what == "json":
        click.echo(json.dumps([as_json(each) for each in merged], indent=2, ensure_ascii=False))
    elif as_what == "csv":
        click.echo(as_csv(merged), nl=False)
    else:
        for each in merged:
            for line in lines_of(each):
                click.echo(line)
    return USAGE if unread else SUCCESS


def _read_stats(paths: Sequence[Path], unread: list[Path]) -> Iterator[Stats]:
    """Yield the statistics of each record, one record in memory at a time; append unreadable ones to ``unread``."""
    for path in paths:
        try:
            yield compute_stats(open_record(path))
        except (InvalidRecordError, OSError) as error:
            unread.append(path)
            click.echo(f"mission: {error}", err=True)
