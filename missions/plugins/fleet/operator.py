"""Somebody at a fleet: sees who is there, and asks all or some of them for something, over a session of their own."""

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
"""Seconds without anybody new after which all that are there were heard."""

MAX_WAIT = 5.0
"""Seconds for which those who come are waited for, at most: a fleet may never be quiet."""

FIRST_ROBOT_TIMEOUT = 2.0
"""Seconds for which somebody is waited for, where nobody is there yet."""

STOP_TIMEOUT = 1.0
"""Seconds that a robot has to confirm a stop; it is asked again meanwhile."""

STOP_RETRY_INTERVAL = 0.3

MAX_TRIES, SUBMIT_TIMEOUT = 3, 2.0
"""How often a robot is asked to keep a task, and seconds that it has to answer each time."""

MAX_WITNESSES = 3
"""Robots that are asked whom they have met: one alone may have been started a moment ago."""


MAX_OPEN_PAGES, MAX_ENDED_PAGES = 1000, 10
"""How often a robot is asked for more of its tasks, at most: that are open, and that have ended."""


@dataclass(frozen=True, slots=True)
class FleetTaskList:
    """Tasks of a fleet, in no order; ``more``: robots that keep older ones, and ``silent``: that did not answer."""

    tasks: list[FleetTaskInfo]
    more: frozenset[str] = frozenset()
    silent: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True)
