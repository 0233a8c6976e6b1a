"""`mission task serve --fleet`: membership of this computer's robot in a fleet."""

import re
import secrets
import socket
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import click

from config.file_io import read_regular
from config.library import find_file, shipped_files
from drivers.clock import SystemClock
from missions.library.shipped import is_known_mission
from missions.plugins.fleet.member import FleetMember, RobotInfo
from missions.plugins.fleet.messages import NAME_PATTERN, Address, FleetAnswer, FleetRequest, FleetTimeouts
from missions.plugins.fleet.options import FleetOptions
from missions.plugins.fleet.task_allocator import TaskAllocator, TaskStore
from missions.plugins.fleet.task_executor import AssignmentQueue, SendRequest, TaskExecutor
from missions.plugins.fleet.zenoh_session import check_name, open_session
from missions.plugins.fleet.zenoh_transport import Roster, ZenohTransport
from missions.plugins.tasks.channels import channels_of
from missions.plugins.tasks.fleet_latch import FleetLatch
from missions.plugins.tasks.queue import local_zone, wall_clock
from missions.plugins.tasks.queue_database import open_db, queue_file
from missions.request import RunRequest
from missions.runner import requested_robot

# Tasks of a fleet member: it runs tasks of the fleet, and manages some of them.


def add_task_services(
    member: FleetMember,
    queue: AssignmentQueue,
    store: TaskStore,
    *,
    robot: str = "",
    options: Sequence[str] = (),
    timeouts: FleetTimeouts | None = None,
    has_mission: Callable[[str], bool] = lambda _: True,
) -> None:
    """Add the services for fleet tasks to a member that is not yet entered.

    One service executes tasks, the other allocates them. The member's thread stores accepted tasks in ``queue``, and
    tasks that it allocates in ``store``. Tasks run like `mission run` on ``robot`` with ``options``. ``has_mission``
    returns whether the robot's library has a mission of this name.
    """
    timeouts, own = timeouts or FleetTimeouts(), member.info.address
    ready, now = _make_sender(member, timeouts), member.clock.now
    errands = TaskExecutor(
        own, queue, member.fleet_robot, ready, now, wall_clock,
        is_stopped=lambda: member.latch.is_latched or member.is_duplicate,
        robot=robot, options=tuple(options), timeouts=timeouts, has_mission=has_mission,
    )  # fmt: skip
    keeper = TaskAllocator(own, store, member.roster, ready, now, wall_clock, timeouts)
    keeper.is_duplicate = lambda: member.is_duplicate
    member.services += [errands, keeper]
    member.current_activity = errands.activity


def _make_sender(member: FleetMember, timeouts: FleetTimeouts) -> SendRequest:
    """Return a function that sends a request to one robot, and wakes the member's thread when the answer arrives."""

    def ready(ask: FleetRequest, address: Address, on_answer: Callable[[FleetAnswer | None], None]) -> None:
        answers: list[FleetAnswer] = []

        def collect_answer(who: Address | None, answer: FleetAnswer | None) -> None:
            if who is not None and answer is not None:
                answers.append(answer)
                return
            on_answer(answers[0] if answers else None)
            member.wake()

        with suppress(Exception):  # no connection; unanswered requests are repeated
            member.transport.send_request(ask, str(address), collect_answer, timeouts.retry_interval * 2)

    return ready


NUMBER_FILE = "fleet_number"
"""Name of the file that stores the number in the robot's fleet address, in the folder of its tasks."""


@dataclass(frozen=True, slots=True)
class MembershipConfig:
    """Settings with which a task server joins a fleet: fleet name, robot name, and the run request for its tasks."""

    fleet: str
    name: str
    request: RunRequest

    @property
    def robot(self) -> str:
        """Name or absolute path of the robot file, valid in any folder; empty for the default robot, simulated."""
        named = self.request.robot
        if named is None:
            return ""
        path = find_file("robots", named)
        return named if path in shipped_files("robots").values() else str(path.resolve())

    @property
    def options(self) -> tuple[str, ...]:
        """Options of `mission run` for the simulation and the world, as typed."""
        settings = (("simulate", self.request.simulate), ("world", self.request.world))
        return tuple(f"--{word}={value}" for word, value in settings if value)


def read_membership(options: FleetOptions) -> MembershipConfig | None:
    """Return the settings with which a task server joins a fleet; None without `--fleet`.

    Raises click.UsageError, TaskError.
    """
    if options.fleet is None:
        if options != FleetOptions():
            raise click.UsageError("--as, --robot, --simulate and --world need --fleet NAME")
        return None
    own = options.as_name or re.sub("[^a-z0-9_-]", "-", socket.gethostname().lower())[:40]
    if options.as_name is None and not NAME_PATTERN.fullmatch(own):
        raise click.UsageError("this computer's name is not a valid robot name\n  try: --as robot1")
    request = RunRequest("", robot=options.robot, simulate=options.simulate, world=options.world)
    return MembershipConfig(check_name(options.fleet), check_name(own, "robot"), request)


def membership(options: FleetOptions) -> Callable[[Path, FleetLatch], AbstractContextManager[FleetMember]] | None:
    """Return a function that opens the fleet membership of a task server as a context; None without `--fleet`.

    Raises click.UsageError, TaskError.
    """
    config = read_membership(options)
    return None if config is None else partial(join_fleet, config)


@contextmanager
def join_fleet(config: MembershipConfig, folder: Path, latch: FleetLatch) -> Iterator[FleetMember]:
    """Make this computer's robot a member of a fleet while the context is entered.

    ``folder`` is the folder of its tasks. Raises TaskError, and the errors of a robot file.
    """
    from missions.plugins.fleet.commands.fleet_tasks import fleet_of  # noqa: PLC0415 - not needed without a fleet
    from missions.plugins.fleet.local_robot import LocalRobot  # noqa: PLC0415

    robot = requested_robot(config.request)
    address = Address(config.name, robot_number(folder))
    simulated = config.request.simulation is not None
    roster = Roster(SystemClock())
    with ExitStack() as closed:
        line = ZenohTransport(open_session(fleet_of(config.fleet)), config.fleet, roster)
        own = RobotInfo(address, robot.name[:60], tuple(sorted(robot.parts)), simulated)
        member = FleetMember(own, line, roster, closed.enter_context(LocalRobot()), latch)
        connection = closed.enter_context(closing(open_db(queue_file(folder), any_thread=True)))
        queue, kept = AssignmentQueue(connection, channels_of, local_zone()), TaskStore(connection)
        add_task_services(member, queue, kept, robot=config.robot, options=config.options, has_mission=is_known_mission)
        line.subscribe()
        with suppress(OSError):
            click.echo(f"in fleet '{config.fleet}' as '{config.name}'", err=True)
        yield closed.enter_context(member)


def robot_number(folder: Path) -> str:
    """Return the random number in the fleet address of the robot whose tasks are in ``folder``.

    The number is drawn and stored at the first call.
    """
    path = folder / NUMBER_FILE
    if not path.exists():
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        new = folder / f".{NUMBER_FILE}.{secrets.token_hex(4)}"
        new.write_text(secrets.token_hex(4), encoding="ascii")
        new.replace(path)
    found = read_regular(path, 1000).decode("ascii", errors="replace").strip()
    if not re.fullmatch("[0-9a-f]{8}", found):
        raise click.ClickException(
            f"{path}: is not a robot number\n  try: rm {path}  (the robot then gets a new number)"
        )
    return found
