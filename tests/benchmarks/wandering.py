"""How much of a room ``wander`` comes to in ten minutes, and how hard it bumps: twenty seeds, each from elsewhere."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from random import Random

import numpy as np
import numpy.typing as npt
from scipy.ndimage import label

from config.library import shipped_files
from config.world import WorldConfig, load_world
from drivers.api import BASE_RADIUS, Pose2D
from drivers.base.twin import BaseTwin
from drivers.sim.world import SimulatedWorld
from missions.library.worlds import build_world
from missions.request import RunRequest
from missions.runner import Runner
from tests.benchmarks.table import Row

CELL = 0.1
"""Metres from one spot of the floor to the next."""

Grid = npt.NDArray[np.bool_]


def rows() -> Iterator[Row]:
    """Yield the share of the floor that was missed, and the hardest bump (m/s), of the worst of twenty seeds."""
    walks = [wander(seed, minutes=10.0) for seed in range(20)]
    least = min(walk.visited for walk in walks)
    hardest = max((bump for walk in walks for bump in walk.bumps), default=0.0)
    yield Row("wander: half of the floor, and what it came to", 0.5, least, 0.5 / least, 1.0)
    yield Row("wander: its hardest bump in m/s, and 0.1", hardest, 0.1, hardest / 0.1, 1.0)


@dataclass(frozen=True)
class Walk:
    """How a run ended, the share of the floor it came to, at what speeds (m/s) it bumped, and whether a wheel fell."""

    result: str
    visited: float
    bumps: tuple[float, ...]
    fell: bool


class Floor:
    """The spots of a room that a base can come to from where it starts; ``seen`` are those that it has been over."""

    def __init__(self, config: WorldConfig, world: SimulatedWorld) -> None:
        half_length, half_width = config.length / 2, config.width / 2
        x, y = config.centre
        self._xs = np.arange(x - half_length + CELL / 2, x + half_length, CELL)
        self._ys = np.arange(y - half_width + CELL / 2, y + half_width, CELL)
        self.free: Grid = np.array([[self._fits(world, float(x), float(y)) for x in self._xs] for y in self._ys])
        self.seen: Grid = np.zeros_like(self.free)

    @staticmethod
    def _fits(world: SimulatedWorld, x: float, y: float) -> bool:
        return not world.contact_directions(x, y, BASE_RADIUS, 0.0) and world.has_floor(x, y)

    def start(self, random: Random) -> Pose2D:
        """Return a place to start at, some way off everything."""
        row, column = random.choice(np.argwhere(self.free).tolist())
        return Pose2D(float(self._xs[column]), float(self._ys[row]), random.uniform(-math.pi, math.pi))

    def visit(self, x: float, y: float) -> None:
        """The base is over this place."""
        self._cover(self.seen, x, y)

    def share(self, start: Pose2D) -> float:
        """Return how much was seen of all that can be, from ``start``."""
        areas, _ = label(self.free)
        mine = areas[abs(self._ys - start.y).argmin(), abs(self._xs - start.x).argmin()]
        within: Grid = np.zeros_like(self.free)
        for row, column in np.argwhere(areas == mine).tolist():
            self._cover(within, float(self._xs[column]), float(self._ys[row]))
        return float((self.seen & within).sum() / within.sum())

    def _cover(self, grid: Grid, x: float, y: float) -> None:
        grid |= (self._xs[None, :] - x) ** 2 + (self._ys[:, None] - y) ** 2 <= BASE_RADIUS**2


def wander(seed: int, *, minutes: float, world: str = "living_room", robot: str = "turtlebot2") -> Walk:
    """Run the mission in simulated time, from a start that belongs to the seed."""
    config = load_world(shipped_files("worlds")[world])
    floor = Floor(config, build_world(config))
    start = floor.start(Random(f"wander {seed}"))  # noqa: S311 - chance, not a secret
    config = replace(config, start=replace(config.start, at=(start.x, start.y), heading=start.heading))
    params = {"duration": f"{minutes} min"}
    order = RunRequest("wander", params, robot=robot, simulate="fast", world=config, eyes="truth", seed=seed)
    runner = Runner(order)
    if runner.twins is None or runner.twins.base is None:
        raise TypeError(f"{robot} has no base in simulated time")
    watch = Watch(runner.twins.base, floor)
    runner.twins.timeline.call_every(BaseTwin.STEP_INTERVAL, watch.look)
    result = runner.run()
    return Walk(result.result, floor.share(start), tuple(watch.bumps), watch.fell)


class Watch:
    """Sees where a base truly goes, and how fast it is when it bumps."""

    def __init__(self, base: BaseTwin, floor: Floor) -> None:
        self.bumps: list[float] = []
        self.fell = False
        self._body = base.body
        self._floor = floor
        self._speed = 0.0
        self._touches = False
        self._at = (math.inf, math.inf)

    def look(self) -> None:
        """Look once."""
        body = self._body
        x, y = body.pose.x, body.pose.y
        if math.dist((x, y), self._at) > CELL / 4:
            self._at = x, y
            self._floor.visit(x, y)
        if body.bumper and not self._touches:
            self.bumps.append(self._speed)
        self.fell = self.fell or bool(body.wheel_drop)
        self._touches, self._speed = bool(body.bumper), body.velocity.linear
