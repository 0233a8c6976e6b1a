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
from config.diagnostics import closest
from config.file_io import PRIVATE_MODE, save_file
from config.library import DEFAULT_ROBOT, SHEET_SUFFIXES, UnknownNameError, find_file, is_file, kinds_of, shipped_files
from missions.cli.behaviours import is_word, show_behaviour
from missions.cli.names import ROBOT, SHOWN_NAME
from missions.cli.numbers import WholeNumber
from missions.cli.option_declarations import behaviours_option, params_option
from missions.cli.options import SECONDS, leaf_loader
from missions.cli.outputs import report_write_errors, written_message
from missions.library.plugins import find_file_kind, load, service
from missions.library.shipped import find_mission, load_mission, shipped_missions
from missions.trees.drawing import TreeDrawing, outline, to_json
from missions.trees.drawing_builder import drawing_of, fold_missions
from missions.trees.text import dot, mermaid, text_tree

Dump = str | bytes

TREE_FORMS: Mapping[str, Callable[[TreeDrawing], Dump]] = {
    "text": outline,
    "unicode": text_tree,
    "ascii": partial(text_tree, ascii=True),
    "dot": dot,
    "mermaid": mermaid,
    "json": lambda drawing: json.dumps(to_json(drawing), indent=1, ensure_ascii=False) + "\n",
    **(service("picture_forms") or {}),
}
"""Output formats of a tree, each with a function that converts a drawing; the formats of pictures are from a plug-in.

Text formats are written as UTF-8.
"""

FORM_OF_SUFFIX: Mapping[str, str] = {
    ".txt": "text",
    ".unicode": "unicode",
    ".ascii": "ascii",
    ".dot": "dot",
    ".gv": "dot",
    ".mmd": "mermaid",
    **{f".{form}": form for form in ("json", "svg", "png", "html") if form in TREE_FORMS},
}
"""Output format of `mission show` for each file suffix, such as "dot" for ".gv"."""

XML, EXPORT_SERVICE = "xml", "export_mission"
"""Format for other systems, which only missions have, and the service that writes it."""

NO_RECORD = "a mission has no times, unlike a record\n  try: mission run {name} --record {stem}.mcap, then show that"
NO_PLOTS = "a PNG needs resvg and Matplotlib\n  try: pip install 'missiontree[plots]', or -o {stem}.svg"


OPTIONS_OF_KIND: Mapping[str, frozenset[str]] = {
    "mission": frozenset({"form", "output", "other", "depth", "params", "files"}),
    "record": frozenset({"form", "output", "other", "depth", "params", "files", "time"}),
    "behaviour": frozenset({"form", "files"}),
    "world": frozenset({"output", "time", "camera", "robot"}),
    "gait": frozenset({"output", "robot"}),
}
"""Kinds of things that `mission show` can show, each with the command's parameters that apply to it."""

KIND_OF_LIBRARY = {"worlds": "world", "gaits": "gait"}
"""Libraries in which `mission show` looks up a name that no mission has, each with the kind of its files."""


@click.command(epilog="Example: mission show greet -o greet.svg")
@click.argument("words", nargs=-1, required=True, type=SHOWN_NAME, metavar="[KIND] NAME")
@click.option(
    "--format",
    "form",
    type=click.Choice([*TREE_FORMS, XML]),
    help="Output format; the default is text, or the format of the file after -o. For a behaviour: text or json.",
)
@click.option(
    "-o", "--output", type=click.Path(path_type=Path, dir_okay=False), metavar="FILE", help="Write to this file."
)
@click.option("--at", "time", metavar="TIME", type=SECONDS, help="Show a record or a world at this time, such as 12s.")
@click.option(
    "--diff", "other", type=SHOWN_NAME, metavar="OTHER", help="Show the differences from this other mission or record."
)
@click.option(
    "--fold",
    "depth",
    type=WholeNumber(min=0),
    metavar="N",
    help="Show sub-missions nested N deep or deeper as one node; 0 folds all.",
)
@params_option
@behaviours_option
@click.option("--camera", is_flag=True, help="Draw the view of the robot's camera at the start, for a world.")
@click.option("--robot", type=ROBOT, help="Robot (name or file), for a world or a gait.")
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
    """Show a mission, a record, a behaviour, a world or a gait, by name or file, as text or as a picture.

    If a mission and something else have the same name, the mission is shown. KIND (mission, record, behaviour, world,
    gait) selects another kind: `mission show behaviour dock`.
    """
    kind, name = _resolve_target(words, files)
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
            _require_service("show_world", "pictures")(name, output, time or 0.0, robot or DEFAULT_ROBOT, camera=camera)
        case "gait":
            _require_service("show_gait", "legs")(name, output, robot)
        case _:
            _show_tree(name, form or _form_of(output), output, time, other, depth, params, files)


def _require_service(name: str, plugin: str) -> Any:
    """Return the function ``name`` of our plug-in ``plugin``. Raises click.UsageError if it is not installed."""
    found = service(name)
    if found is None:
        raise click.UsageError(f"this needs the plug-in '{plugin}', which is not installed")
    return found


