"""Simulated RPLIDAR."""

from drivers.base.range_twin import RangerTwin
from drivers.rplidar.declared import RPLidarKeys
from drivers.rplidar.models import MODELS
from drivers.sim.context import SimContext
from drivers.sim.scanner import make_range_function
from drivers.sim.world import SimulatedWorld


def make(keys: RPLidarKeys, context: SimContext) -> RangerTwin:
    """Return the twin of a range finder, which sees the world from the true pose of the base."""
    model = MODELS[keys.model]
    world = SimulatedWorld() if context.world is None else context.world
    return RangerTwin(
        make_range_function(world, keys.place, context.pose, height=keys.position[2]),
        context.clock,
        least=model.min_range,
        most=model.max_range,
        rate=model.turn_rate,
        place=keys.place,
        blind=keys.blind,
        report=context.report,
        seed=context.seed,
    )
