"""Driving at an edge, at walls, and off the floor, at full speed and from everywhere: no base falls or goes on pushing.

The behaviour here looks at nothing: what keeps the base safe is below every behaviour.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from random import Random

import pytest

from config.library import shipped_files
from config.world import WorldConfig, load_world
from drivers.api import Pose2D
from drivers.base.twin import BaseTwin
from missions.language.plan import Plan
from missions.library.drivers import load_named_robot
from missions.request import RunRequest
from missions.runner import Runner, load_plan
from tests.missions.lone_base import LONE_ROBOT
from tests.tries import tries

STARTS = tries(24, most=100)
LAGS = (0.0, 0.1, 0.2)
"""Dead times of the motors in seconds; users of a Kobuki measured 0.2."""

BLIND = '''
from behaviours.leaf import RUNNING, Leaf, argument
from drivers.api import Velocity


class Blindly(Leaf):
    """Drive on whatever happens, and turn at times."""

    tag = "blindly"
    needs = drives = frozenset({"base"})
    after: float = argument("duration", "when it begins to turn", principal=True)

    def update(self):
        turn = 0.0 if self.elapsed < self.after else 1.5
        self.robot.base.drive(Velocity(0.0 if turn else 0.7, turn))
        return RUNNING

    def terminate(self, new_status):
        self.robot.base.stop()
'''

STUBBORN = """
mission: stubborn
tree:
  race:
    - selector:
        - velocity: {speed: 0.7 m/s}
        - turn: 90 deg
        - turn: -90 deg
        - drive: 20 cm
      retry: forever
    - wait: 15 s
