"""The robot's state as expressions read it: ``battery.percent``, ``face.seen``, ``base.bumper``.

What is not known is None, so that a comparison with it fails with a reason instead of being true by chance.
"""

from dataclasses import dataclass
from typing import TypeVar

from behaviours.robot import Robot
from drivers.api import BaseState, HeadPose, Reading
from drivers.clock import Clock
from perception.api import Face

T = TypeVar("T")

FRESH = 0.5
"""Seconds after which a face is not "seen" any more."""


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
    def distance(self) -> float | None:
        """How far away it is, in metres, guessed from its size."""
        return None if self._face is None else self._face.distance

    @property
    def bearing(self) -> float | None:
        """How far it is from the camera's axis, in radians, positive to the left."""
        return None if self._face is None else self._face.bearing

    def _fresh(self) -> list[Face]:
        sight = self.robot.sight_part
        oldest = self.clock.now() - FRESH
        return [] if sight is None else [face for face in sight.faces() if face.stamp >= oldest]

    @property
    def _face(self) -> Face | None:
        return next(iter(self._fresh()), None)


@dataclass(frozen=True)
class _OfBase:
    """What is read from the base's report."""

    robot: Robot

    @property
    def _state(self) -> BaseState | None:
        return None if self.robot.base_part is None else fresh(self.robot.base_part.state())


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


@dataclass(frozen=True)
class BatteryState(_OfBase):
    """The base's battery."""

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
        return None if self.robot.head_part is None else fresh(self.robot.head_part.pose())


def fresh(reading: Reading[T]) -> T | None:
    """Return what was measured, if it was lately."""
    return reading.value if reading.good else None


def state_of(robot: Robot, clock: Clock) -> dict[str, object]:
    """Return what expressions can read of ``robot``, by name (the names that the checker knows)."""
    return {
        "face": FaceState(robot, clock),
        "base": BasePart(robot),
        "battery": BatteryState(robot),
        "head": HeadState(robot),
    }
