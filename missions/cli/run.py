"""``mission run``: a mission on a robot, simulated unless one is named."""

import json
import sys
from contextlib import suppress
from dataclasses import asdict
from itertools import pairwise
from math import inf, isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from config.defaults import load_defaults
from config.library import MINE
from missions.cli.leash import leash_option, studio_beside, studio_option
from missions.cli.names import MISSION, ROBOT, WORLD
from missions.cli.numbers import Real, Whole
from missions.cli.options import SECONDS, MissionCommand, behaviours_option, pairs, params_option
from missions.cli.origin import chosen_robot, robot_file
from missions.cli.root import DEVICE, FAILURE, INTERRUPTED, SUCCESS
from missions.cli.running import Outputs, run
from missions.executive.executive import Result
from missions.plugins.records import ring
from missions.plugins.records.run_options import record_options, record_wish
from missions.plugins.teleop import FIRST_PAD
from missions.request import RunRequest, Simulate

if TYPE_CHECKING:
    from missions.plugins.ros2.announcing import Announcer


def usual(
    robot: str | None, simulate: Simulate | None, world: str | None, *, on_robot: bool
) -> tuple[str | None, Simulate | None, str | None]:
    """Return robot, simulation and world of a run, with the user's defaults where they were not named.

    Raises click.UsageError for options that contradict each other, InvalidFileError for a wrong file of defaults.
    """
    if on_robot and (robot is not None or simulate is not None):
        other = "--robot names another" if robot is not None else "--simulate moves none"
        raise click.UsageError(f"--on-robot moves this computer's robot, {other}: one of them")
    defaults = load_defaults()
    if on_robot or robot == MINE:
        robot_file(MINE)
        robot = defaults.robot  # records keep a name that means the same tomorrow
    elif robot is None and (own := chosen_robot(None)):
        robot, simulate = own, simulate or "wire"
    if world is None and defaults.world and (robot is None or simulate is not None):
        world = defaults.world
    return robot, simulate, world


EXIT_CODES = {"success": SUCCESS, "failure": FAILURE, "interrupted": INTERRUPTED, "error": DEVICE}


DEFAULT_DURATION = 3600.0
"""Seconds of simulated time after which a run that nobody watches is ended, unless somebody says otherwise."""

LEVELS = ("wire", "fast")


class RunCommand(MissionCommand):
    """A command whose ``--simulate`` and ``--pad`` may stand alone: what follows is theirs only where it can be."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Read the arguments, with level and device put in where they were left out."""
        after = [*args[1:], ""][: len(args)]
        told = [
            "--simulate=wire"
            if word == "--simulate" and follows not in LEVELS
            else f"--pad={FIRST_PAD}"
            if word == "--pad" and not follows.startswith("/")
            else word
            for word, follows in zip(args, after, strict=True)
        ]
        return super().parse_args(ctx, told)

    def too_much(self, words: list[str], args: list[str]) -> str:
        """Say it of a level that there is not."""
        level = next((follows for word, follows in pairwise(args) if word == "--simulate=wire"), "")
        if level in words:
            return f"--simulate takes {' or '.join(LEVELS)}, got '{level}'"
        return super().too_much(words, args)