"""


@pytest.fixture(scope="module")
def blindly(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("blind")
    (folder / "blindly.py").write_text(BLIND)
    for name, turns, ends in (("blind", 13, 15), ("brief", 6, 8)):
        (folder / f"{name}.yaml").write_text(
            f"mission: {name}\ntree:\n  race:\n    - blindly: {turns} s\n    - wait: {ends} s\n"
        )
    return folder / "blind.yaml"


@pytest.fixture
def briefly(blindly: Path) -> Path:
    """The same for who begins near what it shall meet, which it does within three seconds."""
    return blindly.with_stem("brief")


@cache
def plan_of(mission: Path, robot: str) -> Plan:
    return load_plan(order(mission, robot, load_world(shipped_files("worlds")["empty"])), load_named_robot(robot))


def order(mission: Path, robot: str, world: WorldConfig) -> RunRequest:
    leaves = tuple(mission.parent.glob("*.py"))
    return RunRequest(str(mission), robot=robot, simulate="fast", world=world, eyes="truth", behaviours=leaves)


def world_of(name: str, start: Pose2D, lag: float) -> WorldConfig:
    world = load_world(shipped_files("worlds")[name])
    place = replace(world.start, at=(start.x, start.y), heading=start.heading)
    return replace(world, start=place, physics=replace(world.physics, lag=lag), people=())


def ride(mission: Path, robot: str, world: WorldConfig, look: Callable[[BaseTwin, float], None]) -> BaseTwin:
    """Run a mission, and look at the base after each of its steps; return it."""
    runner = Runner(order(mission, robot, world), plan=plan_of(mission, robot))
    assert runner.twins is not None
    assert runner.twins.base is not None
    base, timeline = runner.twins.base, runner.twins.timeline
    timeline.call_every(BaseTwin.STEP_INTERVAL, lambda: look(base, timeline.clock.now()))
    runner.run()
    return base


def at_the_edge(random: Random) -> Pose2D:
    """Return a start from which the way leads to the stairs: every other time to a corner, with any part of the base.

    A corner gives the least way from a floor sensor to a wheel.
    """
    (edge,) = load_world(shipped_files("worlds")["stairs"]).edges
    left, right = edge.x - edge.length / 2, edge.x + edge.length / 2
    low, high = edge.y - edge.width / 2, edge.y + edge.width / 2
    if random.random() < 0.5:
        side = random.choice((1.0, -1.0))
        heading = math.radians(-90.0 + side * (45.0 + random.uniform(-25.0, 25.0)))
        x, y = left if side > 0 else right, high
        away, beside = random.uniform(0.7, 1.2), random.uniform(-0.13, 0.13)
    else:
        heading = math.radians(random.choice((0.0, -90.0)) + random.uniform(-35.0, 35.0))
        on_top = heading < math.radians(-45.0)
        x, y = (random.uniform(left, right), high) if on_top else (left, random.uniform(low + 0.3, high))
        away, beside = random.uniform(0.5, 1.5), 0.0
    c, s = math.cos(heading), math.sin(heading)
    return Pose2D(x - away * c - beside * s, y - away * s + beside * c, heading)


def falls(mission: Path, robot: str, lag: float, seeds: range) -> list[str]:
    """Return the starts from which a base has fallen; all others have come to the edge and stand there."""
    fallen = []
    for seed in seeds:
        start = at_the_edge(Random(seed))  # noqa: S311 - chance, not a secret
        felt = {"cliff": False, "drop": False}

        def look(base: BaseTwin, now: float, felt: dict[str, bool] = felt) -> None:
            del now
            felt["cliff"] |= bool(base.body.cliff)
            felt["drop"] |= bool(base.body.wheel_drop)

        ride(mission, robot, world_of("stairs", start, lag), look)
        assert felt["cliff"], f"{seed}: {start} does not lead to the edge"
        if felt["drop"]:
            fallen.append(f"seed {seed}, lag {lag} s: {start}")
    return fallen


@pytest.mark.parametrize("lag", LAGS)
def test_no_start_at_full_speed_leads_down_the_stairs(briefly: Path, lag: float) -> None:
    share = LAGS.index(lag)
    assert falls(briefly, "turtlebot2", lag, range(share, STARTS, len(LAGS))) == []


def test_base_does_not_fall_during_repeated_retries(tmp_path: Path) -> None:
    mission = tmp_path / "stubborn.yaml"
    mission.write_text(STUBBORN)
    assert falls(mission, "turtlebot2", 0.1, range(tries(3, most=10))) == []


def test_faster_base_stops_at_a_straight_edge(briefly: Path) -> None:
    for seed in range(tries(8, most=20)):
        random = Random(f"straight {seed}")  # noqa: S311 - chance, not a secret
        start = Pose2D(random.uniform(0.0, 1.2), random.uniform(-1.2, 0.6), random.uniform(-0.6, 0.6))
        drops: list[float] = []

        def look(base: BaseTwin, now: float, drops: list[float] = drops) -> None:
            if base.body.wheel_drop:
                drops.append(now)

        base = ride(briefly, "turtlebot2_arm", world_of("stairs", start, 0.0), look)
        assert drops == [], f"{seed}: {start}"
        assert math.hypot(base.body.pose.x - start.x, base.body.pose.y - start.y) > 0.2


# --- walls, and hands that lift it -----------------------------------------------------------------------------------


class Pushing:
    """For how long at most a base that touches something has gone on turning its wheels against it."""

    def __init__(self) -> None:
        self.longest = 0.0
        self.touches = 0
        self._since: float | None = None

    def look(self, base: BaseTwin, now: float) -> None:
        pushes = bool(base.body.bumper) and base.body.wheels.velocity.linear > 0.0
        if pushes and self._since is None:
            self._since = now
            self.touches += 1
        elif not pushes:
            self._since = None
        if self._since is not None:
            self.longest = max(self.longest, now - self._since)


@pytest.mark.parametrize("lag", LAGS)
def test_base_does_not_push_obstacles(blindly: Path, lag: float) -> None:
    touches = 0
    for seed in range(LAGS.index(lag), STARTS, len(LAGS)):
        random = Random(f"wall {seed}")  # noqa: S311 - chance, not a secret
        start = Pose2D(random.uniform(3.5, 4.5), random.uniform(-2.0, 2.0), random.uniform(-1.0, 1.0))
        pushing = Pushing()
        ride(blindly, LONE_ROBOT, world_of("empty", start, lag), pushing.look)
        assert pushing.touches >= 1, f"{seed}: {start}"
        # One report, the dead time, and the motors that brake at 2 m/s^2.
        assert pushing.longest <= BaseTwin.STEP_INTERVAL + lag + 0.25 / 2.0 + BaseTwin.STEP_INTERVAL, f"{seed}: {start}"
        touches += pushing.touches
    assert touches > STARTS / len(LAGS)  # for it backs off, and this behaviour comes again


@pytest.mark.parametrize("lag", LAGS)
def test_lifted_base_stops_its_wheels(blindly: Path, lag: float) -> None:
    for seed in range(LAGS.index(lag), STARTS, len(LAGS)):
        random = Random(f"lift {seed}")  # noqa: S311 - chance, not a secret
        lifted_at, rolls = random.uniform(0.0, 9.0), {"moved": 0.0}

        def look(base: BaseTwin, now: float, lifted_at: float = lifted_at, rolls: dict[str, float] = rolls) -> None:
            base.lift(up=now >= lifted_at)
            # The report, the dead time, and half a metre per second (in a turn) that brakes at 2 m/s^2.
            if now >= lifted_at + 2 * BaseTwin.STEP_INTERVAL + lag + 0.25:
                rolls["moved"] = max(rolls["moved"], *map(abs, base.body.wheels.speeds))

        ride(blindly, "turtlebot2", world_of("empty", Pose2D(0.0, 0.0, 0.0), lag), look)
        assert rolls["moved"] == 0.0, f"{seed}: lifted at {lifted_at:.2f} s"
