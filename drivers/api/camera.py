"""What perception sees of a camera."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from drivers.api.device import Device

Image = npt.NDArray[np.uint8]
"""A picture: shape (height, width, 3), dtype uint8, channels blue, green, red."""


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
