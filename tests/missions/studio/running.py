"""A run in a process of its own, on a virtual base in another, and a client of its control socket."""

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from select import select
from typing import Any

import pytest

from drivers.clock import SystemClock
from missions.control import sockets
from missions.control.run_folders import SYSTEM_ROOT
from missions.control.run_search import FoundProcess, search_runs
from missions.control.sockets import RunConnection
from tests.missions.command import Process
from tests.missions.lone_base import LONE_ROBOT, LoneBase, lone_base
from tests.waiting import wait_until

WAITING = "mission: waiting\ntree:\n  sequence:\n    - wait: 1000 s\n    - drive: 1 m\n"
"""It has a base, and does nothing with it."""

DRIVING = "mission: driving\ntree:\n  drive: {distance: 100 m, speed: 0.4 m/s}\n"

REST = 0.5
"""Seconds within which a base is at rest whatever becomes of the link to who drives it."""


class StampedLink(RunConnection):
    """A connection to a run that keeps the stamp of the newest state."""

    __slots__ = ("stamp",)

    def receive(self) -> Mapping[str, Any]:
        told = super().receive()
        state = told["state"] if told.get("say") == "scene" else told
        self.stamp: int | None = state.get("stamp", getattr(self, "stamp", None))
        return told

    def catch_up(self) -> None:
        """Read all that has come."""
        while b"\n" in self._received or select([self.connection], [], [], 0.0)[0]:
            self.receive()


def found_of(process: int) -> list[FoundProcess]:
    """Return the runs and commands of a process that a stop would find; those of other tests may have left files."""
    return [each for each in search_runs().processes if each.run.partition("-")[0] == str(process)]


class Client:
    """Somebody who is connected to a run, and keeps all that is said."""

    def __init__(self, run: str) -> None:
        self.link = StampedLink.open(sockets.socket_path(run))
        self.number = 0

    def ask(self, do: str, **members: object) -> Mapping[str, Any]:
        return self.link.request({"do": do, **members})

    def drive(self, ahead: float = 1.0, left: float = 0.0, pace: float = 1.0) -> Mapping[str, Any]:
        self.number += 1
        return self.ask("drive", n=self.number, stamp=self.stamp(), ahead=ahead, left=left, pace=pace)

    def stamp(self) -> int:
        """Return the stamp of the newest state; begin to watch where none has come."""
        self.link.catch_up()
        if self.link.stamp is None:
            self.send(do="watch")
            self.hear(lambda told: told["say"] == "scene")
        assert self.link.stamp is not None
        return self.link.stamp

    def send(self, **members: object) -> None:
        self.link.connection.sendall(json.dumps(members).encode() + b"\n")

    def hear(self, wanted: Callable[[Mapping[str, Any]], object]) -> Mapping[str, Any]:
        """Return the first message from now on that is wanted."""
        clock = SystemClock()
        while clock.now() < 20.0:
            told = self.link.receive()
            if wanted(told):
                return told
        raise AssertionError("no such message came")

    def drive_until_it_moves(self, base: LoneBase) -> None:
        def moves() -> bool:
            self.drive()
            return base.seen().top > 0.1

        wait_until(moves, pause=0.02)


@contextmanager
def run_of(folder: Path, text: str = WAITING, *more: str) -> Iterator[tuple[Process, LoneBase]]:
    """Run a mission on a virtual base until this is over."""
    path = folder / "mission.yaml"
    path.write_text(text, encoding="utf-8")
    with ExitStack() as ends:
        base = ends.enter_context(lone_base())
        process = Process("run", str(path), "--robot", LONE_ROBOT, "--port", f"base={base.port}", *more)
        ends.callback(_end, process)
        wait_until(lambda: sockets.socket_path(str(process.process.pid)).exists() or process.process.poll() is not None)
        assert process.process.poll() is None, process.errors
        wait_until(lambda: _ticks(str(process.process.pid)))
        yield process, base


@contextmanager
def simulated_run(folder: Path, text: str = WAITING) -> Iterator[Process]:
    """Run a mission in simulated time, at the speed of ours, until this is over: nothing in it can be late."""
    path = folder / "mission.yaml"
    path.write_text(text, encoding="utf-8")
    process = Process("run", str(path), "--robot", "turtlebot2", "--simulate", "fast", "--speed", "1")
    try:
        wait_until(lambda: sockets.socket_path(str(process.process.pid)).exists() or process.process.poll() is not None)
        assert process.process.poll() is None, process.errors
        wait_until(lambda: _ticks(str(process.process.pid)))
        yield process
    finally:
        _end(process)


def _ticks(run: str) -> bool:
    """Whether a run has begun to tick."""
    with sockets.open_connection(sockets.socket_path(run)) as link:
        link.connection.sendall(b'{"do": "watch"}\n')
        while (told := link.receive())["say"] != "scene":
            pass
        return bool(told["state"]["tick"] > 0)


def _end(process: Process) -> None:
    process.process.terminate()
    process.end()


def seconds_to_rest(base: LoneBase, since: float) -> float:
    """Wait until a base stands, and return how many seconds after ``since``, by its own clock, it did."""
    wait_until(lambda: not base.seen().moving)
    return base.seen().rest_at - since


def nowhere(folder: Path, patch: pytest.MonkeyPatch) -> None:
    """Leave no folder in which sockets and notes could be: a file is in the way of each."""
    place = folder / "a file"
    place.write_text("", encoding="utf-8")
    for name in ("XDG_RUNTIME_DIR", "XDG_STATE_HOME", SYSTEM_ROOT):
        patch.setenv(name, str(place))
