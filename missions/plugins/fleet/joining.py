"""`mission task serve --fleet`: this computer's robot as a member of a fleet."""

import re
import secrets
import socket
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import click

from config.library import find, shipped
from config.reading import read_regular
from drivers.clock import SystemClock
from missions.library.shipped import is_there
from missions.plugins.fleet.errands import ErrandQueue
from missions.plugins.fleet.kept import Kept
from missions.plugins.fleet.line import ZenohLine
from missions.plugins.fleet.member import Member, Own
from missions.plugins.fleet.options import FleetOptions
from missions.plugins.fleet.place import check_name, open_session
from missions.plugins.fleet.robot import employ
from missions.plugins.fleet.roster import Roster
from missions.plugins.fleet.words import NAME, Address
from missions.plugins.tasks.channels import channels_of
from missions.plugins.tasks.fleet_latch import FleetLatch
from missions.plugins.tasks.schema import open_db, queue_file
from missions.plugins.tasks.times import local_zone
from missions.request import RunRequest
from missions.runner import robot_of

NUMBER = "fleet_number"
"""The file that has the number of the robot whose tasks are kept beside it."""


@dataclass(frozen=True, slots=True)
class Joining:
    """Which fleet a server is in, as whom, and on what it does the tasks of that fleet."""

    fleet: str
    name: str
    order: RunRequest

    @property
    def robot(self) -> str:
        """The robot as a run understands it, wherever that begins; empty for the usual one, simulated."""
        named = self.order.robot
        if named is None:
            return ""
        path = find("robots", named)
        return named if path in shipped("robots").values() else str(path.resolve())

    @property
    def options(self) -> tuple[str, ...]:
        """What `mission run` is told beside mission, params and robot."""
        wanted = (("simulate", self.order.simulate), ("world", self.order.world))
        return tuple(f"--{word}={value}" for word, value in wanted if value)


def joining(options: FleetOptions) -> Joining | None:
    """Return how a server is in a fleet; None where it is in none. Raises click.UsageError, TaskError."""
    if options.fleet is None:
        if options != FleetOptions():
            raise click.UsageError("--as, --robot, --simulate and --world say who is in a fleet: add --fleet NAME")
        return None
    own = options.as_name or re.sub("[^a-z0-9_-]", "-", socket.gethostname().lower())[:40]
    if options.as_name is None and not NAME.fullmatch(own):
        raise click.UsageError("this computer's name cannot be a robot's\n  try: --as robot1")
    request = RunRequest("", robot=options.robot, simulate=options.simulate, world=options.world)
    return Joining(check_name(options.fleet), check_name(own, "robot"), request)


def membership(options: FleetOptions) -> Callable[[Path, FleetLatch], AbstractContextManager[Member]] | None:
    """Return the context in which a server is in its fleet; None where it is in none. Raises as ``joining``."""
    wanted = joining(options)
    return None if wanted is None else partial(joined, wanted)


@contextmanager
def joined(wanted: Joining, folder: Path, latch: FleetLatch) -> Iterator[Member]:
    """Be a member of a fleet while this is entered. Raises TaskError, and what a wrong robot file does."""
    from missions.plugins.fleet.commands.fleet_tasks import fleet_of  # noqa: PLC0415 - a server alone needs none of it
    from missions.plugins.fleet.machine import Machine  # noqa: PLC0415

    robot = robot_of(wanted.order)
    address = Address(wanted.name, own_number(folder))
    simulated = wanted.order.simulation is not None
    roster = Roster(SystemClock())
    with ExitStack() as closed:
        line = ZenohLine(open_session(fleet_of(wanted.fleet)), wanted.fleet, roster)
        own = Own(address, robot.name[:60], tuple(sorted(robot.parts)), simulated)
        member = Member(own, line, roster, closed.enter_context(Machine()), latch)
        connection = closed.enter_context(closing(open_db(queue_file(folder), any_thread=True)))
        queue, kept = ErrandQueue(connection, channels_of, local_zone()), Kept(connection)
        employ(member, queue, kept, robot=wanted.robot, options=wanted.options, knows=is_there)
        line.follow()
        with suppress(OSError):
            click.echo(f"in fleet '{wanted.fleet}' as '{wanted.name}'", err=True)
        yield closed.enter_context(member)


def own_number(folder: Path) -> str:
    """Return the number of the robot whose tasks are kept in ``folder``: drawn once, by who is first."""
    path = folder / NUMBER
    if not path.exists():
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        new = folder / f".{NUMBER}.{secrets.token_hex(4)}"
        new.write_text(secrets.token_hex(4), encoding="ascii")
        new.replace(path)
    found = read_regular(path, 1000).decode("ascii", errors="replace").strip()
    if not re.fullmatch("[0-9a-f]{8}", found):
        raise click.ClickException(f"{path}: is no number of a robot\n  try: rm {path}  (it is another robot then)")
    return found
