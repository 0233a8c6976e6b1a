"""Connection to a head for terminal commands, with their common options."""

import threading
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass
from math import degrees, radians
from typing import Any

import click

from behaviours.head import ArrivalDetector, pose_text
from config.diagnostics import suggest_from
from config.library import find_file
from config.robot import RobotConfig
from config.world import load_world
from drivers.api import DeviceStatus, Head, HeadPose, ignore
from drivers.api.sections import HeadKeys, SerialKeys
from drivers.clock import Clock
from drivers.errors import NotConnected
from drivers.head.keys import TwoServoKeys
from drivers.head.pantilt import Trimmable
from drivers.servos.declared import NeckKeys
from missions.assembly.assemble import assemble
from missions.assembly.assembled_robot import CONNECT_TIMEOUT
from missions.assembly.learnt_delays import LearntDelays
from missions.assembly.part_factory import Hooks, Overrides
from missions.cli.commands import shared_option
from missions.cli.keys import interruptible
from missions.cli.names import ROBOT
from missions.cli.origin import robot_file
from missions.cli.root import FAILURE, SUCCESS
from missions.control.holders import hold_robot
from missions.library.drivers import load_robot
from missions.library.interests import Interests

DEFAULT_HEAD = "head"
"""Name of the part that is the head with the camera."""

POLL_INTERVAL = 0.02
"""Seconds between two checks whether the head has arrived."""

ARRIVAL_TOLERANCE = radians(0.51)
"""Distance in radians from the goal at which a head has arrived; some servos take whole degrees only."""

TURN_TIMEOUT = 15.0
"""Maximum seconds until the head has turned to a pose."""


def robot_options(command: Any) -> Any:
    """Add ``--robot``, ``--simulate`` and ``--port`` to a command."""
    for option in (
        shared_option("--port", metavar="PATH", help="Port of the board, instead of the one in the robot file."),
        shared_option("--simulate", is_flag=True, help="Use a virtual board, even with --robot."),
        shared_option("--robot", type=ROBOT, help="Robot (a name or a file) whose head moves; simulated without it."),
    ):
        command = option(command)
    return command


head_option = shared_option(
    "--head", default=DEFAULT_HEAD, metavar="NAME", help="Name of the head, if the robot has several."
)
"""Decorator that adds ``--head`` to a command."""


def head_keys(config: RobotConfig, head: str) -> HeadKeys:
    """Return the section of a head in a robot file. Raises click.UsageError with the names of its heads."""
    heads = {part: it.keys for part, it in config.sections.items() if isinstance(it.keys, HeadKeys)}
    if head in heads:
        return heads[head]
    if not heads:
        raise click.UsageError(f"{config.name} has no head")
    raise click.UsageError(f"{config.name} has no {head}; --head: {suggest_from(head, heads)}")


@dataclass(frozen=True, slots=True)
class OpenHead:
    """A connected head, for commands on the terminal."""

    head: Head
    trimmer: Trimmable
    config: TwoServoKeys | NeckKeys
    clock: Clock
    lags: LearntDelays | None = None
    name: str = DEFAULT_HEAD

    def look(self, target: HeadPose) -> int:
        """Look in a direction, wait for the head, and print its pose; return the exit code."""
        goal = self.head.look(target)
        if not self.wait_for(goal):
            here = self.head.pose().value
            click.echo(
                f"the head stopped at {'?' if here is None else pose_text(here)}, not at {pose_text(goal)}", err=True
            )
            return FAILURE
        click.echo(f"looks at {pose_text(goal)}" + ("" if goal == target else f", the limit for {pose_text(target)}"))
        return SUCCESS

    def wait_for(self, goal: HeadPose) -> bool:
        """Wait until the head is at ``goal``; return whether it arrived."""
        arrival, start = ArrivalDetector(ARRIVAL_TOLERANCE), self.clock.now()
        while not arrival(self.head.pose(), goal, self.clock.now()):
            if arrival.stuck or self.clock.now() - start > TURN_TIMEOUT:
                return False
            pause()
        return True

    def axis_figures(self) -> dict[str, dict[str, float]]:
        """Return angle, limits and trim of each axis in degrees, by joint name."""
        pose, limits, trims = self.head.pose().value, self.head.limits, self.trimmer.trim()
        found = {}
        for number, (axis, ends) in enumerate(((self.config.pan, limits.pan), (self.config.tilt, limits.tilt))):
            figures = {"from": ends[0], "to": ends[1], "trim": trims[number]}
            if pose is not None:
                figures["angle"] = (pose.pan, pose.tilt)[number]
            found[axis.joint or f"{self.name}_{('pan', 'tilt')[number]}"] = {
                name: round(degrees(value), 2) + 0.0 for name, value in figures.items()
            }
        return found


