"""What ROS 2 costs: from a leaf's velocity to the robot; odometry, scans and pictures as shares of a core.

``python -m tests.benchmarks.reaching_ros2`` has the robot in a process of its own, behind a router on loopback.
"""

import os
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from multiprocessing import get_context
from threading import Event
from typing import Any

import numpy as np

from drivers.api import Velocity
from drivers.api.driver import DriverContext
from drivers.base.diff_drive import DiffDriveBase
from drivers.clock import SystemClock
from drivers.errors import NotConnected
from drivers.ros2.base import TWISTS
from drivers.ros2.declared import Ros2BaseKeys, Ros2CameraKeys, Ros2RangeKeys, ZenohKeys
from drivers.ros2.make import base, camera, graph, ranger
from drivers.ros2.node import Ros2Node
from drivers.ros2.session import ZenohAccess, open_session
from drivers.ros2.types import types
from drivers.ros2.virtual import Ros2Terminal, RouterSettings, free_address
from drivers.ros2.virtual_topics import VirtualPictures, VirtualRos2Base, VirtualScan
from drivers.sim.base_body import BaseBody

COMMANDS, SECONDS = 300, 10.0
"""Velocities that are timed; seconds over which a share is taken."""


def serve(address: str, what: frozenset[str], over: Any) -> None:
    """Be the robot, until it is over."""
    picture = np.random.default_rng(0).integers(0, 255, (480, 640, 3), np.uint8)
    robot = Ros2Terminal(RouterSettings(0, "", address), SystemClock())
    robot.devices.append(VirtualRos2Base(BaseBody(), {"cmd_vel": "/cmd_vel", "odom": "/odom"}))
    if "scans" in what:
        robot.devices.append(VirtualScan(lambda rays, _: np.full(len(rays), 2.0), "/scan", beams=720, rate=20.0))
    if "pictures" in what:
        robot.devices.append(VirtualPictures(lambda _: picture, "/image_raw", rate=10.0))
    robot.open()
    over.wait()
    robot.close()


@contextmanager
def driven(what: frozenset[str]) -> Iterator[tuple[str, DiffDriveBase, Any, Any]]:
    """Yield the address of a robot and the drivers of its base, scans and pictures, once all are there."""
    context, address, clock = get_context("spawn"), free_address(), SystemClock()
    over = context.Event()
    with ExitStack() as closed:
        process = context.Process(target=serve, args=(address, what, over))
        process.start()
        closed.callback(process.join)
        closed.callback(over.set)
        nodes = closed.enter_context(closing(graph(ZenohKeys(router=address, domain=0), DriverContext(clock))))
        site = DriverContext(clock, needed_parts={"ros2": nodes})
        parts: list[Any] = [base(Ros2BaseKeys(), site), ranger(Ros2RangeKeys(), site), camera(Ros2CameraKeys(), site)]
        wanted = [part for part, word in zip(parts, ("odometry", "scans", "pictures"), strict=True) if word in what]
        nodes.open()
        for part in wanted:
            closed.enter_context(closing(part)).open()
        while not all(part.health().online for part in wanted):
            time.sleep(0.05)
        yield address, parts[0], parts[1], parts[2]


def reached() -> list[float]:
    """Return the seconds from each ``drive`` of a base at rest until the robot's side has a velocity that is not 0."""
    found, heard, chance = list[float](), Event(), np.random.default_rng(1)
    with driven(frozenset({"odometry"})) as (address, wheels, _, _), ExitStack() as closed:
        session = open_session("beside", ZenohAccess((address,)))
        closed.callback(session.close)
        node = closed.enter_context(closing(Ros2Node(session, SystemClock(), name="beside")))

        def hear(kind: str, payload: bytes) -> None:
            if types().decode(kind, payload).linear.x:
                heard.set()

        node.subscribe("/cmd_vel", TWISTS[:1], hear)
        while len(found) < COMMANDS:
            with suppress(NotConnected):  # on a machine so busy that its odometry fails to come
                wheels.stop()
                time.sleep(chance.uniform(0.1, 0.15))
                heard.clear()
                begun = time.monotonic()
                wheels.drive(Velocity(0.1, 0.0))
                if heard.wait(5.0):
                    found.append(time.monotonic() - begun)
    return sorted(found)


def share(what: frozenset[str]) -> tuple[float, float, float]:
    """Return the share of a core that the drivers take, and how many scans and pictures came each second."""
    with driven(what) as (_, _, scans, pictures):

        def counted() -> tuple[int, int]:
            return scans.health().counters.get("scans", 0), pictures.health().counters.get("frames", 0)

        time.sleep(1.0)
        before, spent, at = counted(), time.process_time(), time.monotonic()
        while (left := at + SECONDS - time.monotonic()) > 0:
            pictures.read(min(left, 0.5)) if "pictures" in what else time.sleep(left)
        taken, after = time.monotonic() - at, counted()
        return (time.process_time() - spent) / taken, *((b - a) / taken for a, b in zip(before, after, strict=True))  # type: ignore[return-value]


def main() -> None:
    """Print all figures, and how loaded the machine was."""
    times = reached()
    median, worst = times[len(times) // 2], times[int(0.99 * len(times))]
    print(f"cmd_vel from drive to the robot: median {1000 * median:.1f} ms, 99 % {1000 * worst:.1f} ms of {len(times)}")
    for what in ({"odometry"}, {"odometry", "scans"}, {"odometry", "pictures"}, {"odometry", "scans", "pictures"}):
        core, scans, pictures = share(frozenset(what))
        print(f"{', '.join(sorted(what))}: {core:.1%} of a core; {scans:.1f} scans/s, {pictures:.1f} pictures/s")
    print(f"load of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")


if __name__ == "__main__":
    main()
