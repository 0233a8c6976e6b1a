"""Virtual devices on the ports of a robot, and the view of its camera in a simulated world."""

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from threading import Timer
from typing import TypeVar

from config.robot import RobotConfig
from config.world import DEFAULT_NOISE, PhysicsConfig, WorldConfig
from drivers.api import Camera, HeadPose, Pose2D, ignore
from drivers.api.driver import resolve_name
from drivers.clock import Clock
from drivers.sim.context import SimContext
from drivers.sim.painter import PannedCamera
from drivers.sim.person_actions import PersonReply
from drivers.sim.rendered_camera import RenderedCamera
from drivers.sim.viewpoint import Viewpoint, camera_viewpoint
from drivers.sim.world import ORIGIN, SimulatedWorld
from drivers.virtual.device import VirtualDevice, VirtualPort
from drivers.virtual.terminal import PseudoTerminal
from missions.assembly.part_factory import order_parts
from missions.library.worlds import build_physics, build_world

D = TypeVar("D")


def ignore_reply(reply: PersonReply) -> None:
    """Do nothing with a person's reply: the robot has no ears."""


class Simulation:
    """Virtual devices for the ``chosen`` parts of a robot, together in one world, each on a pseudo-terminal."""

    def __init__(
        self,
        robot: RobotConfig,
        chosen: frozenset[str],
        clock: Clock,
        *,
        world: WorldConfig | None = None,
        on_answer: Callable[[str, str], None] = ignore,
        seed: int = 0,
        listen: str = "",
    ) -> None:
        self._config = world
        self._world = None if world is None else build_world(world)
        self._on_answer = on_answer
        self.on_reply: Callable[[PersonReply], None] = ignore_reply
        self._answers: list[Timer] = []
        self._robot = robot
        self._clock = clock
        self.parts: dict[str, VirtualDevice] = {}
        self.terminals: dict[str, VirtualPort] = {}
        stage = SimContext(
            clock,
            self._world,
            self.pose,
            physics=build_physics(PhysicsConfig() if world is None else world.physics),
            seed=seed,
            listen_address=listen,
            viewpoint=self.viewpoint,
            camera_noise=DEFAULT_NOISE if world is None else world.noise,
            parts=self.parts,
            part_keys={kind: section.keys for kind, section in robot.sections.items()},
        )
        for kind in order_parts(robot, chosen):
            section = robot.sections[kind]
            if not section.driver.virtual:
                continue
            self.parts[kind] = plugged = resolve_name(section.driver.virtual)(
                section.keys, replace(stage, part_name=kind)
            )
            if plugged.port is not None:
                self.terminals[kind] = plugged.port
            elif plugged.device is not None:
                self.terminals[kind] = PseudoTerminal(plugged.port_name, plugged.device, clock)

    @property
    def ports(self) -> dict[str, str]:
        """Port of the virtual device of each part."""
        return {part: terminal.path for part, terminal in self.terminals.items()}

    def device(self, cls: type[D]) -> D | None:
        """Return the virtual device that is an instance of ``cls``, or None if there is none."""
        return next((each.device for each in self.parts.values() if isinstance(each.device, cls)), None)

    def open(self) -> None:
        """Connect all virtual devices."""
        for terminal in self.terminals.values():
            terminal.open()
        if self._world is not None:
            self._expect(self._world.replies_between(-1.0, math.inf))

    def close(self) -> None:
        """Disconnect all virtual devices and remove their ports. Idempotent."""
        for timer in self._answers:
            timer.cancel()
            timer.join()
        self._answers.clear()
        for terminal in self.terminals.values():
            terminal.close()

    def pose(self, time: float) -> Pose2D:
        """Return the true pose of the base; the start pose without a base."""
        base = self.parts.get("base")
        if base is None or base.pose is None:
            return ORIGIN if self._world is None else self._world.start
        pose = base.pose
        return self._terminal("base").call_paused(lambda: pose(time))

    def viewpoint(self, time: float) -> Viewpoint:
        """Return the true pose of the camera, from the true poses of the base and of the head that carries it."""
        looks = self._head_pose(time)
        camera = None if self._robot.camera is None else self._robot.camera.upright()
        return camera_viewpoint(
            self.pose(time), looks.pan, looks.tilt, (0.0, 0.0, 1.0) if camera is None else camera.position
        )

    def _head_pose(self, time: float) -> HeadPose:
        """Return the true pose of the head relative to the base; straight ahead without a head."""
        head = self.parts.get("head")
        if head is None or head.head_pose is None:
            return HeadPose(0.0, 0.0)
        looks = head.head_pose
        return self._terminal("head").call_paused(lambda: looks(time))

    def _terminal(self, kind: str) -> VirtualPort:
        """Return the pseudo-terminal of a part, or of the part whose connection it shares."""
        owner = next(each for each in (kind, *self._robot.sections[kind].driver.needs) if each in self.terminals)
        return self.terminals[owner]

    def state(self) -> dict[str, object]:
        """Return the true state of each virtual device by part.

        The base is in SI units, the head in degrees, joints in radians.
        """
        now = self._clock.now()
        found = {}
        for kind, plugged in self.parts.items():
            if plugged.state is not None:
                found[kind] = self._terminal(kind).call_paused(partial(plugged.state, now))
        return found

    def hear(self, text: str) -> None:
        """Let the people in the world hear the robot's speech ``text``; their answers are scheduled."""
        if self._world is not None:
            now = self._clock.now()
            self._expect(self._world.deliver_speech(text, now, self._robot_position(now)))

    def _expect(self, replies: Iterable[PersonReply]) -> None:
        for reply in replies:
            timer = Timer(max(0.0, reply.time - self._clock.now()), self._on_spoken, (reply,))
            timer.daemon = True
            timer.start()
            self._answers.append(timer)

    def _on_spoken(self, reply: PersonReply) -> None:
        now = self._clock.now()
        self._on_answer(reply.speaker, reply.text)
        if self._world is not None and self._world.is_audible(reply.speaker, now, self._robot_position(now)):
            self.on_reply(reply)

    def _robot_position(self, time: float) -> tuple[float, float]:
        pose = self.pose(time)
        return pose.x, pose.y

    def rendered_camera(self, *, seed: int = 0, rate: float = 25.0) -> Camera:
        """Return a camera that renders the view from the head, ``rate`` times a second."""
        camera = self._robot.camera
        size = (640, 480) if camera is None else (camera.width, camera.height)
        view = math.radians(60) if camera is None else camera.field_of_view
        return RenderedCamera(
            SimulatedWorld() if self._world is None else self._world,
            self.viewpoint,
            self._clock,
            rate=rate,
            size=size,
            field_of_view=view,
            noise=DEFAULT_NOISE if self._config is None else self._config.noise,
            seed=seed,
        )

    def panned_camera(self, camera: Camera) -> Camera:
        """Return ``camera``, which looks straight ahead, as if it were on the simulated head."""
        return PannedCamera(camera, self.viewpoint)
