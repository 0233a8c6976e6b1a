"""Protocols of sensors: camera, microphone, range finder, and IMU."""

from collections.abc import Mapping, Sequence
from math import inf, tau
from typing import Protocol, runtime_checkable

from drivers.api.device import Device, Reading
from drivers.api.fast_dataclass import dataclass
from drivers.api.marks import fixed
from drivers.api.measures import Angles, Image, Ranges, Samples


@dataclass(frozen=True, slots=True, eq=False)
class CameraFrame:
    """Picture with the time when it was taken (driver's clock), and its number since the camera was opened, from 0."""

    image: Image
    stamp: float
    number: int


class Camera(Device, Protocol):
    """Camera of a robot: a source of pictures."""

    @property
    def field_of_view(self) -> float:
        """Horizontal angle of view in radians."""
        ...

    def read(self, timeout: float) -> CameraFrame | None:
        """Wait up to ``timeout`` seconds for a frame newer than the last one read; return None if there was none.

        Only the latest frame is kept; older ones are dropped. For a thread of its own, not for a tick.
        """
        ...


SOUND_RATE = 16_000
"""Samples per second of every microphone, resampled if the hardware differs."""


@dataclass(frozen=True, slots=True, eq=False)
class Sound:
    """Chunk of sound; ``number`` counts the chunks of a microphone, so that a gap can be detected.

    ``stamp`` is the time of the first sample, in seconds on the driver's clock.
    """

    number: int
    stamp: float
    samples: Samples

    @property
    def end(self) -> float:
        """Time of the end of the chunk, in seconds on the driver's clock."""
        return self.stamp + len(self.samples) / SOUND_RATE


class Microphone(Device, Protocol):
    """Microphone of the robot. It buffers the last few seconds, and drops chunks that are not read in time."""

    def read(self, after: int) -> Sequence[Sound]:
        """Return the chunks with a larger number than ``after``, oldest first; at most the last 5 s are buffered."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class RangeScan:
    """One turn of a range finder.

    ``ranges``: shape (n,), float32, metres from the range finder, NaN without an echo. Beam i points ``start + i *
    step`` radians from the front of the *base*, anticlockwise positive (REP 103), corrected for the mounting. ``stamp``
    (seconds of the driver's clock) is the middle of the turn, ``number`` counts from 0. The measuring range is
    ``least`` to ``most`` metres.
    """

    ranges: Ranges
    start: float
    step: float
    stamp: float
    number: int
    least: float
    most: float

    def figures(self) -> Mapping[str, float]:
        """Return the distances that displays show, by name, in metres."""
        return {"nearest": self.nearest()}

    def bearings(self) -> Angles:
        """Return the bearing of each beam: shape (n,), radians, wrapped to -pi..pi."""
        import numpy as np  # noqa: PLC0415 - see drivers.api.measures

        return wrap_angles(self.start + self.step * np.arange(len(self.ranges), dtype=np.float64))

    def nearest(self, centre: float = 0.0, width: float = tau) -> float:
        """Return the smallest distance (m) within ``width`` radians about bearing ``centre``; infinity if none."""
        import numpy as np  # noqa: PLC0415

        off = np.abs(wrap_angles(self.bearings() - centre))
        inside = self.ranges[off <= width / 2 + 1e-9]
        ranges = inside[np.isfinite(inside)]
        return float(ranges.min()) if ranges.size else inf


def wrap_angles(angles: Angles) -> Angles:
    """Return ``angles`` wrapped to -pi..pi."""
    import numpy as np  # noqa: PLC0415

    wrapped: Angles = np.remainder(angles + tau / 2, tau) - tau / 2
    return wrapped


class Ranger(Device, Protocol):
    """Range finder that rotates, such as a lidar: the part ``range`` of a robot."""

    @property
    @fixed
    def place(self) -> tuple[float, float, float]:
        """Mounting pose on the base: x forward and y left in metres, yaw in radians."""
        ...

    def scan(self) -> Reading[RangeScan]:
        """Return the scan of the latest complete turn; stale after half a second without another."""
        ...


@runtime_checkable
class Guardable(Protocol):
    """Base that can use a range guard, for all sources of commands.

    All bases made with ``drivers.base`` can.
    """

    def guard_by(self, ranger: Ranger, blind: Sequence[tuple[float, float]] = ()) -> None:
        """Limit every velocity by the scans of ``ranger``, unless the robot file switches that off.

        Call it before ``open``. ``blind`` are sectors, pairs of bearings of the base in radians, anticlockwise, in
        which the range finder sees nothing.
        """
        ...


@dataclass(frozen=True, slots=True)
class Attitude:
    """Attitude of the robot, its rates and accelerations; axes of REP 103.

    ``roll`` to the right and ``pitch`` ahead are positive, as is ``yaw`` to the left (rad); yaw drifts and has an
    arbitrary zero. ``rates`` (rad/s) are those about x, y, z; ``forces`` (m/s2) are accelerations along x, y, z, with
    gravity's 9.81 up.
    """

    roll: float
    pitch: float
    yaw: float
    rates: tuple[float, float, float]
    forces: tuple[float, float, float]

    def figures(self) -> Mapping[str, float]:
        """Return the angles that displays show, by name, in radians."""
        return {"roll": self.roll, "pitch": self.pitch}


class Imu(Device, Protocol):
    """Inertial measurement unit: the part ``imu`` of a robot."""

    def attitude(self) -> Reading[Attitude]:
        """Return the latest attitude; stale after 0.1 s without another."""
        ...


@runtime_checkable
class WitnessedBase(Protocol):
    """Base whose progress monitor can compare its motion with other sensors.

    All bases made with ``drivers.base`` can.
    """

    def compare_with(self, *, ranger: Ranger | None = None, imu: Imu | None = None) -> None:
        """Compare the base's motion with the motion that ``ranger`` and ``imu`` measure, to detect motion faults.

        A motion fault is, for example, a base that is stuck. A sensor that is None is not used. Call it before
        ``open``.
        """
        ...