@click.command(cls=RunCommand, epilog="Example: mission run greet --robot turtlebot2_arm --simulate --view")
@click.argument("name", type=MISSION, metavar="MISSION")
@params_option
@behaviours_option
@click.option("--robot", type=ROBOT, help="The robot to run on (a name or a file); it moves, unless --simulate.")
@click.option("--on-robot", is_flag=True, help="Run on this computer's robot (`mission robot use NAME`); it moves.")
@click.option(
    "--simulate",
    metavar="[LEVEL]",
    type=click.Choice(LEVELS),
    help="Simulate the robot, down to the bytes on its wires and in real time (wire; the default where no --robot is "
    "named), or on a simulated clock, in a moment (fast).",
)
@click.option(
    "--speed",
    type=Real(min=0, min_open=True),
    metavar="TIMES",
    help="Simulate on a simulated clock, at so many times real time: 5 to watch it, 0.2 to see every step.",
)
@click.option(
    "--eyes",
    type=click.Choice(["pixels", "truth"]),
    default="pixels",
    show_default=True,
    help="In simulated time: draw pictures and search them, or know from the world who is in view, which is quicker.",
)
@click.option(
    "--until",
    type=SECONDS,
    metavar="TIME",
    help="In simulated time: end the run then, if it has not ended; else after 1 h, unless there is a --speed.",
)
@click.option(
    "--physics",
    is_flag=True,
    help="In simulated time: a robot with a body (a humanoid) stands, walks and falls by MuJoCo. It needs the extra "
    "`physics`.",
)
@click.option("--world", type=WORLD, help="What a simulated robot stands in (a name or a file).")
@click.option("--camera", metavar="SOURCE", help="A video, folder, URL, device or index instead of the robot's camera.")
@click.option(
    "--port",
    "ports",
    multiple=True,
    metavar="PART=PORT",
    callback=pairs("base=/dev/ttyUSB0", empty=False),
    help="Where a part is plugged in, instead of what the robot file says.",
)
@click.option("--seed", type=Whole(min=0), default=0, show_default=True, help="For whatever is drawn by chance.")
@click.option(
    "--events", type=click.Path(dir_okay=False, path_type=Path), help="Write every event here, as JSON lines."
)
@click.option(
    "--film",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="In simulated time: film what the camera sees, beside the room from above: a .webm, or a folder of pictures.",
)
@click.option(
    "--pad",
    metavar="[DEVICE]",
    help="Let a game pad take the wheels while you hold its left shoulder button: the first there is, or this one.",
)
@record_options
@click.option(
    "--view",
    is_flag=True,
    help="Show the tree, the variables, the robot and the log on the whole terminal; keys pause, step and stop.",
)
@click.option(
    "--ros2", is_flag=True, help="Tell ROS 2 how it goes: topics /mission/tree, variables, detections, events."
)
@click.option("--ros2-router", metavar="ADDRESS", help="Where, instead of the robot's router: tcp/127.0.0.1:7447.")
@click.option("--ros2-domain", type=Whole(0, 232), help="The domain of ROS 2, instead of what the robot file says.")
@click.option("--without-stop", is_flag=True, help="Move the robot even if `mission stop` cannot reach the run.")
@studio_option
@leash_option
@click.option("--json", "as_json", is_flag=True, help="End with one line of JSON on stdout; the rest goes to stderr.")
def command(
    name: str,
    params: dict[str, str],
    files: tuple[Path, ...],
    robot: str | None,
    on_robot: bool,
    simulate: Simulate | None,
    speed: float | None,
    eyes: Literal["pixels", "truth"],
    until: float | None,
    physics: bool,
    world: str | None,
    camera: str | None,
    ports: dict[str, str],
    seed: int,
    events: Path | None,
    film: Path | None,
    pad: str | None,
    record: Path | None,
    no_record: bool,
    record_limit: float | None,
    record_frames: float | None,
    overwrite: bool,
    view: bool,
    ros2: bool,
    ros2_router: str | None,
    ros2_domain: int | None,
    without_stop: bool,
    studio: bool,
    leash: int | None,
    as_json: bool,
) -> int:
    """Run a mission (a name or a file). Ctrl-C stops it, safely.

    Exit code 0 is success, 1 failure, 2 a mistake in the command or a file, 3 a device, 130 interrupted, also where
    nobody reads any more what it writes (`| head -1`).
    """
    if speed is not None and not isfinite(speed):
        raise click.BadParameter(f"{speed} is no speed: give a number, such as 5", param_hint="--speed")
    on_a_simulated_clock = speed is not None or eyes == "truth" or film or until or physics
    if on_a_simulated_clock and simulate is None and robot is None and not on_robot:
        simulate = "fast"
    if view and as_json:
        raise click.UsageError("--view takes the whole terminal, --json leaves it to a program: one of them")
    if view and simulate == "fast" and speed is None:
        speed = 1.0  # to be watched
    robot, simulate, world = usual(robot, simulate, world, on_robot=on_robot)
    order = RunRequest(
        name,
        params,
        robot,
        simulate,
        world,
        camera,
        ports,
        seed,
        files,
        eyes=eyes,
        speed=inf if speed is None else speed,
        pad=pad,
        physics=physics,
        ros2_domain=ros2_domain,
        without_stop=without_stop,
    )
    if no_record and record is not None:
        raise click.UsageError("--record keeps it, --no-record does not: one of them")
    kept = record_wish(
        record,
        record_limit,
        record_frames,
        overwrite=overwrite,
        mission=name,
        otherwise=not no_record and ring.wanted(simulated=order.simulation is not None),
    )
    announcer = _announcer(robot, ros2_router, ros2_domain) if ros2 or ros2_router is not None else None
    outputs = Outputs(events, film, kept, view=view, leash=leash, announcer=announcer)
    if until is None and simulate == "fast" and speed is None:
        until = DEFAULT_DURATION

    with studio_beside(wanted=studio):
        return EXIT_CODES[_told(order, outputs, until, as_json=as_json).result]


def _announcer(robot: str | None, router: str | None, domain: int | None) -> "Announcer":
    from missions.plugins.ros2.announcing import announcer_of  # noqa: PLC0415 - few runs are told to ROS 2

    return announcer_of(robot, router, domain)


def _told(order: RunRequest, outputs: Outputs, until: float | None, *, as_json: bool) -> Result:
    """Run it, and say how it ended: in words for people while it goes on, or as one line for a program in the end."""

    def last_words(result: Result) -> None:
        if as_json:
            with suppress(BrokenPipeError):  # a run that nobody reads has ended for that
                click.echo(json.dumps(asdict(result)))

    try:
        result = run(order, outputs, sys.stderr if as_json else sys.stdout, last_words, until=until)
    except Exception as error:
        if not isinstance(error, click.ClickException):
            last_words(Result(order.mission, "error", str(error), 0.0, 0))
        raise
    last_words(result)
    return result
