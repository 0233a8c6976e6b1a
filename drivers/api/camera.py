"""What perception sees of a camera."""

from typing import Protocol

from drivers.api.arrays import Image
from drivers.api.device import Device
from drivers.api.quick import dataclass


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
