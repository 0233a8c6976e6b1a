"""``mission record report``: write a record as one HTML page, and its charts as PNG files."""

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
"""Allowed file name endings of a report."""


@click.command(epilog="Example: mission record report monday.mcap -o monday.html")
@click.argument("file", metavar="RECORD", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="Output page; by default beside the record, such as greet_report.html for greet.mcap.",
)
@click.option(
    "--pictures",
    type=WholeNumber(min=0),
    default=MAX_PICTURES,
    show_default=True,
    metavar="N",
    help="Maximum number of camera pictures: before failures, and evenly spread.",
)
@click.option(
    "--plots",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="DIR",
    help="Folder for plots as PNG; the page is then written only with -o.",
)
def report(file: Path, output: Path | None, pictures: int, plots: Path | None) -> None:
    """Write a report of a record as one self-contained HTML page.

    It has a summary, the tree with a time slider, a timeline, variables, annotated pictures, the motion of head and
    base, the tracking error, and faults.
    """
    if output is None and plots is None:
        output = file.with_name(f"{file.stem}_report.html")  # `mission show` writes NAME.html
    elif output is not None and output.suffix.lower() not in PAGE_SUFFIXES:
        raise click.BadParameter(
            f"{output}: not the name of an HTML page\n  try: -o {shlex.quote(str(output.with_suffix('.html')))}",
            param_hint="-o",
        )
    if plots is not None:
        check_folder(plots, "--plots", f"--plots {shlex.quote(str(plots.with_suffix('')))}")
    study = study_record(open_record(file), max_pictures=pictures if output is not None else 0)
    try:
        if output is not None:
            with report_write_errors(output, "-o"):
                save_file(output, report_page(study).encode(errors="backslashreplace"), PRIVATE_MODE)
            click.echo(written_message(output))
        if plots is not None:
            _plot(study, plots)
    except OSError as error:
        raise click.UsageError(f"{error.filename or output or plots}: {error.strerror or error}") from error


def _plot(study: RecordStudy, folder: Path) -> None:
    try:
        from missions.plugins.records.report.plots import draw_plots  # noqa: PLC0415 - needs an extra
    except ImportError as error:
        raise click.UsageError("plots need Matplotlib\n  try: pip install 'missiontree[plots]'") from error
    for path in draw_plots(study, folder):
        click.echo(written_message(path))
