"""The simulated rest of a robot: virtual devices behind its ports, and what its camera would see from there."""

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from threading import Timer
from typing import TypeVar

from config.robot import RobotConfig
from config.world import NOISE, PhysicsConfig, WorldConfig
from drivers.api import Camera, HeadPose, Pose2D, ignore
from drivers.api.driver import resolved
from drivers.clock import Clock
from drivers.sim.acts import Reply
from drivers.sim.painter import PannedCamera
from drivers.sim.rendered import RenderedCamera
from drivers.sim.stage import Stage
from drivers.sim.viewpoint import Viewpoint, mounted
from drivers.sim.world import ORIGIN, World
from drivers.virtual.plugged import Plugged, Socket
from drivers.virtual.terminal import Terminal
from missions.assembly.together import making_order
from missions.library.worlds import build_physics, build_world

D = TypeVar("D")


def deaf(reply: Reply) -> None:
    """Do nothing: the robot has no ears."""


class Simulation:
    """Virtual devices for some parts of a robot, each on a pseudo-terminal of its own, in one world.

    Without a ``world`` there is open floor, and nobody. ``answered`` is told who says what, and ``robot_hears`` what
    of that is said within earshot of the robot. ``parts`` are the devices by kind.
    """

    def __init__(
        self,
        robot: RobotConfig,
        chosen: frozenset[str],
        clock: Clock,
        *,
        world: WorldConfig | None = None,
        answered: Callable[[str, str], None] = ignore,
        seed: int = 0,
        listen: str = "",
    ) -> None:
        self._config = world
        self._world = None if world is None else build_world(world)
        self._answered = answered
        self.robot_hears: Callable[[Reply], None] = deaf
        self._answers: list[Timer] = []
        self._robot = robot
        self._clock = clock
        self.parts: dict[str, Plugged] = {}
        self.terminals: dict[str, Socket] = {}
        stage = Stage(
            clock,
            self._world,
            self.pose,
            physics=build_physics(PhysicsConfig() if world is None else world.physics),
            seed=seed,
            listen=listen,
            viewpoint=self.viewpoint,
            noise=NOISE if world is None else world.noise,
            parts=self.parts,
            keys={kind: section.keys for kind, section in robot.sections.items()},
        )
        for kind in making_order(robot, chosen):
            section = robot.sections[kind]
            if not section.driver.virtual:
                continue
            self.parts[kind] = plugged = resolved(section.driver.virtual)(section.keys, replace(stage, part=kind))
            if plugged.terminal is not None:
                self.terminals[kind] = plugged.terminal
            elif plugged.device is not None:
                self.terminals[kind] = Terminal(plugged.wire, plugged.device, clock)

    @property
    def ports(self) -> dict[str, str]:
        """Where each part is to be found."""
        return {part: terminal.path for part, terminal in self.terminals.items()}

    def device(self, cls: type[D]) -> D | None:
        """Return the virtual device of a class; None where there is none."""
        return next((each.device for each in self.parts.values() if isinstance(each.device, cls)), None)

    def open(self) -> None:
        """Plug everything in."""
        for terminal in self.terminals.values():
            terminal.open()
        if self._world is not None:
            self._expect(self._world.said(-1.0, math.inf))

    def close(self) -> None:
        """Unplug everything and remove the ports. Safe more than once."""
        for timer in self._answers:
            timer.cancel()
            timer.join()
        self._answers.clear()
        for terminal in self.terminals.values():
            terminal.close()

    def pose(self, time: float) -> Pose2D:
        """Return where the base truly is; where it starts, for one that is not there."""
        base = self.parts.get("base")
        if base is None or base.pose is None:
            return ORIGIN if self._world is None else self._world.start
        pose = base.pose
        return self._terminal("base").ask(lambda: pose(time))

    def viewpoint(self, time: float) -> Viewpoint:
        """Return where the camera truly is and looks: on the head, on the base."""
        looks = self._looks(time)
        camera = None if self._robot.camera is None else self._robot.camera.upright()
        return mounted(self.pose(time), looks.pan, looks.tilt, (0.0, 0.0, 1.0) if camera is None else camera.position)

    def _looks(self, time: float) -> HeadPose:
        """Return where the head truly looks, from the base; ahead, for one that is not there."""
        head = self.parts.get("head")
        if head is None or head.looks is None:
            return HeadPose(0.0, 0.0)
        looks = head.looks
        return self._terminal("head").ask(lambda: looks(time))

    def _terminal(self, kind: str) -> Socket:
        """Return the terminal of a part, or of the part on whose wire it sits."""
        owner = next(each for each in (kind, *self._robot.sections[kind].driver.needs) if each in self.terminals)
        return self.terminals[owner]

    def state(self) -> dict[str, object]:
        """Return what the devices truly do: the base in SI units, servos of the head in degrees, joints in radians."""
        now = self._clock.now()
        found = {}
        for kind, plugged in self.parts.items():
            if plugged.state is not None:
                found[kind] = self._terminal(kind).ask(partial(plugged.state, now))
        return found

    def hear(self, text: str) -> None:
        """Let the people hear what the robot says; what they answer is told in their own time."""
        if self._world is not None:
            now = self._clock.now()
            self._expect(self._world.hear(text, now, self._stand(now)))

    def _expect(self, replies: Iterable[Reply]) -> None:
        for reply in replies:
            timer = Timer(max(0.0, reply.when - self._clock.now()), self._spoken, (reply,))
            timer.daemon = True
            timer.start()
            self._answers.append(timer)

    def _spoken(self, reply: Reply) -> None:
        now = self._clock.now()
        self._answered(reply.who, reply.text)
        if self._world is not None and self._world.audible(reply.who, now, self._stand(now)):
            self.robot_hears(reply)

    def _stand(self, time: float) -> tuple[float, float]:
        pose = self.pose(time)
        return pose.x, pose.y

    def rendered(self, *, seed: int = 0, rate: float = 25.0) -> Camera:
        """Return a camera that sees the world from the head, ``rate`` times a second."""
        camera = self._robot.camera
        size = (640, 480) if camera is None else (camera.width, camera.height)
        view = math.radians(60) if camera is None else camera.field_of_view
        return RenderedCamera(
            World() if self._world is None else self._world,
            self.viewpoint,
            self._clock,
            rate=rate,
            size=size,
            field_of_view=view,
            noise=NOISE if self._config is None else self._config.noise,
            seed=seed,
        )

    def panned(self, camera: Camera) -> Camera:
        """Return ``camera``, which looks ahead, as if it sat on the simulated head."""
        return PannedCamera(camera, self.viewpoint)
