"""From a robot file's sections to drivers: each built of plain values, each on whatever port it is given."""

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Literal

from config.arm import ArmConfig, JointConfig
from config.away import AwayConfig
from config.colours import COLOURS
from config.head import HeadConfig, NeckConfig, NeckJointConfig, ServoConfig
from config.robot import BaseConfig, CameraConfig, RangeConfig, RobotConfig, VoiceConfig
from drivers.api import Away, Camera, Joints, Manner, Notice, Reflexes, Report, Steered, Voice, unsteered
from drivers.arduino.axis import ServoAxis
from drivers.arduino.board import Board
from drivers.arduino.driver import ArduinoHead
from drivers.arduino.memory import Memory
from drivers.camera.choose import open_source
from drivers.clock import Clock
from drivers.dynamixel.bus import Bus
from drivers.dynamixel.driver import DynamixelJoints
from drivers.dynamixel.head import DynamixelHead
from drivers.dynamixel.joint import JointSpec
from drivers.joints_head import JointAxis
from drivers.kobuki.driver import KobukiBase
from drivers.link import Link
from drivers.rplidar.driver import GATHER, RPLidar
from drivers.voice.choose import Wish, make_voice
from missions.assembly.interests import Interests
from missions.folders import state_folder
from perception.api import Face, Frame, Gaze, View
from perception.change import MotionSense
from perception.delay import Delay
from perception.eyes import Vision, unwatched
from perception.finder import FaceDetector, FaceFinder
from perception.identity import NamedFaces, Recogniser
from perception.markers import MarkerSense
from perception.senses import FaceSense, Sense, Senses
from perception.things import ThingSense
from perception.tracks import Tracker


def base(
    config: BaseConfig,
    clock: Clock,
    *,
    port: str,
    report: Report,
    changed: Callable[[], None],
    steered: Steered = unsteered,
) -> KobukiBase:
    """Return the Kobuki's driver."""
    return KobukiBase(
        Link("base", port, config.baud, report=report),
        clock,
        max_linear=config.max_speed,
        max_angular=config.max_turn,
        linear_acceleration=config.acceleration,
        angular_acceleration=config.turn_acceleration,
        reflexes=reflexes(config),
        away=away(config.away),
        report=report,
        changed=changed,
        steered=steered,
    )


def reflexes(config: BaseConfig) -> Reflexes:
    """Return what the base does by itself."""
    return Reflexes(**asdict(config.reflexes))


def away(config: AwayConfig) -> Away:
    """Return what a part that moves does when it is back."""
    return Away(decide=config.decide, latch=config.latch)


def ranger(config: RangeConfig, clock: Clock, *, port: str, report: Report) -> RPLidar:
    """Return the driver of the range finder."""
    link = Link("range", port, config.baud, gather=GATHER, report=report)
    return RPLidar(link, clock, model=config.model, place=place(config), blind=config.blind, report=report)


def place(config: RangeConfig) -> tuple[float, float, float]:
    """Return where a range finder sits on the base: x and y in metres, and its yaw in radians."""
    return (*config.position[:2], config.yaw)


def head(config: HeadConfig, clock: Clock, *, port: str, boot: float | None, report: Report) -> ArduinoHead:
    """Return the driver of a Rodney head; ``boot`` as the robot file says, None for a virtual one."""
    board = Board(
        Link("head", port, config.baud, report=report),
        clock,
        boot_delay=boot or 0.0,
        report=report,
        away=away(config.away),
        remembered=None if boot is None else Memory(state_folder(), port),
    )
    return ArduinoHead(
        board,
        clock,
        pan=axis(config.pan),
        tilt=axis(config.tilt),
        speed=config.speed,
        acceleration=config.acceleration,
    )


def axis(config: ServoConfig) -> ServoAxis:
    """Return one servo of the head."""
    return ServoAxis(config.index, config.lower, config.upper, flip=config.flip, trim=config.trim, start=config.start)


def neck(config: NeckConfig, joints: Joints, clock: Clock, *, report: Report) -> DynamixelHead:
    """Return the driver of a head that is two of the arm's ``joints``; the arm is opened and closed besides."""
    return DynamixelHead(
        joints,
        clock,
        pan=joint_axis(config.pan),
        tilt=joint_axis(config.tilt),
        speed=config.speed,
        acceleration=config.acceleration,
        report=report,
    )


