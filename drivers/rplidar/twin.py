"""The twin of an RPLIDAR."""

from drivers.base.range_twin import RangerTwin
from drivers.rplidar.declared import RPLidarKeys
from drivers.rplidar.models import MODELS
from drivers.sim.scanner import looking
from drivers.sim.stage import Stage
from drivers.sim.world import World


def make(keys: RPLidarKeys, stage: Stage) -> RangerTwin:
    """Return the twin of a range finder, which sees the world from where the base truly is."""
    model = MODELS[keys.model]
    world = World() if stage.world is None else stage.world
    return RangerTwin(
        looking(world, keys.place, stage.pose, height=keys.position[2]),
        stage.clock,
        least=model.least,
        most=model.most,
        rate=model.rate,
        place=keys.place,
        blind=keys.blind,
        report=stage.report,
        seed=stage.seed,
    )
