"""The table of all commands, and groups of commands that import them when they are used."""

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
"""What the context of a command is told where the process is its alone: `missions.control.holders.OWN_PROCESS`."""


def freeze_garbage_collector() -> None:
    """Have Python's search for rubbish pass over all that is there now: it is held off until then, and goes on.

    What is there lasts, and would be searched again and again, in a run within ticks (0.1 s on a Raspberry Pi). Does
    nothing where the process is not the command's alone.
    """
    context = click.get_current_context(silent=True)
    if context is not None and context.find_root().obj == OWN_PROCESS:
        gc.freeze()
        gc.enable()


COMMANDS: Mapping[str, CommandEntry] = {
    "run": CommandEntry(RUN, "missions.cli.run:command", "Run a mission: simulated, unless a robot is named."),
    "stop": CommandEntry(RUN, "missions.cli.stop:command", "Stop what runs on this machine, at once."),
    "list": CommandEntry(LOOK, "missions.cli.list:command", "List missions, robots, worlds, behaviours and so on."),
    "show": CommandEntry(LOOK, "missions.cli.show:command", "Show a mission, record, behaviour, world or gait."),
    "check": CommandEntry(LOOK, "missions.cli.check:command", "Check missions without running them."),
    "completion": CommandEntry(SET_UP, "missions.cli.completion:command", "Set up completion with TAB in your shell."),
}
"""The commands of the core, in the order of the help; plug-ins have the others. Each is imported when it is used."""


def declared_commands() -> Iterator[tuple[str, CommandEntry]]:
    """Yield all commands, without importing any: those of the core, then those of plug-ins."""
    yield from COMMANDS.items()
    for plugin in plugins():
        yield from plugin.commands.items()


OLD_NAMES: Mapping[str, str] = {
    "motion": "run",
    "serve": "task serve",
    "behaviours": "list behaviours",
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
    "controller list": "list controllers",
    "gait show": "show",
    "servo set-id": "servo set SERVO id NEW",
    "servo set-baud": "servo set SERVO baud RATE",
    "servo monitor": "servo info --watch",
    "servo reboot": "servo torque restart SERVO",
    "servo recover": "servo torque recover",
}
"""Commands by their names of before, each with its name of today; a word in capitals is to be filled in."""


def current_name(words: Sequence[str]) -> str:
    """Return the command line of today for one of before; empty for words that were no command."""
    for size in (2, 1):
        if (new := OLD_NAMES.get(" ".join(words[:size]))) is not None:
            rest = [] if any(word.isupper() for word in new.split()) else words[size:]
            return new if new.startswith("make ") else " ".join(("mission", new, *map(quote, rest)))
    return ""


class SharedOption(click.Option):
    """An option of several commands of a group: its help is in that of the group."""


shared_option = partial(click.option, cls=SharedOption)


class FullHelpCommand(click.Command):
    """A command whose help shows all of its options with ``--help-all``, and else those that it needs first."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Read the arguments; ``--help-all`` prints the whole help, and ends."""
        if "--help-all" in args[: args.index("--") if "--" in args else len(args)] and not ctx.resilient_parsing:
            ctx.meta[FullHelpCommand.__name__] = True
            click.echo(self.get_help(ctx))
            ctx.exit()
        return super().parse_args(ctx, args)


class SharingCommand(FullHelpCommand):
    """A command of a group with shared options, which are listed in its own help with ``--help-all`` only."""

    def __init__(self, *args: Any, **more: Any) -> None:
        super().__init__(*args, **more)
        self.shared = [each for each in self.params if isinstance(each, SharedOption)]
        self.params = [each for each in self.params if not isinstance(each, SharedOption)]

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """Return all parameters, those that are shared and the one for help too."""
        *own, helping = super().get_params(ctx)
        return [*own, *self.shared, helping]

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write its own options, and the names of those that it shares."""
        shared = [] if FullHelpCommand.__name__ in ctx.meta else self.shared
        shown = [each for each in self.get_params(ctx) if each not in shared and not isinstance(each, click.Argument)]
        rows = [each.get_help_record(ctx) for each in shown]
        with formatter.section("Options"):
            formatter.write_dl([row for row in rows if row is not None])
        if shared:
            names = ", ".join(each.opts[0] for each in shared)
            formatter.write_paragraph()
            formatter.write_text(f"Options of all these commands: {names} (--help-all)")


class LazyGroup(click.Group):
    """A group with subcommands of plug-ins, too, which are imported when they are used.

    They are declared below the name of the group. An old name of a subcommand is answered with the new one. The help
    has the options that its own commands share.
    """

    command_class = SharingCommand

    @property
    def path(self) -> tuple[str, ...]:
        """The words behind ``mission`` that lead to it."""
        return tuple(str(self.name).split())

    @property
    def lazy_commands(self) -> Mapping[str, CommandEntry]:
        """Its subcommands that are declared in a table, by their last words."""
        found = {tuple(name.split()): each for name, each in declared_commands()}
        return {words[-1]: each for words, each in found.items() if words[:-1] == self.path}

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names: those that are imported already, then the others."""
        del ctx
        return [*self.commands, *self.lazy_commands]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import and return one subcommand; None for an unknown name."""
        if own := super().get_command(ctx, cmd_name):
            return own
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
        """Return the subcommand; say what may be meant by an unknown one."""
        word = args[0]
        if not word.startswith("-") and self.get_command(ctx, word) is None:
            meant = current_name([*self.path, *args]) or f"mission {self.suggestion(ctx, word)}"
            ctx.fail(f"no such command: '{word}'\n  try: {meant}")
        return super().resolve_command(ctx, args)

    def suggestion(self, ctx: click.Context, word: str) -> str:
        """Return the words behind ``mission`` that are meant by an unknown ``word``."""
        from config.diagnostics import closest  # noqa: PLC0415 - as in `guarded`

        return " ".join((*self.path, closest(word, self.list_commands(ctx)) or "--help"))

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write its options, those that its commands share, and the list of its commands."""
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
        """Write the list for ``--help``, without importing more."""
        del ctx
        own = [(name, each.get_short_help_str(formatter.width)) for name, each in self.commands.items()]
        with formatter.section("Commands"):
            formatter.write_dl([*own, *((name, each.help) for name, each in self.lazy_commands.items())])


class MissionGroup(LazyGroup):
    """The command itself."""

    path = ()

    def suggestion(self, ctx: click.Context, word: str) -> str:
        """Return the words that are meant by an unknown ``word``, which may be the name of a mission."""
        from missions.library.shipped import shipped_missions  # noqa: PLC0415 - as in `guarded`

        is_mission = word in shipped_missions() or word.endswith(".yaml")
        return f"run {word}" if is_mission else super().suggestion(ctx, word)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the lists for ``--help``, with the second columns of all below each other."""
        del ctx
        commands = self.lazy_commands
        widest = max(map(len, commands))
        for title in dict.fromkeys((*COMMAND_GROUPS, *(each.group for each in commands.values()))):
            if rows := [(name.ljust(widest), each.help) for name, each in commands.items() if each.group == title]:
                with formatter.section(title):
                    formatter.write_dl(rows)
