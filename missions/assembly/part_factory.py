"""Makes the parts of a robot one after another, on hardware, as virtual devices or as twins.

Each driver declares the parts that it requires, such as the range finder of a base; those are made before it.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import field
from typing import TYPE_CHECKING, Any, Protocol, cast

from behaviours.robot import ExtraPart, Robot
from config.robot import RobotConfig, Section
from drivers.api import (
    Base,
    Device,
    Guardable,
    Head,
    Imu,
    Ranger,
    StatusCallback,
    SteeringCallback,
    WitnessedBase,
    ignore,
)
from drivers.api.driver import resolve_name
from drivers.api.fast_dataclass import dataclass
from drivers.api.kinds import KINDS
from drivers.api.sections import ArmKeys
from drivers.clock import Clock, SystemClock
from drivers.errors import BadRequest
from drivers.extras import extra_hint
from missions.library.import_trial import error_text, find_name_problem
from missions.library.interests import Interests
from perception.api import Frame, Gaze, View

if TYPE_CHECKING:
    from config.world import WorldConfig


@dataclass(frozen=True, slots=True)
class Overrides:
    """Settings of a run that override the robot file.

    ``world`` is the world of a simulated robot, None on hardware. ``camera`` is a source (device or file) that replaces
    the robot's camera, or in a simulation the rendered picture. ``ports`` are device files by part. ``interests`` are
    the detectors and phrases that the mission needs.
    """

    world: "WorldConfig | None" = None
    camera: str | None = None
    ports: Mapping[str, str] = field(default_factory=dict)
    seed: int = 0
    interests: Interests = field(default_factory=Interests)

    def clock(self) -> Clock:
        """Return a new clock in real time; with a world, one that waits for virtual devices."""
        if self.world is None:
            return SystemClock()
        from drivers.virtual.patient_clock import PatientClock  # noqa: PLC0415 - the metal imports no simulation

        return PatientClock()


@dataclass(frozen=True, slots=True)
class Hooks:
    """Callbacks of a robot's devices.

    ``report`` gets device statuses; ``on_change`` is called when new input should cause a tick; ``print_line`` prints
    speech; ``on_view`` gets percepts; ``on_answer`` gets name and text of people who speak in a simulated world;
    ``on_steering`` gets changes of the source that controls the base; ``on_frame`` gets each searched frame with the
    camera's direction.
    """

    report: StatusCallback
    on_change: Callable[[], None]
    print_line: Callable[[str], None]
    on_view: Callable[[View], None]
    on_answer: Callable[[str, str], None]
    on_steering: SteeringCallback = ignore
    on_frame: Callable[[Frame, Gaze | None], None] = ignore


class PartFactory(Protocol):
    """Factory of a robot's parts: on hardware or virtual devices, or in simulated time."""

    def make(self, part: str, section: Section, devices: Mapping[str, Any]) -> tuple[Device, object]:
        """Return the device of a part, and the object that leaves use, which is usually the same."""
        ...


def make_parts(config: RobotConfig, chosen: frozenset[str], factory: PartFactory) -> tuple[Robot, dict[str, Device]]:
    """Return the robot of the ``chosen`` parts as leaves see it, and its devices in the order in which they open."""
    devices: dict[str, Device] = {}
    leaf_parts: dict[str, object] = {}
    for part in order_parts(config, chosen):
        devices[part], leaf_parts[part] = factory.make(part, config.sections[part], devices)
    parts: Mapping[str, object] = devices
    base, ranger = parts.get("base"), parts.get("range")
    if config.has_range_guard and config.range is not None and isinstance(base, Guardable) and ranger is not None:
        base.guard_by(cast("Ranger", ranger), config.range.blind)
    if isinstance(base, WitnessedBase) and {"range", "imu"} & parts.keys():
        base.compare_with(ranger=cast("Ranger | None", ranger), imu=cast("Imu | None", parts.get("imu")))
    opened = sorted(devices, key=lambda part: (list(KINDS).index(config.kind_of(part).name), part not in KINDS))
    return robot_of_parts(config, leaf_parts), {part: devices[part] for part in opened}


