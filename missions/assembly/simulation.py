"""The simulated rest of a robot: virtual devices behind its ports, and what its camera would see from there."""

import math
from collections.abc import Callable, Iterable
from dataclasses import asdict
from threading import Timer

from config.head import HeadConfig, NeckConfig, NeckJointConfig
from config.robot import RangeConfig, RobotConfig
from config.world import NOISE, PhysicsConfig, WorldConfig
from drivers.api import Camera, Pose2D
from drivers.arduino.axis import STARTS
from drivers.clock import Clock
from drivers.sim.acts import Reply
from drivers.sim.panned import PannedCamera
from drivers.sim.rendered import RenderedCamera
from drivers.sim.scanner import looking
from drivers.sim.viewpoint import Viewpoint, mounted
from drivers.sim.wheels import Wheels
from drivers.sim.world import ORIGIN, World
from drivers.virtual.dynamixel import VirtualServoBus
from drivers.virtual.kobuki import VirtualKobuki
from drivers.virtual.rodney import ATTACHED, VirtualRodney
from drivers.virtual.rplidar import VirtualLidar
from drivers.virtual.servo import VirtualServo
from drivers.virtual.terminal import Terminal
from missions.assembly import parts
from missions.assembly.worlds import build_battery, build_world

WIRED = ("base", "head", "arm", "range")
"""The parts that sit on a serial wire."""


def unheard(who: str, text: str) -> None:
    """Do nothing: nobody listens to what people say."""


def deaf(reply: Reply) -> None:
    """Do nothing: the robot has no ears."""


class Simulation:
    """Virtual devices for some parts of a robot, each on a pseudo-terminal of its own, in one world.

    Without a ``world`` there is open floor, and nobody. ``answered`` is told who says what, and ``robot_hears`` what
    of that is said within earshot of the robot.
    """

    def __init__(
        self,
        robot: RobotConfig,
        chosen: frozenset[str],
        clock: Clock,
        *,
        world: WorldConfig | None = None,
        answered: Callable[[str, str], None] = unheard,
        tacho: bool = False,
        seed: int = 0,
    ) -> None:
        self._config = world
        self._world = None if world is None else build_world(world)
        self._answered = answered
        self.robot_hears: Callable[[Reply], None] = deaf
        self._answers: list[Timer] = []
        self.kobuki: VirtualKobuki | None = None
        self.rodney: VirtualRodney | None = None
        self.servos: VirtualServoBus | None = None
        self.lidar: VirtualLidar | None = None
        self._robot = robot
        self._clock = clock
        self.terminals: dict[str, Terminal] = {}
        if robot.base is not None and "base" in chosen:
            physics = PhysicsConfig() if world is None else world.physics
            start = None if self._world is None else self._world.start
            wheels = Wheels(dead_time=physics.lag, slip=physics.slip, pose=start)
            self.kobuki = VirtualKobuki(wheels=wheels, ground=self._world, battery=build_battery(physics))
            self.terminals["base"] = Terminal("kobuki", self.kobuki, clock)
        if isinstance(robot.head, HeadConfig) and "head" in chosen:
            self.rodney = VirtualRodney(
                baud=robot.head.baud, tacho=tacho, logs=not tacho, starts=STARTS if tacho else ATTACHED
            )
            self.terminals["head"] = Terminal("nano", self.rodney, clock)
        if robot.arm is not None and "arm" in chosen:
            joints = robot.arm.joints.values()
            servos = [VirtualServo(joint.id, model=joint.model, angle=joint.zero) for joint in joints]
            self.servos = VirtualServoBus(servos, robot.arm.baud)
            self.terminals["arm"] = Terminal("servos", self.servos, clock)
        if robot.range is not None and "range" in chosen:
            self.lidar = self._lidar(robot.range, seed)
            self.terminals["range"] = Terminal("rplidar", self.lidar, clock)

    def _lidar(self, config: RangeConfig, seed: int) -> VirtualLidar:
        """Return a range finder that sees the world from where the base truly is."""
        world = World() if self._world is None else self._world
        look = looking(world, parts.place(config), self.pose, height=config.position[2])
        return VirtualLidar(look, model=config.model, yaw=config.yaw, seed=seed)

    @property
    def ports(self) -> dict[str, str]:
        """Where each part is to be found."""
        return {part: terminal.path for part, terminal in self.terminals.items()}

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
        if self.kobuki is None:
            return ORIGIN if self._world is None else self._world.start
        kobuki = self.kobuki
        return self.terminals["base"].ask(lambda: kobuki.pose(time))

    def viewpoint(self, time: float) -> Viewpoint:
        """Return where the camera truly is and looks: on the head, on the base."""
        pose = self.pose(time)
        pan = tilt = 0.0
        head, rodney = self._robot.head, self.rodney
        if isinstance(head, HeadConfig) and rodney is not None:
            pan, tilt = self.terminals["head"].ask(
                lambda: (
                    parts.axis(head.pan).to_radians(rodney.angle(head.pan.index, time)),
                    parts.axis(head.tilt).to_radians(rodney.angle(head.tilt.index, time)),
                )
            )
        elif isinstance(head, NeckConfig) and self.servos is not None:
            pan, tilt = self.terminals["arm"].ask(lambda: (self._joint(head.pan), self._joint(head.tilt)))
        place = (0.0, 0.0, 1.0) if self._robot.camera is None else self._robot.camera.position
        return mounted(pose, pan, tilt, place)

    def _joint(self, axis: NeckJointConfig) -> float:
        """Return where an axis of the head is that is a joint of the arm, in radians."""
        if self._robot.arm is None or self.servos is None:
            return 0.0
        joint = self._robot.arm.joints[axis.joint]
        angle = self.servos.servo(joint.id).angle - joint.zero
        return (-angle if joint.reverse else angle) - axis.trim

    def state(self) -> dict[str, object]:
        """Return what the devices truly do: the base in SI units, servos of the head in degrees, joints in radians."""
        now = self._clock.now()
        found: dict[str, object] = {}
        if self.kobuki is not None:
            pose, velocity = self.pose(now), self.kobuki.body.velocity
            found["base"] = asdict(pose) | asdict(velocity)
        if self.rodney is not None:
            rodney = self.rodney
            found["head"] = self.terminals["head"].ask(lambda: [rodney.angle(index, now) for index in range(4)])
        if self.servos is not None and self._robot.arm is not None:
            servos = self.servos.servos  # one a joint, whatever ID somebody has given it by now
            found["arm"] = {name: servo.angle for name, servo in zip(self._robot.arm.joints, servos, strict=True)}
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
