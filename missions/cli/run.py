"""``mission run``: a mission on a robot, simulated unless the user names a robot."""

import json
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, replace
from functools import partial
from math import inf
from pathlib import Path
from typing import Any

import click

from config.defaults import load_defaults
from config.library import OWN_ROBOT
from drivers.api.fast_dataclass import dataclass
from missions.cli.names import MISSION
from missions.cli.option_declarations import DeclaredCommand, add_options
from missions.cli.origin import OTHER_ROBOT, OTHER_SIMULATED_ROBOT, chosen_robot, robot_file
from missions.cli.running import EXIT_CODES, run
from missions.cli.session import RunContext
from missions.executive.executive import Result
from missions.library.plugins import BrokenPluginError, load, plugins
from missions.options import make_options, option, options_of
from missions.plugin import Plugin
from missions.request import RunOptions, RunRequest

DEFAULT_DURATION = 3600.0
"""Seconds of simulated time after which an unattended run ends if ``--until`` is not set."""


@dataclass(frozen=True, kw_only=True)
class OutputOptions(RunOptions):
    """Options of `mission run` for other programs that read the output of a run."""

    events: Path | None = option("Write every event to this file, as JSON lines.", "file", newcomer=True)
    as_json: bool = option(
        "Print the result as one JSON line on stdout; other output goes to stderr.",
        default=False,
        flag="--json",
        newcomer=True,
    )
    leash: int | None = option(
        "Descriptor of a server's pipe; the run stops when it is closed.", "integer", hidden=True
    )

    def check(self, request: RunRequest) -> None:
        """Raise ValueError if ``leash``, the pipe of the server that starts the run, is not an open file descriptor."""
        del request
        try:
            if self.leash is not None:
                os.fstat(self.leash)
        except OSError as error:
            raise ValueError(f"--leash: {self.leash} is not an open file; only a server sets this") from error


def _options_of_plugins() -> Iterator[tuple[Plugin, type[RunOptions]]]:
    """Yield the plug-ins with their options for runs; print why unusable ones are skipped."""
    used_flags = {each.flag for cls in (RunRequest, OutputOptions) for each in options_of(cls)}
    for plugin in plugins():
        if plugin.run_options:
            try:
                options = load(plugin, plugin.run_options)
                flags = _flags_of(plugin, options)
                if clash := sorted(flags & used_flags):
                    raise BrokenPluginError(f"the plug-in '{plugin.name}' adds {clash[0]}, which exists already")
            except BrokenPluginError as error:
                click.echo(f"mission: {error}", err=True)
            else:
                used_flags |= flags
                yield plugin, options


def _flags_of(plugin: Plugin, options: Any) -> set[str]:
    """Return the command-line flags of the options class of a plug-in.

    Raises BrokenPluginError if the class is not a RunOptions or declares no options.
    """
    try:
        if issubclass(options, RunOptions) and (flags := {each.flag for each in options_of(options)}):
            return flags
        problem = "is not a dataclass that extends missions.request.RunOptions and has options"
    except Exception as error:
        problem = f"cannot be read: {type(error).__name__}: {error}"
    raise BrokenPluginError(f"the plug-in '{plugin.name}' cannot be used: {plugin.run_options} {problem}")


PLUGIN_OPTIONS = tuple(_options_of_plugins())
"""Plug-ins that add options to a run, each with its options class."""


@click.command(cls=DeclaredCommand, epilog="Example: mission run greet --robot turtlebot2_arm --simulate --view")
@click.argument("mission", type=MISSION, metavar="MISSION")
@add_options(RunRequest, OutputOptions, *(options for _, options in PLUGIN_OPTIONS))
def command(mission: str, **values: object) -> int:
    """Run a mission, given by name or file. Ctrl-C stops it safely.

    `mission run 1` to `8` run the exercises of the TurtleBot course.

    Exit codes: 0 success, 1 failure, 2 error in the command or a file, 3 device error, 130 interrupted (Ctrl-C,
    SIGTERM, closed output).
    """
    request = make_options(RunRequest, values, mission=mission).with_default_simulation
    output = make_options(OutputOptions, values)
    features = [(plugin, make_options(options, values)) for plugin, options in PLUGIN_OPTIONS]
    for _, options in features:
        request = options.adapt(request)
    request = with_defaults(request)
    try:
        for options in (output, *(options for _, options in features)):
            options.check(request)
    except ValueError as error:
        raise click.UsageError(str(error)) from error
    contexts = [] if output.events is None else [_events_context(output.events)]
    for plugin, options in features:
        if plugin.run_context and options.is_wanted(request):
            contexts.append(partial(load(plugin, plugin.run_context), options))
    reachable = any(options.needs_control and options.is_wanted(request) for _, options in features)
    return EXIT_CODES[_run_and_report(request, output, contexts, reachable=reachable).result]


def _events_context(path: Path) -> RunContext:
    from missions.cli.events_file import write_events  # noqa: PLC0415 - most runs write no events

    return partial(write_events, path)


def with_defaults(request: RunRequest) -> RunRequest:
    """Return the request with the user's default robot and world where it names none.

    Raises InvalidFileError for a defaults file with errors, UnknownNameError for a default robot that does not exist.
    """
    robot, simulate, world = request.robot, request.simulate, request.world
    defaults = load_defaults()
    if robot == OWN_ROBOT:
        robot_file(OWN_ROBOT)
        robot = defaults.robot  # records need a name that stays valid if the default changes
    elif robot is None and (default_robot := chosen_robot(None, OTHER_ROBOT if simulate else OTHER_SIMULATED_ROBOT)):
        robot, simulate = default_robot, simulate or "wire"
    if world is None and defaults.world and (robot is None or simulate is not None):
        world = defaults.world
    until = request.until
    if until is None and simulate == "fast" and request.speed == inf:
        until = DEFAULT_DURATION
    return replace(request, robot=robot, simulate=simulate, world=world, until=until)


def _run_and_report(
    request: RunRequest, output: OutputOptions, contexts: Sequence[RunContext], *, reachable: bool
) -> Result:
    """Run the request, and return its result. With ``--json`` the result is printed as one JSON line at the end.

    ``output`` are the output options; ``contexts`` are those of plug-ins; ``reachable`` forces a control socket.
    """

    def last_words(result: Result) -> None:
        if output.as_json:
            with suppress(BrokenPipeError):  # the run has ended since its output was closed
                click.echo(json.dumps(asdict(result)))

    try:
        out = sys.stderr if output.as_json else sys.stdout
        result = run(request, out, last_words, leash=output.leash, contexts=contexts, reachable=reachable)
    except Exception as error:
        if not isinstance(error, click.ClickException):
            last_words(Result(request.mission, "error", str(error), 0.0, 0))
        raise
    last_words(result)
    return result
