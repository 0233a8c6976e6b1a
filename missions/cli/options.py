"""Option types and helpers that several commands share: NAME=VALUE, times and sizes with units, behaviour files."""

import re
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from shlex import quote
from typing import ClassVar

import click

from behaviours.leaf import Leaf
from config.library import kinds_of
from config.units import si_value
from missions.library.shipped import TEST_SUFFIX, behaviour_files
from missions.library.vocabulary import behaviour_files_beside, load_leaves


class SecondsType(click.ParamType[float]):
    """A time since the start of a run with its unit: ``12.5s``, ``"2 min"``."""

    name = "time"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> float:
        if isinstance(value, float):
            return value
        try:
            found = si_value(str(value), "duration")
        except ValueError as error:
            self.fail(str(error), param, ctx)
        if found < 0:
            self.fail(f"must be 0 s or later, got {value}", param, ctx)
        return found


SECONDS = SecondsType()


class SizeType(click.ParamType[float]):
    """A file size: ``500 MB``, ``2GB``."""

    name = "size"
    UNITS: ClassVar[Mapping[str, float]] = {"kb": 1e3, "mb": 1e6, "gb": 1e9, "tb": 1e12}

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> float:
        if isinstance(value, float):
            return value
        found = re.fullmatch(r"([0-9]{1,15}(?:\.[0-9]+)?)\s*([kMGT]B)", str(value).strip(), re.IGNORECASE)
        if found is None:
            self.fail(f"{value!r} is not a size: give a number and a unit, such as 500 MB or 2 GB", param, ctx)
        return float(found[1]) * self.UNITS[found[2].lower()]


SIZE = SizeType()


class MissionCommand(click.Command):
    """A command for a mission; its errors name a missing ``--param`` and a missing value of an option."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the arguments. Raises click.UsageError."""
        options = {word: option for option in self.params if isinstance(option, click.Option) for word in option.opts}
        for word, follows in pairwise(args):
            if word in options and follows in options and not (options[word].is_flag or options[word].count):
                takes = options[word].make_metavar(ctx)
                ctx.fail(f"{word} needs a value\n  try: {word} {takes}")
        ctx.allow_extra_args = True
        remaining = super().parse_args(ctx, list(args))
        if remaining and not ctx.resilient_parsing:
            ctx.fail(self.unexpected_message(remaining, args))
        return remaining

    def unexpected_message(self, words: list[str], args: list[str]) -> str:
        """Return the error for ``words`` that are not arguments of the command; suggest ``--param`` for NAME=VALUE."""
        del args
        params = [f"--param {quote(word)}" for word in words if "=" in word]
        return f"unexpected: {' '.join(words)}" + (f"\n  try: {' '.join(params)}" if params else "")


def name_value_callback(
    example: str, *, empty: bool = True
) -> Callable[[click.Context, click.Parameter, tuple[str, ...]], dict[str, str]]:
    """Return a click callback that parses repeated NAME=VALUE options into a dict; the text must be UTF-8.

    ``empty`` allows empty values.
    """

    def read(ctx: click.Context, option: click.Parameter, values: tuple[str, ...]) -> dict[str, str]:
        found: dict[str, str] = {}
        for value in values:
            if (shown := value.encode(errors="surrogateescape").decode(errors="backslashreplace")) != value:
                raise click.BadParameter(f"'{shown}' is not UTF-8 text", ctx=ctx, param=option)
            name, equals, text = value.partition("=")
            if not equals or not name.strip() or not (text or empty):
                raise click.BadParameter(f"'{value}' is not NAME=VALUE, such as {example}", ctx=ctx, param=option)
            found[name.strip()] = text
        return found

    return read


def mission_files_in(name: str, *, tests: bool = True) -> list[str]:
    """Return ``name``, or if it is a folder, the missions in it, with their test files if ``tests`` is true.

    Files of other kinds are left out, such as worlds, and hidden files, such as those that an interrupted command has
    left.
    """
    folder = Path(name)
    if not folder.is_dir():
        return [name]
    files = (path for path in sorted(folder.glob("[!.]*.yaml")) if path.is_file())
    found = [str(path) for path in files if (tests if path.name.endswith(TEST_SUFFIX) else _may_be_mission(path))]
    if not found:
        raise click.UsageError(f"{name}: no missions (*.yaml) in this folder")
    return found


def _may_be_mission(path: Path) -> bool:
    """Return whether a file is a mission, or of no known kind, such as a mission without its first key."""
    kinds = kinds_of(path)
    return not kinds or "missions" in kinds


def leaf_loader(required_files: Sequence[Path]) -> Callable[[str], Mapping[str, type[Leaf]]]:
    """Return a function that loads the leaves for a mission by its name or path.

    The leaves come from MissionTree, from ``required_files``, and from the behaviour files in the mission's folder. The
    function caches the leaves for each set of files. It prints on stderr the files of the mission's folder that it
    runs. Raises InvalidFileError; the returned function raises UnknownNameError too.
    """
    known = {tuple(required_files): load_leaves(required_files)}

    def leaves(name: str) -> Mapping[str, type[Leaf]]:
        files = tuple(behaviour_files(name, required_files))
        if files not in known:
            print_found_files(files, required_files)
            known[files] = load_leaves(files, required_files)
        return known[files]

    return leaves


def folder_behaviour_files(given_files: Sequence[Path]) -> list[Path]:
    """Return ``given_files`` and the behaviour files in the current folder; print the latter on stderr."""
    files = [*given_files, *(path for path in behaviour_files_beside(Path("mission.yaml")) if path not in given_files)]
    print_found_files(files, given_files)
    return files


def print_found_files(files: Sequence[Path], known_files: Sequence[Path]) -> None:
    """Print on stderr the behaviour files that are run although the user did not name them."""
    if found := [str(path) for path in files if path not in known_files]:
        click.echo(f"behaviours of this folder: {', '.join(found)}", err=True)
