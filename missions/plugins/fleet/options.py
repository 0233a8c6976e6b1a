"""Options of `mission task serve` for a server in a fleet."""

from drivers.api.fast_dataclass import dataclass
from missions.options import option
from missions.request import Simulate


@dataclass(frozen=True, kw_only=True)
class FleetOptions:
    """Which fleet a server is in, as whom, and which robot runs its tasks."""

    fleet: str | None = option("Be in this fleet, and do its tasks: docs/fleet.md.", metavar="NAME")
    as_name: str | None = option("The robot's name in its fleet; else this computer's.", flag="--as", metavar="NAME")
    robot: str | None = option("The robot of the fleet's tasks; it moves, unless --simulate.", "robot")
    simulate: Simulate | None = option("Simulate that robot.", among=("wire", "fast"))
    world: str | None = option("The world around a simulated robot.", "world")
