"""The robot's state as expressions read it: ``battery.percent``, ``face.seen``, ``base.bumper``.

What nobody sees is None, so that a comparison with it fails with a reason instead of being true by chance. A part that
does not report raises SensorSilent, so that whatever asks is suspended.
"""

from collections.abc import Mapping
from math import radians
from typing import TypeVar

from behaviours.robot import Robot
from drivers.api import BaseState, HeadPose, RangeScan, Reading
from drivers.api.quick import dataclass
from drivers.clock import Clock
from drivers.errors import SensorSilent
from missions.executive.guard import BatteryWatch, Guard
from missions.language.values import Value
from perception.api import Face

T = TypeVar("T")

FRESH = 0.5
"""Seconds after which a face is not "seen" any more."""

AHEAD = radians(60)
"""Radians about straight ahead in which a range finder looks for what is ahead."""


@dataclass(frozen=True)
class FaceState:
    """The largest face in view."""

    robot: Robot
    clock: Clock

    @property
    def seen(self) -> bool:
        """True when a face was seen within the last half second."""
        return self._face is not None

    @property
    def count(self) -> int:
        """How many faces were seen within the last half second."""
        return len(self._fresh())

    @property
    def id(self) -> int | None:
        """The id of the largest face."""
        return None if self._face is None else self._face.id

    @property
    def name(self) -> str | None:
        """Whose it is: a name, `unknown` for a stranger, an empty text while that is not decided."""
        return None if self._face is None else self._face.name

    @property
    def undecided(self) -> bool:
        """True while a face is seen of which it is not decided whose it is."""
        return any(not face.name for face in self._fresh())

    @property
    def distance(self) -> float | None:
        """How far away it is, in metres, guessed from its size."""
        return None if self._face is None else self._face.distance

    @property
    def bearing(self) -> float | None:
        """How far it is from the camera's axis, in radians, positive to the left."""
        return None if self._face is None else self._face.bearing

    def _fresh(self) -> list[Face]:
        sight = self.robot.sight_part
        if sight is None:
            return []
        faces, looked, oldest = sight.faces(), sight.looked(), self.clock.now() - FRESH
        if looked is None or looked < oldest:
            raise SensorSilent("the camera does not report")
        return [face for face in faces if face.stamp >= oldest]

    @property
    def _face(self) -> Face | None:
        return next(iter(self._fresh()), None)


@dataclass(frozen=True)
class _OfBase:
    """What is read from the base's report."""

    robot: Robot

    @property
    def _state(self) -> BaseState | None:
        return None if self.robot.base_part is None else fresh(self.robot.base_part.state(), "base")


@dataclass(frozen=True)
class BasePart(_OfBase):
    """Where the base is, and what it feels."""

    @property
    def x(self) -> float | None:
        """Metres ahead of where it started."""
        return None if self._state is None else self._state.pose.x

    @property
    def y(self) -> float | None:
        """Metres to the left of where it started."""
        return None if self._state is None else self._state.pose.y

    @property
    def heading(self) -> float | None:
        """Radians since it started, positive to the left."""
        return None if self._state is None else self._state.pose.heading

    @property
    def reckoned(self) -> bool | None:
        """True where nothing measures how it moves: its place is dead reckoning, on which no condition may rest."""
        return None if self._state is None else self._state.reckoned

    @property
    def bumper(self) -> bool | None:
        """True while a bumper is pressed."""
        return None if self._state is None else bool(self._state.bumper)

    @property
    def cliff(self) -> bool | None:
        """True while a cliff sensor sees no floor."""
        return None if self._state is None else bool(self._state.cliff)

    @property
    def wheel_drop(self) -> bool | None:
        """True while a wheel hangs."""
        return None if self._state is None else bool(self._state.wheel_drop)

    @property
    def button(self) -> int | None:
        """The number of the button that is pressed, the lowest of several; none, while none is."""
        return None if self._state is None else min(self._state.buttons, default=None)

    @property
    def docked(self) -> bool | None:
        """True while it stands on the contacts of its dock."""
        return None if self._state is None else self._state.docked

    @property
    def stopped(self) -> bool | None:
        """True while it is stopped until somebody enables it."""
        return None if self.robot.base_part is None else bool(self.robot.base_part.latched)

    @property
    def driver(self) -> str | None:
        """Who commands it: `mission`, `teleop` or `safety`; an empty text while nobody does."""
        return None if self.robot.base_part is None else str(self.robot.base_part.steering().source or "")


