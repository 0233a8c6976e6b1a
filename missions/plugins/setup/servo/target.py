"""Which servos a command means: the options that all of ``mission servo`` share."""

import functools
import shlex
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import click

from config.diagnostics import suggest_from
from config.robot import RobotConfig
from drivers.servos.declared import DynamixelKeys
from missions.cli.commands import shared_option
from missions.cli.names import ROBOT
from missions.cli.numbers import WholeNumber
from missions.cli.origin import robot_file
from missions.library.drivers import load_robot

DEFAULT_ARM = "arm"
"""The name of an arm that has none of its own."""


@dataclass(frozen=True, slots=True)
class ServoTarget:
    """Whose servos are meant: those of a robot file, simulated ones, or whatever is behind a port.

    ``arm`` is the name of the arm, of a robot that has several.
    """

    robot: str | None = None
    simulate: bool = False
    port: str | None = None
    baud: int | None = None
    arm: str = DEFAULT_ARM

    @property
    def is_virtual(self) -> bool:
        """True where no hardware is meant: on request, or because none was named."""
        return self.simulate or (self.robot is None and self.port is None)

    @property
    def options(self) -> str:
        """What of it was asked for, as it is typed, with a space before each: for the command that a hint names."""
        arm = None if self.arm == DEFAULT_ARM else self.arm
        given = (("--robot", self.robot), ("--arm", arm), ("--port", self.port), ("--baud", self.baud))
        typed = [f" {option} {shlex.quote(str(value))}" for option, value in given if value is not None]
        return "".join(typed) + " --simulate" * self.simulate

    def report_if_simulated(self) -> None:
        """Say on stderr that no hardware is touched: what all is well with is not the arm on the table."""
        if self.is_virtual:
            why = ", as --simulate asks" if self.simulate else "; name --robot or --port for real ones"
            click.echo(f"simulated servos{why}", err=True)

    def config(self) -> RobotConfig:
        """Read the robot file, with port and baud rate as they were asked for. Raises click.UsageError without arm."""
        robot = load_robot(robot_file(self.robot))
        arm = find_arm(robot, self.arm)
        return robot.with_keys(self.arm, replace(arm, port=self.port or arm.port, baud=self.baud or arm.baud))

    @property
    def keys(self) -> DynamixelKeys:
        """What the robot file says of the arm, as ``config`` reads it."""
        found: DynamixelKeys = self.config().sections[self.arm].keys
        return found

    def check(self) -> None:
        """Raise click.UsageError for options that contradict each other."""
        if self.simulate and self.port is not None:
            raise click.UsageError("--port names a real port: leave it out, or --simulate")

    def require_joints(self) -> None:
        """Raise click.UsageError where nothing says which joints there are."""
        if self.robot is None and not self.is_virtual:
            raise click.UsageError("--port alone names no joints: name the robot's file too, with --robot")


def find_arm(robot: RobotConfig, name: str) -> DynamixelKeys:
    """Return what a robot file says of an arm of ours. Raises click.UsageError, with the arms that there are."""
    arms = {part: it.keys for part, it in robot.sections.items() if isinstance(it.keys, DynamixelKeys)}
    if name in arms:
        return arms[name]
    if arms:
        raise click.UsageError(f"{robot.name} has no {name}; --arm: {suggest_from(name, arms)}")
    raise click.UsageError(f"{robot.name} has no arm: its file has no servos to work on")


arm_option = shared_option("--arm", default=DEFAULT_ARM, metavar="NAME", help="Which arm, of a robot that has several.")
"""Adds ``--arm`` to a command."""


def target_options(command: Callable[..., Any], *, baud: bool = True) -> Callable[..., Any]:
    """Add ``--robot``, ``--arm``, ``--simulate``, ``--port`` and, unless told not to, ``--baud`` to a command.

    It gets them as its first argument, a ``ServoTarget`` that was checked.
    """

    @functools.wraps(command)
    def wrapped(
        robot: str | None, simulate: bool, port: str | None, arm: str, baud: int | None = None, **others: object
    ) -> Any:
        target = ServoTarget(robot, simulate, port, baud, arm)
        target.check()
        return command(target, **others)

    rate = shared_option("--baud", type=WholeNumber(min=1), metavar="RATE", help="The bus's rate, instead of the "
                        "file's.")  # fmt: skip
    options = (
        shared_option("--port", metavar="PATH", help="Where the adapter is plugged in, instead of what the file says."),
        arm_option,
        shared_option("--simulate", is_flag=True, help="Use virtual servos, even with --robot."),
        shared_option("--robot", type=ROBOT, help="The robot (a name or a file), whose servos move. Without it and "
                     "--port: simulated."),
    )  # fmt: skip
    with_options: Callable[..., Any] = rate(wrapped) if baud else wrapped
    for option in options:
        with_options = option(with_options)
    return with_options