def robot_of_parts(config: RobotConfig, parts: Mapping[str, object]) -> Robot:
    """Return the robot that leaves see, from its parts by name."""
    fields: dict[str, Any] = {f"{KINDS[kind].field}_part": part for kind, part in parts.items() if kind in KINDS}
    others = {
        name: ExtraPart(kind, parts[name], joint_groups(config, name))
        for name, kind in config.extra_parts.items()
        if name in parts
    }
    return Robot(
        **fields,
        extra_parts=others,
        camera_position=camera_position(config),
        groups=joint_groups(config),
        places=_map_places(config),
    )


def _map_places(config: RobotConfig) -> Mapping[str, tuple[float, float, float, str]]:
    """Return the places of a robot's map: x and y (m), heading (rad), and frame; empty without ROS 2."""
    if "ros2" not in config.sections:
        return {}
    from missions.library.folders import places_of  # noqa: PLC0415 - a robot without ROS 2 knows no map

    return {name: (it.x, it.y, it.heading, it.frame) for name, it in places_of(config).items()}


def joint_groups(config: RobotConfig, part: str = "arm") -> Mapping[str, tuple[str, ...]]:
    """Return the joint groups of an arm; empty for a part that is not an arm."""
    section = config.sections.get(part)
    return section.keys.groups if section is not None and isinstance(section.keys, ArmKeys) else {}


def camera_position(config: RobotConfig) -> tuple[float, float, float]:
    """Return the position of the camera on the robot (x, y, z in m); without a camera, 1 m above the floor."""
    return (0.0, 0.0, 1.0) if config.camera is None else config.camera.position


def resolve_maker(name: str, section: Section, what: str) -> Callable[..., Any]:
    """Return the function with the dotted ``name`` that makes a device, twin or virtual device (``what``, for errors).

    Raises BadRequest if the driver of ``section`` does not declare one, if the name is wrong, or if a package that the
    driver needs is not installed.
    """
    driver = section.driver
    part = f"{section.part}: the driver '{driver.name}'"
    if not name:
        raise BadRequest(f"{part} has no {what}", hint="its author can declare one: docs/drivers.md")
    outside = not name.startswith("drivers.")
    if outside and (problem := find_name_problem(name)):
        raise BadRequest(f"{part} has a wrong {what}, {name}: {problem.message}", hint="tell its author")
    try:
        found: Callable[..., Any] = resolve_name(name)
    except Exception as error:
        if isinstance(error, ModuleNotFoundError) and (install := extra_hint(driver.extra)):
            raise BadRequest(f"{part} needs the package '{error.name}'", hint=install) from error
        raise BadRequest(f"{part} has a wrong {what}, {name}: {error_text(error)}", hint="tell its author") from error
    return found


def gaze(stamp: float, base: Base | None, head: Head | None) -> Gaze:
    """Return the direction of the camera at ``stamp`` in the odometry frame; straight ahead if unknown."""
    heading = base.heading_at(stamp) if base is not None else None
    pose = head.pose_at(stamp) if head is not None else None
    yaw = (heading or 0.0) + (pose.pan if pose is not None else 0.0)
    pitch = pose.tilt if pose is not None else 0.0
    return Gaze(yaw, pitch)


def with_carriers(config: RobotConfig, chosen: frozenset[str]) -> frozenset[str]:
    """Return the ``chosen`` parts and the parts that they need.

    A camera needs the head that carries it; a base with a range guard needs the range finder.
    """
    if "camera" in chosen:
        chosen |= {"head"}
    if "base" in chosen and config.has_range_guard:
        chosen |= {"range"}
    chosen &= config.parts
    return chosen | {need for kind in chosen for need in config.sections[kind].driver.needs if need in config.parts}


def order_parts(config: RobotConfig, chosen: frozenset[str]) -> Iterator[str]:
    """Yield the ``chosen`` parts, each after the parts that its driver or its kind needs first."""
    done: set[str] = set()

    def make(part: str) -> Iterator[str]:
        if part in done or part not in chosen or part not in config.sections:
            return
        done.add(part)
        for before in (*config.sections[part].driver.needs, *config.kind_of(part).made_after):
            yield from make(before)
        yield part

    for part in (*KINDS, *sorted(config.parts.difference(KINDS))):
        yield from make(part)
