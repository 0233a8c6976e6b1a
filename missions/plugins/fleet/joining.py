"""`mission task serve --fleet`: this computer's robot as a member of a fleet."""

import re
import secrets
import socket
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import click

from config.library import find, shipped
from config.reading import read_regular
from drivers.clock import SystemClock
from missions.library.shipped import is_there
from missions.plugins.fleet.errands import ErrandQueue, Errands, Ready
from missions.plugins.fleet.keeper import Keeper, Kept
from missions.plugins.fleet.line import Roster, ZenohLine
from missions.plugins.fleet.member import Member, Own
from missions.plugins.fleet.options import FleetOptions
from missions.plugins.fleet.place import check_name, open_session
from missions.plugins.fleet.words import NAME, Address, Answer, Ask, Times
from missions.plugins.tasks.channels import channels_of
from missions.plugins.tasks.fleet_latch import FleetLatch
from missions.plugins.tasks.queue import local_zone, wall_clock
from missions.plugins.tasks.schema import open_db, queue_file
from missions.request import RunRequest
from missions.runner import robot_of

# What a member of a fleet is besides being seen: it does tasks of the fleet, and keeps some of them.


def employ(
    member: Member,
    queue: ErrandQueue,
    kept: Kept,
    *,
    robot: str = "",
    options: Sequence[str] = (),
    times: Times | None = None,
    knows: Callable[[str], bool] = lambda _: True,
) -> None:
    """Let a member do and keep tasks, before it is entered: as `mission run` on a ``robot`` with these ``options``.

    ``knows`` says whether there is a mission of a name; ``queue`` and ``kept`` are for the member's thread.
    """
    times, own = times or Times(), member.own.address
    ready, now = _asking(member, times), member.clock.now
    errands = Errands(
        own, queue, member.body, ready, now, wall_clock, held=lambda: member.latch.stopped or member.copied,
        robot=robot, options=tuple(options), times=times, knows=knows,
    )  # fmt: skip
    keeper = Keeper(own, kept, member.roster, ready, now, wall_clock, times)
    keeper.copied = lambda: member.copied
    member.workers += [errands, keeper]
    member.busy = errands.doing


def _asking(member: Member, times: Times) -> Ready:
    """Return what asks one robot, and wakes the member with its answer."""

    def ready(ask: Ask, address: Address, on_answer: Callable[[Answer | None], None]) -> None:
        answers: list[Answer] = []

        def heard(who: Address | None, answer: Answer | None) -> None:
            if who is not None and answer is not None:
                answers.append(answer)
                return
            on_answer(answers[0] if answers else None)
            member.wake()

        with suppress(Exception):  # the wire is closed, or not there yet: what is not answered is asked again
            member.line.ask(ask, str(address), heard, times.again * 2)

    return ready


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
