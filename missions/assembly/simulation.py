"""The simulated rest of a robot: virtual devices behind its ports, and what its camera would see from there."""

import math
from dataclasses import asdict, replace

from config.faults import Fault, InvalidFileError, Mark, Source
from config.robot import RobotConfig
from config.world import PersonConfig, WorldConfig
from drivers.api import Camera, Pose2D
from drivers.clock import Clock
from drivers.errors import BadRequest
from drivers.sim.panned import PannedCamera
from drivers.sim.people import Person
from drivers.sim.rendered import RenderedCamera
from drivers.sim.room import Room
from drivers.sim.viewpoint import Viewpoint
from drivers.sim.world import World
from drivers.virtual.ax12 import VirtualAX12
from drivers.virtual.dynamixel import VirtualServoBus
from drivers.virtual.kobuki import VirtualKobuki
from drivers.virtual.rodney import VirtualRodney
from drivers.virtual.terminal import Terminal
from missions.assembly import parts

WIRED = ("base", "head", "arm")
"""The parts that sit on a serial wire."""


class Simulation:
    """Virtual devices for some parts of a robot, each on a pseudo-terminal of its own, in one world."""

    def __init__(self, robot: RobotConfig, chosen: frozenset[str], clock: Clock, *, tacho: bool = False) -> None:
        self.kobuki = VirtualKobuki() if robot.base is not None and "base" in chosen else None
        self.rodney: VirtualRodney | None = None
        self.servos: VirtualServoBus | None = None
        self._robot = robot
        self._clock = clock
        self.terminals: dict[str, Terminal] = {}
        if self.kobuki is not None:
            self.terminals["base"] = Terminal("kobuki", self.kobuki, clock)
        if robot.head is not None and "head" in chosen:
            self.rodney = VirtualRodney(baud=robot.head.baud, tacho=tacho)
            self.terminals["head"] = Terminal("nano", self.rodney, clock)
        if robot.arm is not None and "arm" in chosen:
            servos = [VirtualAX12(joint.id, angle=joint.zero) for joint in robot.arm.joints.values()]
            self.servos = VirtualServoBus(servos, robot.arm.baud)
            self.terminals["arm"] = Terminal("servos", self.servos, clock)

    @property
    def ports(self) -> dict[str, str]:
        """Where each part is to be found."""
        return {part: terminal.path for part, terminal in self.terminals.items()}

    def open(self) -> None:
        """Plug everything in."""
        for terminal in self.terminals.values():
            terminal.open()

    def close(self) -> None:
        """Unplug everything and remove the ports. Safe more than once."""
        for terminal in self.terminals.values():
            terminal.close()

    def pose(self, time: float) -> Pose2D:
        """Return where the base truly is; at the origin where there is none."""
        if self.kobuki is None:
            return Pose2D(0.0, 0.0, 0.0)
        kobuki = self.kobuki
        return self.terminals["base"].ask(lambda: kobuki.pose(time))

    def viewpoint(self, time: float) -> Viewpoint:
        """Return where the camera truly is and looks: on the head, on the base."""
        pose = self.pose(time)
        pan = tilt = 0.0
        head, rodney = self._robot.head, self.rodney
        if head is not None and rodney is not None:
            pan, tilt = self.terminals["head"].ask(
                lambda: (
                    parts.axis(head.pan).to_radians(rodney.angle(head.pan.index, time)),
                    parts.axis(head.tilt).to_radians(rodney.angle(head.tilt.index, time)),
                )
            )
        x, y, z = (0.0, 0.0, 1.0) if self._robot.camera is None else self._robot.camera.position
        return Viewpoint(
            x=pose.x + x * math.cos(pose.heading) - y * math.sin(pose.heading),
            y=pose.y + x * math.sin(pose.heading) + y * math.cos(pose.heading),
            z=z,
            yaw=pose.heading + pan,
            pitch=tilt,
        )

    def state(self) -> dict[str, object]:
        """Return what the devices truly do: the base in SI units, servos of the head in degrees, joints in radians."""
        now = self._clock.now()
        found: dict[str, object] = {}
        if self.kobuki is not None:
            pose, velocity = self.pose(now), self.kobuki.wheels.velocity
            found["base"] = asdict(pose) | asdict(velocity)
        if self.rodney is not None:
            rodney = self.rodney
            found["head"] = self.terminals["head"].ask(lambda: [rodney.angle(index, now) for index in range(4)])
        if self.servos is not None and self._robot.arm is not None:
            servos = self.servos
            found["arm"] = {name: servos.servo(joint.id).angle for name, joint in self._robot.arm.joints.items()}
        return found

    def rendered(self, world: WorldConfig, *, seed: int = 0) -> Camera:
        """Return a camera that sees ``world`` from the head."""
        camera = self._robot.camera
        size = (640, 480) if camera is None else (camera.width, camera.height)
        view = math.radians(60) if camera is None else camera.field_of_view
        return RenderedCamera(
            build_world(world),
            self.viewpoint,
            self._clock,
            rate=25.0,
            size=size,
            field_of_view=view,
            noise=world.noise,
            seed=seed,
        )

    def panned(self, camera: Camera) -> Camera:
        """Return ``camera``, which looks ahead, as if it sat on the simulated head."""
        return PannedCamera(camera, self.viewpoint)


def build_world(config: WorldConfig) -> World:
    """Return the world that a world file describes. Raises InvalidFileError for what cannot be."""
    try:
        return World(
            room=replace(Room(), length=config.length, width=config.width, centre=config.centre),
            people=tuple(_person(person) for person in config.people),
            light=config.light,
        )
    except BadRequest as error:
        raise InvalidFileError([Fault(Source(config.file, ""), Mark(), str(error), error.hint)]) from error


def _person(config: PersonConfig) -> Person:
    return Person(
        config.name,
        look=config.look,
        x=config.x,
        y=config.y,
        height=config.height,
        facing="camera" if config.facing is None else config.facing,
        path=config.path,
        speed=config.speed,
        start=config.start,
        loop=config.loop,
    )
