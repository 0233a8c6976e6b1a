"""The robot as a leaf sees it: its parts by name, behind the protocols of the drivers."""

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
    """One more ``part`` of a ``kind``, under a name of its own; ``groups`` as those of a robot's arm."""

    kind: str
    part: Any
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Robot:
    """The parts that a leaf may use; what this robot lacks is None. Leaves use the properties, which never are.

    ``camera_position`` is where the camera sits: (x, y, z) in metres from the middle of the base on the floor, with the axes of REP
    103. The head turns about it. ``groups`` are joints of the arm that go by one name, such as ``left_arm``. ``lag`` is
    how long the base takes to begin what it is told: all that turn it learn it together. ``extra_parts`` are further parts
    of a kind by their own names, such as ``lidar_mast``, a head without a camera: a leaf that is told to turn that one
    sees it as its ``head``.
    ``places`` are those of its map by name: x, y (m), heading (rad), and the frame that they are in.

    The checker has made sure that a leaf's ``needs`` are there, so BadRequest from a property means that the leaf
    forgot to declare one.
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
        """The base."""
        return _require(self.base_part, "base")

    @property
    def sounds(self) -> Sounds:
        """The sounder of the base."""
        return _require(self.base.sounds, "sounds")

    @property
    def lights(self) -> Lights:
        """The lights of the base."""
        return _require(self.base.lights, "lights")

    @property
    def legs(self) -> Legs:
        """The legs of the base."""
        return _require(self.base.legs, "legs")

    @property
    def head(self) -> Head:
        """The head."""
        return _require(self.head_part, "head")

    @property
    def arm(self) -> Joints:
        """The arm's joints."""
        return _require(self.arm_part, "arm")

    @property
    def joint_ranges(self) -> JointRanges:
        """The arm's joints by name and group, and how far and fast they go; and those of its other arms."""
        others = {name: other for name, other in self.extra_parts.items() if other.kind == "arm"}
        arms = {name: JointRanges(other.part.limits, other.groups) for name, other in others.items()}
        return JointRanges(self.arm.limits, self.groups, arms)

    @property
    def ranger(self) -> Ranger:
        """The range finder; its part is called ``range``."""
        return _require(self.ranger_part, "range")

    @property
    def imu(self) -> Imu:
        """What feels how the robot leans."""
        return _require(self.imu_part, "imu")

    @property
    def voice(self) -> Voice:
        """The voice."""
        return _require(self.voice_part, "voice")

    @property
    def sight(self) -> Sight:
        """What the camera sees."""
        return _require(self.sight_part, "camera")

    @property
    def hearing(self) -> Hearing:
        """What the microphone hears."""
        return _require(self.hearing_part, "microphone")

    @property
    def screen(self) -> Screen:
        """The screen with the robot's face."""
        return _require(self.screen_part, "screen")

    @property
    def ros2(self) -> Ros2:
        """The nodes of ROS 2."""
        return _require(self.ros2_part, "ros2")

    @property
    def parts(self) -> frozenset[str]:
        """The names of the parts that are there."""
        return frozenset(name for name, _, part in _parts(self) if part is not None)

    @property
    def capabilities(self) -> frozenset[str]:
        """The names of the optional capabilities that are there; see ``drivers.api.kinds.CAPABILITIES``."""
        owners = {name: getattr(self, f"{KINDS[kind].field}_part") for name, kind in CAPABILITIES.items()}
        return frozenset(name for name, owner in owners.items() if getattr(owner, name, None) is not None)

    def with_named_parts(self, part_names: Mapping[str, str]) -> "Robot":
        """Return the robot as who means these parts sees it, each named by its kind: that one is its only one.

        The first of the kind is then among the ``extra_parts``, by the name of its kind.
        """
        robot = self
        for kind, name in part_names.items():
            if name == kind and name not in robot.extra_parts:
                continue
            part, other = f"{KINDS[kind].field}_part", robot.extra_parts.get(name)
            first = ExtraPart(kind, getattr(robot, part), robot.groups if kind == "arm" else {})
            found: dict[str, Any] = {part: None if other is None else other.part}
            if first.part is not None:
                found["others"] = {kind: first, **robot.extra_parts}
            if kind == "arm" and other is not None:
                found["groups"] = other.groups
            robot = replace(robot, **found)
        return robot


def hold_still(robot: Robot, claims: frozenset[str]) -> None:
    """Make the named actuators hold still: base and head stopped, arm stiff where it is, voice silent.

    Each for itself, whatever goes wrong with another; that is told in the log.
    """
    for name, kind, part in _parts(robot):
        if (still := kind.hold_still) is None or part is None or name not in claims:
            continue
        try:
            still(part)
        except Exception:  # the next part must hold still all the same
            log.exception("%s could not be made to hold still", name)


def _parts(robot: Robot) -> Iterator[tuple[str, PartKind, Any]]:
    """Yield each part with its name and kind; None for one that is not there."""
    yield from ((kind.name, kind, getattr(robot, f"{kind.field}_part")) for kind in KINDS.values())
    yield from ((name, KINDS[other.kind], other.part) for name, other in robot.extra_parts.items())


def _require(part: Part | None, name: str) -> Part:
    if part is None:
        raise BadRequest(f"this robot has no {name}", hint=f"declare needs = frozenset({{'{name}'}}) in the leaf")
    return part
