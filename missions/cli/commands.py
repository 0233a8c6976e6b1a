"""The table of all commands, and click groups that import a command when it is used."""

import gc
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from importlib import import_module
from shlex import quote
from typing import Any

import click

from missions.library.plugins import find_command, load, plugins
from missions.plugin import COMMAND_GROUPS, LOOK, RUN, SET_UP, CommandEntry

OWN_PROCESS = "alone"
"""Value of ``obj`` in click's root context if the process runs only this command; as in `missions.control.holders`."""


def freeze_garbage_collector() -> None:
    """Exclude all present objects from garbage collection, and enable it for later ones.

    These objects live as long as the process. Searching them again would cost 0.1 s of a tick on a Raspberry Pi. Does
    nothing if the process does not belong to this command alone.
    """
    context = click.get_current_context(silent=True)
    if context is not None and context.find_root().obj == OWN_PROCESS:
        gc.freeze()
        gc.enable()


COMMANDS: Mapping[str, CommandEntry] = {
    "run": CommandEntry(RUN, "missions.cli.run:command", "Run a mission: simulated, unless a robot is named."),
    "stop": CommandEntry(RUN, "missions.cli.stop:command", "Stop all runs of this user on this computer."),
    "list": CommandEntry(LOOK, "missions.cli.list:command", "List missions, robots, worlds, behaviours and so on."),
    "show": CommandEntry(LOOK, "missions.cli.show:command", "Show a mission, record, behaviour, world or gait."),
    "check": CommandEntry(LOOK, "missions.cli.check:command", "Check missions without running them."),
    "completion": CommandEntry(SET_UP, "missions.cli.completion:command", "Set up completion with TAB in your shell."),
}
"""Commands of the core in the order of the help; plug-ins declare the others. Each is imported when it is used."""


def declared_commands() -> Iterator[tuple[str, CommandEntry]]:
    """Yield the declarations of all commands, core first, without importing the commands."""
    yield from COMMANDS.items()
    for plugin in plugins():
        yield from plugin.commands.items()


OLD_NAMES: Mapping[str, str] = {
    "motion": "run",
    "serve": "task serve",
    "world show": "show",
    "world": "show",
    "fault": "simulate fault",
    "tune tracker": "controller tune",
    "tune": "controller tune",
    "replay": "record replay",
    "report": "record report",
    "stats": "record stats",
    "camera": "robot camera",
    "models": "robot models",
    "udev": "robot udev",
    "place": "ros2 place",
    "storm": "make storm",
    "task cancel": "task remove",
    "record mend": "record repair",
    "gait show": "show",
    "servo set-id": "servo set SERVO id NEW",
    "servo set-baud": "servo set SERVO baud RATE",
    "servo monitor": "servo info --watch",
    "servo reboot": "servo torque restart SERVO",
    "servo recover": "servo torque recover",
}
"""Former names of commands, each with its present name; words in capitals are placeholders."""


def current_name(words: Sequence[str]) -> str:
    """Return the present command line for a former one; empty if the words were never a command."""
    for size in (2, 1):
        if (new := OLD_NAMES.get(" ".join(words[:size]))) is not None:
            rest = [] if any(word.isupper() for word in new.split()) else words[size:]
            return new if new.startswith("make ") else " ".join(("mission", new, *map(quote, rest)))
    return ""


class SharedOption(click.Option):
    """An option that several commands of a group share; the help of the group lists it."""


shared_option = partial(click.option, cls=SharedOption)


class FullHelpCommand(click.Command):
    """A command whose help lists only its important options, and all of them with ``--help-all``."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the arguments; with ``--help-all``, print the full help and exit."""
        if "--help-all" in args[: args.index("--") if "--" in args else len(args)] and not ctx.resilient_parsing:
            ctx.meta[FullHelpCommand.__name__] = True
            click.echo(self.get_help(ctx))
            ctx.exit()
        return super().parse_args(ctx, args)


