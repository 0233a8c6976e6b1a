"""The dock that charges a base: a low box with two contacts, and three infrared beams that show the way to it.

Its beams are as its vendor describes them: three sectors before it that overlap, each told apart in near and far, and
three receivers on the base. The vendor gives no figures for them: all those here are our assumption.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import atan2, cos, hypot, pi, radians, remainder, sin, tau

from drivers.api import DockBeam, DockSignals, Pose2D
from drivers.sim.block import Point3
from drivers.sim.room import Colour
from drivers.sim.things import Box
from drivers.sim.walk import Place

SIZE = (0.1, 0.25, 0.1)
"""Its length along the way it faces, its width and its height, in metres."""

COLOUR: Colour = (44, 46, 52)

REACH = 0.015
"""Metres before its front at which its contacts, on springs, meet those of the base."""

ASIDE, ASKEW = 0.04, radians(20)
"""How far a base may stand beside its middle (metres), and how far turned, for the contacts to meet."""

NEAR_RANGE, FAR_RANGE = 0.6, 2.5
"""Metres from its middle up to which the base hears the near beams, and the far ones."""

_SECTORS = (
    (radians(4), radians(45), DockBeam.NEAR_LEFT, DockBeam.FAR_LEFT),
    (radians(-12), radians(12), DockBeam.NEAR_CENTRE, DockBeam.FAR_CENTRE),
    (radians(-45), radians(-4), DockBeam.NEAR_RIGHT, DockBeam.FAR_RIGHT),
)
"""From and to which bearing, left of where the dock faces, each beam goes."""

_RECEIVERS = ((radians(15), radians(95)), (radians(-15), radians(15)), (radians(-95), radians(-15)))
"""From and to which direction, left of its heading, the left, centre and right receiver of the base hear. The centre
one looks so narrowly that who drives towards what it hears comes to the dock, as the vendor's own program does."""

_HEIGHT = 0.05  # metres above the floor of beams and receivers
NO_SIGNALS = DockSignals()


@dataclass(frozen=True, slots=True)
class Dock:
    """A dock about (x, y) that faces ``heading``: a base drives onto it from there, the other way round."""

    x: float
    y: float
    heading: float

    @property
    def box(self) -> Box:
        """What it is to whoever bumps into it or looks at it."""
        return Box("dock", self.x, self.y, SIZE, COLOUR, heading=self.heading)

    @property
    def way(self) -> tuple[Place, Place]:
        """The line that shows on maps where a base comes from: its two ends, in metres."""
        c, s = cos(self.heading), sin(self.heading)
        return (self.x, self.y), (self.x + 2.5 * SIZE[0] * c, self.y + 2.5 * SIZE[0] * s)

    def contact(self, base: Pose2D, radius: float) -> bool:
        """Say whether a base of that radius stands so on the floor that the contacts meet."""
        dx, dy = base.x - self.x, base.y - self.y
        if abs(dx) + abs(dy) > 1.0:
            return False
        c, s = cos(self.heading), sin(self.heading)
        ahead, aside = dx * c + dy * s, dy * c - dx * s
        askew = remainder(base.heading - self.heading - pi, tau)
        return 0.0 < ahead <= SIZE[0] / 2 + radius + REACH and abs(aside) <= ASIDE and abs(askew) <= ASKEW

    def signals(self, base: Pose2D, clear: Callable[[Point3, Point3], bool]) -> DockSignals:
        """Return what the receivers of a base hear; ``clear`` says whether nothing is between two places."""
        dx, dy = base.x - self.x, base.y - self.y
        away = hypot(dx, dy)
        if away > FAR_RANGE:
            return NO_SIGNALS
        bearing = remainder(atan2(dy, dx) - self.heading, tau)
        # Added up as plain numbers: flags are slow.
        beams = sum(
            (near if away <= NEAR_RANGE else far).value for low, high, near, far in _SECTORS if low <= bearing <= high
        )
        way = remainder(atan2(-dy, -dx) - base.heading, tau)
        heard = [low <= way <= high for low, high in _RECEIVERS]
        if not (beams and any(heard)) or not clear((base.x, base.y, _HEIGHT), (self.x, self.y, _HEIGHT)):
            return NO_SIGNALS
        return DockSignals(*(DockBeam(beams if here else 0) for here in heard))
