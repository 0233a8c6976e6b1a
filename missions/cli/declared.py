"""Options of the command line from their declarations in ``missions.options``."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import click

from missions.cli.commands import FullHelp
from missions.cli.names import MISSION, PARAMS, ROBOT, WORLD
from missions.cli.numbers import InUnit, Real, Whole
from missions.cli.options import SECONDS, SIZE, MissionCommand, pairs
from missions.options import Option, options_of
from missions.request import RunRequest

NAMES = {"mission": MISSION, "robot": ROBOT, "world": WORLD, "duration": SECONDS, "size": SIZE, "params": PARAMS}
"""The types of options whose values need no bounds."""

EXAMPLES = {"params": 'patience="5 s"', "ports": "base=/dev/ttyUSB0"}
"""Examples of NAME=VALUE, for messages."""


class DeclaredOption(click.Option):
    """A click option made of a declaration."""

    def __init__(self, declared: Option) -> None:
        self.declared = declared
        more: dict[str, Any] = {"metavar": declared.metavar} if declared.metavar else {}
        if isinstance(declared.default, str | int) and not isinstance(declared.default, bool):
            more |= {"default": declared.default, "show_default": True}
        if declared.kind in EXAMPLES:
            more["callback"] = pairs(EXAMPLES[declared.kind], empty=declared.kind == "params")
        super().__init__(
            [declared.flag, declared.name],
            type=None if declared.kind == "flag" else _type_of(declared),
            is_flag=declared.kind == "flag",
            multiple=declared.several or declared.kind in EXAMPLES,
            hidden=declared.hidden,
            help=declared.help,
            **more,
        )


def _type_of(declared: Option) -> click.ParamType[Any] | None:
    kind, low, high = declared.kind, declared.low, declared.high
    match kind:
        case "choice":
            return click.Choice(declared.among)
        case "integer":
            return Whole(None if low is None else int(low), None if high is None else int(high))
        case "number":
            return Real(low, high)
        case "frequency":
            return InUnit("Hz", low, high)
        case "path" | "file":
            return click.Path(path_type=Path, dir_okay=kind == "path")
        case _:
            return NAMES.get(kind)


def declared_options(*declared: type | Option) -> Callable[[Any], Any]:
    """Return a decorator that adds options, or all options of dataclasses, to a command's function."""

    def add(function: Any) -> Any:
        made = [
            DeclaredOption(option)
            for each in declared
            for option in ((each,) if isinstance(each, Option) else options_of(each))
        ]
        function.__click_params__ = [*made[::-1], *getattr(function, "__click_params__", [])]
        return function

    return add


def options_of_run(*names: str) -> Iterator[Option]:
    """Yield some options of `mission run`, for another command."""
    for each in options_of(RunRequest):
        if each.name in names:
            yield each


params_option = declared_options(*options_of_run("params"))
"""Adds ``--param NAME=VALUE`` to a command, which gets them as ``params``."""

behaviours_option = declared_options(*(replace(each, name="files") for each in options_of_run("behaviours")))
"""Adds ``--behaviours FILE.py`` to a command, which gets a tuple of paths as ``files``."""


class DeclaredCommand(FullHelp, MissionCommand):
    """A command with declared options: grouped in its help, which shows the others with ``--help-all`` only.

    An option that may stand alone takes the next word only if that can be its value.
    """

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Read the arguments."""
        following = [*args[1:], ""][: len(args)]
        return super().parse_args(ctx, [self._joined(*words) for words in zip(args, following, strict=True)])

    def _joined(self, word: str, follows: str) -> str:
        """Return an option that stands alone together with its value."""
        alone = next((each for each in self._declared() if each.flag == word and each.alone), None)
        if alone is None or (follows in alone.among if alone.among else follows.startswith("/")):
            return word
        return f"{word}={alone.alone}"

    def _declared(self) -> Iterator[Option]:
        return (each.declared for each in self.params if isinstance(each, DeclaredOption))

    def too_much(self, words: list[str], args: list[str]) -> str:
        """Return the error for ``words`` that are no arguments; a level that there is not is named."""
        for each in self._declared():
            level = next((follows for word, follows in pairwise(args) if word == f"{each.flag}={each.alone}"), "")
            if each.among and level in words:
                return f"{each.flag} takes {' or '.join(each.among)}, got '{level}'"
        return super().too_much(words, args)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options in groups; those that a newcomer does not need with ``--help-all`` only."""
        every = FullHelp.__name__ in ctx.meta
        groups: dict[str, list[tuple[str, str]]] = {"Options": []}
        left = 0
        for each in self.get_params(ctx):
            told = each.get_help_record(ctx)
            if told is None or isinstance(each, click.Argument):
                continue
            declared = each.declared if isinstance(each, DeclaredOption) else None
            if declared is None or declared.newcomer or every:
                groups.setdefault(declared.group if declared is not None else "", []).append(told)
            else:
                left += 1
        groups["Options"] = groups.pop("", []) + groups["Options"]
        if left:
            groups["Options"].append(("--help-all", f"Show {left} more options."))
        for title, rows in groups.items():
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows)
