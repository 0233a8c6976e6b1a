"""Following a person: how fast the base is told to drive, when it is not, and that it stops."""

import math
from dataclasses import replace

import pytest

from behaviours.catalogue import LEAVES
from behaviours.leaf import FAILURE, RUNNING
from behaviours.tracking.follow import RuleBases
from behaviours.tracking.track import FollowPerson
from config.controller import load_controller
from config.diagnostics import InvalidFileError
from config.diagnostics import SourceText as FileSource
from config.library import shipped_files
from drivers.api import BaseState, HeadPose, Pose2D, Sides, Source, Steering, Velocity
from missions.language.document import check_plan
from missions.library.lookups import LOOKUPS
from missions.plugins.testing.recorders import STOP, LeafTestBench, face, good, none, stale

LEFT = Sides(left=True)
STILL = BaseState(Pose2D(0.0, 0.0, 0.0), Velocity(0.0, 0.0))


@pytest.fixture(scope="module")
def rules() -> RuleBases:
    return RuleBases.from_mapping(load_controller(shipped_files("controllers")["face"]).values)


def following(bench: LeafTestBench, rules: RuleBases, **arguments: object) -> FollowPerson:
    return bench.put(FollowPerson("follow_person"), controller=rules, **arguments)


def show(bench: LeafTestBench, distance: float, *, yaw: float = 0.0, number: int = 1) -> None:
    """Show one face at a distance in metres, seen now."""
    bench.sight.seen = [replace(face(bench.clock.now(), number=number, yaw=yaw), distance=distance)]


def told(bench: LeafTestBench) -> Velocity:
    velocity = bench.base.commands[-1]
    assert isinstance(velocity, Velocity)
    return velocity


@pytest.mark.parametrize(
    ("distance", "speed"), [(5.0, 0.3), (1.5, 0.3), (1.3, 0.16), (1.1, 0.0), (1.0, 0.0), (0.4, 0.0)]
)
def test_follow_person_drives_faster_with_distance_and_never_backwards(
    distance: float, speed: float, rules: RuleBases
) -> None:
    bench = LeafTestBench()
    leaf = following(bench, rules)
    show(bench, distance)
    assert bench.tick(leaf) is RUNNING
    assert told(bench).linear == pytest.approx(speed)


def test_follow_person_drives_slower_while_the_head_looks_aside(rules: RuleBases) -> None:
    speeds = []
    for pan in (0.0, 0.3, 0.6, 0.9):
        bench = LeafTestBench()
        bench.head.reading = good(HeadPose(pan, 0.0))
        leaf = following(bench, rules)
        show(bench, 4.0, yaw=pan)
        bench.tick(leaf)
        speeds.append(told(bench).linear)
    assert speeds == sorted(speeds, reverse=True)
    assert speeds[0] == 0.3
    assert speeds[-1] == 0.0


def test_follow_person_turns_the_base_after_the_head(rules: RuleBases) -> None:
    bench = LeafTestBench()
    bench.head.reading = good(HeadPose(1.2, 0.0))
    leaf = following(bench, rules)
    show(bench, 4.0, yaw=1.2)
    bench.tick(leaf)
    assert told(bench).angular > 0.5


@pytest.mark.parametrize(
    ("felt", "reason"),
    [
        (replace(STILL, bumper=LEFT), "bumped into something"),
        (replace(STILL, cliff=LEFT), "a cliff ahead"),
        (replace(STILL, wheel_drop=LEFT), "a wheel has dropped"),
    ],
)
def test_follow_person_fails_and_stops_head_and_base_on_contact(felt: BaseState, reason: str, rules: RuleBases) -> None:
    bench = LeafTestBench()
    leaf = following(bench, rules)
    show(bench, 3.0)
    bench.tick(leaf)
    bench.base.reading = good(felt)
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == reason
    assert bench.base.commands[-1] == STOP
    assert bench.head.commands[-1] == STOP


