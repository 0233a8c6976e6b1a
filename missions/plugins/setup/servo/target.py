"""Selection of servos: the common options of ``mission servo``."""

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
"""Name of the arm in a robot file whose only arm has no name of its own."""


@dataclass(frozen=True, slots=True)
class ServoTarget:
    """Servos that a command works on: those of a robot file, simulated ones, or those on a serial port.

    ``arm`` is the name of the arm in a robot with several.
    """

    robot: str | None = None
    simulate: bool = False
    port: str | None = None
    baud: int | None = None
    arm: str = DEFAULT_ARM

    @property
    def is_virtual(self) -> bool:
        """Whether the servos are simulated, on request or because no hardware was named."""
        return self.simulate or (self.robot is None and self.port is None)

    @property
    def options(self) -> str:
        """Command-line options that select the same servos, such as " --robot FILE --arm left".

        They are appended to suggested commands.
        """
        arm = None if self.arm == DEFAULT_ARM else self.arm
        given = (("--robot", self.robot), ("--arm", arm), ("--port", self.port), ("--baud", self.baud))
        typed = [f" {option} {shlex.quote(str(value))}" for option, value in given if value is not None]
        return "".join(typed) + " --simulate" * self.simulate

    def report_if_simulated(self) -> None:
        """Print to stderr that servos are simulated, so that results are not taken for those of the real arm."""
        if self.is_virtual:
            why = ", because of --simulate" if self.simulate else "; add --robot or --port for real ones"
            click.echo(f"simulated servos{why}", err=True)

    def config(self) -> RobotConfig:
        """Return the robot, with port and baud rate of the options. Raises click.UsageError without an arm."""
        robot = load_robot(robot_file(self.robot))
        arm = find_arm(robot, self.arm)
        return robot.with_keys(self.arm, replace(arm, port=self.port or arm.port, baud=self.baud or arm.baud))

    @property
    def keys(self) -> DynamixelKeys:
        """Section of the arm in the robot file, with port and baud rate of the options."""
        found: DynamixelKeys = self.config().sections[self.arm].keys
        return found

    def check(self) -> None:
        """Raise click.UsageError for contradictory options."""
        if self.simulate and self.port is not None:
            raise click.UsageError("--port and --simulate cannot be used together")

    def require_joints(self) -> None:
        """Raise click.UsageError if the user named only a port.

        A command for joints needs a robot file or a simulation, since a port does not tell the names of the joints.
        """
        if self.robot is None and not self.is_virtual:
            raise click.UsageError("--port alone names no joints: add --robot with the robot file")


def find_arm(robot: RobotConfig, name: str) -> DynamixelKeys:
    """Return the section of a Dynamixel or Feetech arm. Raises click.UsageError with the names of the arms."""
    arms = {part: it.keys for part, it in robot.sections.items() if isinstance(it.keys, DynamixelKeys)}
    if name in arms:
        return arms[name]
    if arms:
        raise click.UsageError(f"{robot.name} has no {name}; --arm: {suggest_from(name, arms)}")
    raise click.UsageError(f"{robot.name} has no arm: its file has no servos to work on")


arm_option = shared_option(
    "--arm", default=DEFAULT_ARM, metavar="NAME", help="Name of the arm, if the robot has several."
)
"""Decorator that adds ``--arm`` to a command."""


def target_options(command: Callable[..., Any], *, baud: bool = True) -> Callable[..., Any]:
    """Add ``--robot``, ``--arm``, ``--simulate``, ``--port`` and, unless ``baud`` is False, ``--baud`` to a command.

    The command gets a checked ``ServoTarget`` as its first argument.
    """

    @functools.wraps(command)
    def wrapped(
        robot: str | None, simulate: bool, port: str | None, arm: str, baud: int | None = None, **others: object
    ) -> Any:
        target = ServoTarget(robot, simulate, port, baud, arm)
        target.check()
        return command(target, **others)

    rate = shared_option("--baud", type=WholeNumber(min=1), metavar="RATE", help="Baud rate, instead of the "
                        "one in the robot file.")  # fmt: skip
    options = (
        shared_option("--port", metavar="PATH", help="Port of the adapter, instead of the one in the robot file."),
        arm_option,
        shared_option("--simulate", is_flag=True, help="Use virtual servos, even with --robot."),
        shared_option("--robot", type=ROBOT, help="Robot (a name or a file) whose servos move. Without it and "
                     "--port, the servos are simulated."),
    )  # fmt: skip
    with_options: Callable[..., Any] = rate(wrapped) if baud else wrapped
    for option in options:
        with_options = option(with_options)
    return with_options
