"""From a robot file to a robot: real drivers, on the robot's own ports or on virtual devices."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

from behaviours.robot import Robot
from config.head import HeadConfig, NeckConfig
from config.robot import CameraConfig, MicrophoneConfig, RobotConfig
from config.world import WorldConfig
from drivers.api import Base, Camera, Device, Head, Joints, Report, Screen, Steered, Voice, unsteered
from drivers.clock import Clock
from drivers.errors import BadRequest
from missions.assembly import parts
from missions.assembly.assembled import Assembled
from missions.assembly.detectors import face_detector
from missions.assembly.duplex import HalfDuplex
from missions.assembly.face import LivelyScreen, screen
from missions.assembly.gallery import recogniser
from missions.assembly.hearing import Hearing, hearing, microphone
from missions.assembly.interests import Interests
from missions.assembly.lags import believed
from missions.assembly.simulated_hearing import TextHearing, simulated_hearing
from missions.assembly.simulation import Simulation
from missions.teleop.beside import Beside
from missions.teleop.pad import pad_at
from perception.api import Frame, Gaze, View
from perception.delay import Delay
from perception.eyes import Eyes, Vision, unwatched

PATIENCE = 0.005
"""Seconds that a servo's reply may be late."""

SIMULATED_PATIENCE = 0.1
"""The same for virtual servos, which share one interpreter with perception and the renderer."""


@dataclass(frozen=True, slots=True)
class Wishes:
    """What the caller asks for beyond the robot file.

    ``world`` is what a simulated robot stands in, None for the metal. ``camera`` is a source instead of the robot's
    camera, or of the rendered one. ``ports`` are ports by part instead of the robot file's. ``interests`` are
    what the mission looks for. ``pad`` is the node of a game pad that goes before the mission.
    """

    world: WorldConfig | None = None
    camera: str | None = None
    ports: Mapping[str, str] = field(default_factory=dict)
    seed: int = 0
    interests: Interests = field(default_factory=Interests)
    pad: str | None = None


@dataclass(frozen=True, slots=True)
class Audience:
    """Who is told: of a device's notices, of anything worth a tick, of what is said aloud, and of each percept.

    ``answered`` is told who in a simulated world has said which words, ``steered`` who commands the base, as that
    changes. ``watched`` gets each frame that was searched, and where the camera looked then.
    """

    report: Report
    changed: Callable[[], None]
    out: Callable[[str], None]
    seen: Callable[[View], None]
    answered: Callable[[str, str], None]
    steered: Steered = unsteered
    watched: Callable[[Frame, Gaze | None], None] = unwatched


def assemble(
    config: RobotConfig, chosen: frozenset[str], clock: Clock, wishes: Wishes, audience: Audience
) -> Assembled:
    """Put together the ``chosen`` parts of a robot. Opens nothing; a camera brings the head that carries it along."""
    chosen = with_carriers(config, chosen)
    simulation = None
    if wishes.world is not None:
        simulation = Simulation(config, chosen, clock, world=wishes.world, answered=audience.answered, seed=wishes.seed)
    ports = dict(wishes.ports) if simulation is None else {**simulation.ports, **wishes.ports}
    devices: dict[str, Device] = {}
    base = head = arm = ranger = sight = eyes = delay = None
    if config.base is not None and "base" in chosen:
        port = ports.get("base", config.base.port)
        devices["base"] = base = parts.base(
            config.base, clock, port=port, report=audience.report, changed=audience.changed, steered=audience.steered
        )
    if config.arm is not None and "arm" in chosen:
        arm = parts.arm(
            config.arm,
            clock,
            port=ports.get("arm", config.arm.port),
            patience=PATIENCE if simulation is None else SIMULATED_PATIENCE,
            report=audience.report,
        )
    if config.head is not None and "head" in chosen:
        devices["head"] = head = _head(config.head, arm, clock, ports, booted=bool(simulation), report=audience.report)
    if arm is not None:  # behind the head, which may lead its joints: so the head is also closed first
        devices["arm"] = arm
    if config.range is not None and "range" in chosen:
        port = ports.get("range", config.range.port)
        devices["range"] = ranger = parts.ranger(config.range, clock, port=port, report=audience.report)
    voice, hears, face = _manners(config, chosen, clock, simulation, wishes, audience)
    devices |= {device.name: device for device in (voice, hears, face) if device is not None}
    if config.camera is not None and "camera" in chosen:
        devices["camera"] = camera = _camera(config.camera, clock, simulation, wishes, audience.report)
        delay = Delay(config.camera.delay if simulation is not None else believed(config.name, config.camera.delay))
        sight = _vision(config.camera, camera, clock, lambda stamp: gaze(stamp, base, head), delay, wishes, audience)
        eyes = Eyes(camera, sight)
    if wishes.pad is not None and base is not None:
        devices["pad"] = Beside(base, partial(pad_at, wishes.pad, clock), clock, report=audience.report)
    robot = Robot(
        base_part=base,
        head_part=head,
        arm_part=arm,
        ranger_part=ranger,
        voice_part=voice,
        sight_part=sight,
        hearing_part=hears,
        screen_part=face,
        eye=parts.eye(config),
        groups={} if config.arm is None else config.arm.groups,
    )
    return Assembled(config.name, robot, devices, eyes, simulation, delay)