class Operator:
    """A session in a fleet: its ``transport``, and the ``roster`` that it keeps."""

    fleet: FleetKeys
    transport: ZenohTransport
    roster: Roster
    clock: Clock
    by: str

    def members(self) -> Mapping[Address, RosterEntry]:
        """Return all that were met, by anybody: those that are there, and those that were."""
        return self.roster.members()

    def discover(self) -> None:
        """Wait until all are known that are there, and ask some of them whom they have met."""
        wait_until_stable(self.roster, self.clock)
        there = [address for address, each in self.members().items() if each.is_online][:MAX_WITNESSES]
        for answer in self._request_each(there, lambda _: ListPeers(), 1.0).values():
            for met in _decode_data(Peer, answer):
                with suppress(CodecError):
                    self.roster.on_peer_report(Address.read(met.robot), met.connection)

    def missing_robots(self) -> list[str]:
        """Return the robots that the file of the fleet names, and that nobody has met."""
        met = {address.name for address in self.members()}
        return [name for name in self.fleet.robots if name not in met]

    def stop(self, by: str = "") -> tuple[Mapping[Address, FleetAnswer], list[str]]:
        """Stop all; return what each has confirmed, and the names of those that did not answer.

        All are asked at once, who comes meanwhile as soon as it is heard of, and who does not answer again.
        Those that others have met are named. It ends, though robots come without end.
        """
        answers: dict[Address, FleetAnswer] = {}
        asked_at: dict[Address, list[float]] = {}

        def heard(who: Address | None, answer: FleetAnswer | None) -> None:
            if who is not None and answer is not None:
                answers[who] = answer

        stop = FleetStop(by=by or self.by, press=secrets.token_hex(8))
        pause, begun = Event(), self.clock.now()
        known, quiet = set[Address](), begun
        if there := [each.address for each in self.members().values() if each.connection == "ONLINE"]:
            self.transport.send_request(stop, "*/*", heard, STOP_TIMEOUT)  # all by one question
            asked_at = {each: [begun] for each in there}
        while True:
            now = self.clock.now()
            there = [each.address for each in self.members().values() if each.connection == "ONLINE"]
            silent = [each for each in there if each not in answers]
            for each in silent:
                times = asked_at.setdefault(each, [])
                if not times or now - times[-1] >= STOP_RETRY_INTERVAL:
                    times.append(now)
                    self.transport.send_request(stop, str(each), heard, STOP_TIMEOUT)
            if not known.issuperset(there):
                known, quiet = known.union(there), now
            tried = all(now - asked_at[each][0] > STOP_TIMEOUT for each in silent)
            if now > begun + MAX_WAIT or (
                tried and now > (quiet + QUIET_TIME if there else begun + FIRST_ROBOT_TIMEOUT)
            ):
                break
            pause.wait(0.01)
        self.discover()
        gone = [each.address for each in self.members().values() if each.connection != "OFFLINE"]
        lost = sorted(str(each) for each in gone if each not in answers)
        # Of two that have one address, one may have answered for both.
        copied = sorted(f"{each}, a number that two robots have" for each in answers if self.roster.is_duplicate(each))
        return dict(answers), [*lost, *copied, *self.missing_robots()]

    def release(self, names: Collection[str], by: str = "", *, resume: bool) -> Mapping[Address, FleetAnswer]:
        """Release the last stop of those that are there, or that are named so; return what each says."""
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
        """Have a robot keep a task, whose ID names it; ask again, which does no harm, until it answers.

        Raises TaskError where it does not: whether it has the task is not known then.
        """
        for _ in range(MAX_TRIES):
            answers = self._request_each([allocator], lambda _: request, SUBMIT_TIMEOUT)
            if allocator in answers:
                return answers[allocator]
        what = f"{allocator.name} has not answered: whether it keeps task {request.task} is not known"
        raise TaskError(what, hint=f"mission fleet tasks; or the same again, with --id {request.task}")

    def choose_allocator(self, on: str) -> Address:
        """Return a robot that is to keep a task: by chance, and not the one that does it, where there are others.

        Raises TaskError where nobody is there.
        """
        there = [address for address, each in self.members().items() if each.is_online]
        if not there:
            raise TaskError(f"nobody is in fleet '{self.fleet.fleet}'", hint="mission fleet list")
        return secrets.choice([each for each in there if each.name != on] or there)

    def tasks(self, *, ended: bool) -> FleetTaskList:
        """Return the tasks that the robots keep that are there; with ``ended``, of those that have ended the newest."""
        self.discover()
        there = [address for address, each in self.members().items() if each.is_online]
        open_ones = self._pages(there, MAX_OPEN_PAGES, ended=False)
        if not ended:
            return open_ones
        over = self._pages(there, MAX_ENDED_PAGES, ended=True)
        both = {each.id: each for each in (*open_ones.tasks, *over.tasks)}  # one may have ended in between
        return FleetTaskList(list(both.values()), open_ones.more | over.more, open_ones.silent | over.silent)

    def _pages(self, there: Collection[Address], most: int, *, ended: bool) -> FleetTaskList:
        """Ask for tasks, page after page, so many of each robot at ``most``."""
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
                page = [told for told in _decode_data(FleetTaskInfo, answer) if TASK_ID_PATTERN.fullmatch(told.id)]
                if page and page[-1].id not in found:
                    before[who] = page[-1].id
                found |= {each.id: each for each in page}
            if not before:
                break
        return FleetTaskList(list(found.values()), frozenset(map(str, before)), frozenset(silent))

    def decide(self, number: str, what: Literal["hand-on", "give-up"]) -> FleetAnswer:
        """Say what is to become of a task whose robot is lost. Raises TaskError where its keeper does not answer."""
        keeper = Address.read(number.rpartition("/")[0])
        answers = self._request_each([keeper], lambda _: DecideTask(by=self.by, task=number, decision=what), 3.0)
        if keeper not in answers:
            raise TaskError(f"{keeper.name}, which keeps task {number}, does not answer", hint="mission fleet list")
        return answers[keeper]

    def _request_each(
        self, those: Collection[Address], ask: Callable[[Address], FleetRequest], timeout: float
    ) -> dict[Address, FleetAnswer]:
        """Ask each of some robots, all at the same time; return the answers."""
        found: dict[Address, FleetAnswer] = {}
        over = [Event() for _ in those]
        for address, done in zip(those, over, strict=True):

            def heard(who: Address | None, answer: FleetAnswer | None, done: Event = done) -> None:
                if who is None or answer is None:
                    done.set()
                else:
                    found[who] = answer

            self.transport.send_request(ask(address), str(address), heard, timeout)
        for done in over:
            done.wait(timeout + 1.0)
        return dict(found)


def _decode_data(kind: type[T], answer: FleetAnswer) -> Iterator[T]:
    """Yield what an answer tells that is exactly of a class; the rest is left out."""
    for told in answer.data:
        with suppress(CodecError):
            yield decode(kind, told, RULES)


def wait_until_stable(roster: Roster, clock: Clock) -> None:
    """Wait until nobody new is heard of for a while, or for as long as anybody is waited for."""
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
    """Be at a fleet while this is entered. Raises TaskError where that is not possible."""
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
