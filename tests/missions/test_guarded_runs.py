"""Whole runs of robots with a range finder: a leaf that is held up by the range guard, and who else it holds."""

import re
from collections.abc import Mapping
from dataclasses import replace
from math import hypot, inf
from pathlib import Path

import pytest

from config.library import find_file
from config.robot import RobotConfig
from config.world import WorldConfig, load_world
from config.world_items import PersonConfig
from drivers.api import Source, Velocity
from drivers.sim.world import SimulatedWorld
from missions.assembly.part_factory import with_carriers
from missions.control.commands import DriveCommand
from missions.control.wheels import WheelArbiter
from missions.executive.events import FaultRaised
from missions.executive.executive import Result
from missions.library.drivers import load_robot
from missions.request import RunRequest
from missions.runner import Runner

RADIUS = 0.177

STANDS = "sequence: [{log: '${base.x / 1 m}'}, {wait: 12 s}]"
"""A mission that uses the base, and does not drive it."""


class GuardedRun:
    """One run of a tree on a TurtleBot; ``least_clear`` is how near its rim came to anything."""

    def __init__(
        self, folder: Path, tree: str, world: WorldConfig, *, robot: str = "turtlebot2", lines: Mapping[str, str] = {}
    ) -> None:
        mission, named = folder / "m.yaml", folder / "r.robot.yaml"
        mission.write_text(f"mission: m\ntree: {{{tree}}}\n", encoding="utf-8")
        text = find_file("robots", robot).read_text("utf-8")
        for before, after in lines.items():
            assert before in text
            text = text.replace(before, after)
        named.write_text(text, encoding="utf-8")
        self.faults: list[FaultRaised] = []
        order = RunRequest(str(mission), robot=str(named), simulate="fast", world=world, eyes="truth")
        self.runner = Runner(
            order, listeners=[lambda each: self.faults.append(each) if type(each) is FaultRaised else None]
        )
        assert self.runner.twins is not None
        self.twins = self.runner.twins
        self.least_clear = inf
        self.twins.timeline.call_every(0.05, self._look)

    def run(self) -> Result:
        return self.runner.run()

    def _look(self) -> None:
        assert self.twins.base is not None
        at = self.twins.base.body.pose
        self.least_clear = min(self.least_clear, clear(self.twins.world, at.x, at.y, self.twins.timeline.clock.now()))


def clear(world: SimulatedWorld, x: float, y: float, time: float) -> float:
    (x_low, x_high), (y_low, y_high) = world.room.extent()
    near = [x - x_low, x_high - x, y - y_low, y_high - y]
    return min(near + [hypot(*solid.nearest_offset(x, y)) for solid in world.solids(time)]) - RADIUS


def hall(*people: PersonConfig) -> WorldConfig:
    return replace(load_world(find_file("worlds", "empty")), people=people)


def test_drive_towards_an_obstacle_fails_before_contact(tmp_path: Path) -> None:
    ran = GuardedRun(tmp_path, "drive: {distance: 4 m, speed: 0.5 m/s}", load_world(find_file("worlds", "obstacles")))
    result = ran.run()
    assert result.result == "failure"
    assert re.match(r"something is in the way, \d+ cm ahead", result.reason)
    assert ran.least_clear > 0.03


@pytest.mark.parametrize("tree", ["go_to: {x: 2 m, y: 0 m}", "arc: {radius: 3 m, angle: 60 deg}", "drive: -3 m"])
def test_motion_fails_after_five_seconds_before_an_obstacle(tmp_path: Path, tree: str) -> None:
    places = {"go_to": (1.0, 0.0), "arc": (1.0, 0.17), "drive": (-1.0, 0.0)}
    x, y = places[tree.partition(":")[0]]
    ran = GuardedRun(tmp_path, tree, hall(PersonConfig(name="Anna", look="anna", at=(x, y))))
    result = ran.run()
    assert result.result == "failure"
    assert re.match(r"something is in the way, \d+ cm", result.reason)
    assert ("behind" in result.reason) is tree.startswith("drive")
    assert 8.0 < result.seconds < 16.0
    assert ran.least_clear > 0.03


