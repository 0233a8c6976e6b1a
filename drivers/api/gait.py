"""Keys of a gait: by its steps, or by the positions of the soles over a cycle."""

from collections.abc import Iterator
from typing import Literal

from drivers.api.keys import KeyDiagnostic, key, keys

Vector = tuple[float, float, float]


@keys
class PointKeys:
    """Positions of the soles at one point of the cycle."""

    at: float = key("share", low=0.0, high=1.0, help="When: a share of the cycle, below 100 %.")
    left: Vector = key("length", help="The middle of the left sole from the trunk's origin: [x, y, z].")
    right: Vector = key("length", help="The middle of the right sole.")
    left_turn: float = key("angle", default=0.0, help="How far the left sole is turned, to the left.")
    right_turn: float = key("angle", default=0.0, help="How far the right sole is turned, to the left.")
    on: Literal["both", "left", "right"] = key(default="both", help="Which of them is on the floor from then on.")


@keys
class WalkKeys:
    """Walk, described by its steps."""

    step: float = key("length", help="How far a foot lands ahead of the other; negative is backwards.")
    side: float = key("length", default=0.0, help="How far it goes to the left in two steps.")
    turn: float = key("angle", default=0.0, help="How far it turns to the left in two steps.")
    period: float | None = key("duration", default=None, low=0.3, high=5.0, help="The time of two steps.")
    double_support: float | None = key("share", default=None, low=0.05, high=0.8, help="The share on both feet.")
    rise: float | None = key("length", default=None, low=0.0, high=0.3, help="How high a foot is lifted.")
    sway: float | None = key("length", default=None, low=0.0, high=0.2, help="How far it sways to either side.")
    height: float | None = key("length", default=None, low=0.05, high=2.0, help="From the soles to the trunk.")
    feet: float | None = key("length", default=None, low=0.01, help="From one sole to the other.")


@keys
class GaitKeys:
    """The keys of a gait file."""

    gait: str = key(help="What it is called.")
    summary: str = key(default="", help="What it is, in a line.")
    walk: WalkKeys | None = key(default=None, help="A walk by its steps, for the walking engine.")
    period: float | None = key("duration", default=None, low=0.1, high=60.0, help="The time of a cycle of points.")
    points: tuple[PointKeys, ...] = key(default=(), each="a point", help="Where the soles are, one after another.")

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield errors: neither or both of ``walk`` and ``points``, no period, too few or unordered points."""
        if (self.walk is None) == (not self.points):
            hint = "such as walk: {step: 50 mm}"
            yield KeyDiagnostic(
                "a gait file needs either 'walk' or 'points'", hint=hint, about=(("walk",), ("points",))
            )
        if self.points and self.period is None:
            yield KeyDiagnostic(
                "'points' need a 'period'", ("points",), hint="period: 1 s", about=(("points",), ("period",))
            )
        if 0 < len(self.points) < 3:
            yield KeyDiagnostic("'points' needs at least three", ("points",), about=(("points",),))
        before = -1.0
        for place, point in enumerate(self.points):
            at = ("points", place, "at")
            if not before < point.at < 1.0:
                yield KeyDiagnostic("'at' must be later than the one before, and below 100 %", at, about=(at,))
            before = point.at