def _resolve_target(words: Sequence[str], files: Sequence[Path]) -> tuple[str, str]:
    """Return the kind and the name of the thing to show, from the ``words`` of the command line.

    Raises click.UsageError if there is no such thing.
    """
    if len(words) > 1:
        if len(words) > 2 or words[0] not in OPTIONS_OF_KIND:
            raise click.UsageError(
                f"unexpected: {' '.join(words)}\n  try: mission show {{{'|'.join(OPTIONS_OF_KIND)}}} NAME"
            )
        return words[0], words[1]
    (name,) = words
    path = Path(name)
    if _is_record(name):
        return "record", name
    if path.suffix in SHEET_SUFFIXES:
        return "gait", name
    if is_file(path):
        return next((KIND_OF_LIBRARY[kind] for kind in kinds_of(path) if kind in KIND_OF_LIBRARY), "mission"), name
    with suppress(UnknownNameError):
        find_mission(name)
        return "mission", name
    for library, kind in KIND_OF_LIBRARY.items():
        with suppress(UnknownNameError):
            find_file(library, name)
            return kind, name
    if is_word(name, files):
        return "behaviour", name
    close = closest(
        name, [*shipped_missions(), *LEAVES, *(each for kind in KIND_OF_LIBRARY for each in shipped_files(kind))]
    )
    if close and close not in shipped_missions():
        raise click.UsageError(f"unknown name '{name}'; did you mean '{close}'?")
    return "mission", name


def _require_fitting(option: click.Option, kind: str, name: str) -> None:
    """Raise click.UsageError if ``option`` does not apply to ``name``, which is a ``kind`` such as "world"."""
    if option.name in OPTIONS_OF_KIND[kind]:
        return
    if option.name == "time":
        raise click.UsageError(f"--at: {NO_RECORD.format(name=name, stem=Path(name).stem)}")
    fitting = " or a ".join(each for each, options in OPTIONS_OF_KIND.items() if option.name in options)
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
    """Draw the tree of the mission or record ``name``; with ``other``, both trees side by side."""
    if form == XML:
        if other is not None or depth is not None or _is_record(name):
            raise click.UsageError("XML holds one whole mission: no record, and no --diff or --fold beside it")
        _export(name, output, params, files)
        return
    names = [name] if other is None else [name, other]
    drawings = [_drawing(each, params if each == name else {}, files, time) for each in names]
    if depth is not None:
        drawings = [fold_missions(each, depth) for each in drawings]
    try:
        dump = TREE_FORMS[form](drawings[0]) if other is None else _pair(drawings[0], drawings[1], form, output)
    except ImportError as error:
        raise click.UsageError(NO_PLOTS.format(stem=Path(name).stem)) from error
    _write(dump, output, form, name, private=any(map(_is_record, names)))


def _export(name: str, output: Path | None, params: dict[str, str], files: tuple[Path, ...]) -> None:
    """Write a mission for other systems, and a report of everything that they do not have to stderr."""
    export = _require_service(EXPORT_SERVICE, "interchange")
    exported = export(load_mission(name, params=params, leaves=leaf_loader(files)(name)))
    _write(exported.text, output, XML, name, private=False)
    for line in exported.lines():
        click.echo(line, err=True)


def _form_of(output: Path | None) -> str:
    if output is None:
        return "text"
    if output.suffix.lower() == f".{XML}":
        return XML
    if output.suffix.lower() not in FORM_OF_SUFFIX:
        known = ", ".join((*FORM_OF_SUFFIX, f".{XML}"))
        picture = shlex.quote(str(output.with_suffix(".png")))
        raise click.UsageError(f"-o {output}: unknown format; known: ({known})\n  try: -o {picture}")
    return FORM_OF_SUFFIX[output.suffix.lower()]


def _is_record(name: str) -> bool:
    found = find_file_kind(name.lower())
    return found is not None and bool(found[1].drawing)


def _drawing(name: str, params: dict[str, str], files: tuple[Path, ...], time: float | None) -> TreeDrawing:
    """Return the drawing of the tree of a mission, or of a record at ``time`` (seconds from its start)."""
    if (found := find_file_kind(name.lower())) is not None and found[1].drawing:
        plugin, kind = found
        drawing: TreeDrawing = load(plugin, kind.drawing)(Path(name), time)
        return drawing
    return drawing_of(load_mission(name, params=params, leaves=leaf_loader(files)(name)))


def _pair(left: TreeDrawing, right: TreeDrawing, form: str, output: Path | None) -> Dump:
    """Return two drawings side by side; text for a terminal is as wide as the terminal."""
    width = shutil.get_terminal_size((120, 24)).columns if output is None else None
    try:
        dump: Dump = _require_service("dump_pair", "pictures")(left, right, form, width)
    except ValueError as error:
        raise click.UsageError(str(error)) from error
    return dump


def _write(dump: Dump, output: Path | None, form: str, name: str, *, private: bool) -> None:
    """Write a drawing to a file as UTF-8, or to stdout; never write bytes to a terminal.

    A ``private`` file is readable by its owner only.
    """
    if output is None:
        if isinstance(dump, bytes) and sys.stdout.isatty():
            raise click.UsageError(f"a terminal cannot show {form}\n  try: -o {Path(name).stem}.{form}")
        click.echo(dump, nl=False)
        return
    with report_write_errors(output, "-o"):
        save_file(output, dump, PRIVATE_MODE if private else None)
    click.echo(written_message(output) if private else f"wrote {output}", err=True)
