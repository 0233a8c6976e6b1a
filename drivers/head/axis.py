"""One axis of the head as a hobby servo: from radians to the whole degrees that the sketch takes, and back."""

import math
from dataclasses import replace
from typing import Self

from drivers.api.fast_dataclass import dataclass
from drivers.head.keys import ServoKeys
from drivers.head.pantilt import MAX_TRIM, AxisStep, PanTiltMotion

CENTRE_DEGREES = 90
"""Degrees that the sketch takes for straight ahead."""

MAX_DEGREES = 180
"""The largest angle in degrees; from 544 on the Servo library would take the number for microseconds."""

SERVO_LAG = 0.0125
"""Seconds by which the servos are behind the pose that is told of a past time: that is a straight line between what
they were sent 50 times a second, while they stay where they are until sent on, and then need their time."""

ENCODER_SKETCH_STARTS = (90, 120, 90, 90)
"""Degrees to which the Rodney sketches with encoders send servos 0 to 3 when they start."""

ATTACHED_DEGREES = 92
"""Degrees at which a servo is that was attached and sent nowhere: the Servo library's 1500 microseconds."""

FIRST_SKETCH_STARTS = (90, 120, ATTACHED_DEGREES, ATTACHED_DEGREES)
"""The same of the first sketch (Parts 01 to 04), which has no encoders, and sends servos 0 and 1 only."""


BRAKED_OFFSET = math.radians(0.25)
"""Radians by which a head that was stopped is taken to be short of the degree that it keeps: there and back it takes
no more than a degree, and who tells it to go on and stops it ever again gets it no farther."""


@dataclass(frozen=True, slots=True)
class ServoAxis:
    """Which servo it is, how far the head may turn by it (radians), and its mounting: a ``drivers.head.pantilt.HeadAxis``.

    As the pan/tilt node of the Rodney project has it: ``lower`` and ``upper`` bound the angle of the joint; 0 is 90
    degrees of the servo; ``flip`` is for a servo that turns the other way; ``trim`` (radians, +-45 degrees) corrects a
    horn that sits askew, and is added last, in the servo's own direction. ``start`` is where the sketch sends the servo
    when it starts, in degrees as it takes them; None is where the Rodney sketches of Part 01 and later send it.
    Raises ValueError for values that no servo can have.
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
        """-1 for a servo that turns the other way than the head."""
        return -1 if self.flip else 1

    @property
    def is_measured(self) -> bool:
        """False: a hobby servo reports nothing."""
        return False

    def with_trim(self, trim: float) -> Self:
        """Return the same servo with another trim (radians). Raises ValueError for one that it cannot have."""
        return replace(self, trim=trim)

    @property
    def range(self) -> tuple[float, float]:
        """The angles in radians that it may have and can reach, least and greatest."""
        ends = sorted((self.to_radians(0), self.to_radians(MAX_DEGREES)))
        return max(self.lower, ends[0]), min(self.upper, ends[1])

    @property
    def start_degrees(self) -> int:
        """The degrees at which it stands once a sketch with encoders has started."""
        return self.start_degrees_of_sketch(has_encoders=True)

    def start_degrees_of_sketch(self, *, has_encoders: bool) -> int:
        """Return the degrees at which it stands once the sketch has started, a ``later`` one or the first."""
        if self.start is not None:
            return self.start
        starts = ENCODER_SKETCH_STARTS if has_encoders else FIRST_SKETCH_STARTS
        return starts[self.index] if self.index < len(starts) else CENTRE_DEGREES

    def to_degrees(self, angle: float) -> int:
        """Return what to send for ``angle`` radians: the nearest whole degree in 0..180."""
        turned = math.degrees(self.sign * angle + self.trim) + CENTRE_DEGREES
        return min(max(round(turned), 0), MAX_DEGREES)

    def next_degree(self, angle: float, heading: float) -> int:
        """Return what to send on the way through ``angle`` to ``heading`` (radians): the next whole degree on that way.

        So a movement begins at once and not when it has covered half a degree, and no degree is sent that lies beyond.
        """
        end = self.to_degrees(heading)
        # What floats lose must not make an angle that stands at a whole degree one that is still on the way to it.
        exact = round(math.degrees(self.sign * angle + self.trim) + CENTRE_DEGREES, 9)
        if abs(exact - end) < 1:
            return end
        degree = math.floor(exact) + 1 if end > exact else math.ceil(exact) - 1
        return min(max(degree, 0), MAX_DEGREES)

    def nearest_angle(self, angle: float) -> float:
        """Return the angle nearest to ``angle`` (radians) at which the servo can stand."""
        return self.to_radians(self.to_degrees(angle))

    def to_radians(self, degrees: float) -> float:
        """Return the angle in radians at which the servo stands when ``degrees`` was sent."""
        return self.sign * (math.radians(degrees - CENTRE_DEGREES) - self.trim)


def next_degrees(
    motion: PanTiltMotion[ServoAxis],
    steps: tuple[AxisStep[ServoAxis], AxisStep[ServoAxis]],
    sent: tuple[int, ...] | None,
) -> tuple[int, int]:
    """Return what to send two servos now, of which these degrees were ``sent`` last; empty or None where none were.

    The degree sent last may lie ahead of where the head had got to when it was told to brake: it does not turn back,
    and goes on from there: ``steps`` are those of its ``way`` now.
    """
    pan, tilt = (step.axis.next_degree(step.angle, step.heading) for step in steps)
    if sent:
        kept = [
            (new - old) * step.braking_direction * step.axis.sign < 0
            for step, new, old in zip(steps, (pan, tilt), sent, strict=True)
        ]
        pan, tilt = (old if keeps else new for keeps, new, old in zip(kept, (pan, tilt), sent, strict=True))
        if any(kept):
            motion.settle_at(
                step.axis.to_radians(old) - step.braking_direction * BRAKED_OFFSET if keeps else None
                for keeps, step, old in zip(kept, steps, sent, strict=True)
            )
    return pan, tilt


def make_servo_axis(keys: ServoKeys) -> ServoAxis:
    """Return the axis that the keys of a servo describe."""
    return ServoAxis(keys.servo, keys.lower, keys.upper, flip=keys.flip, trim=keys.trim, start=keys.start)
