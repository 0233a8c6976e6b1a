"""``mission show``: the tree of a mission, or of a record at a moment, as a picture; or two of them side by side."""

import shlex
import shutil
import sys
from pathlib import Path

import click

from config.saving import PRIVATE, save_file
from missions.cli.names import SHOWN
from missions.cli.numbers import Whole
from missions.cli.options import SECONDS, behaviours_option, leaves_for, params_option
from missions.cli.outputs import writing, wrote
from missions.library.shipped import load_mission
from missions.plugins.pictures.compare import compare, side_by_side
from missions.plugins.pictures.forms import FORMS, PAIR_FORMS, SUFFIXES, Dump
from missions.plugins.records.recording.read import open_record
from missions.trees.draw import at, drawing_of, folded
from missions.trees.drawing import Drawing
from missions.trees.states import now_of

RECORD = ".mcap"
"""What the name of a record ends in; all other names are missions."""

NO_RECORD = "a mission has no moments\n  try: mission run {name} --record {stem}.mcap, then show that"
NO_PLOTS = "a PNG needs resvg and Matplotlib\n  try: pip install 'missiontree[plots]', or -o {stem}.svg"


@click.command(epilog="Example: mission show greet -o greet.svg")
@click.argument("name", type=SHOWN, metavar="MISSION|RECORD")
@click.option(
    "--format",
    "form",
    type=click.Choice(list(FORMS)),
    help="How to draw it: text, unless the file after -o says otherwise.",
)
@click.option("-o", "--output", type=click.Path(path_type=Path, dir_okay=False), metavar="FILE", help="Write it there.")
@click.option("--at", "time", metavar="TIME", type=SECONDS, help="Show a record at this moment, such as 12.5s.")
@click.option("--diff", "other", type=SHOWN, metavar="OTHER", help="Show what differs in this other mission or record.")
@click.option(
    "--fold",
    "depth",
    type=Whole(min=0),
    metavar="N",
    help="Show sub-missions that lie in N others, or more, as one node; 0 folds them all.",
)
@params_option
@behaviours_option
def command(
    name: str,
    form: str | None,
    output: Path | None,
    time: float | None,
    other: str | None,
    depth: int | None,
    params: dict[str, str],
    files: tuple[Path, ...],
) -> None:
    """Draw the tree of a mission (a name or a file) or of a record."""
    form = form or _form_of(output)
    names = [name] if other is None else [name, other]
    if time is not None and not any(map(_is_record, names)):
        raise click.UsageError(f"--at: {NO_RECORD.format(name=name, stem=Path(name).stem)}")
    drawings = [_drawing(each, params if each == name else {}, files, time) for each in names]
    if depth is not None:
        drawings = [folded(each, depth) for each in drawings]
    try:
        dump = FORMS[form](drawings[0]) if other is None else _pair(drawings[0], drawings[1], form, output)
    except ImportError as error:
        raise click.UsageError(NO_PLOTS.format(stem=Path(name).stem)) from error
    _write(dump, output, form, name, private=any(map(_is_record, names)))


def _form_of(output: Path | None) -> str:
    if output is None:
        return "text"
    if output.suffix.lower() not in SUFFIXES:
        known = ", ".join(SUFFIXES)
        picture = shlex.quote(str(output.with_suffix(".png")))
        raise click.UsageError(f"-o {output}: the name says no format that is known ({known})\n  try: -o {picture}")
    return SUFFIXES[output.suffix.lower()]


def _is_record(name: str) -> bool:
    return Path(name).suffix.lower() == RECORD


def _drawing(name: str, params: dict[str, str], files: tuple[Path, ...], time: float | None) -> Drawing:
    """Return the drawing of a mission or of a record; of that, at ``time`` if it is given."""
    if not _is_record(name):
        return drawing_of(load_mission(name, params=params, leaves=leaves_for(files)(name)))
    record = open_record(Path(name))
    drawing = record.drawing()
    if time is None:
        return drawing
    if time > record.until:
        click.echo(f"mission: {name} ends at {record.until:.2f} s, and is shown as it stood then", err=True)
        time = record.until
    return at(drawing, {key: now_of(change) for key, change in record.statuses(time).items()}, time)


def _pair(left: Drawing, right: Drawing, form: str, output: Path | None) -> Dump:
    """Dump two drawings side by side, as wide as the terminal where they go to one."""
    if form not in PAIR_FORMS:
        raise click.UsageError(f"--diff knows no format '{form}', only {', '.join(PAIR_FORMS)}")
    comparison = compare(left, right)
    if output is None and form in ("text", "unicode", "ascii"):
        return side_by_side(comparison, shutil.get_terminal_size((120, 24)).columns, ascii_only=form == "ascii")
    return PAIR_FORMS[form](comparison)


def _write(dump: Dump, output: Path | None, form: str, name: str, *, private: bool) -> None:
    """Write to a file, as UTF-8, or to stdout; bytes never to a terminal. A ``private`` file is for its owner only."""
    if output is None:
        if isinstance(dump, bytes) and sys.stdout.isatty():
            raise click.UsageError(f"a terminal cannot show {form}\n  try: -o {Path(name).stem}.{form}")
        click.echo(dump, nl=False)
        return
    with writing(output, "-o"):
        save_file(output, dump, PRIVATE if private else None)
    click.echo(wrote(output) if private else f"wrote {output}", err=True)
