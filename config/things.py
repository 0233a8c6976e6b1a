"""What stands about in a world file: inner walls, furniture, edges, coloured objects, the dock, other robots."""

from collections.abc import Iterator
from typing import Annotated

from config.colours import COLOURS
from config.units import written
from drivers.api.keys import Mistake, inside, key, keys

Place = tuple[float, float]
"""A place (x, y) on the floor, in metres."""

Spot = tuple[float, float, float]
"""A place with its height above the floor; or the length, width and height of a box."""

PLACE = "'{}' needs a place, such as [1.5 m, 0.2 m]"
"""What is said of a place that is none."""

SIDES = "'{}' needs three lengths, such as [1.2 m, 0.8 m, 0.75 m]"
"""The same of the size of a box."""

THICKNESS = 0.1
"""Metres from one side of an inner wall to the other."""

MARKERS = 50
"""How many markers there are: those of ArUco's dictionary DICT_4X4_50."""

DOCK = (0.1, 0.25)
"""Metres that a dock takes of the floor: along the way it faces, and across."""

SHAPES = ("ball", "box")
"""The shapes of coloured objects."""

_MARKER_SPACE = 0.21  # metres that the side of a robot must have for its marker


class OnPlan:
    """What has a place ``at``, whose first two numbers are metres along x and y."""

    at: tuple[float, ...]

    @property
    def x(self) -> float:
        """Its place along x, in metres."""
        return self.at[0]

    @property
    def y(self) -> float:
        """Its place along y, in metres."""
        return self.at[1]


@keys
class Placed(OnPlan):
    """What has a place on the floor."""

    at: Place = key("length", wrong=PLACE, help="Where its middle is: [x, y].")


@keys
class PlacedPose(OnPlan):
    """What stands on the floor, or on something else."""

    name: str = key(help="What it is called.")
    at: Place | Spot = key(
        "length", wrong=PLACE, help="Where its middle is: [x, y], or [x, y, z] for z over the floor."
    )

    @property
    def bottom(self) -> float:
        """The height above the floor of what it stands on, in metres."""
        return sum(self.at[2:])

    def mistakes(self) -> Iterator[Mistake]:
        """Yield what would be below the floor."""
        if self.bottom < 0.0:
            yield Mistake("'at' must be at least 0 m", ("at", 2), about=(("at",),))


@keys
class WallConfig:
    """An inner wall; as high as the room where ``height`` is None."""

    start: Place = key("length", word="from", wrong=PLACE, help="One end: [x, y].")
    end: Place = key("length", word="to", wrong=PLACE, help="The other end: [x, y].")
    height: float | None = key("length", default=None, low=0.1, help="Its height; that of the room where not given.")


@keys
class BoxConfig(PlacedPose):
    """A piece of furniture: a box whose ``size`` is its length along ``heading``, its width and its height."""

    size: Spot = key("length", low=0.01, high=20.0, wrong=SIDES, help="Its length, width and height.")
    heading: float = key("angle", default=0.0, help="Which way its length goes.")
    colour: str = key(default="brown", among=COLOURS, help="Its colour.")


@keys
class ThingConfig(PlacedPose):
    """A coloured object: a ball of the diameter ``size``, or a box."""

    shape: str = key(among=SHAPES, help="Its shape.")
    size: (
        Annotated[float, inside("length", low=0.02, high=2.0)]
        | Annotated[Spot, inside("length", low=0.01, high=20.0, wrong=SIDES)]
    ) = key(help="Across, of a ball; length, width and height, of a box.")
    turned: float | None = key("angle", default=None, word="heading", help="Which way the length of a box goes.")
    colour: str = key(among=COLOURS, help="Its colour.")

    @property
    def heading(self) -> float:
        """Which way its length goes, in radians."""
        return self.turned or 0.0

    def mistakes(self) -> Iterator[Mistake]:
        """Yield a size or a heading that belong to the other shape, too."""
        yield from super().mistakes()
        about = (("shape",), ("size",))
        if self.shape == "box" and isinstance(self.size, float):
            yield Mistake(SIDES.replace("{}", "size"), ("size",), about=about)
        elif self.shape == "ball" and not isinstance(self.size, float):
            yield Mistake("'size' of a ball needs one length, such as '20 cm'", ("size",), about=about)
        if self.shape == "ball" and self.turned is not None:
            yield Mistake("a ball has no 'heading'", ("heading",), named=True, about=(("shape",),))


@keys
class EdgeConfig(Placed):
    """Where the floor ends: a rectangle, its ``size`` along x and along y."""

    size: Place = key(
        "length",
        low=0.05,
        high=50.0,
        wrong="'{}' needs a length and a width, such as [1 m, 0.8 m]",
        help="Its length along x, and its width along y.",
    )

    @property
    def length(self) -> float:
        """Metres along x."""
        return self.size[0]

    @property
    def width(self) -> float:
        """Metres along y."""
        return self.size[1]


@keys
class DockConfig(Placed):
    """The dock of the base."""

    heading: float = key("angle", help="The way that it faces.")


@keys
class Walker(Placed):
    """Who stands at a place, and may go about."""

    name: str = key(help="What they are called.")
    path: tuple[Annotated[Place, inside("length", wrong=PLACE)], ...] = key(
        default=(), word="walk", help="The places that they go to, one after another."
    )
    speed: float = key("speed", default=0.5, low=0.01, high=5.0, help="How fast they go.")
    start: float = key("duration", default=0.0, low=0.0, word="after", help="How long they wait before they go.")
    loop: bool = key(default=True, help="Whether they go back to the first place, and on again.")


@keys
class RoverConfig(Walker):
    """Another robot, with a marker on its sides, that stands or drives as people walk."""

    marker: int = key(low=0, high=MARKERS - 1, help="The number of the marker on its sides.")
    heading: float = key("angle", default=0.0, help="Which way it looks at first.")
    size: Spot = key(
        "length",
        default=(0.35, 0.35, 0.42),
        low=0.01,
        high=20.0,
        wrong=SIDES,
        help="Its length, width and height.",
    )
    colour: str = key(default="grey", among=COLOURS, help="Its colour.")
    speed: float = key("speed", default=0.2, low=0.01, high=5.0, help="How fast it goes.")

    def mistakes(self) -> Iterator[Mistake]:
        """Yield a size that has no room for the marker."""
        if min(self.size) < _MARKER_SPACE:
            least = written(_MARKER_SPACE, "length")
            message = f"'size': no side has room for its marker, which needs {least}"
            yield Mistake(message, ("size",), about=(("size",),))
