"""Things and other robots: what counts as seen, and the searches for them."""

from collections.abc import Sequence

import pytest

from behaviours.leaf import FAILURE, RUNNING, SUCCESS, Leaf
from behaviours.other_robots import FindRobot, RobotSeenLeaf
from behaviours.search import FindObject, ObjectSeenLeaf
from drivers.api import HeadPose
from missions.plugins.testing.recorders import STOP, LeafTestBench, good
from perception.api import Marker, Thing, ThingSpec
from perception.tracks import common_fields
from tests.behaviours.percepts import percept

RED_BALL = ThingSpec("red ball", "red", "ball")


def thing(bench: LeafTestBench, name: str = "red ball", *, age: float = 0.1, number: int = 1) -> Thing:
    seen = percept(bench.clock.now() - age, number=number)
    return Thing(**common_fields(seen), name=name, colour="red", shape="ball")


def marker(bench: LeafTestBench, number: int, name: str = "", *, age: float = 0.1) -> Marker:
    seen = percept(bench.clock.now() - age, number=number)
    return Marker(**common_fields(seen), number=number, name=name, heading=0.0)


def test_object_seen_finds_and_stores_the_requested_object() -> None:
    bench = LeafTestBench()
    bench.sight.found = [thing(bench, "blue box", number=1), thing(bench, number=2), thing(bench, number=3)]
    leaf = bench.put(ObjectSeenLeaf("object_seen"), what=RED_BALL, output_variable="ball")
    assert bench.tick(leaf) is SUCCESS
    assert bench.run.variables == {"ball": bench.sight.found[1]}


@pytest.mark.parametrize(("age", "status"), [(0.3, SUCCESS), (0.9, FAILURE)])
def test_an_object_seen_too_long_ago_does_not_count(age: float, status: object) -> None:
    bench = LeafTestBench()
    bench.sight.found = [thing(bench, age=age)]
    assert bench.tick(bench.put(ObjectSeenLeaf("object_seen"), what=RED_BALL)) is status


def test_object_seen_within_sets_the_maximum_age() -> None:
    bench = LeafTestBench()
    bench.sight.found = [thing(bench, age=2.0)]
    assert bench.tick(bench.put(ObjectSeenLeaf("object_seen"), what=RED_BALL, within=3.0)) is SUCCESS


@pytest.mark.parametrize(
    ("leaf", "reason"),
    [
        (ObjectSeenLeaf("object_seen"), "no red ball in view"),
        (RobotSeenLeaf("robot_seen"), "no robot in view"),
    ],
)
def test_object_and_robot_conditions_fail_with_their_reason(leaf: Leaf, reason: str) -> None:
    bench = LeafTestBench()
    bench.put(leaf, what=RED_BALL)
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == reason
    bench.sight.searched = None
    assert bench.tick(leaf) is RUNNING
    assert (leaf.is_suspended, leaf.reason) == (True, "waiting: the camera does not report")


@pytest.mark.parametrize(
    ("which", "seen"), [("", 3), ("7", 7), (" 7 ", 7), ("R2", 7), ("3", 3), ("8", None), ("Ann", None)]
)
def test_robot_seen_matches_by_number_or_name_or_any(which: str, seen: int | None) -> None:
    bench = LeafTestBench()
    bench.sight.marked = [marker(bench, 3), marker(bench, 7, "R2")]
    leaf = bench.put(RobotSeenLeaf("robot_seen"), which=which)
    assert bench.tick(leaf) is (FAILURE if seen is None else SUCCESS)
    assert getattr(leaf.result, "number", None) == seen
    assert seen is not None or leaf.reason == f"robot {which} is not in view"


@pytest.mark.parametrize("leaf", [FindObject("find_object"), FindRobot("find_robot")])
def test_search_continues_until_the_requested_target_is_in_view(leaf: Leaf) -> None:
    bench = LeafTestBench()
    bench.put(leaf, what=RED_BALL, which="7", output_variable="it")
    bench.sight.found, bench.sight.marked = [thing(bench, "blue box")], [marker(bench, 3)]
    for _ in range(40):
        bench.sight.searched = bench.clock.now()
        assert bench.tick(leaf) is RUNNING
        bench.head.reading = good(_last_pose(bench.head.commands))
    assert len({command.pan for command in bench.head.commands if isinstance(command, HeadPose)}) > 3
    bench.sight.found, bench.sight.marked = [thing(bench)], [marker(bench, 7)]
    assert bench.tick(leaf) is SUCCESS
    assert bench.run.variables["it"] == leaf.result
    assert bench.head.commands[-1] == STOP


@pytest.mark.parametrize(("leaf", "noun"), [(FindObject("find_object"), "object"), (FindRobot("find_robot"), "robot")])
def test_search_fails_after_its_scans(leaf: Leaf, noun: str) -> None:
    bench = LeafTestBench()
    bench.put(leaf, what=RED_BALL, pan=(-0.4, 0.4), tilt=(0.0, 0.0), step=0.4, scans=1)
    status: object = RUNNING
    for _ in range(200):
        bench.sight.searched = bench.clock.now()
        status = bench.tick(leaf)
        if status is not RUNNING:
            break
        bench.head.reading = good(_last_pose(bench.head.commands))
    assert status is FAILURE
    assert leaf.reason == f"no {noun} found in 1 scan"


def _last_pose(commands: Sequence[object]) -> HeadPose:
    return [command for command in commands if isinstance(command, HeadPose)][-1]
