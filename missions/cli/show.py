"""``mission show``: missions, records, behaviours, worlds and gaits, as text or as pictures."""

import json
import shlex
import shutil
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from behaviours.catalogue import LEAVES
from config.faults import closest
from config.library import DEFAULT_ROBOT, SHEETS, UnknownNameError, find, is_file, kinds_of, shipped
from config.reading import PRIVATE, save_file
from missions.cli.behaviours import is_word, show_behaviour
from missions.cli.declared import behaviours_option, params_option
from missions.cli.names import ROBOT, SHOWN
from missions.cli.numbers import Whole
from missions.cli.options import SECONDS, leaves_for
from missions.cli.outputs import writing, wrote
from missions.library.plugins import file_kind_of, load, service
from missions.library.shipped import find_mission, load_mission, shipped_missions
from missions.trees.draw import drawing_of, folded
from missions.trees.drawing import Drawing, outline, to_json
from missions.trees.text import dot, mermaid, text_tree

Dump = str | bytes

FORMS: Mapping[str, Callable[[Drawing], Dump]] = {
    "text": outline,
    "unicode": text_tree,
    "ascii": partial(text_tree, ascii=True),
    "dot": dot,
    "mermaid": mermaid,
    "json": lambda drawing: json.dumps(to_json(drawing), indent=1, ensure_ascii=False) + "\n",
    **(service("picture_forms") or {}),
}
"""The forms of one tree: as text, and as pictures by a plug-in. Text is meant as UTF-8."""

SUFFIXES: Mapping[str, str] = {
    ".txt": "text",
    ".unicode": "unicode",
    ".ascii": "ascii",
    ".dot": "dot",
    ".gv": "dot",
    ".mmd": "mermaid",
    **{f".{form}": form for form in ("json", "svg", "png", "html") if form in FORMS},
}
"""The form that the name of a file asks for."""

NO_RECORD = "a mission has no moments\n  try: mission run {name} --record {stem}.mcap, then show that"
NO_PLOTS = "a PNG needs resvg and Matplotlib\n  try: pip install 'missiontree[plots]', or -o {stem}.svg"


ALLOWED: Mapping[str, frozenset[str]] = {
    "mission": frozenset({"form", "output", "other", "depth", "params", "files"}),
    "record": frozenset({"form", "output", "other", "depth", "params", "files", "time"}),
    "behaviour": frozenset({"form", "files"}),
    "world": frozenset({"output", "time", "camera", "robot"}),
    "gait": frozenset({"output", "robot"}),
}
"""The kinds of things that can be shown, each with its options, by their parameters."""

LIBRARIES = {"worlds": "world", "gaits": "gait"}
"""The kinds of files whose names are looked up where there is no mission of the name."""


@click.command(epilog="Example: mission show greet -o greet.svg")
@click.argument("words", nargs=-1, required=True, type=SHOWN, metavar="[KIND] NAME")
@click.option(
    "--format",
    "form",
    type=click.Choice(list(FORMS)),
    help="How to draw a mission or a record: text, unless the file after -o says otherwise. A behaviour: text or json.",
)
@click.option("-o", "--output", type=click.Path(path_type=Path, dir_okay=False), metavar="FILE", help="Write it there.")
@click.option("--at", "time", metavar="TIME", type=SECONDS, help="Show a record or a world at this time, such as 12s.")
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
@click.option("--camera", is_flag=True, help="Of a world: draw the view of the robot's camera at the start.")
@click.option("--robot", type=ROBOT, help="Of a world or a gait: the robot (a name or a file).")
@click.pass_context
def command(
    ctx: click.Context,
    words: tuple[str, ...],
    form: str | None,
    output: Path | None,
    time: float | None,
    other: str | None,
    depth: int | None,
    params: dict[str, str],
    files: tuple[Path, ...],
    camera: bool,
    robot: str | None,
) -> None:
    """Show a mission, a record, a behaviour, a world or a gait, by its name or file, as text or as a picture.

    A name of two kinds is that of a mission; KIND (mission, record, behaviour, world, gait) chooses another:
    `mission show behaviour dock`.
    """
    kind, name = _meant(words, files)
    for option in ctx.command.params:
        if ctx.get_parameter_source(str(option.name)) is ParameterSource.COMMANDLINE and isinstance(
            option, click.Option
        ):
            _require_fitting(option, kind, name)
    match kind:
        case "behaviour":
            if form not in (None, "text", "json"):
                raise click.UsageError(f"--format {form}: a behaviour is shown as text or as json")
            show_behaviour(name, files, as_json=form == "json")
        case "world":
            _service("show_world", "pictures")(name, output, time or 0.0, robot or DEFAULT_ROBOT, camera=camera)
        case "gait":
            _service("show_gait", "legs")(name, output, robot)
        case _:
            _show_tree(name, form or _form_of(output), output, time, other, depth, params, files)


