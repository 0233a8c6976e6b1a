"""A fleet that is stopped: how soon each robot stands, and how soon each has confirmed it.

``python -m tests.benchmarks.stopping_fleet PROCESSES SESSIONS ROUNDS`` puts so many robots into each of so many
processes, all at one router of Zenoh's without anything between, and stops them again and again. Each robot is a whole
member, with a session, a roster of all others and a latch on the disk of its own; what it moves is a note of the time.
"""

import sys
import tempfile
import time
from contextlib import ExitStack
from multiprocessing import get_context
from pathlib import Path
from threading import Event
from typing import Any

from config.fleet import FleetKeys
from drivers.clock import SystemClock
from missions.plugins.fleet.fleet_robot import Telemetry
from missions.plugins.fleet.member import FleetMember, RobotInfo
from missions.plugins.fleet.messages import Address
from missions.plugins.fleet.operator import connect_operator
from missions.plugins.fleet.zenoh_session import open_session
from missions.plugins.fleet.zenoh_transport import Roster, ZenohTransport
from missions.plugins.tasks.fleet_latch import FleetLatch
from tests.missions.service.fleets import free_port, router


class Body:
    """Notes when it was stopped, on the clock that all processes of a machine have in common."""

    def __init__(self, where: Any, place: int) -> None:
        self._where, self._place = where, place

    def read_telemetry(self) -> Telemetry:
        """Tell nothing that changes."""
        return Telemetry(battery=0.5)

    def stop(self, by: str) -> tuple[bool, str]:
        """Note the time."""
        self._where[self._place] = time.monotonic()
        return True, f"stopped by {by}"

    def release(self, by: str, *, resume: bool) -> tuple[bool, str]:
        """Do nothing."""
        return True, f"released by {by}{' and resumed' * resume}"


def serve(first: int, count: int, port: int, folder: str, where: Any, over: Any) -> None:
    """Be so many robots, until it is over."""
    with ExitStack() as closed:
        for number in range(first, first + count):
            clock = SystemClock()
            roster = Roster(clock)
            keys = FleetKeys(fleet="trial", connect=(f"tcp/127.0.0.1:{port}",))
            line = ZenohTransport(open_session(keys, mode="client"), keys.fleet, roster)
            line.subscribe()
            own = RobotInfo(Address(f"r{number}", f"{number:08x}"), "note", ("base",), simulated=True)
            latch = FleetLatch(Path(folder) / f"r{number}")
            closed.enter_context(FleetMember(own, line, roster, Body(where, number), latch, clock=clock))
        over.wait()


def main(processes: int, sessions: int, rounds: int) -> None:
    """Stop them, and print what came of it."""
    count, port, pause, context = processes * sessions, free_port(), Event(), get_context("spawn")
    where, over = context.Array("d", count, lock=False), context.Event()
    stood: list[float] = []
    confirmed: list[float] = []
    with tempfile.TemporaryDirectory() as folder, router(port), ExitStack() as closed:
        words = [(each * sessions, sessions, port, folder, where, over) for each in range(processes)]
        robots = [context.Process(target=serve, args=each) for each in words]
        for each in robots:
            each.start()
            closed.callback(each.join)
        closed.callback(over.set)
        keys = FleetKeys(fleet="trial", mode="client", connect=(f"tcp/127.0.0.1:{port}",))
        operator = closed.enter_context(connect_operator(keys))
        while sum(each.is_online for each in operator.members().values()) < count:
            pause.wait(0.1)
        for _ in range(rounds):
            pause.wait(2.0)
            begun, at, ask = time.monotonic(), dict[Address, float](), operator.transport.send_request

            def timed(wanted: Any, whom: str, on_answer: Any, timeout: float, at: Any = at, ask: Any = ask) -> None:
                def heard(who: Any, answer: Any) -> None:
                    if who is not None and answer is not None:
                        at.setdefault(who, time.monotonic())
                    on_answer(who, answer)

                ask(wanted, whom, heard, timeout)

            operator.transport.send_request = timed  # type: ignore[assignment,method-assign]
            operator.stop()
            operator.transport.send_request = ask  # type: ignore[method-assign]
            stood += [when - begun for when in where if when >= begun]
            confirmed += [when - begun for when in at.values()]
            pause.wait(1.0)
            operator.release([], resume=True)
    wanted = count * rounds
    for what, found in (("stands", sorted(stood)), ("has confirmed", sorted(confirmed))):
        shares = ", ".join(
            f"{share:.0%} {found[min(int(share * len(found)), len(found) - 1)]:.3f} s" for share in (0.5, 0.99)
        )
        print(f"{count} robots in {processes} processes: {what} after: {shares} ({len(found)} of {wanted})")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
