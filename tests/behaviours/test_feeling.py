"""What the base feels, as conditions, and what it shows and sounds."""

import math
from dataclasses import replace

import pytest

from behaviours.base_conditions import BatteryBelow, Bumped, ButtonPressed, Cliff, Docked, ObstacleWithin
from behaviours.leaf import FAILURE, RUNNING, SUCCESS, Leaf
from behaviours.signals import Led, SoundLeaf
from drivers.api import BaseState, Lamp, Pose2D, Sides, Tune, Velocity
from drivers.errors import BadRequest
from missions.plugins.testing.recorders import OFFLINE_ERROR, LeafTestBench, good, none, stale

HERE = BaseState(Pose2D(0.0, 0.0, 0.0), Velocity(0.0, 0.0), battery_percent=40.0)
LEFT = Sides(left=True)


@pytest.mark.parametrize(
    ("leaf", "values", "felt", "reason"),
    [
        (Bumped("bumped"), {}, replace(HERE, bumper=LEFT), "bumper left"),
        (Bumped("bumped"), {"side": "left"}, replace(HERE, bumper=LEFT), "bumper left"),
        (Cliff("cliff"), {}, replace(HERE, cliff=Sides(centre=True, right=True)), "cliff centre and right"),
        (Cliff("cliff"), {"side": "right"}, replace(HERE, cliff=Sides(right=True)), "cliff right"),
        (BatteryBelow("battery_below"), {"percent": 0.5}, HERE, "the battery holds 40 %"),
        (Docked("docked"), {}, replace(HERE, docked=True), ""),
        (ButtonPressed("button_pressed"), {"number": 1}, replace(HERE, buttons=frozenset({0, 1})), ""),
    ],
)
def test_sensor_conditions_succeed_when_their_signal_is_present(
    leaf: Leaf, values: dict[str, object], felt: BaseState, reason: str
) -> None:
    bench = LeafTestBench()
    bench.put(leaf, **values)
    bench.base.reading = good(felt)
    assert bench.tick(leaf) is SUCCESS
    assert leaf.reason == reason


@pytest.mark.parametrize(
    ("leaf", "values", "felt", "reason"),
    [
        (Bumped("bumped"), {}, HERE, "no bumper"),
        (Bumped("bumped"), {"side": "right"}, replace(HERE, bumper=LEFT), "bumper left"),
        (Bumped("bumped"), {}, replace(HERE, cliff=LEFT), "no bumper"),
        (Cliff("cliff"), {}, replace(HERE, bumper=LEFT), "no cliff"),
        (BatteryBelow("battery_below"), {"percent": 0.4}, HERE, "the battery holds 40 %"),
        (Docked("docked"), {}, replace(HERE, charging=True), "not on the dock"),
        (
            ButtonPressed("button_pressed"),
            {"number": 2},
            replace(HERE, buttons=frozenset({0})),
            "button 2 is not pressed",
        ),
    ],
)
def test_sensor_conditions_fail_with_the_present_signals(
    leaf: Leaf, values: dict[str, object], felt: BaseState, reason: str
) -> None:
    bench = LeafTestBench()
    bench.put(leaf, **values)
    bench.base.reading = good(felt)
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == reason


def conditions(bench: LeafTestBench) -> list[Leaf]:
    return [
        bench.put(Bumped("bumped")),
        bench.put(Cliff("cliff")),
        bench.put(BatteryBelow("battery_below"), percent=1.0),
        bench.put(Docked("docked")),
        bench.put(ButtonPressed("button_pressed"), number=0),
    ]


def test_conditions_are_suspended_while_the_base_does_not_report() -> None:
    bench = LeafTestBench()
    everything = replace(HERE, bumper=LEFT, cliff=LEFT, docked=True, buttons=frozenset({0}))
    for reading in (stale(everything), none()):
        bench.base.reading = reading
        for leaf in conditions(bench):
            assert bench.tick(leaf) is RUNNING
            assert (leaf.is_suspended, leaf.reason) == (True, "waiting: the base does not report")
            assert bench.tick(leaf, after=4.9) is RUNNING
            assert bench.tick(leaf, after=0.1) is FAILURE
            assert leaf.reason == "the base has not reported for 5 s"


# --- the range finder ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("angle", "distance", "sector", "status", "reason"),
    [
        (0, 0.5, 60, SUCCESS, "50 cm away"),
        (29, 0.5, 60, SUCCESS, "50 cm away"),
        (-29, 0.5, 60, SUCCESS, "50 cm away"),
        (31, 0.5, 60, FAILURE, "nothing in sight"),
        (180, 0.5, 360, SUCCESS, "50 cm away"),
        (0, 0.7, 60, FAILURE, "70 cm away"),
    ],
)
def test_obstacle_within_checks_distance_and_sector(
    angle: int, distance: float, sector: float, status: object, reason: str
) -> None:
    bench = LeafTestBench()
    leaf = bench.put(ObstacleWithin("obstacle_within"), distance=0.6, sector=math.radians(sector))
    bench.ranger.show({angle: distance})
    assert bench.tick(leaf) is status
    assert leaf.reason == reason


def test_obstacle_within_is_suspended_while_the_range_finder_does_not_report() -> None:
    bench = LeafTestBench()
    leaf = bench.put(ObstacleWithin("obstacle_within"), distance=1.0)
    bench.ranger.show({0: 0.5})
    seen = bench.ranger.reading.value
    assert seen is not None
    for reading in (stale(seen), none()):
        bench.ranger.reading = reading
        assert bench.tick(leaf) is RUNNING
        assert (leaf.is_suspended, leaf.reason) == (True, "waiting: the range finder does not report")
    bench.ranger.show({0: 0.5})
    assert bench.tick(leaf) is SUCCESS
    assert not leaf.is_suspended


# --- what it shows and sounds ----------------------------------------------------------------------------------------


def test_a_tune_and_a_tone_are_played_once() -> None:
    bench = LeafTestBench()
    assert bench.tick(bench.put(SoundLeaf("sound"), tune="recharge")) is SUCCESS
    assert bench.tick(bench.put(SoundLeaf("sound"), tone=440.0, duration=0.2)) is SUCCESS
    assert bench.base.commands == [Tune.RECHARGE, (440.0, 0.2)]


@pytest.mark.parametrize("values", [{}, {"tune": "on", "tone": 440.0}])
def test_a_sound_is_one_of_the_two(values: dict[str, object]) -> None:
    bench = LeafTestBench()
    leaf = bench.put(SoundLeaf("sound"), **values)
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "needs either a tune or a tone"
    assert bench.base.commands == []


def test_a_light_is_switched() -> None:
    bench = LeafTestBench()
    assert bench.tick(bench.put(Led("led"), colour="red")) is SUCCESS
    assert bench.tick(bench.put(Led("led"), colour="off", number=2)) is SUCCESS
    assert bench.base.commands == [(1, Lamp.RED), (2, Lamp.OFF)]


def test_sound_and_led_wait_for_an_offline_base_and_fail_on_unsupported_values() -> None:
    bench = LeafTestBench()
    for leaf in (bench.put(SoundLeaf("sound"), tune="on"), bench.put(Led("led"), colour="red")):
        bench.base.trouble = OFFLINE_ERROR
        assert bench.tick(leaf) is RUNNING
        bench.base.trouble = BadRequest("base: no light 1")
        assert bench.tick(leaf) is FAILURE
        assert leaf.reason == "base: no light 1"
