"""Wandering: where it goes by what it sees and has bumped into, and what the base is told."""

import math
from dataclasses import replace
from typing import Any

import pytest

from behaviours.leaf import FAILURE, RUNNING
from behaviours.robot import Robot
from behaviours.wander import BACK_OFF_DISTANCE, BLIND_SPEED, CHOICE_INTERVAL, SHUT_IN_TIMEOUT, Wander
from drivers.api import BaseState, Pose2D, Sides, Source, Steering, Velocity
from missions.plugins.testing.recorders import STOP, LeafTestBench, good, none

STILL = Velocity(0.0, 0.0)
HERE = BaseState(Pose2D(0.0, 0.0, 0.0), STILL)
ROUND = range(360)


def wandering(bench: LeafTestBench, *, blind: bool = False, **arguments: object) -> Wander:
    leaf = bench.put(Wander("wander"), **arguments)
    if blind:
        leaf.robot = Robot(base_part=bench.base)
    return leaf


def told(bench: LeafTestBench) -> Velocity:
    velocity = bench.base.commands[-1]
    assert isinstance(velocity, Velocity)
    return velocity


def stand(bench: LeafTestBench, x: float = 0.0, heading: float = 0.0, **felt: Any) -> None:
    bench.base.reading = good(replace(BaseState(Pose2D(x, 0.0, heading), STILL), **felt))


def test_wander_drives_straight_ahead_without_obstacles() -> None:
    bench = LeafTestBench()
    assert bench.tick(wandering(bench, speed=0.4)) is RUNNING
    assert told(bench) == Velocity(0.4, 0.0)


def test_wander_turns_towards_free_space() -> None:
    bench = LeafTestBench()
    bench.ranger.show({angle: 3.0 if 50 <= angle <= 130 else 0.6 for angle in ROUND})
    bench.tick(wandering(bench))
    assert told(bench).linear == 0.0
    assert told(bench).angular > 0.5


def test_wander_slows_down_near_obstacles() -> None:
    speeds = []
    for distance in (2.0, 1.0, 0.6, 0.4):
        bench = LeafTestBench()
        bench.ranger.show(dict.fromkeys(ROUND, distance))
        leaf = wandering(bench, speed=0.5)
        bench.tick(leaf)
        speeds.append(told(bench).linear)
    assert speeds == sorted(speeds, reverse=True)
    assert speeds[0] == 0.5
    assert speeds[-1] < 0.25


def test_wander_prefers_unvisited_directions() -> None:
    bench = LeafTestBench()
    bench.ranger.show(dict.fromkeys(ROUND, 2.5))
    leaf = wandering(bench)
    for x in (0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5):
        stand(bench, x)
        bench.tick(leaf, after=CHOICE_INTERVAL)
    stand(bench, 1.5, heading=math.pi)  # back where it came from
    bench.tick(leaf, after=CHOICE_INTERVAL)
    assert abs(told(bench).angular) > 0.3


def test_wander_stops_and_waits_for_a_silent_range_finder() -> None:
    bench = LeafTestBench()
    leaf = wandering(bench)
    bench.tick(leaf)
    bench.ranger.reading = none()
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == "waiting for the range finder"
    assert told(bench) == STILL


def test_blind_wander_drives_at_the_blind_speed() -> None:
    bench = LeafTestBench()
    bench.tick(wandering(bench, blind=True, speed=0.5))
    assert told(bench) == Velocity(BLIND_SPEED, 0.0)


@pytest.mark.parametrize("blind", [True, False])
@pytest.mark.parametrize("what", ["bumper", "cliff"])
def test_wander_backs_off_straight_after_contact_and_turns_away(what: str, *, blind: bool) -> None:
    bench = LeafTestBench()
    leaf = wandering(bench, blind=blind)
    bench.tick(leaf)
    felt: dict[str, Any] = {what: Sides(centre=True)}
    stand(bench, 1.0, **felt)
    assert bench.tick(leaf) is RUNNING
    assert told(bench).linear < 0.0
    assert told(bench).angular == 0.0
    stand(bench, 1.0 - BACK_OFF_DISTANCE / 2)
    bench.tick(leaf)
    assert told(bench).linear < 0.0
    stand(bench, 1.0 - BACK_OFF_DISTANCE - 0.01)
    bench.tick(leaf)
    assert told(bench).linear == 0.0
    assert abs(told(bench).angular) > 0.3


def test_wander_waits_while_the_base_backs_off() -> None:
    bench = LeafTestBench()
    leaf = wandering(bench)
    bench.tick(leaf)
    stand(bench, 1.0, bumper=Sides(left=True))
    bench.base.steers = Steering(Source.SAFETY, STILL, STILL, "backing off: bumper left")
    bench.base.commands.clear()
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == "backing off: bumper left"
    assert bench.base.commands == []


def test_wander_fails_after_a_while_when_enclosed() -> None:
    bench = LeafTestBench()
    bench.ranger.show(dict.fromkeys(ROUND, 0.25))
    leaf = wandering(bench)
    assert bench.tick(leaf) is RUNNING
    assert told(bench) == STILL
    assert bench.tick(leaf, after=SHUT_IN_TIMEOUT + 0.1) is FAILURE
    assert leaf.reason == "no way out"


def test_wander_fails_on_a_wheel_drop_or_a_latched_base() -> None:
    cases: tuple[tuple[str, dict[str, Any], str], ...] = (
        ("", {"wheel_drop": Sides(left=True)}, "a wheel has dropped"),
        ("button 0 was pressed", {}, "the base is stopped: button 0 was pressed"),
    )
    for latched, felt, reason in cases:
        bench = LeafTestBench()
        leaf = wandering(bench)
        bench.tick(leaf)
        stand(bench, **felt)
        bench.base.latched = latched
        assert bench.tick(leaf) is FAILURE
        assert leaf.reason == reason
        assert bench.base.commands[-1] == STOP


def test_a_halt_stops_the_base() -> None:
    bench = LeafTestBench()
    leaf = wandering(bench)
    bench.tick(leaf)
    assert bench.halt(leaf)
    assert bench.base.commands[-1] == STOP
