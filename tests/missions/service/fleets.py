"""Fleets in a test: robots that are members of one over loopback, with a body that only counts what is asked of it."""

import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from config.fleet import FleetKeys
from drivers.clock import SystemClock
from missions.plugins.fleet.fleet_robot import Telemetry
from missions.plugins.fleet.member import FleetMember, RobotInfo
from missions.plugins.fleet.messages import Address
from missions.plugins.fleet.operator import Operator, connect_operator
from missions.plugins.fleet.zenoh_session import open_session
from missions.plugins.fleet.zenoh_transport import Roster, ZenohTransport
from missions.plugins.tasks.fleet_latch import FleetLatch


class CountingBody:
    """A Body without a robot: ``said`` keeps what it was asked, ``telemetry`` is what it tells."""

    def __init__(self) -> None:
        self.said: list[str] = []
        self.telemetry = Telemetry()

    def read_telemetry(self) -> Telemetry:
        return self.telemetry

    def stop(self, by: str) -> tuple[bool, str]:
        self.said.append(f"stop by {by}")
        return True, "stopped (base)"

    def release(self, by: str, *, resume: bool) -> tuple[bool, str]:
        self.said.append(f"release by {by}{' and resume' * resume}")
        return True, "released"


def free_port() -> int:
    with socket.socket() as tried:
        tried.bind(("127.0.0.1", 0))
        return int(tried.getsockname()[1])


def local_fleet(port: int) -> FleetKeys:
    return FleetKeys(fleet="trial", connect=(f"tcp/127.0.0.1:{port}",))


@contextmanager
def router(port: int) -> Iterator[None]:
    """Somewhere for all to meet: a router of Zenoh's own."""
    fleet = replace(FleetKeys(), listen=(f"tcp/127.0.0.1:{port}",))
    session: Any = open_session(fleet, mode="router")
    try:
        yield
    finally:
        session.close()


@contextmanager
def member(
    fleet: FleetKeys, name: str, folder: Path, body: CountingBody, *, number: str = "0000000a"
) -> Iterator[FleetMember]:
    """A robot that is in a fleet until this is over."""
    clock = SystemClock()
    roster = Roster(clock)
    with ExitStack() as closed:
        line = ZenohTransport(open_session(fleet, mode="client"), fleet.fleet, roster)
        own = RobotInfo(Address(name, number), "turtlebot2", ("base", "voice"), simulated=True)
        line.subscribe()
        yield closed.enter_context(FleetMember(own, line, roster, body, FleetLatch(folder / name), clock=clock))


@contextmanager
def at(fleet: FleetKeys) -> Iterator[Operator]:
    with connect_operator(replace(fleet, mode="client")) as found:
        yield found
