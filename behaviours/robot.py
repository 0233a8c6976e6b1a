"""Robot as a leaf sees it: parts by name, behind the protocols of the drivers."""

from collections.abc import Iterator, Mapping
from dataclasses import field, replace
from typing import Any, TypeVar

from behaviours.joint_ranges import JointRanges
from behaviours.run import log
from behaviours.tracking.lag_estimator import LagEstimator
from drivers.api import Base, Head, Imu, Joints, Legs, Lights, Ranger, Ros2, Screen, Sounds, Voice
from drivers.api.fast_dataclass import dataclass
from drivers.api.kinds import CAPABILITIES, KINDS, PartKind
from drivers.errors import BadRequest
from perception.api import Hearing, Sight

Part = TypeVar("Part")


@dataclass(frozen=True, slots=True)
class ExtraPart:
    """Additional ``part`` of a ``kind`` that the robot already has; ``groups`` are the joint groups if it is an arm."""

    kind: str
    part: Any
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Robot:
    """Parts that a leaf may use. The ``..._part`` fields are None for missing parts; the properties never are.

    ``camera_position`` is (x, y, z) in metres from the middle of the base on the floor (axes of REP 103); the head
    turns about it. ``groups`` are the joint groups of the arm, such as ``left_arm``. ``lag`` estimates the command lag
    of the base and is shared by all leaves that turn the base. ``extra_parts`` are additional parts of a kind by name,
    such as ``lidar_mast``, a head without a camera. A leaf with ``on: lidar_mast`` sees that part as its ``head``.
    ``places`` are the named places of the map: x, y (m), heading (rad), frame.

    The checker ensures that a leaf's ``needs`` are there. So BadRequest from a property means that the leaf does not
    declare the part.
    """

    base_part: Base | None = None
    head_part: Head | None = None
    arm_part: Joints | None = None
    voice_part: Voice | None = None
    sight_part: Sight | None = None
    camera_position: tuple[float, float, float] = (0.0, 0.0, 1.0)
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    ranger_part: Ranger | None = None
    hearing_part: Hearing | None = None
    screen_part: Screen | None = None
    ros2_part: Ros2 | None = None
    imu_part: Imu | None = None
    lag: LagEstimator = field(default_factory=LagEstimator, compare=False)
    extra_parts: Mapping[str, ExtraPart] = field(default_factory=dict)
    places: Mapping[str, tuple[float, float, float, str]] = field(default_factory=dict)

    @property
    def base(self) -> Base:
        """Mobile base. Raises BadRequest if the robot has none, as all properties of parts do."""
        return _require(self.base_part, "base")

    @property
    def sounds(self) -> Sounds:
        """Sounder of the base."""
        return _require(self.base.sounds, "sounds")

    @property
    def lights(self) -> Lights:
        """Lights of the base."""
        return _require(self.base.lights, "lights")

    @property
    def legs(self) -> Legs:
        """Legs of the base."""
        return _require(self.base.legs, "legs")

    @property
    def head(self) -> Head:
        """Pan/tilt head that carries the camera."""
        return _require(self.head_part, "head")

    @property
    def arm(self) -> Joints:
        """Joints of the arm."""
        return _require(self.arm_part, "arm")

    @property
    def joint_ranges(self) -> JointRanges:
        """Joints and groups of the arm with their limits, including those of all additional arms."""
        others = {name: other for name, other in self.extra_parts.items() if other.kind == "arm"}
        arms = {name: JointRanges(other.part.limits, other.groups) for name, other in others.items()}
        return JointRanges(self.arm.limits, self.groups, arms)

    @property
    def ranger(self) -> Ranger:
        """Range finder; its part is called ``range``."""
        return _require(self.ranger_part, "range")

    @property
    def imu(self) -> Imu:
        """Inertial measurement unit."""
        return _require(self.imu_part, "imu")

    @property
    def voice(self) -> Voice:
        """Voice for speech and sounds."""
        return _require(self.voice_part, "voice")

    @property
    def sight(self) -> Sight:
        """Percepts of the camera."""
        return _require(self.sight_part, "camera")

    @property
    def hearing(self) -> Hearing:
        """Phrases that the microphone picks up."""
        return _require(self.hearing_part, "microphone")

    @property
    def screen(self) -> Screen:
        """Screen with the robot's face."""
        return _require(self.screen_part, "screen")

    @property
    def ros2(self) -> Ros2:
        """Client of ROS 2 nodes."""
        return _require(self.ros2_part, "ros2")

    @property
    def parts(self) -> frozenset[str]:
        """Names of the parts that the robot has."""
        return frozenset(name for name, _, part in _parts(self) if part is not None)

    @property
    def capabilities(self) -> frozenset[str]:
        """Names of the optional capabilities that the robot has; see ``drivers.api.kinds.CAPABILITIES``."""
        owners = {name: getattr(self, f"{KINDS[kind].field}_part") for name, kind in CAPABILITIES.items()}
        return frozenset(name for name, owner in owners.items() if getattr(owner, name, None) is not None)

    def with_named_parts(self, part_names: Mapping[str, str]) -> "Robot":
        """Return a view of the robot in which each kind resolves to the named part.

        The part that was the first of its kind is then in ``extra_parts``, under the name of the kind.
        """
        robot = self
        for kind, name in part_names.items():
            if name == kind and name not in robot.extra_parts:
                continue
            part, other = f"{KINDS[kind].field}_part", robot.extra_parts.get(name)
            first = ExtraPart(kind, getattr(robot, part), robot.groups if kind == "arm" else {})
            found: dict[str, Any] = {part: None if other is None else other.part}
            if first.part is not None:
                found["extra_parts"] = {kind: first, **robot.extra_parts}
            if kind == "arm" and other is not None:
                found["groups"] = other.groups
            robot = replace(robot, **found)
        return robot


def hold_still(robot: Robot, claims: frozenset[str]) -> None:
    """Make the actuators ``claims`` hold still: base and head stop, the arm keeps its position, the voice is silent.

    An exception of one part is logged and does not prevent the others from stopping.
    """
    for name, kind, part in _parts(robot):
        if (still := kind.hold_still) is None or part is None or name not in claims:
            continue
        try:
            still(part)
        except Exception:  # the next part must hold still all the same
            log.exception("%s could not be made to hold still", name)


def _parts(robot: Robot) -> Iterator[tuple[str, PartKind, Any]]:
    """Yield name, kind and part; the part is None if missing."""
    yield from ((kind.name, kind, getattr(robot, f"{kind.field}_part")) for kind in KINDS.values())
    yield from ((name, KINDS[other.kind], other.part) for name, other in robot.extra_parts.items())


def _require(part: Part | None, name: str) -> Part:
    if part is None:
        raise BadRequest(f"this robot has no {name}", hint=f"declare needs = frozenset({{'{name}'}}) in the leaf")
    return part