def test_follow_person_slows_down_and_stops_before_obstacles(rules: RuleBases) -> None:
    speeds = []
    for distance in (3.0, 0.5, 0.35, 0.2):
        bench = LeafTestBench()
        leaf = following(bench, rules)
        bench.ranger.show({0: distance})
        show(bench, 4.0)
        bench.tick(leaf)
        speeds.append(told(bench).linear)
    assert speeds == sorted(speeds, reverse=True)
    assert speeds[0] == 0.3
    assert 0.0 < speeds[2] < 0.25
    assert speeds[3] == 0.0


def test_follow_person_does_not_drive_while_the_range_finder_is_silent(rules: RuleBases) -> None:
    bench = LeafTestBench()
    leaf = following(bench, rules)
    bench.ranger.reading = none()
    show(bench, 4.0)
    assert bench.tick(leaf) is RUNNING
    assert told(bench).linear == 0.0


def test_follow_person_fails_on_a_latched_base(rules: RuleBases) -> None:
    bench = LeafTestBench()
    leaf = following(bench, rules)
    bench.base.latched = "button 0 was pressed"
    show(bench, 4.0)
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "the base is stopped: button 0 was pressed"


def test_follow_person_does_not_drive_without_fresh_odometry(rules: RuleBases) -> None:
    bench = LeafTestBench()
    leaf = following(bench, rules)
    bench.base.reading = stale(STILL)
    show(bench, 3.0)
    assert bench.tick(leaf) is RUNNING
    assert told(bench).linear == 0.0


def test_follow_person_stops_and_then_fails_without_a_face(rules: RuleBases) -> None:
    bench = LeafTestBench()
    leaf = following(bench, rules, patience=1.0)
    show(bench, 3.0)
    bench.tick(leaf)
    bench.sight.seen = ()
    assert bench.tick(leaf, after=0.5) is RUNNING
    assert told(bench) == Velocity(0.0, 0.0)
    assert bench.tick(leaf, after=0.6) is FAILURE
    assert leaf.reason == "no face for 1 s"
    assert bench.base.commands[-1] == STOP


def test_follow_person_starts_with_the_named_face(rules: RuleBases) -> None:
    bench = LeafTestBench()
    now = bench.clock.now()
    larger, named = face(now, number=1, yaw=0.5), replace(face(now, number=2, yaw=-0.5), distance=1.0)
    leaf = following(bench, rules, face=named)
    bench.sight.seen = [larger, named]
    bench.tick(leaf)
    assert leaf.result == named


def test_a_halt_stops_the_base(rules: RuleBases) -> None:
    bench = LeafTestBench()
    leaf = following(bench, rules)
    show(bench, math.inf)
    bench.tick(leaf)
    assert told(bench).linear == 0.3
    assert bench.halt(leaf)
    assert bench.base.commands[-1] == STOP


def test_follow_person_refuses_a_distance_below_the_minimum() -> None:
    with pytest.raises(InvalidFileError, match=r"'distance' must be between 0\.6 m and 5 m"):
        check_plan(FileSource("m.yaml", "mission: m\ntree: {follow_person: {distance: 0.59 m}}\n"), LEAVES, LOOKUPS)
    check_plan(FileSource("m.yaml", "mission: m\ntree: {follow_person: {distance: 0.6 m}}\n"), LEAVES, LOOKUPS)


def test_follow_person_fails_after_five_seconds_behind_the_range_guard(rules: RuleBases) -> None:
    bench = LeafTestBench()
    leaf = following(bench, rules)
    because = "something is in the way, 0.1 m ahead"
    blocked = Steering(Source.MISSION, Velocity(0.3, 0.0), Velocity(0.0, 0.0), because)
    slowed = replace(blocked, allowed=Velocity(0.05, 0.0))
    for steering, seconds in ((blocked, 4.9), (slowed, 0.2), (blocked, 4.9)):
        bench.base.steers = steering
        for _ in range(round(seconds / 0.1)):
            show(bench, 3.0)
            assert bench.tick(leaf, after=0.1) is RUNNING
    for _ in range(3):
        show(bench, 3.0)
        status = bench.tick(leaf, after=0.1)
    assert status is FAILURE
    assert leaf.feedback_message == because
