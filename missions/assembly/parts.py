"""From a robot file's sections to drivers: each built of plain values, each on whatever port it is given."""

from collections.abc import Callable
from typing import Literal

from config.robot import ArmConfig, BaseConfig, CameraConfig, HeadConfig, JointConfig, ServoConfig
from drivers.api import Camera, Notice, Report, Voice
from drivers.arduino.axis import ServoAxis
from drivers.arduino.driver import ArduinoHead
from drivers.camera.choose import open_source
from drivers.clock import Clock
from drivers.dynamixel.bus import Bus
from drivers.dynamixel.driver import DynamixelJoints
from drivers.dynamixel.joint import JointSpec
from drivers.kobuki.driver import KobukiBase
from drivers.link import Link
from drivers.voice.printed import PrintedVoice
from drivers.voice.speaker import Speaker
from drivers.voice.synthesiser import find_synthesiser
from perception.api import Face, Gaze
from perception.eyes import Eyes
from perception.faces import HaarFaces
from perception.finder import FaceFinder
from perception.tracks import Tracker


def base(config: BaseConfig, clock: Clock, *, port: str, report: Report, changed: Callable[[], None]) -> KobukiBase:
    """Return the Kobuki's driver."""
    return KobukiBase(
        Link("base", port, config.baud, report=report),
        clock,
        max_linear=config.max_speed,
        max_angular=config.max_turn,
        linear_acceleration=config.acceleration,
        angular_acceleration=config.turn_acceleration,
        report=report,
        changed=changed,
    )


def head(config: HeadConfig, clock: Clock, *, port: str, boot: float, report: Report) -> ArduinoHead:
    """Return the driver of a Rodney head; ``boot`` as the robot file says, 0 for a virtual one."""
    return ArduinoHead(
        Link("head", port, config.baud, report=report),
        clock,
        pan=axis(config.pan),
        tilt=axis(config.tilt),
        speed=config.speed,
        boot_delay=boot,
        report=report,
    )


def axis(config: ServoConfig) -> ServoAxis:
    """Return one servo of the head."""
    return ServoAxis(config.index, config.lower, config.upper, flip=config.flip, trim=config.trim)


def arm(config: ArmConfig, clock: Clock, *, port: str, patience: float, report: Report) -> DynamixelJoints:
    """Return the driver of the arm's servos; ``patience`` is how long (s) a reply may be late, beside its wire time."""
    at_rest: Literal["hold", "relax"] = "relax" if config.at_end == "relax" else "hold"
    joints = {name: _joint(joint) for name, joint in config.joints.items()}
    return DynamixelJoints(
        Bus(port, clock, baud=config.baud, name="arm", patience=patience), joints, clock, at_rest=at_rest, report=report
    )


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


def camera(config: CameraConfig, clock: Clock, *, source: str, report: Report) -> Camera:
    """Return the camera on ``source``: an index, a device, a file, a URL or a folder."""
    size = config.width, config.height
    return open_source(source, clock, field_of_view=config.field_of_view, size=size, report=report)


def eyes(
    source: Camera,
    gaze: Callable[[float], Gaze | None],
    clock: Clock,
    *,
    report: Report,
    seen: Callable[[float, tuple[Face, ...]], None],
) -> Eyes:
    """Return the eyes that look through a camera for faces."""
    return Eyes(
        source,
        gaze,
        field_of_view=source.field_of_view,
        finder=FaceFinder(HaarFaces()),
        tracker=Tracker(),
        now=clock.now,
        on_percept=seen,
        on_trouble=lambda error: report(Notice("camera", "fault", f"a picture could not be searched: {error}")),
    )


def voice(
    driver: str, clock: Clock, out: Callable[[str], None], *, report: Report, changed: Callable[[], None]
) -> Voice:
    """Return a voice: a synthesiser where one is installed and ``driver`` is ``auto``, else printed words."""
    found = find_synthesiser() if driver == "auto" else None
    if found is None:
        return PrintedVoice(clock, out, changed=changed)
    return Speaker(found, out, report=report, changed=changed)
