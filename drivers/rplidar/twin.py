"""Simulated RPLIDAR."""

from drivers.base.range_twin import RangerTwin
from drivers.rplidar.declared import RPLidarKeys
from drivers.rplidar.models import MODELS
from drivers.sim.context import SimContext
from drivers.sim.scanner import make_range_function
from drivers.sim.world import SimulatedWorld


def make(keys: RPLidarKeys, stage: SimContext) -> RangerTwin:
    """Return the twin of a range finder, which sees the world from the true pose of the base."""
    model = MODELS[keys.model]
    world = SimulatedWorld() if stage.world is None else stage.world
    return RangerTwin(
        make_range_function(world, keys.place, stage.pose, height=keys.position[2]),
        stage.clock,
        least=model.min_range,
        most=model.max_range,
        rate=model.turn_rate,
        place=keys.place,
        blind=keys.blind,
        report=stage.report,
        seed=stage.seed,
    )
