"""Dimensions as type annotations, and names for the array types of devices.

A value is a float in SI units; expressions of missions read its dimension from the annotation, so a length cannot be
added to an angle. At run time all array types are ``Array``, so that checking a mission need not import numpy.
"""

from math import isfinite
from typing import TYPE_CHECKING, Annotated


class Array:
    """Placeholder for any numpy array at run time."""


if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    Image = npt.NDArray[np.uint8]
    Samples = npt.NDArray[np.int16]
    Angles = npt.NDArray[np.float64]
    Ranges = npt.NDArray[np.float32]
else:
    Image = Samples = Angles = Ranges = Array
"""A picture: shape (height, width, 3), dtype uint8, channels blue, green, red.
Sound: shape (n,), dtype int16, one channel, ``drivers.api.SOUND_RATE`` samples a second.
Angles in radians, dtype float64. Distances in metres, dtype float32."""


Angle = Annotated[float, "angle"]
"""Angle in radians; the annotation gives its dimension to expressions of missions."""

Length = Annotated[float, "length"]
"""Length in metres; the annotation gives its dimension to expressions of missions."""

Duration = Annotated[float, "duration"]
"""Duration in seconds; the annotation gives its dimension to expressions of missions."""


def length_text(metres: float) -> str:
    """Return a length as messages write it: "4 mm" below 1 cm, "35 cm" below 1 m, then "1.25 m"."""
    size = abs(metres)
    if not isfinite(metres):
        return "an unknown distance"
    if size < 0.0005:
        return "0 m"
    if size < 0.0095:
        return f"{1000 * metres:.0f} mm"
    if size < 0.995:
        return f"{100 * metres:.0f} cm"
    return f"{round(metres, 2):.3g} m" if size < 999.5 else f"{metres:.0f} m"
