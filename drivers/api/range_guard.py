"""The range guard of a base: its section of a robot file, and the reasons that it gives for slowing the base down."""

from collections.abc import Iterator
from math import atan2, hypot, pi, tau
from typing import Annotated, Literal

from drivers.api.keys import Mistake, inside, key, keys
from drivers.api.steering import Steering

IN_THE_WAY = "something is in the way"
"""Begins the reason of a base that is slowed down for what the range finder sees; distance and direction follow."""

SCANS_LATE = "the range finder's scans are late"
SCANS_MISSING = "the range finder does not report"
OUT_OF_SIGHT = "the range finder does not see that direction"
GUARD_FAILED = "the range guard failed"

_REASONS = (IN_THE_WAY, SCANS_LATE, SCANS_MISSING, OUT_OF_SIGHT, GUARD_FAILED)

MIN_GAP = 0.02
"""Metres: the smallest gap, which covers the noise of a range finder."""

Footprint = float | tuple[tuple[float, float], ...]
"""The radius of a round body about the middle of the base, or the corners of its outline, in metres."""


def is_guarded(steering: Steering) -> bool:
    """Return True while the range guard slows the base down or stops it."""
    return steering.because.startswith(_REASONS)


@keys
class RangeGuardKeys:
    """How a base keeps away from what its range finder sees."""

    footprint: (
        float | tuple[Annotated[tuple[float, float], inside("length", wrong="'{}' needs [x, y]")], ...] | None
    ) = key(
        "length",
        default=None,
        low=0.02,
        high=2.0,
        help="Its body from above: a radius, or corners [x, y], from between its wheels; else as its driver knows it.",
        hint="footprint: 0.18 m",
    )
    gap: float = key(
        "length", default=0.05, low=MIN_GAP, high=1.0, help="The room that it keeps between its body and anything."
    )
    reaction: float | None = key(
        "duration",
        default=None,
        low=0.02,
        high=5.0,
        help="How long after a command the wheels obey it; else as its driver knows it.",
    )
    unseen: Literal["slow", "free"] = key(
        default="slow",
        help="Where the range finder does not look: drive there at 0.1 m/s at most, or as if nothing were there.",
    )

    def mistakes(self) -> Iterator[Mistake]:
        """Yield a footprint that does not enclose the middle of the base."""
        if not isinstance(self.footprint, tuple):
            return
        angles = sorted(atan2(y, x) for x, y in self.footprint)
        gaps = [
            after - before
            for before, after in zip(angles, [*angles[1:], *(each + tau for each in angles[:1])], strict=True)
        ]
        if len(angles) < 3 or max(gaps) > pi - 1e-6 or min(hypot(x, y) for x, y in self.footprint) < 1e-3:
            message = "'footprint': the corners must enclose the middle between the wheels, [0 m, 0 m]"
            yield Mistake(
                message,
                ("footprint",),
                hint="footprint: [[15 cm, 10 cm], [15 cm, -10 cm], [-10 cm, -10 cm], [-10 cm, 10 cm]]",
            )
