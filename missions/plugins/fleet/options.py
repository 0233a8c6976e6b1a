"""Options of `mission task serve` for a server in a fleet."""

from drivers.api.fast_dataclass import dataclass
from missions.options import option
from missions.request import Simulate


@dataclass(frozen=True, kw_only=True)
class FleetOptions:
    """Options of a task server that is a member of a fleet: the fleet, the robot's name there, and its robot file."""

    fleet: str | None = option("Join this fleet and run its tasks: docs/fleet.md.", metavar="NAME")
    as_name: str | None = option(
        "Name of the robot in its fleet; the default is this computer's name.", flag="--as", metavar="NAME"
    )
    robot: str | None = option("Robot for the fleet's tasks; it moves unless --simulate is given.", "robot")
    simulate: Simulate | None = option("Simulate the robot.", among=("wire", "fast"))
    world: str | None = option("World of the simulated robot.", "world")