def _vision(
    config: CameraConfig,
    camera: Camera,
    clock: Clock,
    looked: Callable[[float], Gaze | None],
    delay: Delay,
    wishes: Wishes,
    audience: Audience,
) -> Vision:
    """Return what searches the pictures of ``camera``, which ``looked`` says where at a time."""
    world = wishes.world
    return parts.vision(
        looked,
        clock,
        interests=wishes.interests,
        detector=face_detector(config),
        lens=config if world is None else None,
        field_of_view=camera.field_of_view,
        report=audience.report,
        seen=audience.seen,
        watched=audience.watched,
        recogniser=recogniser(
            wishes.interests,
            audience.report,
            camera=config if world is None or wishes.camera is not None else None,
            drawn=() if world is None else world.people,
        ),
        delay=delay,
    )


def with_carriers(config: RobotConfig, chosen: frozenset[str]) -> frozenset[str]:
    """Return the parts that a robot has of the ``chosen``, and those that carry them."""
    if "camera" in chosen:
        chosen |= {"head"}
    if "head" in chosen and isinstance(config.head, NeckConfig):
        chosen |= {"arm"}
    return chosen & config.parts


def _head(
    config: HeadConfig | NeckConfig,
    arm: Joints | None,
    clock: Clock,
    ports: Mapping[str, str],
    *,
    booted: bool,
    report: Report,
) -> Head:
    if isinstance(config, HeadConfig):
        port, boot = ports.get("head", config.port), None if booted else config.boot
        return parts.head(config, clock, port=port, boot=boot, report=report)
    if arm is None:
        raise BadRequest("head: it is two joints of an arm that is not there", hint="add the arm to the parts")
    return parts.neck(config, arm, clock, report=report)


def _aloud(out: Callable[[str], None], hear: Callable[[str], None], text: str) -> None:
    """Say ``text``, where people hear it."""
    out(text)
    hear(text)


def _manners(
    config: RobotConfig,
    chosen: frozenset[str],
    clock: Clock,
    simulation: Simulation | None,
    wishes: Wishes,
    audience: Audience,
) -> tuple[Voice | None, Hearing | TextHearing | None, Screen | None]:
    """Return what the robot speaks with, its ears, which do not hear it speak, and its face, which moves with it."""
    voice = hears = face = None
    if config.voice is not None and "voice" in chosen:
        out = audience.out if simulation is None else partial(_aloud, audience.out, simulation.hear)
        spoken = config.voice if simulation is None else replace(config.voice, driver="print")
        voice = parts.voice(spoken, clock, out, report=audience.report, changed=audience.changed)
    if config.microphone is not None and "microphone" in chosen:
        hears = _hearing(config.microphone, voice, clock, simulation, wishes, audience)
    if config.screen is not None and "screen" in chosen:
        shown = screen(config.screen, clock, audience.out, audience.report)
        face = LivelyScreen(shown, voice, clock, audience.report)
    return voice, hears, face


def _hearing(
    config: MicrophoneConfig,
    voice: Voice | None,
    clock: Clock,
    simulation: Simulation | None,
    wishes: Wishes,
    audience: Audience,
) -> Hearing | TextHearing:
    phrases, report, changed = wishes.interests.phrases, audience.report, audience.changed
    if simulation is None or wishes.world is None:
        source, deaf = microphone(config, clock, report), HalfDuplex(voice, clock).deaf
        return hearing(config, source, phrases, clock, report=report, deaf=deaf, changed=changed)
    found, simulation.robot_hears = simulated_hearing(
        config, wishes.world, phrases, clock, voice=voice, seed=wishes.seed, report=report, changed=changed
    )
    return found


def _camera(
    config: CameraConfig, clock: Clock, simulation: Simulation | None, wishes: Wishes, report: Report
) -> Camera:
    source = wishes.camera
    if simulation is not None and source is None:
        return simulation.rendered(seed=wishes.seed)
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
