"""``mission record report``: a record as one page for people who were not there, and as pictures for papers."""

import shlex
from pathlib import Path

import click

from config.file_io import PRIVATE_MODE, save_file
from missions.cli.numbers import WholeNumber
from missions.cli.outputs import check_folder, report_write_errors, written_message
from missions.plugins.records.recording.run_record import open_record
from missions.plugins.records.report.page import report_page
from missions.plugins.records.report.summary import MAX_PICTURES, RecordStudy, study_record

PAGE_SUFFIXES = (".html", ".htm")
"""What the name of a report may end in."""


@click.command(epilog="Example: mission record report monday.mcap -o monday.html")
@click.argument("file", metavar="RECORD", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="Write the page there, instead of beside the record (greet_report.html of greet.mcap).",
)
@click.option(
    "--pictures",
    type=WholeNumber(min=0),
    default=MAX_PICTURES,
    show_default=True,
    metavar="N",
    help="At most so many pictures of the camera: before failures, and evenly.",
)
@click.option(
    "--plots",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="DIR",
    help="Write the plots there, as PNG for papers; the page only with -o.",
)
def report(file: Path, output: Path | None, pictures: int, plots: Path | None) -> None:
    """Write a report of a record: one page, which needs nothing beside it.

    It has a summary in words, the tree with a slider for time, a timeline of its nodes, variables, pictures with what
    was seen in them, how head and base moved, the tracking error, and faults.
    """
    if output is None and plots is None:
        output = file.with_name(f"{file.stem}_report.html")  # not the name of a picture of the mission
    elif output is not None and output.suffix.lower() not in PAGE_SUFFIXES:
        raise click.BadParameter(
            f"{output}: a report is a page of HTML\n  try: -o {shlex.quote(str(output.with_suffix('.html')))}",
            param_hint="-o",
        )
    if plots is not None:
        check_folder(plots, "--plots", f"--plots {shlex.quote(str(plots.with_suffix('')))}")
    found = study_record(open_record(file), max_pictures=pictures if output is not None else 0)
    try:
        if output is not None:
            with report_write_errors(output, "-o"):
                save_file(output, report_page(found).encode(errors="backslashreplace"), PRIVATE_MODE)
            click.echo(written_message(output))
        if plots is not None:
            _plot(found, plots)
    except OSError as error:
        raise click.UsageError(f"{error.filename or output or plots}: {error.strerror or error}") from error


def _plot(study: RecordStudy, folder: Path) -> None:
    try:
        from missions.plugins.records.report.plots import draw_plots  # noqa: PLC0415 - needs an extra
    except ImportError as error:
        raise click.UsageError("plots need Matplotlib\n  try: pip install 'missiontree[plots]'") from error
    for path in draw_plots(study, folder):
        click.echo(written_message(path))