@contextmanager
def open_robot_head(
    name: str | None,
    *,
    simulate: bool,
    port: str | None,
    head: str = DEFAULT_HEAD,
    stay: bool = False,
    camera: bool = False,
) -> Iterator[OpenHead]:
    """Yield a connected head of a robot, and close it at the end of the context.

    ``name`` is the robot; None or ``simulate`` means a simulated one. ``port`` replaces the port in its file, ``head``
    is the part's name. The head moves to its start pose, unless ``stay`` is set. With ``camera``, the camera is opened
    too. Raises NotConnected with the reason after ``CONNECT_TIME``.
    """
    config = load_robot(robot_file(name))
    keys = head_keys(config, head)
    virtual = simulate or name is None
    if virtual and port is not None:
        raise click.UsageError("--port needs --robot NAME, and excludes --simulate")
    carriers = config.sections[head].driver.needs
    part = head if isinstance(keys, SerialKeys) or not carriers else carriers[0]  # the part that has the port
    ports = {} if port is None else {part: port}
    with open_head(config, ports, head=head, virtual=virtual, stay=stay, camera=camera) as bench:
        yield bench


@contextmanager
def open_head(
    config: RobotConfig,
    ports: Mapping[str, str],
    *,
    head: str = DEFAULT_HEAD,
    virtual: bool = False,
    stay: bool = False,
    camera: bool = False,
) -> Iterator[OpenHead]:
    """Open a head of ``config``, with ``ports`` instead of those in its file.

    ``virtual`` means that the head is simulated. The other parameters and the errors are as in ``open_robot_head``.
    """
    keys = head_keys(config, head)
    overrides = Overrides(
        world=load_world(find_file("worlds", "empty")) if virtual else None,
        ports=ports,
        interests=Interests(faces=False),
    )
    clock = overrides.clock()
    hooks = Hooks(ignore if stay else _print_warning, ignore, click.echo, ignore, ignore)
    robot = assemble(config, frozenset({head, "camera"} if camera else {head}), clock, overrides, hooks)
    turned, trimmer = robot.robot.with_named_parts({DEFAULT_HEAD: head}).head, robot.devices[head]
    if not isinstance(trimmer, Trimmable) or not isinstance(keys, TwoServoKeys | NeckKeys):
        raise click.UsageError(f"the {head} of {config.name} cannot be trimmed")
    if stay:
        trimmer.skip_start_move()
    with interruptible(), hold_robot(config.name, simulated=virtual), closing(robot):
        robot.open()
        while not (turned.health().online and turned.pose().good):
            if clock.now() > CONNECT_TIMEOUT:
                health = turned.health()
                raise NotConnected(health.detail, hint=health.hint)
            pause()
        yield OpenHead(turned, trimmer, keys, clock, None if robot.eyes is None else robot.lags, head)


def _print_warning(notice: DeviceStatus) -> None:
    """Print a notice of the head if it is a fault, with the command to try."""
    if notice.kind == "fault":
        click.echo(f"{notice.device}: {notice.message}" + (f"\n  try: {notice.hint}" if notice.hint else ""), err=True)


def pause() -> None:
    """Wait ``POLL_INTERVAL``, while the head's driver works on its own thread."""
    threading.Event().wait(POLL_INTERVAL)
