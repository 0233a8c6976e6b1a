"""Tests of what can be varied in a world."""

from collections.abc import Mapping
from math import atan2, degrees, hypot, pi, remainder
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.diagnostics import SourceText
from config.library import shipped_files
from config.world import WorldConfig, parse_world
from config.world_items import PersonConfig
from config.yaml_nodes import read_source
from missions.plugins.testing.sweep.parameters import find_parameter, parameter_names
from missions.plugins.testing.sweep.variation import DrawnValue, ValueList, Variation
from missions.plugins.testing.sweep.worlds import plain_world, vary_world

HALL: dict[str, Any] = {
    "world": "hall",
    "room": {"length": "40 m", "width": "40 m", "centre": ["0 m", "0 m"]},
    "start": {"at": ["2 m", "-1 m"], "heading": "90 deg"},
    "people": [
        {"name": "Anna", "at": ["2 m", "1 m"], "walk": [["3 m", "1 m"]]},
        {"name": "Ben", "at": ["4 m", "-1 m"]},
    ],
}


def turned(drawn: Mapping[str, DrawnValue], world: dict[str, Any] = HALL, seed: int = 0) -> WorldConfig:
    """The world with these values."""
    pairs = [(Variation(name, "", ValueList((value,))), value) for name, value in drawn.items()]
    return parse_world(SourceText("hall.yaml", vary_world(world, pairs, seed)))


def seen_from_start(world: WorldConfig, person: PersonConfig) -> tuple[float, float]:
    """How far and in which direction (degrees, to the left) somebody is."""
    x, y = person.x - world.start.x, person.y - world.start.y
    return hypot(x, y), degrees(remainder(atan2(y, x) - world.start.heading, 2 * pi))


@given(st.floats(0.6, 15), st.floats(-170, 170))
def test_a_person_is_put_where_the_run_has_drawn(far: float, angle: float) -> None:
    world = turned({"person.bearing": angle, "person.distance": far})
    assert seen_from_start(world, world.people[0]) == pytest.approx((far, angle), abs=0.02)


def test_a_walk_comes_along_with_the_walker() -> None:
    (point,) = turned({"person.distance": 5.0}).people[0].path
    assert point == pytest.approx((3.0, 4.0))
    (point,) = turned({"person.bearing": 90.0}).people[0].path
    assert point == pytest.approx((0.0, 0.0))


def test_the_second_person_is_varied_by_number() -> None:
    world = turned({"person2.distance": 3.0})
    assert (world.people[0].x, world.people[0].y) == (2.0, 1.0)
    assert (world.people[1].x, world.people[1].y) == pytest.approx((5.0, -1.0))


def test_speed_makes_a_standing_person_walk_across_the_view() -> None:
    ben = turned({"person2.speed": 0.4}).people[1]
    assert ben.speed == 0.4
    assert [*ben.path[0], *ben.path[1]] == pytest.approx([4.0, -1.8, 4.0, -0.2])


def test_speed_keeps_an_existing_path_and_zero_removes_it() -> None:
    assert turned({"person.speed": 0.4}).people[0].path == ((3.0, 1.0),)
    assert turned({"person.speed": 0.0}).people[0].path == ()


def test_the_walk_is_across_the_view_from_where_the_person_was_put_whatever_the_order() -> None:
    one = turned({"person2.speed": 0.4, "person2.distance": 5.0})
    other = turned({"person2.distance": 5.0, "person2.speed": 0.4})
    assert one == other
    assert one.people[1].path[0] == pytest.approx((7.0, -1.8))


def test_facing_counts_from_looking_at_the_robot() -> None:
    assert turned({"person.facing": 0.0}).people[0].facing == pytest.approx(-pi / 2)
    assert turned({"person2.facing": 90.0}).people[1].facing == pytest.approx(pi + pi / 2)


def test_looks_and_heights_are_set() -> None:
    anna = turned({"person.look": "farah", "person.height": 1.25}).people[0]
    assert (anna.look, anna.height) == ("farah", 1.25)


def test_people_go_or_come_to_places_of_the_runs_own() -> None:
    assert [person.name for person in turned({"people": 1}).people] == ["Anna"]
    assert turned({"people": 0}).people == ()
    four = turned({"people": 4}, seed=1)
    assert [person.name for person in four.people] == ["Anna", "Ben", "Guest 3", "Guest 4"]
    assert all(1.1 < seen_from_start(four, person)[0] < 3.1 for person in four.people[2:])
    assert turned({"people": 4}, seed=1) == four
    assert turned({"people": 4}, seed=2) != four


def test_the_world_as_a_whole_is_varied() -> None:
    values: dict[str, DrawnValue] = {"light": 25.0, "noise": 12.0, "slip": 5.0, "lag": 0.2, "dropouts": 10.0}
    world = turned(
        values, {**HALL, "light": [{"at": "1 s", "light": "10 %"}], "physics": {"slip": "1 %", "lag": "1 s"}}
    )
    assert (world.light, world.light_changes, world.noise) == (0.25, (), 12.0)
    assert (world.physics.slip, world.physics.lag, world.physics.dropouts) == (0.05, 0.2, 0.1)


def test_camera_noise_of_the_world_can_be_varied() -> None:
    assert turned({"noise": 12.0}, {**HALL, "camera": {"noise": 5}}).noise == 12.0


@pytest.mark.parametrize("name", [name for name in parameter_names() if not name.startswith("param.")])
def test_every_listed_parameter_can_be_varied(name: str) -> None:
    kind = find_parameter(name).kind
    value: DrawnValue = "ben" if kind == "text" else 1 if kind == "count" else 0.9
    assert turned({name: value}) != turned({})


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("person.distanse", "did you mean 'person.distance'?"),
        ("lihgt", "did you mean 'light'?"),
        ("person0.distance", "did you mean 'person.distance'?"),
        (
            "weather",
            "known are: people, light, noise, slip, lag, dropouts, friction, masses, servo_delay, slope, push, ",
        ),
    ],
)
def test_unknown_parameter_is_refused_with_a_suggestion(name: str, hint: str) -> None:
    with pytest.raises(LookupError) as unknown:
        find_parameter(name)
    assert str(unknown.value).startswith(hint)


def test_missing_person_cannot_be_varied() -> None:
    with pytest.raises(ValueError, match="the world 'hall' has no person 3"):
        turned({"person3.distance": 1.0})
    with pytest.raises(ValueError, match="the world 'empty' has no person 1"):
        turned({"person.distance": 1.0}, {"world": "empty"})


def test_variation_leaves_the_world_unchanged() -> None:
    before = repr(HALL)
    turned({"person.distance": 5.0, "people": 5, "lag": 0.1})
    assert repr(HALL) == before


@pytest.mark.parametrize("name", shipped_files("worlds"))
def test_every_shipped_world_survives_being_written(name: str) -> None:
    source = read_source(shipped_files("worlds")[name])
    again = SourceText(source.name, vary_world(plain_world(source), [], 0))
    assert parse_world(again) == parse_world(source)
