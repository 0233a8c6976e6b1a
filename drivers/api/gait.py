"""Keys of a gait file: a walk described by its steps, or by the positions of the soles over a cycle."""

from collections.abc import Iterator
from typing import Literal

from drivers.api.keys import KeyDiagnostic, key, keys

Vector = tuple[float, float, float]


@keys
class PointKeys:
    """Keys of one point of a gait cycle: the positions of both soles."""

    at: float = key("share", low=0.0, high=1.0, help="Time as a share of the cycle, below 100 %.")
    left: Vector = key("length", help="Position of the left sole's middle, from the trunk's origin: [x, y, z].")
    right: Vector = key("length", help="Position of the right sole's middle.")
    left_turn: float = key("angle", default=0.0, help="Rotation of the left sole, to the left.")
    right_turn: float = key("angle", default=0.0, help="Rotation of the right sole, to the left.")
    on: Literal["both", "left", "right"] = key(default="both", help="Soles on the floor from then on.")


@keys
class WalkKeys:
    """Keys of a walk in a gait file, described by its steps."""

    step: float = key("length", help="Distance from one foot to the next; negative is backwards.")
    side: float = key("length", default=0.0, help="Distance to the left in two steps.")
    turn: float = key("angle", default=0.0, help="Turn to the left in two steps.")
    period: float | None = key("duration", default=None, low=0.3, high=5.0, help="Duration of two steps.")
    double_support: float | None = key(
        "share", default=None, low=0.05, high=0.8, help="Share of the cycle on both feet."
    )
    rise: float | None = key("length", default=None, low=0.0, high=0.3, help="Height of a lifted foot.")
    sway: float | None = key("length", default=None, low=0.0, high=0.2, help="Sway to either side.")
    height: float | None = key(
        "length", default=None, low=0.05, high=2.0, help="Height of the trunk's origin above the soles."
    )
    feet: float | None = key("length", default=None, low=0.01, help="Distance between the soles.")


@keys
class GaitKeys:
    """The keys of a gait file."""

    gait: str = key(help="Name of the gait.")
    summary: str = key(default="", help="Summary in one line.")
    walk: WalkKeys | None = key(default=None, help="Walk described by its steps, for the walking engine.")
    period: float | None = key("duration", default=None, low=0.1, high=60.0, help="Duration of a cycle of points.")
    points: tuple[PointKeys, ...] = key(default=(), each="a point", help="Positions of the soles, in order of time.")

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield an error for each contradiction in the file.

        The file must have either ``walk`` or ``points``. Points need a period, there must be at least three of them,
        and they must be in the order of time.
        """
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
