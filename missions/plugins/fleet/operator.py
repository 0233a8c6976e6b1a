"""Operator of a fleet: lists the robots and sends requests to some or all of them."""

import os
import secrets
import socket
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from threading import Event
from typing import Literal, TypeVar

from config.fleet import FleetKeys
from drivers.clock import Clock, SystemClock
from missions.codec import CodecError, decode
from missions.plugins.fleet.messages import (  # fmt: skip
    RULES,
    TASK_ID_PATTERN,
    Address,
    DecideTask,
    FleetAnswer,
    FleetRelease,
    FleetRequest,
    FleetStop,
    FleetTaskInfo,
    KeepTask,
    ListFleetTasks,
    ListPeers,
    Peer,
)
from missions.plugins.fleet.zenoh_session import check_name, open_session
from missions.plugins.fleet.zenoh_transport import Roster, RosterEntry, ZenohTransport
from missions.plugins.tasks.task import TaskError

T = TypeVar("T")

QUIET_TIME = 0.25
"""Seconds without a new robot after which the discovery of a fleet's robots is complete."""

MAX_WAIT = 5.0
"""Maximum seconds for the discovery of a fleet's robots, since new robots may keep appearing."""

FIRST_ROBOT_TIMEOUT = 2.0
"""Seconds for which a discovery waits for the first robot of the fleet."""

STOP_TIMEOUT = 1.0
"""Seconds for a robot to confirm a stop; the request is repeated in that time."""

STOP_RETRY_INTERVAL = 0.3

MAX_TRIES, SUBMIT_TIMEOUT = 3, 2.0
"""Number of tries to submit a task, and seconds to wait for each answer."""

MAX_WITNESSES = 3
"""Maximum number of robots that an operator asks for the robots they have seen.

One robot would not be enough: it may have just started, and have seen no other.
"""


MAX_OPEN_PAGES, MAX_ENDED_PAGES = 1000, 10
"""Maximum number of pages of open tasks, and of ended tasks, to request from a robot."""


@dataclass(frozen=True, slots=True)
class FleetTaskList:
    """Tasks of a fleet, unordered.

    ``more`` names the robots that have further, older tasks; ``silent`` names the robots that did not answer.
    """

    tasks: list[FleetTaskInfo]
    more: frozenset[str] = frozenset()
    silent: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True)
