"""What a robot measures: its dimensions, as annotations, and the arrays that devices deal in, by their names.

A mission cannot add a length to an angle: a value stays a float in SI units; expressions read of its class what it
measures. numpy is imported by who computes with arrays, and is not for a check: where a program runs, they all are
``Array``, which says of a field that it holds one.
"""

from math import isfinite
from typing import TYPE_CHECKING, Annotated


class Array:
    """An array of numpy, whatever it holds."""


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
"""Radians."""

Length = Annotated[float, "length"]
"""Metres."""

Duration = Annotated[float, "duration"]
"""Seconds."""


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