class SharingCommand(FullHelpCommand):
    """A command of a group with shared options; its own help lists those only with ``--help-all``."""

    def __init__(self, *args: Any, **more: Any) -> None:
        super().__init__(*args, **more)
        self.shared = [each for each in self.params if isinstance(each, SharedOption)]
        self.params = [each for each in self.params if not isinstance(each, SharedOption)]

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """Return all parameters, including the shared options and the help option."""
        *params, helping = super().get_params(ctx)
        return [*params, *self.shared, helping]

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options of the command, and the names of the shared options."""
        shared = [] if FullHelpCommand.__name__ in ctx.meta else self.shared
        shown = [each for each in self.get_params(ctx) if each not in shared and not isinstance(each, click.Argument)]
        rows = [each.get_help_record(ctx) for each in shown]
        with formatter.section("Options"):
            formatter.write_dl([row for row in rows if row is not None])
        if shared:
            names = ", ".join(each.opts[0] for each in shared)
            formatter.write_paragraph()
            formatter.write_text(f"More options: {names} (explained by --help-all)")


class LazyGroup(click.Group):
    """A click group that imports its subcommands, also those of plug-ins, when they are used.

    The declared name of a subcommand begins with the name of its group, as in ``record replay``. If the user types a
    former name of a subcommand, the error names the present one.
    """

    command_class = SharingCommand

    @property
    def path(self) -> tuple[str, ...]:
        """Words after ``mission`` that lead to this group, such as ("robot", "models")."""
        return tuple(str(self.name).split())

    @property
    def lazy_commands(self) -> Mapping[str, CommandEntry]:
        """Declarations of the group's subcommands, by the last word of their names; each is imported when used."""
        found = {tuple(name.split()): each for name, each in declared_commands()}
        return {words[-1]: each for words, each in found.items() if words[:-1] == self.path}

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of the subcommands: the imported ones, then the others."""
        del ctx
        return [*self.commands, *self.lazy_commands]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import and return a subcommand; None if the name is unknown."""
        if own_command := super().get_command(ctx, cmd_name):
            return own_command
        name = " ".join((*self.path, cmd_name))
        if entry := COMMANDS.get(name):
            module, _, attribute = entry.path.partition(":")
            command = getattr(import_module(module), attribute)
        elif found := find_command(name):
            plugin, entry = found
            command = load(plugin, entry.path)
        else:
            return None
        freeze_garbage_collector()
        if not isinstance(command, click.Command):
            raise click.ClickException(f"{entry.path} is {type(command).__name__}, not a click command")
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the subcommand in ``args``; fail with a suggestion if there is no such subcommand."""
        word = args[0]
        if not word.startswith("-") and self.get_command(ctx, word) is None:
            suggestion = current_name([*self.path, *args]) or f"mission {self.suggestion(ctx, word)}"
            ctx.fail(f"no such command: '{word}'\n  try: {suggestion}")
        return super().resolve_command(ctx, args)

    def suggestion(self, ctx: click.Context, word: str) -> str:
        """Return the likely words after ``mission`` for an unknown ``word``.

        ``list`` in the group of a kind, as in ``robot list``, and the plural of a kind suggest ``mission list``.
        """
        from config.diagnostics import closest  # noqa: PLC0415 - as in `guarded`
        from missions.cli.list import LISTED_KINDS  # noqa: PLC0415 - likewise

        kind = f"{self.name}s" if word == "list" else word
        if kind in LISTED_KINDS:
            return f"list {kind}"
        return " ".join((*self.path, closest(word, self.list_commands(ctx)) or "--help"))

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options shared by the commands of the group, its own options, and the list of commands."""
        shared = {
            option.name: option.get_help_record(ctx)
            for each in self.commands.values()
            for option in getattr(each, "shared", ())
        }
        if shared:
            with formatter.section("Options of the commands"):
                formatter.write_dl([row for row in shared.values() if row is not None])
        super().format_options(ctx, formatter)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of commands for ``--help`` without importing them."""
        del ctx
        rows = [(name, each.get_short_help_str(formatter.width)) for name, each in self.commands.items()]
        with formatter.section("Commands"):
            formatter.write_dl([*rows, *((name, each.help) for name, each in self.lazy_commands.items())])


class MissionGroup(LazyGroup):
    """Root group: the ``mission`` command."""

    path = ()

    def suggestion(self, ctx: click.Context, word: str) -> str:
        """Return the likely words for an unknown ``word``, which may be the name of a mission."""
        from missions.library.shipped import shipped_missions  # noqa: PLC0415 - as in `guarded`

        is_mission = word in shipped_missions() or word.endswith(".yaml")
        return f"run {word}" if is_mission else super().suggestion(ctx, word)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the commands for ``--help`` by topic, with aligned columns."""
        del ctx
        commands = self.lazy_commands
        widest = max(map(len, commands))
        for title in dict.fromkeys((*COMMAND_GROUPS, *(each.group for each in commands.values()))):
            if rows := [(name.ljust(widest), each.help) for name, each in commands.items() if each.group == title]:
                with formatter.section(title):
                    formatter.write_dl(rows)
