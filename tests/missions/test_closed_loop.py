"""Driving by odometry on the whole simulated robot: where it truly ends up, and what it believes."""

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from behaviours.leaf import Leaf
from config.library import shipped_files
from config.world import WorldConfig, load_world
from drivers.api import Pose2D
from missions.executive.executive import Result
from missions.request import RunRequest
from missions.runner import Runner

ARM = "turtlebot2_arm"


def hall(*, slip: float = 0.0, lag: float = 0.0) -> WorldConfig:
    """Return a large empty room; ``slip`` is a share, ``lag`` in seconds."""
    world = load_world(shipped_files("worlds")["empty"])
    return replace(
        world, room=replace(world.room, length=20.0, width=20.0), physics=replace(world.physics, slip=slip, lag=lag)
    )


def run(mission: str, world: WorldConfig, *, robot: str = ARM, params: Mapping[str, str] | None = None) -> "Ended":
    """Run a mission in simulated time."""
    runner = Runner(RunRequest(mission, params or {}, robot=robot, simulate="fast", world=world, eyes="truth"))
    result = runner.run()
    assert runner.twins is not None
    leaves = [node for node in runner.root.iterate() if isinstance(node, Leaf)]
    return Ended(result, runner.twins.pose(), leaves)


class Ended:
    """How a run ended, and where; what its last leaf said, and its first one found."""

    def __init__(self, result: Result, pose: Pose2D, leaves: Sequence[Leaf]) -> None:
        self.result = result
        self.pose = pose
        self.found = leaves[0].result
        self.said = leaves[-1].reason

    @property
    def degrees(self) -> float:
        return math.degrees(self.pose.heading)


@pytest.fixture
def step(tmp_path: Path) -> "Steps":
    return Steps(tmp_path)


class Steps:
    """Missions of one step each, whose result is what the step stores."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def __call__(self, **leaf: object) -> str:
        ((word, values),) = leaf.items()
        mission = self._folder / "one.yaml"
        step = {word: values, "as": "gone"}
        mission.write_text(f"mission: one\ntree: {json.dumps(step)}\nreturns: {{gone: gone}}\n")
        return str(mission)


@pytest.mark.parametrize("speed", [0.1, 0.2, 0.5])
@pytest.mark.parametrize("metres", [1.0, -1.0, 0.3])
@pytest.mark.parametrize("lag", [0.0, 0.2])
def test_a_drive_ends_within_a_centimetre(step: Steps, metres: float, speed: float, lag: float) -> None:
    ended = run(step(drive={"distance": f"{metres} m", "speed": f"{speed} m/s"}), hall(lag=lag))
    assert ended.result.result == "success"
    assert ended.pose.x == pytest.approx(metres, abs=0.01)
    assert ended.pose.y == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("degrees", [90.0, -90.0, 10.0, 360.0])
@pytest.mark.parametrize("lag", [0.0, 0.1, 0.2])
def test_a_turn_ends_within_a_quarter_of_a_degree(step: Steps, degrees: float, lag: float) -> None:
    ended = run(step(turn=f"{degrees} deg"), hall(lag=lag))
    assert ended.result.result == "success"
    assert ended.degrees == pytest.approx(degrees, abs=0.25)


@pytest.mark.parametrize("lag", [0.0, 0.1, 0.2])
@pytest.mark.parametrize("speed", ["0.3 m/s", "0.5 m/s"])
def test_a_square_of_three_metres_closes_within_two_centimetres_and_half_a_degree(speed: str, lag: float) -> None:
    ended = run("square_3m", hall(lag=lag), params={"speed": speed})
    assert ended.result.result == "success"
    assert math.hypot(ended.pose.x, ended.pose.y) < 0.02
    assert ended.degrees == pytest.approx(360.0, abs=0.5)


def test_drive_with_slip_and_lag_ends_by_odometry(step: Steps) -> None:
    ended = run(step(drive="1 m"), hall(slip=0.05, lag=0.1))
    assert ended.result.result == "success"
    assert ended.found == pytest.approx(1.0, abs=0.01)
    assert ended.pose.x == pytest.approx(0.95, abs=0.01)


def test_square_with_slip_and_lag_closes_by_odometry() -> None:
    ended = run("square_3m", hall(slip=0.05, lag=0.1), robot="turtlebot2")
    assert ended.result.result == "success"
    ahead, left = map(float, re.findall(r"-?[0-9.]+(?= m)", ended.said))
    assert math.hypot(ahead, left) < 0.02


def test_go_to_reaches_position_and_heading(step: Steps) -> None:
    ended = run(step(go_to={"x": "1.5 m", "y": "-0.8 m", "heading": "90 deg"}), hall(lag=0.1))
    assert ended.result.result == "success"
    assert math.hypot(ended.pose.x - 1.5, ended.pose.y + 0.8) < 0.025
    assert ended.degrees == pytest.approx(90.0, abs=0.5)


def test_arc_ends_on_its_circle(step: Steps) -> None:
    ended = run(step(arc={"radius": "1 m", "angle": "180 deg"}), hall())
    assert ended.result.result == "success"
    assert math.hypot(ended.pose.x, ended.pose.y - 2.0) < 0.03
