"""``mission run``: a mission on a robot, simulated unless one is named."""

import json
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, replace
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING

import click

from config.defaults import load_defaults
from config.library import MINE
from drivers.api.quick import dataclass
from missions.cli.declared import DeclaredCommand, declared_options
from missions.cli.leash import studio_beside
from missions.cli.names import MISSION
from missions.cli.origin import chosen_robot, robot_file
from missions.cli.root import DEVICE, FAILURE, INTERRUPTED, SUCCESS
from missions.cli.running import Outputs, run
from missions.executive.executive import Result
from missions.options import filled, option
from missions.plugins.pictures.options import FilmOptions
from missions.plugins.records.options import RecordOptions
from missions.plugins.records.run_options import record_wish
from missions.plugins.ros2.options import Ros2Options
from missions.plugins.studio.options import StudioOptions
from missions.plugins.teleop.options import PadOptions
from missions.plugins.view.options import ViewOptions
from missions.request import RunOptions, RunRequest

if TYPE_CHECKING:
    from missions.plugins.ros2.announcing import Announcer

EXIT_CODES = {"success": SUCCESS, "failure": FAILURE, "interrupted": INTERRUPTED, "error": DEVICE}


DEFAULT_DURATION = 3600.0
"""Seconds of simulated time after which a run that nobody watches is ended, unless somebody says otherwise."""


@dataclass(frozen=True, kw_only=True)
class OutputOptions(RunOptions):
    """What a run writes for other programs."""

    events: Path | None = option("Write every event to this file, as JSON lines.", "file", newcomer=True)
    as_json: bool = option(
        "End with one line of JSON on stdout; the rest goes to stderr.", default=False, flag="--json", newcomer=True
    )
    leash: int | None = option("The end of a server's pipe: the run stops with it.", "integer", hidden=True)

    def check(self, request: RunRequest) -> None:
        """Raise ValueError for a leash that is no open file."""
        del request
        try:
            if self.leash is not None:
                os.fstat(self.leash)
        except OSError as error:
            raise ValueError(f"--leash: {self.leash} is no open file: only a server gives this") from error


@click.command(cls=DeclaredCommand, epilog="Example: mission run greet --robot turtlebot2_arm --simulate --view")
@click.argument("mission", type=MISSION, metavar="MISSION")
@declared_options(
    RunRequest, ViewOptions, RecordOptions, OutputOptions, StudioOptions, FilmOptions, PadOptions, Ros2Options
)
def command(mission: str, **values: object) -> int:
    """Run a mission (a name, a file, or the number of a motion of the course). Ctrl-C stops it, safely.

    Exit code 0 is success, 1 failure, 2 an error in the command or a file, 3 a device, 130 interrupted (Ctrl-C,
    SIGTERM, closed output).
    """
    request = filled(RunRequest, values, mission=mission)
    view, record, film = filled(ViewOptions, values), filled(RecordOptions, values), filled(FilmOptions, values)
    ros2, output = filled(Ros2Options, values), filled(OutputOptions, values)
    pad, studio = filled(PadOptions, values), filled(StudioOptions, values)
    features: Sequence[RunOptions] = (film, view, record, pad, studio, ros2, output)
    request = request.on_named_clock
    for each in features:
        request = each.adapt(request)
    request = with_defaults(request)
    try:
        for each in features:
            each.check(request)
    except ValueError as error:
        raise click.UsageError(str(error)) from error
    if view.view and output.as_json:
        raise click.UsageError("--view takes the whole terminal, --json leaves it to a program: one of them")
    kept = record_wish(record, request)
    announcer = _announcer(request, ros2) if ros2.wanted(request) else None
    outputs = Outputs(
        output.events,
        film.film,
        kept,
        view=view.view,
        leash=output.leash,
        studio=studio.studio,
        announcer=announcer,
    )
    with studio_beside(wanted=studio.studio):
        return EXIT_CODES[_told(request, outputs, as_json=output.as_json).result]


def with_defaults(request: RunRequest) -> RunRequest:
    """Return a request with the user's default robot and world, where none are named.

    Raises InvalidFileError for a wrong file of defaults, UnknownNameError for a robot that is not there.
    """
    robot, simulate, world = request.robot, request.simulate, request.world
    defaults = load_defaults()
    if robot == MINE:
        robot_file(MINE)
        robot = defaults.robot  # records keep a name that means the same tomorrow
    elif robot is None and (own := chosen_robot(None)):
        robot, simulate = own, simulate or "wire"
    if world is None and defaults.world and (robot is None or simulate is not None):
        world = defaults.world
    until = request.until
    if until is None and simulate == "fast" and request.speed == inf:
        until = DEFAULT_DURATION
    return replace(request, robot=robot, simulate=simulate, world=world, until=until)


def _announcer(request: RunRequest, ros2: Ros2Options) -> "Announcer":
    from missions.plugins.ros2.announcing import announcer_of  # noqa: PLC0415 - few runs are told to ROS 2

    return announcer_of(request.robot, ros2.ros2_router, request.ros2_domain)


def _told(order: RunRequest, outputs: Outputs, *, as_json: bool) -> Result:
    """Run it, and say how it ended: in words for people while it goes on, or as one line for a program in the end."""

    def last_words(result: Result) -> None:
        if as_json:
            with suppress(BrokenPipeError):  # a run that nobody reads has ended for that
                click.echo(json.dumps(asdict(result)))

    try:
        result = run(order, outputs, sys.stderr if as_json else sys.stdout, last_words)
    except Exception as error:
        if not isinstance(error, click.ClickException):
            last_words(Result(order.mission, "error", str(error), 0.0, 0))
        raise
    last_words(result)
    return result
