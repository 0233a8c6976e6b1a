"""Makes click options from the declarations in ``missions.options``."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import click

from missions.cli.commands import FullHelpCommand
from missions.cli.names import MISSION, PARAMS, ROBOT, WORLD
from missions.cli.numbers import QuantityInUnit, RealNumber, WholeNumber
from missions.cli.options import SECONDS, SIZE, MissionCommand, name_value_callback
from missions.options import Option, options_of
from missions.request import RunRequest

OPTION_TYPES = {"mission": MISSION, "robot": ROBOT, "world": WORLD, "duration": SECONDS, "size": SIZE, "params": PARAMS}
"""Click type for each option kind whose values are not bounded numbers."""

EXAMPLES = {"params": 'patience="5 s"', "ports": "base=/dev/ttyUSB0"}
"""Examples of NAME=VALUE for error messages, by kind of option."""


class DeclaredOption(click.Option):
    """A click option made from an ``Option``."""

    def __init__(self, declaration: Option) -> None:
        self.declaration = declaration
        more: dict[str, Any] = {"metavar": declaration.metavar} if declaration.metavar else {}
        if isinstance(declaration.default, str | int) and not isinstance(declaration.default, bool):
            more |= {"default": declaration.default, "show_default": True}
        if declaration.kind in EXAMPLES:
            more["callback"] = name_value_callback(EXAMPLES[declaration.kind], empty=declaration.kind == "params")
        super().__init__(
            [declaration.flag, declaration.name],
            type=None if declaration.kind == "flag" else _type_of(declaration),
            is_flag=declaration.kind == "flag",
            multiple=declaration.several or declaration.kind in EXAMPLES,
            hidden=declaration.hidden,
            help=declaration.help,
            **more,
        )


def _type_of(declaration: Option) -> click.ParamType[Any] | None:
    kind, low, high = declaration.kind, declaration.low, declaration.high
    match kind:
        case "choice":
            return click.Choice(declaration.among)
        case "integer":
            return WholeNumber(None if low is None else int(low), None if high is None else int(high))
        case "number":
            return RealNumber(low, high)
        case "frequency":
            return QuantityInUnit("Hz", low, high)
        case "path" | "file":
            return click.Path(path_type=Path, dir_okay=kind == "path")
        case _:
            return OPTION_TYPES.get(kind)


def add_options(*declarations: type | Option) -> Callable[[Any], Any]:
    """Return a decorator that adds options, or all options of dataclasses, to the function of a command."""

    def add(function: Any) -> Any:
        options = [
            DeclaredOption(option)
            for each in declarations
            for option in ((each,) if isinstance(each, Option) else options_of(each))
        ]
        function.__click_params__ = [*options[::-1], *getattr(function, "__click_params__", [])]
        return function

    return add


def run_options(*names: str) -> Iterator[Option]:
    """Yield the options of `mission run` with these ``names``, so that another command can have them too."""
    for each in options_of(RunRequest):
        if each.name in names:
            yield each


params_option = add_options(*run_options("params"))
"""Decorator that adds ``--param NAME=VALUE``; the command gets a dict as ``params``."""

behaviours_option = add_options(*(replace(each, name="files") for each in run_options("behaviours")))
"""Decorator that adds ``--behaviours FILE.py``; the command gets the paths as a tuple ``files``."""


class DeclaredCommand(FullHelpCommand, MissionCommand):
    """A command with declared options, which its help groups; less common ones appear only with ``--help-all``.

    An option with an optional value takes the next word only if that word is a possible value.
    """

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        following = [*args[1:], ""][: len(args)]
        return super().parse_args(ctx, [self._join_default(*words) for words in zip(args, following, strict=True)])

    def _join_default(self, word: str, follows: str) -> str:
        """Return the option ``word`` with "=" and its default value, unless ``follows`` is a possible value.

        ``follows`` is the next word of the command line.
        """
        alone = next((each for each in self._declarations() if each.flag == word and each.alone), None)
        if alone is None or (follows in alone.among if alone.among else follows.startswith("/")):
            return word
        return f"{word}={alone.alone}"

    def _declarations(self) -> Iterator[Option]:
        return (each.declaration for each in self.params if isinstance(each, DeclaredOption))

    def unexpected_message(self, words: list[str], args: list[str]) -> str:
        """Return the error for unexpected ``words``; if one of them follows an option with fixed values, list those."""
        for each in self._declarations():
            level = next((follows for word, follows in pairwise(args) if word == f"{each.flag}={each.alone}"), "")
            if each.among and level in words:
                return f"{each.flag} takes {' or '.join(each.among)}, got '{level}'"
        return super().unexpected_message(words, args)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options by group; less common ones only with ``--help-all``."""
        every = FullHelpCommand.__name__ in ctx.meta
        groups: dict[str, list[tuple[str, str]]] = {"Options": []}
        width = 0
        for each in self.get_params(ctx):
            record = each.get_help_record(ctx)
            if record is None or isinstance(each, click.Argument):
                continue
            declared = each.declaration if isinstance(each, DeclaredOption) else None
            if declared is None or declared.newcomer or every:
                groups.setdefault(declared.group if declared is not None else "", []).append(record)
            else:
                width += 1
        groups["Options"] = groups.pop("", []) + groups["Options"]
        if width:
            groups["Options"].append(("--help-all", f"Show {width} more option{'s' * (width > 1)}."))
        for title, rows in groups.items():
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows)