def test_drive_continues_when_the_obstacle_leaves(tmp_path: Path) -> None:
    anna = PersonConfig(name="Anna", look="anna", at=(1.0, 0.0), path=((1.0, 2.0),), speed=0.8, start=7.0, loop=False)
    ran = GuardedRun(tmp_path, "drive: {distance: 2 m}", hall(anna))
    result = ran.run()
    assert result.result == "success"
    assert 13.0 < result.seconds < 19.0


def test_range_guard_can_be_disabled_in_the_robot_file(tmp_path: Path) -> None:
    lines = {"  reflexes:\n": "  range_guard: off\n  reflexes:\n"}
    ran = GuardedRun(
        tmp_path, "drive: {distance: 3 m}", hall(PersonConfig(name="Anna", look="anna", at=(1.0, 0.0))), lines=lines
    )
    assert ran.run().reason == "bumped into something"
    assert "range" not in ran.twins.parts


def test_range_guard_applies_to_driving_from_the_studio(tmp_path: Path) -> None:
    ran = GuardedRun(tmp_path, STANDS, hall(PersonConfig(name="Anna", look="anna", at=(1.0, 0.0))))
    base, clock = ran.runner.assembled_robot.robot.base, ran.twins.timeline.clock
    wheels, number = WheelArbiter(base, None, clock), iter(range(1, 10_000))
    wheels.take("page", "Ada")
    ran.twins.timeline.call_every(
        0.1,
        lambda: wheels.drive("page", DriveCommand(n=next(number), stamp=wheels.stamp(), ahead=1.0, left=0.0, pace=1.0)),
    )
    assert ran.run().result == "success"
    assert 0.03 < ran.least_clear < 0.08


def test_drive_without_scans_fails_with_a_notice(tmp_path: Path) -> None:
    ran = GuardedRun(tmp_path, "drive: {distance: 4 m}", hall())
    ranger = ran.twins.parts["range"]
    ran.twins.timeline.call_at(4.0, ranger.plug.unplug)
    result = ran.run()
    assert result.reason == "the range finder does not report"
    assert 10.0 < result.seconds < 12.5
    told = [each.detail for each in ran.faults if each.part == "base" and each.status == "fault"]
    assert [each.partition(":")[0] for each in told] == [
        "the range finder's scans are late",
        "the range finder does not report",
    ]


def guarded(robot: str) -> RobotConfig:
    return load_robot(find_file("robots", robot))


def test_base_with_range_guard_requires_its_range_finder() -> None:
    assert with_carriers(guarded("turtlebot2"), frozenset({"base"})) == {"base", "range"}
    assert with_carriers(guarded("turtlebot2"), frozenset({"voice"})) == {"voice"}
    assert with_carriers(guarded("wave_rover"), frozenset({"base"})) == {"base"}
    assert not guarded("wave_rover").has_range_guard


@pytest.mark.parametrize("robot", ["turtlebot2", "turtlebot3", "turtlebot4"])
def test_shipped_robots_with_a_range_finder_stop_before_a_person(tmp_path: Path, robot: str) -> None:
    anna = PersonConfig(name="Anna", look="anna", at=(1.0, 0.0))
    ran = GuardedRun(tmp_path, "drive: {distance: 3 m}", hall(anna), robot=robot)
    assert re.match(r"something is in the way, \d+ cm ahead", ran.run().reason)
    assert ran.least_clear > 0.02


def test_range_guard_applies_to_foreign_commands(tmp_path: Path) -> None:
    ran = GuardedRun(tmp_path, STANDS, hall(PersonConfig(name="Anna", look="anna", at=(1.0, 0.0))))
    base = ran.twins.base
    assert base is not None
    ran.twins.timeline.call_every(0.1, lambda: base.drive(Velocity(0.5, 0.0), source=Source.MISSION))
    ran.run()
    assert 0.03 < ran.least_clear < 0.08
