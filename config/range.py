"""The ``range`` section of a robot file: a range finder that turns, where it sits, and what of the robot it sees."""

from dataclasses import dataclass

from config.fields import Fields
from config.marked import Listing

RANGE_MODELS = ("a1", "a2")
"""The models, as the driver knows them: a test holds the two together."""

HEIGHT = 0.2
"""Metres above the floor that it sits, where the file does not say: on the middle plate of a TurtleBot 2."""

Sector = tuple[float, float]
"""Two bearings on the base in radians; what is between them, anticlockwise from the first to the second."""


@dataclass(frozen=True, slots=True)
class RangeConfig:
    """An RPLIDAR: its model and port, and where it is.

    ``position`` is (x, y, z) in metres from the middle of the base on the floor, ``yaw`` how far its front is turned
    from the robot's (radians). In the ``blind`` sectors the robot itself is in its way.
    """

    port: str
    model: str = "a1"
    baud: int = 115_200
    position: tuple[float, float, float] = (0.0, 0.0, HEIGHT)
    yaw: float = 0.0
    blind: tuple[Sector, ...] = ()


def read_range(fields: Fields | None) -> RangeConfig | None:
    """Read the section."""
    if fields is None:
        return None
    fields.choice("driver", ["rplidar"])
    found = RangeConfig(
        port=fields.text("port"),
        model=fields.choice("model", RANGE_MODELS, RANGE_MODELS[0]),
        baud=fields.integer("baud", 115_200, low=1),
        position=fields.position("position", (0.0, 0.0, HEIGHT)),
        yaw=fields.quantity("yaw", "angle", 0.0),
        blind=_sectors(fields, "blind"),
    )
    fields.done()
    return found


def _sectors(fields: Fields, key: str) -> tuple[Sector, ...]:
    """Read ``[[100 deg, 120 deg], [170 deg, -170 deg]]``."""
    sectors = []
    for node in fields.items(key):
        ends = node.items if isinstance(node, Listing) else []
        if len(ends) != 2:
            fields.fault(node.mark, f"'{key}' needs pairs of angles, anticlockwise", f"{key}: [[100 deg, 120 deg]]")
            continue
        first, second = (fields.measure(end, key, "angle") for end in ends)
        sectors.append((first, second))
    return tuple(sectors)