@dataclass(frozen=True)
class BatteryState(_OfBase):
    """The base's battery."""

    watch: BatteryWatch | None = None

    @property
    def percent(self) -> float | None:
        """How full it is, 0..100."""
        return None if self._state is None else self._state.battery_percent

    @property
    def voltage(self) -> float | None:
        """In volts."""
        return None if self._state is None else self._state.battery_voltage

    @property
    def charging(self) -> bool | None:
        """True while it charges."""
        return None if self._state is None else self._state.charging

    @property
    def low(self) -> bool | None:
        """True when it is below what the robot file calls low, and was so two seconds ago."""
        return None if self._state is None or self.watch is None else self.watch.low

    @property
    def critical(self) -> bool | None:
        """True when it is below what the robot file calls critical, and was so two seconds ago: the mission ends."""
        return None if self._state is None or self.watch is None else self.watch.critical


@dataclass(frozen=True)
class HeadState:
    """Where the head looks."""

    robot: Robot

    @property
    def pan(self) -> float | None:
        """Radians, positive to the left."""
        return None if self._pose is None else self._pose.pan

    @property
    def tilt(self) -> float | None:
        """Radians, positive down."""
        return None if self._pose is None else self._pose.tilt

    @property
    def _pose(self) -> HeadPose | None:
        return None if self.robot.head_part is None else fresh(self.robot.head_part.pose(), "head")


@dataclass(frozen=True)
class RangeState:
    """What the range finder measures, from where it sits; as far as it can see, where nothing is nearer."""

    robot: Robot

    @property
    def nearest(self) -> float | None:
        """Metres to the nearest thing around."""
        return None if self._scan is None else min(self._scan.nearest(), self._scan.most)

    @property
    def ahead(self) -> float | None:
        """Metres to the nearest thing within 30 degrees left and right of straight ahead."""
        return None if self._scan is None else min(self._scan.nearest(0.0, AHEAD), self._scan.most)

    @property
    def _scan(self) -> RangeScan | None:
        return None if self.robot.ranger_part is None else fresh(self.robot.ranger_part.scan(), "range finder")


def fresh(reading: Reading[T], part: str) -> T:
    """Return what was measured lately. Raises SensorSilent where nothing was."""
    if reading.value is None or not reading.good:
        raise SensorSilent(f"the {part} does not report")
    return reading.value


def state_of(robot: Robot, clock: Clock, guard: Guard | None = None) -> dict[str, object]:
    """Return what expressions can read of ``robot``, by name (the names that the checker knows).

    Whether its battery is low is for the ``guard`` to say.
    """
    return {
        "face": FaceState(robot, clock),
        "base": BasePart(robot),
        "battery": BatteryState(robot, None if guard is None else guard.battery),
        "head": HeadState(robot),
        "range": RangeState(robot),
    }


PLACE = frozenset({"base.x", "base.y", "base.heading"})
"""What of a base is dead reckoning where nothing measures it."""


def unmeasured(condition: Value, scope: Mapping[str, object]) -> str:
    """Say what in a condition nothing measures, or nothing. Raises SensorSilent while the base does not report."""
    reads = () if condition.template is None else condition.template.reads
    place = next((read.dotted for read in reads if read.dotted in PLACE), "")
    base = scope.get("base")
    if place and isinstance(base, BasePart) and base.reckoned:
        return f"{place} is dead reckoning: this base measures nothing that a condition may rest on"
    return ""