class Operator:
    """Connection of an operator to a fleet; ``by`` is the operator's name, which requests contain."""

    fleet: FleetKeys
    transport: ZenohTransport
    roster: Roster
    clock: Clock
    by: str

    def members(self) -> Mapping[Address, RosterEntry]:
        """Return the roster: robots that are connected, or were."""
        return self.roster.members()

    def discover(self) -> None:
        """Wait until no further robots appear, then ask some of them which robots they have seen."""
        wait_until_stable(self.roster, self.clock)
        there = [address for address, each in self.members().items() if each.is_online][:MAX_WITNESSES]
        for answer in self._request_each(there, lambda _: ListPeers(), 1.0).values():
            for met in _decode_data(Peer, answer):
                with suppress(CodecError):
                    self.roster.on_peer_report(Address.read(met.robot), met.connection)

    def missing_robots(self) -> list[str]:
        """Return the names of robots in the fleet file that neither this operator nor any robot has seen."""
        met = {address.name for address in self.members()}
        return [name for name in self.fleet.robots if name not in met]

    def stop(self, by: str = "") -> tuple[Mapping[Address, FleetAnswer], list[str]]:
        """Stop all robots; return the confirmations, and the names of robots that did not answer.

        The request goes to all robots at once, to new robots as soon as they appear, and again to robots that have not
        answered. Robots that only other robots have seen are among the names returned. The call ends even if new robots
        keep appearing.
        """
        answers: dict[Address, FleetAnswer] = {}
        asked_at: dict[Address, list[float]] = {}

        def collect_answer(address: Address | None, answer: FleetAnswer | None) -> None:
            if address is not None and answer is not None:
                answers[address] = answer

        stop = FleetStop(by=by or self.by, press=secrets.token_hex(8))
        pause, begun = Event(), self.clock.now()
        known, quiet = set[Address](), begun
        if there := [each.address for each in self.members().values() if each.connection == "ONLINE"]:
            self.transport.send_request(stop, "*/*", collect_answer, STOP_TIMEOUT)  # one request to all
            asked_at = {each: [begun] for each in there}
        while True:
            now = self.clock.now()
            there = [each.address for each in self.members().values() if each.connection == "ONLINE"]
            silent = [each for each in there if each not in answers]
            for each in silent:
                times = asked_at.setdefault(each, [])
                if not times or now - times[-1] >= STOP_RETRY_INTERVAL:
                    times.append(now)
                    self.transport.send_request(stop, str(each), collect_answer, STOP_TIMEOUT)
            if not known.issuperset(there):
                known, quiet = known.union(there), now
            tried = all(now - asked_at[each][0] > STOP_TIMEOUT for each in silent)
            if now > begun + MAX_WAIT or (
                tried and now > (quiet + QUIET_TIME if there else begun + FIRST_ROBOT_TIMEOUT)
            ):
                break
            pause.wait(0.01)
        self.discover()
        unreached = [each.address for each in self.members().values() if each.connection != "OFFLINE"]
        lost = sorted(str(each) for each in unreached if each not in answers)
        # If two robots share an address, one may have answered for both.
        copied = sorted(f"{each}, a number shared by two robots" for each in answers if self.roster.is_duplicate(each))
        return dict(answers), [*lost, *copied, *self.missing_robots()]

    def release(self, names: Collection[str], by: str = "", *, resume: bool) -> Mapping[Address, FleetAnswer]:
        """Release the last stop of all connected robots, or of the named ones; return their answers."""
        self.discover()
        stops = {
            each.address: each.state.stops
            for each in self.members().values()
            if each.is_online
            and each.state is not None
            and (not names or each.address.name in names or str(each.address) in names)
        }
        return self._request_each(
            stops, lambda each: FleetRelease(by=by or self.by, stop=stops[each], resume=resume), 3.0
        )

    def submit(self, request: KeepTask, allocator: Address) -> FleetAnswer:
        """Submit a task to the robot that keeps it, retrying until it answers; a repeated request has no effect.

        Raises TaskError without an answer: whether the robot has the task is unknown then.
        """
        for _ in range(MAX_TRIES):
            answers = self._request_each([allocator], lambda _: request, SUBMIT_TIMEOUT)
            if allocator in answers:
                return answers[allocator]
        what = f"{allocator.name} has not answered; it is unknown whether it has task {request.task} is not known"
        raise TaskError(what, hint=f"mission fleet tasks; or repeat the command with --id {request.task}")

    def choose_allocator(self, on: str) -> Address:
        """Return a random robot as allocator, if possible another one than ``on``. Raises TaskError without robots."""
        there = [address for address, each in self.members().items() if each.is_online]
        if not there:
            raise TaskError(f"no robots in fleet '{self.fleet.fleet}'", hint="mission fleet list")
        return secrets.choice([each for each in there if each.name != on] or there)

    def tasks(self, *, ended: bool) -> FleetTaskList:
        """Return the open tasks that connected robots allocate; with ``ended``, also the newest ended tasks."""
        self.discover()
        there = [address for address, each in self.members().items() if each.is_online]
        open_ones = self._pages(there, MAX_OPEN_PAGES, ended=False)
        if not ended:
            return open_ones
        over = self._pages(there, MAX_ENDED_PAGES, ended=True)
        both = {
            each.id: each for each in (*open_ones.tasks, *over.tasks)
        }  # a task may have ended between the two requests
        return FleetTaskList(list(both.values()), open_ones.more | over.more, open_ones.silent | over.silent)

    def _pages(self, there: Collection[Address], most: int, *, ended: bool) -> FleetTaskList:
        """Request tasks from the robots in ``there``, page by page, at most ``most`` pages from each."""
        found: dict[str, FleetTaskInfo] = {}
        before, silent = dict.fromkeys(there, ""), set[str]()
        for _ in range(most):
            since = before
            answers = self._request_each(
                since,
                lambda each: ListFleetTasks(by=self.by, ended=ended, before=since[each]),  # noqa: B023
                3.0,
            )
            silent |= {str(each) for each in since if each not in answers}
            before = {}
            for who, answer in answers.items():
                page = [task for task in _decode_data(FleetTaskInfo, answer) if TASK_ID_PATTERN.fullmatch(task.id)]
                if page and page[-1].id not in found:
                    before[who] = page[-1].id
                found |= {each.id: each for each in page}
            if not before:
                break
        return FleetTaskList(list(found.values()), frozenset(map(str, before)), frozenset(silent))

    def decide(self, number: str, what: Literal["reassign", "give-up"]) -> FleetAnswer:
        """Send a person's decision about a task whose robot no longer answers; return the allocator's answer.

        ``number`` is the task's ID. Raises TaskError if the allocator of the task does not answer.
        """
        keeper = Address.read(number.rpartition("/")[0])
        answers = self._request_each([keeper], lambda _: DecideTask(by=self.by, task=number, decision=what), 3.0)
        if keeper not in answers:
            raise TaskError(f"{keeper.name}, which manages task {number}, does not answer", hint="mission fleet list")
        return answers[keeper]

    def _request_each(
        self, those: Collection[Address], ask: Callable[[Address], FleetRequest], timeout: float
    ) -> dict[Address, FleetAnswer]:
        """Send a request to each of the robots in parallel; return their answers by address."""
        found: dict[Address, FleetAnswer] = {}
        over = [Event() for _ in those]
        for address, done in zip(those, over, strict=True):

            def collect_answer(who: Address | None, answer: FleetAnswer | None, done: Event = done) -> None:
                if who is None or answer is None:
                    done.set()
                else:
                    found[who] = answer

            self.transport.send_request(ask(address), str(address), collect_answer, timeout)
        for done in over:
            done.wait(timeout + 1.0)
        return dict(found)


