"""Parts that only sense: the camera, the microphone, the range finder (a turn is one value), and the attitude (IMU)."""

from collections.abc import Mapping, Sequence
from math import inf, tau
from typing import Protocol, runtime_checkable

from drivers.api.device import Device, Reading
from drivers.api.fast_dataclass import dataclass
from drivers.api.marks import fixed
from drivers.api.measures import Angles, Image, Ranges, Samples


@dataclass(frozen=True, slots=True, eq=False)
class CameraFrame:
    """One picture, when it was taken (driver's clock), and its number since the camera was opened, from 0."""

    image: Image
    stamp: float
    number: int


class Camera(Device, Protocol):
    """A source of pictures."""

    @property
    def field_of_view(self) -> float:
        """The horizontal angle of view in radians."""
        ...

    def read(self, timeout: float) -> CameraFrame | None:
        """Wait up to ``timeout`` seconds for a frame newer than the last one read; None when none came.

        The newest frame wins: frames that nobody read in time are dropped. For a reader's own thread, not for a tick.
        """
        ...


SOUND_RATE = 16_000
"""Samples a second that every microphone gives, whatever its hardware does."""


@dataclass(frozen=True, slots=True, eq=False)
class Sound:
    """A piece of sound: ``number`` counts the pieces of a microphone, so that a gap shows.

    ``stamp`` is the time of its first sample, in seconds on the driver's clock.
    """

    number: int
    stamp: float
    samples: Samples

    @property
    def end(self) -> float:
        """The time at which it ends."""
        return self.stamp + len(self.samples) / SOUND_RATE


class Microphone(Device, Protocol):
    """What the robot hears with. It keeps what it has heard for a few seconds, and drops what nobody fetches."""

    def read(self, after: int) -> Sequence[Sound]:
        """Return the pieces with a larger number than ``after``, oldest first; at most the last 5 s are kept."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class RangeScan:
    """One turn of a range finder.

    ``ranges``: shape (n,), float32, metres from the finder, NaN where nothing came back. Beam i points ``start + i *
    step`` radians from straight ahead of the *base*, anticlockwise positive (REP 103): how the finder is built in is
    worked in already. ``stamp`` (seconds of the driver's clock) is the middle of the turn, ``number`` counts from 0.
    It measures from ``least`` to ``most`` metres.
    """

    ranges: Ranges
    start: float
    step: float
    stamp: float
    number: int
    least: float
    most: float

    def figures(self) -> Mapping[str, float]:
        """Return what is shown of it, in metres."""
        return {"nearest": self.nearest()}

    def bearings(self) -> Angles:
        """Return where each beam points: shape (n,), radians, wrapped to -pi..pi."""
        import numpy as np  # noqa: PLC0415 - see drivers.api.measures

        return wrap_angles(self.start + self.step * np.arange(len(self.ranges), dtype=np.float64))

    def nearest(self, centre: float = 0.0, width: float = tau) -> float:
        """Return the least distance (m) within ``width`` radians about the bearing ``centre``; infinity for none."""
        import numpy as np  # noqa: PLC0415

        off = np.abs(wrap_angles(self.bearings() - centre))
        inside = self.ranges[off <= width / 2 + 1e-9]
        seen = inside[np.isfinite(inside)]
        return float(seen.min()) if seen.size else inf


def wrap_angles(angles: Angles) -> Angles:
    """Return the same directions as angles from -pi to pi."""
    import numpy as np  # noqa: PLC0415

    turned: Angles = np.remainder(angles + tau / 2, tau) - tau / 2
    return turned


class Ranger(Device, Protocol):
    """A range finder that turns; its part of the robot is ``range``."""

    @property
    @fixed
    def place(self) -> tuple[float, float, float]:
        """Where it sits on the base: x forward and y left in metres, and its yaw in radians."""
        ...

    def scan(self) -> Reading[RangeScan]:
        """Return the newest whole turn; stale after half a second without another."""
        ...


@runtime_checkable
class Guardable(Protocol):
    """A base that keeps away from what a range finder sees, whoever commands; those on ``drivers.base`` do."""

    def guard_by(self, ranger: Ranger, blind: Sequence[tuple[float, float]] = ()) -> None:
        """Limit every velocity by the scans of ``ranger``, unless the robot file switches that off.

        To be called before ``open``. ``blind`` are sectors, pairs of bearings of the base in radians, anticlockwise, in
        which it sees nothing.
        """
        ...


@dataclass(frozen=True, slots=True)
class Attitude:
    """How the robot leans, and how that changes; axes of REP 103, which are the robot's own.

    ``roll`` to its right and ``pitch`` ahead are above 0 (rad), ``yaw`` to its left: it drifts, and begins anywhere.
    ``rates`` (rad/s) are those about x, y, z; ``forces`` (m/s2) the acceleration along them, with gravity's 9.81 up.
    """

    roll: float
    pitch: float
    yaw: float
    rates: tuple[float, float, float]
    forces: tuple[float, float, float]

    def figures(self) -> Mapping[str, float]:
        """Return what is shown of it, in radians."""
        return {"roll": self.roll, "pitch": self.pitch}


class Imu(Device, Protocol):
    """An IMU; its part of the robot is ``imu``."""

    def attitude(self) -> Reading[Attitude]:
        """Return the newest attitude; stale after 0.1 s without another."""
        ...


@runtime_checkable
class WitnessedBase(Protocol):
    """A base whose progress monitor compares its motion with other instruments; those on ``drivers.base`` do."""

    def compare_with(self, *, ranger: Ranger | None = None, imu: Imu | None = None) -> None:
        """Compare its motion with what these see, where they can tell; to be called before ``open``."""
        ...