def joint_axis(config: NeckJointConfig) -> JointAxis:
    """Return one joint of a neck."""
    return JointAxis(config.joint, config.lower, config.upper, trim=config.trim)


def arm(config: ArmConfig, clock: Clock, *, port: str, patience: float, report: Report) -> DynamixelJoints:
    """Return the driver of the arm's servos; ``patience`` is how long (s) a reply may be late, beside its wire time."""
    bus = Bus(port, clock, baud=config.baud, name="arm", patience=patience)
    return DynamixelJoints(
        bus, joints(config), clock, rate=config.rate, at_rest=at_rest(config), away=away(config.away), report=report
    )


def joints(config: ArmConfig) -> dict[str, JointSpec]:
    """Return the joints of the arm, by name."""
    return {name: _joint(joint) for name, joint in config.joints.items()}


def at_rest(config: ArmConfig) -> Literal["hold", "relax"]:
    """Return what rest means for the arm."""
    return "relax" if config.at_end == "relax" else "hold"


def _joint(config: JointConfig) -> JointSpec:
    return JointSpec(
        config.id,
        model=config.model,
        zero=config.zero,
        direction=-1 if config.reverse else 1,
        lower=config.lower,
        upper=config.upper,
        speed=config.speed,
        torque_limit=config.torque,
    )


def eye(config: RobotConfig) -> tuple[float, float, float]:
    """Return where the camera sits (m, robot's frame), or would, on a robot that has none."""
    return (0.0, 0.0, 1.0) if config.camera is None else config.camera.position


def camera(config: CameraConfig, clock: Clock, *, source: str, report: Report) -> Camera:
    """Return the camera on ``source``: an index, a device, a file, a URL or a folder."""
    size = config.width, config.height
    return open_source(source, clock, field_of_view=config.field_of_view, size=size, report=report)


def vision(
    gaze: Callable[[float], Gaze | None],
    clock: Clock,
    *,
    interests: Interests,
    detector: FaceDetector,
    field_of_view: float,
    lens: CameraConfig | None,
    report: Report,
    seen: Callable[[View], None],
    watched: Callable[[Frame, Gaze | None], None] = unwatched,
    recogniser: Recogniser | None = None,
    delay: Delay | None = None,
) -> Vision:
    """Return what searches the pictures of a camera for what somebody is interested in; ``detector`` finds faces.

    ``lens`` is what calibration found of it, None for an ideal one. ``recogniser`` puts names on the faces. ``delay``
    is how late it stamps its pictures, to be learnt.
    """
    faces: Sense[Face] = FaceSense(FaceFinder(detector), Tracker())
    senses = Senses(
        faces=(faces if recogniser is None else NamedFaces(faces, recogniser)) if interests.faces else None,
        things=ThingSense(interests.wanted, COLOURS) if interests.wanted else None,
        markers=None if interests.markers is None else MarkerSense(interests.markers),
        scene=MotionSense() if interests.motion else None,
    )
    return Vision(
        gaze,
        field_of_view=field_of_view,
        centre=(0.5, 0.5) if lens is None else lens.centre,
        distortion=() if lens is None else lens.distortion,
        senses=senses,
        now=clock.now,
        delay=delay,
        on_view=seen,
        on_frame=watched,
        on_trouble=lambda error: report(Notice("camera", "fault", f"a picture could not be searched: {error}")),
    )


def voice(
    config: VoiceConfig, clock: Clock, out: Callable[[str], None], *, report: Report, changed: Callable[[], None]
) -> Voice:
    """Return the voice; one that cannot speak here prints its words."""
    model = str(Path(config.model).expanduser().absolute()) if config.model else ""
    wish = Wish(config.driver, manner(config), config.volume, config.device, model, config.command)
    return make_voice(wish, clock, out, report=report, changed=changed)


def manner(config: VoiceConfig) -> Manner:
    """Return how a robot speaks, unless its mission says otherwise."""
    return Manner(config.voice, config.speed, config.language)