def _decode_data(kind: type[T], answer: FleetAnswer) -> Iterator[T]:
    """Yield the JSON objects in an answer as objects of class ``kind``; invalid ones are skipped."""
    for entry in answer.data:
        with suppress(CodecError):
            yield decode(kind, entry, RULES)


def wait_until_stable(roster: Roster, clock: Clock) -> None:
    """Wait until no new robot has appeared for QUIET_TIME, or until the timeout."""
    pause, begun = Event(), clock.now()
    known, since = set[Address](), begun
    while (now := clock.now()) < begun + MAX_WAIT and (
        now < since + QUIET_TIME or (not known and now < begun + FIRST_ROBOT_TIMEOUT)
    ):
        there = {address for address, each in roster.members().items() if each.is_online}
        if not there <= known:
            known, since = known | there, now
        pause.wait(0.02)


@contextmanager
def connect_operator(fleet: FleetKeys, *, clock: Clock | None = None) -> Iterator[Operator]:
    """Connect to a fleet for the duration of the context. Raises TaskError if that is impossible."""
    clock = clock or SystemClock()
    check_name(fleet.fleet)
    roster = Roster(clock)
    line = ZenohTransport(open_session(fleet), fleet.fleet, roster)
    try:
        line.subscribe()
        yield Operator(fleet, line, roster, clock, f"operator {os.getuid()} at {_host()}")
    finally:
        line.close()


def _host() -> str:
    return "".join(each for each in socket.gethostname() if each.isalnum() or each in ".-_")[:40] or "somewhere"
