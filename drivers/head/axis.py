"""Axis of a head on a hobby servo: conversion between radians and whole degrees of the servo."""

import math
from dataclasses import replace
from typing import Self

from drivers.api.fast_dataclass import dataclass
from drivers.head.keys import ServoKeys
from drivers.head.pantilt import MAX_TRIM, AxisStep, PanTiltMotion

CENTRE_DEGREES = 90
"""Servo angle in degrees that is straight ahead."""

MAX_DEGREES = 180
"""Largest angle of a servo in degrees; the Servo library takes 544 and more for microseconds."""

SERVO_LAG = 0.0125
"""Seconds by which servos lag behind the recorded pose.

The recorded pose is interpolated linearly between setpoints at 50 Hz. A servo does not move until the next setpoint,
and then needs time to turn.
"""

ENCODER_SKETCH_STARTS = (90, 120, 90, 90)
"""Degrees to which the Rodney sketches with encoders move servos 0 to 3 at boot."""

ATTACHED_DEGREES = 92
"""Degrees of a servo that is attached but has no setpoint: the Servo library's 1500 microseconds."""

FIRST_SKETCH_STARTS = (90, 120, ATTACHED_DEGREES, ATTACHED_DEGREES)
"""Degrees of servos 0 to 3 after the boot of the first sketch (Parts 01 to 04), which moves only 0 and 1."""


BRAKED_OFFSET = math.radians(0.25)
"""Radians by which a stopped head is assumed to be short of the whole degree that was sent last.

Without this assumption, each start after a stop could send the servo another degree ahead, and repeated starts and
stops would move the head.
"""


@dataclass(frozen=True, slots=True)
class ServoAxis:
    """Axis on a hobby servo: its number, range (radians) and mounting; a ``drivers.head.pantilt.HeadAxis``.

    As in the pan/tilt node of the Rodney project, ``lower`` and ``upper`` limit the joint angle, and 0 is 90 degrees of
    the servo. ``flip`` is for a servo that turns the other way. ``trim`` (radians, +-45 degrees) corrects a servo arm
    that sits askew on its shaft; it is added last, in the servo's own direction. ``start`` is the servo's angle in
    degrees after the boot of the sketch; if None, it is the angle of the Rodney sketches of Part 01 and later. Raises
    ValueError for impossible values.
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
        if not abs(self.trim) <= MAX_TRIM:
            trim = f"{math.degrees(self.trim):.1f} deg"
            raise ValueError(f"servo {self.index}: a trim of {trim} is not within -45..45 deg")
        if not 0 <= self.start_degrees <= MAX_DEGREES:
            raise ValueError(
                f"servo {self.index}: a start of {self.start_degrees} degrees is not within 0..{MAX_DEGREES}"
            )
        if self.range[0] > self.range[1]:
            raise ValueError(f"servo {self.index}: nothing of {self.lower}..{self.upper} rad is within its reach")

    @property
    def sign(self) -> int:
        """-1 for a servo that turns the other way than the head, else 1."""
        return -1 if self.flip else 1

    @property
    def is_measured(self) -> bool:
        """False: a hobby servo reports nothing."""
        return False

    def with_trim(self, trim: float) -> Self:
        """Return the same axis with another trim (radians).

        Raises ValueError for more than 45 degrees, or a trim that leaves an empty range.
        """
        return replace(self, trim=trim)

    @property
    def range(self) -> tuple[float, float]:
        """Range of the head's angle in radians that is permitted and reachable."""
        ends = sorted((self.to_radians(0), self.to_radians(MAX_DEGREES)))
        return max(self.lower, ends[0]), min(self.upper, ends[1])

    @property
    def start_degrees(self) -> int:
        """Servo angle in degrees after the boot of an Arduino sketch that supports wheel encoders.

        The first sketch, without encoders, starts some servos at other angles.
        """
        return self.start_degrees_of_sketch(has_encoders=True)

    def start_degrees_of_sketch(self, *, has_encoders: bool) -> int:
        """Return the degrees of the servo after the boot of a sketch with encoders, or of the first sketch."""
        if self.start is not None:
            return self.start
        starts = ENCODER_SKETCH_STARTS if has_encoders else FIRST_SKETCH_STARTS
        return starts[self.index] if self.index < len(starts) else CENTRE_DEGREES

    def to_degrees(self, angle: float) -> int:
        """Return the setpoint for ``angle`` radians: the nearest whole degree in 0..180."""
        turned = math.degrees(self.sign * angle + self.trim) + CENTRE_DEGREES
        return min(max(round(turned), 0), MAX_DEGREES)

    def next_degree(self, angle: float, heading: float) -> int:
        """Return the next whole degree after ``angle`` on the way to ``heading`` (radians).

        So a movement begins at once instead of after half a degree, and no setpoint is beyond ``heading``.
        """
        end = self.to_degrees(heading)
        # Rounded, so that a float error does not turn a whole degree into one that is not reached yet.
        exact = round(math.degrees(self.sign * angle + self.trim) + CENTRE_DEGREES, 9)
        if abs(exact - end) < 1:
            return end
        degree = math.floor(exact) + 1 if end > exact else math.ceil(exact) - 1
        return min(max(degree, 0), MAX_DEGREES)

    def nearest_angle(self, angle: float) -> float:
        """Return the angle nearest to ``angle`` (radians) that is a whole degree of the servo."""
        return self.to_radians(self.to_degrees(angle))

    def to_radians(self, degrees: float) -> float:
        """Return the angle in radians of the servo at setpoint ``degrees``."""
        return self.sign * (math.radians(degrees - CENTRE_DEGREES) - self.trim)


def next_degrees(
    motion: PanTiltMotion[ServoAxis],
    steps: tuple[AxisStep[ServoAxis], AxisStep[ServoAxis]],
    sent: tuple[int, ...] | None,
) -> tuple[int, int]:
    """Return the setpoints of two servos; ``sent`` are their last setpoints, empty or None if there are none.

    ``steps`` are the current steps of ``motion``. While the head brakes, the last setpoint of a servo may be ahead of
    the head. The servo then keeps this setpoint, and the motion continues from there.
    """
    pan, tilt = (step.axis.next_degree(step.angle, step.heading) for step in steps)
    if sent:
        braked_ahead = [
            (new - old) * step.braking_direction * step.axis.sign < 0
            for step, new, old in zip(steps, (pan, tilt), sent, strict=True)
        ]
        pan, tilt = (old if keeps else new for keeps, new, old in zip(braked_ahead, (pan, tilt), sent, strict=True))
        if any(braked_ahead):
            motion.settle_at(
                step.axis.to_radians(old) - step.braking_direction * BRAKED_OFFSET if keeps else None
                for keeps, step, old in zip(braked_ahead, steps, sent, strict=True)
            )
    return pan, tilt


def make_servo_axis(keys: ServoKeys) -> ServoAxis:
    """Return the axis that the keys of a servo describe."""
    return ServoAxis(keys.servo, keys.lower, keys.upper, flip=keys.flip, trim=keys.trim, start=keys.start)
