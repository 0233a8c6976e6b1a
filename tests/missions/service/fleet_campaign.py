"""A fleet that is killed and cut apart while it does its tasks: what is lost, what is done twice, how fast it hears.

``python -m tests.missions.service.fleet_campaign ROBOTS TASKS KILLS CUTS`` runs a campaign and prints its figures. Each
robot is a process; its only way to the others is a proxy on loopback, and behind that a router of Zenoh's.
"""

import os
import random
import select
import socket
import sqlite3
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event, Thread

from config.fleet import FleetKeys
from drivers.clock import SystemClock
from missions.plugins.fleet.membership import robot_number
from missions.plugins.fleet.messages import Address, KeepTask
from missions.plugins.fleet.operator import Operator, connect_operator
from missions.plugins.fleet.task_allocator import LATE_PREFIX
from missions.plugins.tasks.queue_database import open_db, queue_file
from missions.plugins.tasks.task import TaskError
from tests.forked import Forked
from tests.missions.service.fleets import free_port, router


class Proxy:
    """A way to the router that can be cut: then what is sent stays in the wire, until it is mended or hung up on."""

    def __init__(self, to: int) -> None:
        self._to = to
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listener.getsockname()[1])
        self.cut, self._over = Event(), Event()
        self._thread = Thread(target=self._serve, name=f"proxy {self.port}", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._over.set()
        self._thread.join()

    def _serve(self) -> None:
        other: dict[socket.socket, socket.socket] = {}
        with self._listener:
            while not self._over.is_set():
                watched = [self._listener, *other] if not self.cut.is_set() else []
                if not watched:
                    self._over.wait(0.05)
                    continue
                for ready in select.select(watched, [], [], 0.05)[0]:
                    if ready is self._listener:
                        near = ready.accept()[0]
                        far = socket.create_connection(("127.0.0.1", self._to))
                        other[near], other[far] = far, near
                    elif ready in other:
                        self._pass_on(ready, other)
            for each in other:
                each.close()

    @staticmethod
    def _pass_on(ready: socket.socket, other: dict[socket.socket, socket.socket]) -> None:
        try:
            data = ready.recv(1 << 16)
            other[ready].sendall(data)
        except OSError:
            data = b""
        if not data:
            pair = other.pop(ready)
            other.pop(pair, None)
            ready.close()
            pair.close()


@dataclass(slots=True)
class Robot:
    """One robot of the campaign: its folder outlives its process."""

    name: str
    folder: Path
    proxy: Proxy
    process: Forked | None = None
    back_at: float = 0.0
    mended_at: float = 0.0
    changed_at: float = 0.0

    def start(self) -> None:
        words = (str(self.folder), self.name, str(self.proxy.port))
        self.process = Forked("tests.missions.service.fleet_robot", *words, stderr=None)

    def kill(self) -> None:
        if self.process is not None:
            self.process.kill()
            self.process.wait()
            self.process = None

    @property
    def address(self) -> Address:
        return Address(self.name, robot_number(self.folder))


@dataclass(slots=True)
class Figures:
    """What came of a campaign; times in seconds."""

    robots: int
    tasks: int
    seconds: float = 0.0
    kills: int = 0
    cuts: int = 0
    states: Counter[str] = field(default_factory=Counter)
    twice: list[str] = field(default_factory=list)
    untold: list[str] = field(default_factory=list)
    acts: Counter[str] = field(default_factory=Counter)
    once_only: set[str] = field(default_factory=set)
    list_delays: list[float] = field(default_factory=list)
    stop_delays: list[float] = field(default_factory=list)
    unstopped: int = 0
    struck_delays: list[float] = field(default_factory=list)
    struck_unstopped: int = 0
    processor: float = 0.0
    waiting: list[str] = field(default_factory=list)

    def told(self) -> str:
        """Return the figures, as lines."""
        again = sum(count - 1 for count in self.acts.values())
        forbidden = sum(self.acts[each] > 1 for each in self.once_only)
        lists, stops, struck = sorted(self.list_delays), sorted(self.stop_delays), sorted(self.struck_delays)
        lines = [
            f"{self.robots} robots, {self.tasks} tasks in {self.seconds:.1f} s; {self.kills} kill -9, {self.cuts} cuts",
            f"ended as {dict(self.states)}; lost {len(self.waiting)}",
            f"done by two {len(self.twice)}, of them not told {len(self.untold)}, not to be repeated {forbidden}",
            f"acts beyond one {again}",
            f"list correct after: median {_share(lists, 0.5):.3f}, 99 % {_share(lists, 0.99):.3f} of {len(lists)}",
            f"stop confirmed after: median {_share(stops, 0.5):.3f}, 99 % {_share(stops, 0.99):.3f} of {len(stops)}",
            f"among kills and cuts: median {_share(struck, 0.5):.3f}, 99 % {_share(struck, 0.99):.3f} of {len(struck)}",
            f"not confirmed, of those connected for {SETTLED:g} s: {self.struck_unstopped}",
            f"stop not confirmed: {self.unstopped}; processor of an idle robot: {self.processor:.2%} of a core",
        ]
        return "\n".join(lines)


SETTLED = 2.0
"""Seconds since it was last struck, or came back, after which a robot counts as connected: so long a list may lag."""


def _share(values: list[float], share: float) -> float:
    return values[min(len(values) - 1, int(share * len(values)))] if values else float("nan")


class Campaign:
    """The robots, the one who gives them tasks, and what strikes them; ``seed`` draws when."""

    def __init__(self, folder: Path, robots: int, seed: int, closed: ExitStack) -> None:
        self.chance, self.clock, self.pause = random.Random(seed), SystemClock(), Event()  # noqa: S311 - not a secret
        port = free_port()
        closed.enter_context(router(port))
        self.robots = []
        for number in range(robots):
            proxy = closed.enter_context(closing(Proxy(port)))
            self.robots.append(Robot(f"r{number}", folder / f"r{number}", proxy))
            closed.callback(self.robots[-1].kill)
        fleet = FleetKeys(fleet="campaign", mode="client", connect=(f"tcp/127.0.0.1:{port}",))
        self.operator: Operator = closed.enter_context(connect_operator(fleet))
        self.stopper: Operator = closed.enter_context(connect_operator(fleet))
        self.stopping: Thread | None = None
        closed.callback(self._join)
        self.figures = Figures(robots, 0)

    def begin(self) -> None:
        """Start all, and wait until all are listed."""
        for robot in self.robots:
            robot.start()
        self.until(lambda: len(self.online()) == len(self.robots), 120.0)

    def online(self) -> set[Address]:
        """Return who is there, as the operator's list has it."""
        return {address for address, each in self.operator.members().items() if each.is_online}

    def until(self, holds: object, seconds: float) -> float:
        """Wait until something holds; return after how long."""
        begun = self.clock.now()
        while not holds():  # type: ignore[operator]
            assert self.clock.now() < begun + seconds, f"it did not come true within {seconds:g} s"
            self.pause.wait(0.01)
        return self.clock.now() - begun

    def give(self, count: int) -> None:
        """Give so many tasks, a quarter of them such that may not be done twice; each until it is acknowledged."""
        for _ in range(count):
            self.strike_if_due()
            while True:
                there = sorted(self.online())
                if not there:
                    self.pause.wait(0.05)
                    continue
                keeper = self.chance.choice(there)
                number = f"{keeper}/{self.chance.getrandbits(48):012x}"
                once = self.chance.random() < 0.25
                wanted = KeepTask(
                    task=number, mission="note", params={"id": number}, if_interrupted="give-up" if once else "retry"
                )
                if self._given(wanted, keeper):
                    break
            self.figures.tasks += 1
            self.given.append(number)
            self.figures.once_only |= {number} if once else set()

    def _given(self, wanted: KeepTask, keeper: Address) -> bool:
        """Ask until the keeper has answered: whether it has the task is not known before."""
        while True:
            with suppress(TaskError):
                return self.operator.submit(wanted, keeper).ok
            self.strike_if_due()

    given: list[str]

    def strike(self, kills: int, cuts: int, stops: int = 0) -> None:
        """Plan what strikes, over the time that the tasks take, and how often another stops all meanwhile."""
        self.given = []
        self.planned = ["kill"] * kills + ["cut"] * cuts + ["stop"] * stops
        self.chance.shuffle(self.planned)
        self.next_at = self.clock.now() + 0.5

    every: float = 0.7

    def strike_if_due(self) -> None:
        """Kill, cut, start and mend what is due."""
        now = self.clock.now()
        for robot in self.robots:
            if robot.process is None and now >= robot.back_at:
                robot.start()
                robot.changed_at = now
            if robot.proxy.cut.is_set() and now >= robot.mended_at:
                robot.proxy.cut.clear()
                robot.changed_at = now
        if not self.planned or now < self.next_at:
            return
        self.next_at = now + self.every
        whole = [each for each in self.robots if each.process is not None and not each.proxy.cut.is_set()]
        if len(whole) < 2:
            return
        robot, what = self.chance.choice(whole), self.planned.pop()
        if what == "stop":
            self._join()
            self.stopping = Thread(target=self._stop_among_strikes, name="another operator")
            self.stopping.start()
            return
        robot.changed_at = now
        if what == "kill":
            robot.kill()
            robot.back_at = now + self.chance.uniform(0.0, 3.0)
            self.figures.kills += 1
        else:
            robot.proxy.cut.set()
            robot.mended_at = now + self.chance.uniform(0.5, 10.0)
            self.figures.cuts += 1

    def finish(self, seconds: float) -> None:
        """Go on striking until nothing is planned, then wait until all tasks have ended; count what came of it."""
        begun = self.clock.now()
        while self.clock.now() < begun + seconds:
            self.strike_if_due()
            whole = all(each.process is not None and not each.proxy.cut.is_set() for each in self.robots)
            if not self.planned and whole and self.open() == 0 and not self.untold():
                break
            if not self.planned and any(each.state and each.state.stopped for each in self.operator.members().values()):
                self.operator.release([], resume=True)  # who was away when all were released
            self.pause.wait(0.1)
        self.figures.seconds = self.clock.now()
        for robot in self.robots:
            robot.kill()
        done: Counter[str] = Counter()
        for robot in self.robots:
            journal = robot.folder / "done"
            lines = journal.read_text(encoding="utf-8").splitlines() if journal.exists() else []
            self.figures.acts.update(lines)
            with closing(open_db(queue_file(robot.folder))) as connection:
                done.update(row["id"] for row in connection.execute(_DONE))
                for row in connection.execute("SELECT id, state FROM kept"):
                    self.figures.states[row["state"]] += 1
                    if row["state"] not in ("FINISHED", "FAILED"):
                        self.figures.waiting.append(row["id"])
        self.figures.twice = [number for number, count in done.items() if count > 1]
        self.figures.untold = self.untold()
        self.figures.waiting += sorted(set(self.given) - self.kept())

    def untold(self) -> list[str]:
        """Return tasks that two robots have done, of which no keeper says so: it may be about to hear of it."""
        done: Counter[str] = Counter()
        told: set[str] = set()
        for robot in self.robots:
            with closing(open_db(queue_file(robot.folder))) as connection:
                done.update(row["id"] for row in connection.execute(_DONE))
                told |= {
                    row["id"]
                    for row in connection.execute("SELECT id, reason FROM kept")
                    if LATE_PREFIX in row["reason"]
                }
        return [number for number, count in done.items() if count > 1 and number not in told]

    def kept(self) -> set[str]:
        """Return all tasks that are kept by anybody."""
        found: set[str] = set()
        for robot in self.robots:
            with closing(open_db(queue_file(robot.folder))) as connection:
                found |= {row["id"] for row in connection.execute("SELECT id FROM kept")}
        return found

    def open(self) -> int:
        """Return how many tasks have not ended, as the robots' own files have it."""
        count = 0
        for robot in self.robots:
            path = queue_file(robot.folder)
            if path.exists():
                with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as connection:
                    for sql in (_OPEN, "SELECT count(*) FROM errand WHERE told = 0"):
                        count += connection.execute(sql).fetchone()[0]
        return count

    def measure(self, rounds: int) -> None:
        """Measure how soon the list is right, how soon a stop is confirmed, and what an idle robot costs."""
        spent, at = self._spent(), self.clock.now()
        self.pause.wait(min(5.0, rounds * 1.0))
        self.figures.processor = (self._spent() - spent) / (self.clock.now() - at) / len(self.robots)
        for _ in range(rounds):
            robot = self.chance.choice(self.robots)
            address = robot.address
            robot.kill()
            self.figures.list_delays.append(self.until(lambda a=address: a not in self.online(), 30.0))
            robot.start()
            self.until(lambda a=address: a in self.online(), 60.0)
            robot.proxy.cut.set()
            self.figures.list_delays.append(self.until(lambda a=address: a not in self.online(), 30.0))
            robot.proxy.cut.clear()
            self.figures.list_delays.append(self.until(lambda a=address: a in self.online(), 30.0))
            there, heard = self._stop(self.operator)
            self.figures.stop_delays += [heard[each] for each in there if each in heard]
            self.figures.unstopped += len(there - heard.keys())

    def _join(self) -> None:
        if self.stopping is not None:
            self.stopping.join()

    def _stop_among_strikes(self) -> None:
        begun = self.clock.now()
        there, at = self._stop(self.stopper)
        there &= {each.address for each in self.robots if each.changed_at < begun - SETTLED}
        self.figures.struck_delays += [at[each] for each in there if each in at]
        self.figures.struck_unstopped += len(there - at.keys())

    def _stop(self, operator: Operator) -> tuple[set[Address], dict[Address, float]]:
        """Stop and release all; return who was there, and after how long each has confirmed it."""
        there, begun, at = self.online(), self.clock.now(), dict[Address, float]()
        ask = operator.transport.send_request

        def timed(wanted, where, on_answer, timeout):  # type: ignore[no-untyped-def]
            def heard(who, answer):  # type: ignore[no-untyped-def]
                if who is not None and answer is not None and who not in at:
                    at[who] = self.clock.now() - begun
                on_answer(who, answer)

            ask(wanted, where, heard, timeout)

        object.__setattr__(operator.transport, "send_request", timed)
        operator.stop()
        object.__setattr__(operator.transport, "send_request", ask)
        operator.release([], resume=True)
        return there, at

    def _spent(self) -> float:
        """Return the processor time of all robots, in seconds."""
        ticks = 0
        for robot in self.robots:
            if robot.process is not None:
                fields = Path(f"/proc/{robot.process.pid}/stat").read_text(encoding="ascii").rsplit(")", 1)[1].split()
                ticks += int(fields[11]) + int(fields[12])
        return ticks / os.sysconf("SC_CLK_TCK")


_OPEN = "SELECT count(*) FROM kept WHERE state NOT IN ('FINISHED', 'FAILED')"
_DONE = "SELECT errand.id FROM errand JOIN task ON task.id = errand.task WHERE task.state = 'done'"


@contextmanager
def campaign(folder: Path, robots: int, seed: int = 1) -> Iterator[Campaign]:
    """A fleet of so many robots, in processes that end with this."""
    with ExitStack() as closed:
        yield Campaign(folder, robots, seed, closed)


def main(robots: int, tasks: int, kills: int, cuts: int, rounds: int) -> None:
    """Run one, and print its figures."""
    with tempfile.TemporaryDirectory() as folder, campaign(Path(folder), robots) as fleet:
        fleet.begin()
        fleet.measure(rounds)
        fleet.strike(kills, cuts, rounds)
        fleet.give(tasks)
        fleet.finish(600.0)
        print(fleet.figures.told())  # noqa: T201


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
