"""From a robot file to a robot: real drivers, on the robot's own ports or on virtual devices."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from behaviours.robot import Robot
from config.robot import CameraConfig, RobotConfig
from config.world import WorldConfig
from drivers.api import Base, Camera, Device, Head, Report
from drivers.clock import Clock
from missions.assembly import parts
from missions.assembly.assembled import Assembled
from missions.assembly.simulation import Simulation
from perception.api import Face, Gaze

PATIENCE = 0.005
"""Seconds that a servo's reply may be late."""

SIMULATED_PATIENCE = 0.1
"""The same for virtual servos, which share one interpreter with perception and the renderer."""


@dataclass(frozen=True, slots=True)
class Wishes:
    """What the caller asks for beyond the robot file.

    ``world`` is what a simulated robot stands in, None for the metal. ``camera`` is a source instead of the robot's
    camera, or of the rendered one. ``ports`` are ports by part instead of the robot file's.
    """

    world: WorldConfig | None = None
    camera: str | None = None
    ports: Mapping[str, str] = field(default_factory=dict)
    seed: int = 0


@dataclass(frozen=True, slots=True)
class Ears:
    """Who is told: of a device's notices, of anything worth a tick, of what is said aloud, and of each percept."""

    report: Report
    changed: Callable[[], None]
    out: Callable[[str], None]
    seen: Callable[[float, tuple[Face, ...]], None]


def assemble(config: RobotConfig, chosen: frozenset[str], clock: Clock, wishes: Wishes, ears: Ears) -> Assembled:
    """Put together the ``chosen`` parts of a robot. Opens nothing; a camera brings the head that carries it along."""
    if "camera" in chosen:
        chosen |= {"head"}
    chosen &= config.parts
    simulation = None if wishes.world is None else Simulation(config, chosen, clock)
    ports = dict(wishes.ports) if simulation is None else {**simulation.ports, **wishes.ports}
    devices: dict[str, Device] = {}
    base = head = arm = voice = sight = eyes = None
    if config.base is not None and "base" in chosen:
        port = ports.get("base", config.base.port)
        devices["base"] = base = parts.base(config.base, clock, port=port, report=ears.report, changed=ears.changed)
    if config.head is not None and "head" in chosen:
        port, boot = ports.get("head", config.head.port), 0.0 if simulation else config.head.boot
        devices["head"] = head = parts.head(config.head, clock, port=port, boot=boot, report=ears.report)
    if config.arm is not None and "arm" in chosen:
        port = ports.get("arm", config.arm.port)
        devices["arm"] = arm = parts.arm(
            config.arm,
            clock,
            port=port,
            patience=PATIENCE if simulation is None else SIMULATED_PATIENCE,
            report=ears.report,
        )
    if config.voice is not None and "voice" in chosen:
        driver = "print" if simulation else config.voice.driver
        devices["voice"] = voice = parts.voice(driver, clock, ears.out, report=ears.report, changed=ears.changed)
    if config.camera is not None and "camera" in chosen:
        devices["camera"] = camera = _camera(config.camera, clock, simulation, wishes, ears.report)
        sight = eyes = parts.eyes(
            camera, lambda stamp: gaze(stamp, base, head), clock, report=ears.report, seen=ears.seen
        )
    robot = Robot(base_part=base, head_part=head, arm_part=arm, voice_part=voice, sight_part=sight)
    return Assembled(config.name, robot, devices, eyes, simulation)


def _camera(
    config: CameraConfig, clock: Clock, simulation: Simulation | None, wishes: Wishes, report: Report
) -> Camera:
    source = wishes.camera
    if simulation is not None and wishes.world is not None and source is None:
        return simulation.rendered(wishes.world, seed=wishes.seed)
    camera = parts.camera(config, clock, source=config.source if source is None else source, report=report)
    # A simulated head cannot turn a real camera, so its picture is turned instead.
    return camera if simulation is None else simulation.panned(camera)


def gaze(stamp: float, base: Base | None, head: Head | None) -> Gaze:
    """Return which way the camera looked at ``stamp``, in the odometry frame; straight ahead as far as unknown."""
    heading = base.heading_at(stamp) if base is not None else None
    pose = head.pose_at(stamp) if head is not None else None
    yaw = (heading or 0.0) + (pose.pan if pose is not None else 0.0)
    pitch = pose.tilt if pose is not None else 0.0
    return Gaze(yaw, pitch)