def _service(name: str, plugin: str) -> Any:
    """Return a function of a plug-in. Raises click.UsageError without the plug-in."""
    found = service(name)
    if found is None:
        raise click.UsageError(f"this needs the plug-in '{plugin}', which is not installed")
    return found


def _meant(words: Sequence[str], files: Sequence[Path]) -> tuple[str, str]:
    """Return the kind and the name of what is to be shown. Raises click.UsageError."""
    if len(words) > 1:
        if len(words) > 2 or words[0] not in ALLOWED:
            raise click.UsageError(f"unexpected: {' '.join(words)}\n  try: mission show {{{'|'.join(ALLOWED)}}} NAME")
        return words[0], words[1]
    (name,) = words
    path = Path(name)
    if _is_record(name):
        return "record", name
    if path.suffix in SHEETS:
        return "gait", name
    if is_file(path):
        return next((LIBRARIES[kind] for kind in kinds_of(path) if kind in LIBRARIES), "mission"), name
    with suppress(UnknownNameError):
        find_mission(name)
        return "mission", name
    for library, kind in LIBRARIES.items():
        with suppress(UnknownNameError):
            find(library, name)
            return kind, name
    if is_word(name, files):
        return "behaviour", name
    close = closest(name, [*shipped_missions(), *LEAVES, *(each for kind in LIBRARIES for each in shipped(kind))])
    if close and close not in shipped_missions():
        raise click.UsageError(f"nothing is called '{name}'; did you mean '{close}'?")
    return "mission", name


def _require_fitting(option: click.Option, kind: str, name: str) -> None:
    """Raise click.UsageError for an option that does not fit what is shown."""
    if option.name in ALLOWED[kind]:
        return
    if option.name == "time":
        raise click.UsageError(f"--at: {NO_RECORD.format(name=name, stem=Path(name).stem)}")
    fitting = " or a ".join(each for each, options in ALLOWED.items() if option.name in options)
    raise click.UsageError(f"{option.opts[-1]} is for a {fitting}, and '{name}' is a {kind}")


def _show_tree(
    name: str,
    form: str,
    output: Path | None,
    time: float | None,
    other: str | None,
    depth: int | None,
    params: dict[str, str],
    files: tuple[Path, ...],
) -> None:
    """Draw the tree of a mission or of a record, or of two of them side by side."""
    names = [name] if other is None else [name, other]
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
    found = file_kind_of(name.lower())
    return found is not None and bool(found[1].drawing)


def _drawing(name: str, params: dict[str, str], files: tuple[Path, ...], time: float | None) -> Drawing:
    """Return the drawing of a mission or of a record; of that, at ``time`` if it is given."""
    if (found := file_kind_of(name.lower())) is not None and found[1].drawing:
        plugin, kind = found
        drawing: Drawing = load(plugin, kind.drawing)(Path(name), time)
        return drawing
    return drawing_of(load_mission(name, params=params, leaves=leaves_for(files)(name)))


def _pair(left: Drawing, right: Drawing, form: str, output: Path | None) -> Dump:
    """Dump two drawings side by side, as wide as the terminal where they go to one."""
    width = shutil.get_terminal_size((120, 24)).columns if output is None else None
    try:
        dump: Dump = _service("dump_pair", "pictures")(left, right, form, width)
    except ValueError as error:
        raise click.UsageError(str(error)) from error
    return dump


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
