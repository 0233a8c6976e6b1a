"""The simulated world as values: who is where at what time, and what cannot be."""

from math import dist, hypot, radians
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import BadRequest
from drivers.sim.appearances import APPEARANCES
from drivers.sim.people import Person
from drivers.sim.room import Fixture, Room
from drivers.sim.viewpoint import PinholeLens, Viewpoint
from drivers.sim.world import SimulatedWorld

points = st.tuples(st.floats(-2, 4), st.floats(-2, 2))


def test_person_without_a_path_stands_still() -> None:
    person = Person("anna", x=1.5, y=-0.5)
    assert person.position_at(0.0) == person.position_at(1000.0) == (1.5, -0.5)


def test_walk_starts_at_its_time_with_its_speed() -> None:
    person = Person("ben", x=1.0, y=0.0, path=((3.0, 0.0), (3.0, 1.0)), speed=0.5, start=2.0, loop=False)
    assert person.position_at(1.9) == (1.0, 0.0)
    assert person.position_at(4.0) == pytest.approx((2.0, 0.0))
    assert person.position_at(7.0) == pytest.approx((3.0, 0.5))
    assert person.position_at(60.0) == (3.0, 1.0)


def test_looped_path_returns_to_its_start() -> None:
    person = Person("ben", x=1.0, y=0.0, path=((2.0, 0.0),), speed=0.5)
    assert person.position_at(3.0) == pytest.approx((1.5, 0.0))
    assert person.position_at(4.0) == pytest.approx((1.0, 0.0))
    assert person.position_at(5.0) == pytest.approx(person.position_at(1.0))


@given(st.lists(points, max_size=4), st.booleans(), st.floats(0, 100), st.floats(0, 5), st.floats(0.1, 3))
def test_people_never_exceed_their_speed(
    path: list[tuple[float, float]], loop: bool, time: float, later: float, speed: float
) -> None:
    person = Person("chidi", path=tuple(path), loop=loop, speed=speed)
    assert dist(person.position_at(time), person.position_at(time + later)) <= speed * later + 1e-9


@given(st.lists(points, max_size=4), st.booleans(), st.floats(0, 1000))
def test_walk_stays_in_the_room_of_its_waypoints(path: list[tuple[float, float]], loop: bool, time: float) -> None:
    world = SimulatedWorld(people=(Person("dora", path=tuple(path), loop=loop),))
    (presence,) = world.people_at(time)
    assert world.room.contains(presence.x, presence.y, margin=-1e-9)
    assert presence.distance(0, 0) == pytest.approx(hypot(presence.x, presence.y))


def test_unknown_look_lists_the_available_ones() -> None:
    with pytest.raises(BadRequest, match="no look named 'zorro'") as caught:
        Person("anna", look="zorro")
    assert all(look in caught.value.hint for look in APPEARANCES)


@pytest.mark.parametrize(
    ("wrong", "what"),
    [({"height": 3.0}, "eyes at 3.0 m"), ({"speed": 0.0}, "walks at 0.0 m/s"), ({"x": float("nan")}, "not finite")],
)
def test_an_impossible_person_is_refused(wrong: dict[str, Any], what: str) -> None:
    with pytest.raises(BadRequest, match=what):
        Person("anna", **wrong)


def test_a_path_out_of_the_room_is_refused_with_the_extent_of_the_room() -> None:
    with pytest.raises(BadRequest, match=r"ben at \(9, 0\) m is outside") as caught:
        SimulatedWorld(people=(Person("ben", path=((9.0, 0.0),)),))
    assert "x -3..5 m" in caught.value.hint


def test_two_people_cannot_have_one_name() -> None:
    with pytest.raises(BadRequest, match="more than one person is called eve"):
        SimulatedWorld(people=(Person("eve"), Person("eve", x=2.0)))


def test_light_cannot_be_negative() -> None:
    with pytest.raises(BadRequest, match="light -1"):
        SimulatedWorld(light=-1.0)


@pytest.mark.parametrize(
    ("fixture", "what"),
    [
        (Fixture("door", "front", along=2.9), "the wall ends at 3.0 m"),
        (Fixture("window", "left", bottom=1.0, height=2.0), "from 1.0 to 3.0 m"),
        (Fixture("picture", "back", width=0.0), "both sides must be above 0"),
    ],
)
def test_oversized_fixture_is_refused(fixture: Fixture, what: str) -> None:
    with pytest.raises(BadRequest, match=what):
        Room(fixtures=(fixture,))


def test_a_room_has_volume() -> None:
    with pytest.raises(BadRequest, match="every side must be above 0"):
        Room(length=0.0)


@given(st.floats(-7, 7), st.floats(-1.5, 1.5))
def test_a_rotation_keeps_lengths_and_handedness(yaw: float, pitch: float) -> None:
    rotation = np.array(Viewpoint(yaw=yaw, pitch=pitch).rotation())
    assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-9)
    assert np.linalg.det(rotation) == pytest.approx(1.0)


def test_viewpoint_axes_follow_the_camera_convention() -> None:
    ahead, left = (1.0, 0.0, 0.0), (1.0, 0.2, 0.0)
    assert (np.array(Viewpoint().rotation()) @ left)[0] < 0
    assert (np.array(Viewpoint(pitch=0.3).rotation()) @ ahead)[1] < 0
    assert (np.array(Viewpoint(yaw=0.3).rotation()) @ ahead)[0] > 0


def test_half_the_field_of_view_ends_at_the_edge_of_the_picture() -> None:
    lens = PinholeLens(640, 480, radians(60))
    x, _, z = np.array(lens.matrix()) @ (np.tan(radians(30)), 0.0, 1.0)
    assert x / z == pytest.approx(639.5)
    assert lens.half_diagonal == pytest.approx(0.625, abs=0.001)
