"""The default robot in a process of its own, for what is measured beside it: virtual devices, and a camera on its head.

    python -m tests.benchmarks.robot_beside WORLD

It prints its ports and the address of its camera as one line of JSON, and ends with its standard input. The camera
draws ``WORLD`` from where the head truly looks, 30 times a second, and gives the pictures as a webcam does: not
compressed, and lost where nobody takes them in time.
"""

import json
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from subprocess import PIPE, Popen
from threading import Event, Thread

import cv2

from config.library import DEFAULT_ROBOT, find_file
from config.world import load_world
from drivers.api import Camera, Image
from drivers.api.kinds import PORT_KINDS
from drivers.clock import SystemClock
from missions.assembly.simulation import Simulation
from missions.library.drivers import load_robot

RATE = 30
"""Pictures a second."""

HEADER = b"HTTP/1.0 200 OK\r\nContent-Type: video/x-yuv4mpeg\r\n\r\nYUV4MPEG2 W%d H%d F%d:1 Ip A1:1 C420jpeg\n"
"""Before the first picture; the format is YUV4MPEG2, which needs no more than this and a word before each picture."""


@dataclass(frozen=True)
class Beside:
    """Where the robot is to be found: the ``ports`` of its parts, the address of its ``camera``."""

    ports: dict[str, str]
    camera: str

    @property
    def options(self) -> list[str]:
        """What ``mission run`` is told of it."""
        ports = [word for part, port in self.ports.items() for word in ("--port", f"{part}={port}")]
        return ["--robot", DEFAULT_ROBOT, "--camera", self.camera, *ports]


@contextmanager
def robot_beside(world: str) -> Iterator[Beside]:
    """Have the robot stand in ``world`` until the end of the block."""
    with Popen([sys.executable, "-m", "tests.benchmarks.robot_beside", world], stdin=PIPE, stdout=PIPE) as process:
        if process.stdout is None or process.stdin is None:
            raise RuntimeError("a process without pipes")
        yield Beside(**json.loads(process.stdout.readline()))
        process.stdin.close()


def main(world: str) -> None:
    """Be the robot."""
    clock, config = SystemClock(), load_robot(find_file("robots", DEFAULT_ROBOT))
    simulation = Simulation(
        config, frozenset(PORT_KINDS) & config.parts, clock, world=load_world(find_file("worlds", world))
    )
    door = socket.create_server(("127.0.0.1", 0))
    simulation.open()
    try:
        Thread(target=_serve, args=(door, simulation), daemon=True).start()
        ports = {"ports": simulation.ports, "camera": f"http://127.0.0.1:{door.getsockname()[1]}/camera.y4m"}
        print(json.dumps(ports), flush=True)
        sys.stdin.read()
    finally:
        simulation.close()


def _serve(door: socket.socket, simulation: Simulation) -> None:
    """Show the pictures to one program after the other."""
    while True:
        line, _ = door.accept()
        with line, suppress(OSError):
            line.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 500_000)
            line.recv(4096)
            camera = simulation.rendered_camera(rate=RATE)
            camera.open()
            _show(line, camera)


def _show(line: socket.socket, camera: Camera) -> None:
    begun = False
    while True:
        frame = camera.read(1.0)
        if frame is None:
            Event().wait(0.001)
            continue
        height, width = frame.image.shape[:2]
        if not begun:
            line.sendall(HEADER % (width, height, RATE))
            begun = True
        line.sendall(b"FRAME\n" + _raw(frame.image))


def _raw(image: Image) -> bytes:
    return cv2.cvtColor(image, cv2.COLOR_BGR2YUV_I420).tobytes()


if __name__ == "__main__":
    main(sys.argv[1])
