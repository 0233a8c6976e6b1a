"""Following objects and robots, and following without a head."""

from dataclasses import replace

import pytest

from behaviours.leaf import FAILURE, RUNNING
from behaviours.robot import Robot
from behaviours.tracking.follow import RuleBases
from behaviours.tracking.track import TrackFace, TrackObject, TrackRobot
from config.controller import load_controller
from config.library import shipped_files
from drivers.api import BaseState, HeadPose, Pose2D, Velocity
from missions.plugins.testing.recorders import STOP, LeafTestBench, face, good
from perception.api import Box, Marker, Thing, ThingSpec

BOX = Box(300, 220, 40, 40)


@pytest.fixture(scope="module")
def rules() -> RuleBases:
    return RuleBases.from_mapping(load_controller(shipped_files("controllers")["face"]).values)


def thing(stamp: float, name: str, *, number: int = 1, yaw: float = 0.0) -> Thing:
    colour, shape = name.split()
    return Thing(number, stamp, BOX, yaw, 0.0, yaw, 0.0, 0.0, 0.0, 1.5, name, colour, shape)


def marker(stamp: float, number: int, name: str, *, yaw: float = 0.0) -> Marker:
    return Marker(number + 100, stamp, BOX, yaw, 0.0, yaw, 0.0, 0.0, 0.0, 1.5, number, name, 0.0)


def aim(bench: LeafTestBench) -> HeadPose:
    return [command for command in bench.head.commands if isinstance(command, HeadPose)][-1]


def test_track_object_tracks_only_the_requested_object(rules: RuleBases) -> None:
    bench = LeafTestBench()
    leaf = bench.put(TrackObject("track_object"), controller=rules, what=ThingSpec("red ball", "red", "ball"))
    for _ in range(30):
        now = bench.clock.now()
        bench.sight.found = [thing(now, "blue box", number=1, yaw=-0.4), thing(now, "red ball", number=2, yaw=0.3)]
        assert bench.tick(leaf) is RUNNING
    assert aim(bench).pan == pytest.approx(0.3, abs=0.01)
    assert leaf.reason == "object 2, 17 deg off"
    assert leaf.result == bench.sight.found[1]


def test_track_object_reports_a_lost_object(rules: RuleBases) -> None:
    bench = LeafTestBench()
    leaf = bench.put(
        TrackObject("track_object"), controller=rules, what=ThingSpec("red ball", "red", "ball"), patience=1.0
    )
    bench.sight.found = [thing(bench.clock.now(), "blue box")]
    assert bench.tick(leaf) is RUNNING
    assert bench.tick(leaf, after=1.1) is FAILURE
    assert leaf.reason == "no object for 1 s"
    assert bench.head.commands == [STOP]


@pytest.mark.parametrize(("which", "pan"), [("7", 0.3), ("R2", 0.3), ("8", -0.4), ("", -0.4)])
def test_track_robot_selects_by_number_or_name_or_size(rules: RuleBases, which: str, pan: float) -> None:
    bench = LeafTestBench()
    leaf = bench.put(TrackRobot("track_robot"), controller=rules, which=which)
    for _ in range(30):
        now = bench.clock.now()
        bench.sight.marked = [marker(now, 8, "", yaw=-0.4), marker(now, 7, "R2", yaw=0.3)]
        assert bench.tick(leaf) is RUNNING
    assert aim(bench).pan == pytest.approx(pan, abs=0.01)


def test_robot_without_a_head_turns_its_base_to_the_face(rules: RuleBases) -> None:
    bench = LeafTestBench()
    bench.robot = Robot(base_part=bench.base, sight_part=bench.sight)
    leaf = bench.put(TrackFace("track_face"), controller=rules)
    turns = []
    for heading in (0.0, 0.2, 0.29):
        bench.clock.advance(1.0)  # so long that what it was told has passed
        bench.base.reading = replace(
            good(BaseState(Pose2D(0.0, 0.0, heading), Velocity(0.0, 0.0))), stamp=bench.clock.now()
        )
        bench.sight.seen = [face(bench.clock.now(), yaw=0.3)]
        assert bench.tick(leaf) is RUNNING
        command = bench.base.commands[-1]
        assert isinstance(command, Velocity)
        turns.append(command.angular)
    assert turns[0] > turns[1] > turns[2] > 0.0
    assert bench.head.commands == []
    assert bench.halt(leaf)
    assert bench.base.commands[-1] == STOP
