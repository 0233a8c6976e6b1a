"""One axis of the head as a hobby servo: from radians to the whole degrees that the sketch takes, and back."""

import math
from dataclasses import dataclass

MIDDLE = 90
"""Degrees that the sketch takes for straight ahead."""

FULL = 180
"""The largest angle in degrees; from 544 on the Servo library would take the number for microseconds."""

STARTS = (90, 120, 90, 90)
"""Degrees to which the Rodney sketch sends servos 0 to 3 when it starts."""

LARGEST_TRIM = math.radians(45)


@dataclass(frozen=True, slots=True)
class ServoAxis:
    """Which servo it is, how far it may turn (radians), and how it is built in.

    ``flip`` is for a servo that turns the other way; ``trim`` (radians, +-45 degrees) corrects a horn that sits askew,
    and counts in the servo's own direction. ``start`` is where the sketch sends the servo when it starts, in degrees as
    it takes them; None is where the Rodney sketch sends it. Raises ValueError for values that no servo can have.
    """

    index: int
    lower: float
    upper: float
    flip: bool = False
    trim: float = 0.0
    start: int | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.index <= 255:
            raise ValueError(f"servo axis: index {self.index} does not fit into 0..255")
        if not self.lower <= self.upper:
            raise ValueError(f"servo {self.index}: lower limit {self.lower} is not below upper limit {self.upper}")
        if not abs(self.trim) <= LARGEST_TRIM:
            raise ValueError(f"servo {self.index}: trim {self.trim} rad is more than 45 degrees")
        if not 0 <= self.awake <= FULL:
            raise ValueError(f"servo {self.index}: a start of {self.awake} degrees is not within 0..{FULL}")
        if self.range[0] > self.range[1]:
            raise ValueError(f"servo {self.index}: nothing of {self.lower}..{self.upper} rad is within its reach")

    @property
    def range(self) -> tuple[float, float]:
        """The angles in radians that it may have and can reach, least and greatest."""
        ends = sorted((self.to_radians(0), self.to_radians(FULL)))
        return max(self.lower, ends[0]), min(self.upper, ends[1])

    @property
    def awake(self) -> int:
        """The degrees at which it stands once the sketch has started."""
        if self.start is not None:
            return self.start
        return STARTS[self.index] if self.index < len(STARTS) else MIDDLE

    def to_degrees(self, angle: float) -> int:
        """Return what to send for ``angle`` radians: the nearest whole degree in 0..180."""
        turned = math.degrees((-angle if self.flip else angle) + self.trim) + MIDDLE
        return min(max(round(turned), 0), FULL)

    def to_radians(self, degrees: float) -> float:
        """Return the angle in radians at which the servo stands when ``degrees`` was sent."""
        angle = math.radians(degrees - MIDDLE) - self.trim
        return -angle if self.flip else angle
