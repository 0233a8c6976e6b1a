"""A range finder in the assembly: the real driver over a virtual device, in the same world as the base."""

from math import cos, radians
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

from behaviours.robot import Robot
from config.library import find_file
from config.robot import RobotConfig
from config.world import load_world
from drivers.api import Angles, wrap_angles
from drivers.api.kinds import PORT_KINDS
from drivers.base.range_twin import RangerTwin
from drivers.clock import ManualClock, SystemClock
from drivers.errors import BadRequest, NotConnected
from missions.assembly.simulation import Simulation
from missions.executive.events import Event, Logged
from missions.executive.state import state_of
from missions.library.drivers import load_robot
from missions.request import RunRequest
from missions.runner import Runner

MISSION = """\
mission: m
tree:
  sequence:
    - wait: 8 s
      until: range.ahead < 12 m
    - log: "${range.ahead / 1 m} ${range.nearest / 1 m}"
"""


@pytest.fixture
def turtlebot() -> RobotConfig:
    return load_robot(find_file("robots", "turtlebot2"))


def measured(folder: Path, *, simulate: Literal["wire", "fast"]) -> tuple[float, float]:
    """Return what a mission reads of the range finder in a corridor: ahead, and all around."""
    mission = folder / "m.yaml"
    mission.write_text(MISSION, encoding="utf-8")
    events: list[Event] = []
    order = RunRequest(str(mission), robot="turtlebot2", simulate=simulate, world="corridor", eyes="truth")
    assert Runner(order, listeners=[events.append]).run().result == "success"
    (line,) = [event.text for event in events if isinstance(event, Logged) and event.level == "info"]
    ahead, nearest = map(float, line.split())
    return ahead, nearest


@pytest.mark.parametrize("simulate", ["wire", "fast"])
@pytest.mark.real_time
def test_mission_reads_the_range_finder(tmp_path: Path, simulate: Literal["wire", "fast"]) -> None:
    # The robot is in the middle of a corridor of 2 m, whose walls reach into what is ahead at 30 degrees.
    ahead, nearest = measured(tmp_path, simulate=simulate)
    assert nearest == pytest.approx(1.0, abs=0.1)
    assert 1.3 <= ahead <= 1.0 / cos(radians(60)) + 0.1


def test_a_range_finder_has_a_port_as_other_parts_on_a_wire_have(turtlebot: RobotConfig) -> None:
    clock = SystemClock()
    simulation = Simulation(
        turtlebot, frozenset(PORT_KINDS) & turtlebot.parts, clock, world=load_world(find_file("worlds", "empty"))
    )
    assert set(simulation.ports) == {"base", "range"}
    simulation.close()


def looked(*things: tuple[float, float]) -> tuple[Any, ManualClock]:
    """Return what expressions read of a range finder that sees things at these bearings (deg) and distances (m)."""

    def look(found: Angles, time: float) -> Angles:
        del time
        far = np.full(len(found), np.inf)
        for bearing, distance in things:
            far[np.argmin(np.abs(wrap_angles(found - radians(bearing))))] = distance
        return far

    clock = ManualClock()
    twin = RangerTwin(look, clock, noise=0.0)
    twin.open()
    for _ in range(2):
        clock.advance(twin.STEP_INTERVAL)
        twin.step()
    return state_of(Robot(ranger_part=twin), clock)["range"], clock


def test_range_ahead_covers_30_degrees_and_nearest_all_directions() -> None:
    state, _ = looked((29, 1.5), (-20, 2.0), (40, 0.5), (180, 0.25))
    assert (state.nearest, state.ahead) == (0.25, 1.5)


def test_range_ahead_without_obstacle_is_the_maximum_range() -> None:
    state, _ = looked((90, 3.0))
    assert (state.nearest, state.ahead) == (3.0, 12.0)


def test_an_old_turn_is_not_trusted() -> None:
    state, clock = looked((0, 1.0))
    clock.advance(1.0)
    for name in ("nearest", "ahead"):
        with pytest.raises(NotConnected, match="the range finder does not report"):
            getattr(state, name)


def test_range_state_is_none_without_a_range_finder() -> None:
    state = state_of(Robot(), ManualClock())["range"]
    assert [getattr(state, name) for name in ("nearest", "ahead")] == [None, None]


def test_undeclared_need_of_a_range_finder_gives_a_hint() -> None:
    with pytest.raises(BadRequest, match="this robot has no range") as caught:
        Robot().ranger  # noqa: B018 - the asking is what is tested
    assert "{'range'}" in caught.value.hint
