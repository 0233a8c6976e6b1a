"""What a base and its sensors feel of the world: bumps, edges, ranges, lines of sight."""

from math import atan2, cos, hypot, inf, pi, radians, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import BadRequest
from drivers.sim.people import Person, WaypointPath
from drivers.sim.person_actions import PersonAction
from drivers.sim.room import DEFAULT_FIXTURES, Room
from drivers.sim.world import Light, LightChange, SimulatedWorld
from drivers.sim.world_objects import Edge, Ground, Rover, Wall, WorldBall, WorldBox

RED = (200, 40, 40)
TABLE = WorldBox("table", 2.0, 0.0, (0.8, 1.0, 0.75), RED)
EMPTY = SimulatedWorld()


def test_room_walls_are_felt_at_their_place() -> None:
    ground: Ground = EMPTY
    assert ground.contact_directions(0.0, 0.0, 0.18, 0.0) == []
    assert ground.contact_directions(4.9, 0.0, 0.18, 0.0) == [0.0]
    assert ground.contact_directions(-2.9, 2.9, 0.18, 0.0) == pytest.approx([pi, pi / 2])
    assert ground.contact_directions(0.0, -2.9, 0.18, 0.0) == [-pi / 2]


@pytest.mark.parametrize(
    "world",
    [
        SimulatedWorld(furniture=(TABLE,)),
        SimulatedWorld(walls=(Wall((1.65, -1.0), (1.65, 1.0)),)),
        SimulatedWorld(objects=(WorldBall("ball", 1.7, 0.0, 0.2, RED),)),
        SimulatedWorld(robots=(Rover("R2", 3, 1.775, 0.0),)),
        SimulatedWorld(people=(Person("Anna", x=1.85),)),
    ],
    ids=["furniture", "wall", "ball", "robot", "person"],
)
def test_everything_solid_is_bumped_into_seen_by_the_range_finder_and_in_the_way(world: SimulatedWorld) -> None:
    assert world.contact_directions(1.5, 0.0, 0.18, 0.0) == pytest.approx([0.0])
    assert world.contact_directions(1.3, 0.0, 0.18, 0.0) == []
    assert world.distance(0.0, 0.0, 0.0, 0.0) == pytest.approx(1.6, abs=0.001) or world.objects  # a ball is low
    assert world.distance(0.0, 0.0, pi, 0.0) == pytest.approx(3.0)
    assert not world.is_visible((0.0, 0.0, 0.1), (4.0, 0.0, 0.1), 0.0)


def test_bump_direction_is_towards_the_nearest_point() -> None:
    world = SimulatedWorld(furniture=(TABLE,))
    assert world.contact_directions(1.5, 0.6, 0.18, 0.0) == pytest.approx([atan2(-0.1, 0.1)])
    assert world.contact_directions(1.9, 0.1, 0.18, 0.0) == pytest.approx([atan2(-0.1, 0.1)])  # from within: its middle


def test_raised_object_is_passed_under_but_blocks_the_view() -> None:
    lamp = WorldBox("lamp", 1.0, 0.0, (0.3, 0.3, 0.3), RED, bottom=1.0)
    world = SimulatedWorld(objects=(lamp,))
    assert world.contact_directions(1.0, 0.0, 0.18, 0.0) == []
    assert world.distance(0.0, 0.0, 0.0, 0.0) == pytest.approx(5.0)
    assert world.distance(0.0, 0.0, 0.0, 0.0, height=1.1) == pytest.approx(0.85)
    assert not world.is_visible((0.0, 0.0, 1.1), (3.0, 0.0, 1.1), 0.0)


def test_range_finder_distance_is_limited() -> None:
    assert EMPTY.distance(0.0, 0.0, 0.0, 0.0, 2.0) == 2.0
    assert EMPTY.distance(0.0, 0.0, 0.0, 0.0, inf) == pytest.approx(5.0)


@given(st.floats(-2.9, 4.9), st.floats(-2.9, 2.9), st.floats(-10, 10))
def test_a_ray_from_within_the_room_always_ends_at_a_wall(x: float, y: float, angle: float) -> None:
    far = EMPTY.distance(x, y, angle, 0.0)
    (x_low, x_high), (y_low, y_high) = EMPTY.room.extent()
    hit = (x + far * cos(angle), y + far * sin(angle))
    assert min(abs(hit[0] - x_low), abs(hit[0] - x_high), abs(hit[1] - y_low), abs(hit[1] - y_high)) < 1e-6
    assert EMPTY.room.contains(*hit, margin=-1e-6)


def test_the_floor_ends_at_an_edge() -> None:
    world = SimulatedWorld(edges=(Edge(3.0, 0.0, 1.0, 2.0),))
    assert world.has_floor(2.4, 0.0)
    assert not world.has_floor(2.6, 0.9)
    assert world.has_floor(3.0, 1.1)


def test_person_is_hidden_only_by_others_in_the_line_of_sight() -> None:
    ben = Person("Ben", x=1.5, y=0.0)
    world = SimulatedWorld(people=(Person("Anna", x=3.0), ben))
    eye, anna = (0.0, 0.0, 1.6), (3.0, 0.0, 1.6)
    assert not world.is_visible(eye, anna, 0.0)
    assert world.is_visible(eye, (1.5, 0.0, 1.6), 0.0)
    assert world.is_visible((0.0, 0.0, 2.5), (3.0, 0.0, 1.7), 0.0)  # over the head of Ben
    assert world.is_visible((0.0, 0.4, 1.6), (3.0, -0.05, 1.6), 0.0)  # beside his head, over his shoulder
    assert not world.is_visible((0.0, 0.4, 1.1), (3.0, -0.05, 1.1), 0.0)


def test_departed_person_blocks_nothing() -> None:
    world = SimulatedWorld(people=(Person("Ben", x=1.5, acts=(PersonAction(at=0.0, leave=True),), speed=5.0),))
    assert not world.is_visible((0.0, 0.0, 1.6), (4.0, 0.0, 1.6), 0.0)
    assert world.is_visible((0.0, 0.0, 1.6), (4.0, 0.0, 1.6), 2.0)
    assert world.contact_directions(1.5, 0.0, 0.18, 2.0) == []


def test_near_sides_are_visible_but_points_outside_the_room_are_not() -> None:
    world = SimulatedWorld(furniture=(TABLE,), robots=(Rover("R2", 3, 0.0, 2.0),))
    assert world.is_visible((0.0, 0.0, 0.5), (2.0, 0.0, 0.4), 0.0)
    assert world.is_visible((0.0, 0.0, 0.5), (0.0, 2.0 - 0.175, 0.3), 0.0)
    assert not world.is_visible((0.0, 0.0, 0.5), (9.0, 0.0, 0.4), 0.0)


def test_rover_follows_its_path_and_heading() -> None:
    rover = Rover("R2", 3, 1.0, 1.0, heading=1.0, path=((1.0, -1.0),), speed=0.5, start=2.0)
    assert rover.solid(1.0).heading == 1.0
    there, back = rover.solid(3.0), rover.solid(7.0)
    assert (there.x, there.y, there.heading) == pytest.approx((1.0, 0.5, -pi / 2))
    assert (back.x, back.y, back.heading) == pytest.approx((1.0, -0.5, pi / 2))
    parked = Rover("R3", 3, 0.0, 0.0, path=((1.0, 0.0),), speed=1.0, loop=False)
    assert (parked.solid(9.0).x, parked.solid(9.0).heading) == (1.0, 0.0)


def test_degenerate_path_has_no_heading() -> None:
    assert WaypointPath(((1.0, 1.0), (1.0, 1.0)), 1.0).heading_at(3.0) is None
    walk = WaypointPath(((0.0, 0.0), (0.0, 0.0), (1.0, 0.0)), 1.0, loop=False)
    assert (walk.position_at(0.5), walk.heading_at(0.5)) == ((0.5, 0.0), 0.0)


def test_light_fades_evenly_and_a_new_change_begins_where_the_last_had_come_to() -> None:
    light = Light(
        1.0, (LightChange(2.0, 0.0, duration=4.0), LightChange(4.0, 1.0, duration=1.0), LightChange(10.0, 0.25))
    )
    assert [light.level_at(time) for time in (0.0, 2.0, 3.0, 4.0, 4.5, 5.0, 9.9, 10.0)] == pytest.approx(
        [1.0, 1.0, 0.75, 0.5, 0.75, 1.0, 1.0, 0.25]
    )
    assert SimulatedWorld(light=light).light_at(3.0) == pytest.approx(0.75)
    assert SimulatedWorld(light=0.5).light_at(99.0) == 0.5


@given(st.lists(st.tuples(st.floats(0, 20), st.floats(0, 2), st.floats(0, 5)), max_size=4), st.floats(0, 40))
def test_light_level_stays_between_its_named_levels(changes: list[tuple[float, float, float]], time: float) -> None:
    light = Light(1.0, tuple(LightChange(*change) for change in sorted(changes)))
    levels = [1.0, *(level for _, level, _ in changes)]
    assert min(levels) - 1e-9 <= light.level_at(time) <= max(levels) + 1e-9


@pytest.mark.parametrize("changes", [(LightChange(2.0, 1.0), LightChange(1.0, 0.5)), (LightChange(1.0, -0.5),)])
def test_light_in_disorder_is_refused(changes: tuple[LightChange, ...]) -> None:
    with pytest.raises(BadRequest, match="light"):
        Light(1.0, changes)


def test_small_room_keeps_only_fitting_fixtures() -> None:
    small, usual = (
        Room.with_default_fixtures(5.0, 5.0, 2.6, (0.0, 0.0)),
        Room.with_default_fixtures(8.0, 6.0, 2.6, (1.0, 0.0)),
    )
    assert 0 < len(small.fixtures) < len(DEFAULT_FIXTURES)
    assert usual == Room()


def test_the_nearest_wall_is_the_nearest_spot_of_any_wall() -> None:
    room = Room()
    x, y = room.nearest_wall(4.0, 1.0)
    assert (x, y) == (5.0, 1.0)
    rays = [EMPTY.distance(4.0, 1.0, radians(angle), 0.0) for angle in range(360)]
    assert hypot(x - 4.0, y - 1.0) == pytest.approx(min(rays))


def test_sizeless_things_and_unknown_markers_are_refused() -> None:
    with pytest.raises(BadRequest, match="no length"):
        Wall((1.0, 1.0), (1.0, 1.0))
    with pytest.raises(BadRequest, match="table"):
        WorldBox("table", 0.0, 0.0, (1.0, 0.0, 1.0), RED)
    with pytest.raises(BadRequest, match="ball"):
        WorldBall("ball", 0.0, 0.0, 0.2, RED, bottom=-1.0)
    with pytest.raises(BadRequest, match="edge"):
        Edge(0.0, 0.0, 1.0, -1.0)
    with pytest.raises(BadRequest, match=r"R2: marker 50: must be within 0\.\.49"):
        Rover("R2", 50, 0.0, 0.0)
    with pytest.raises(BadRequest, match="too small for a marker"):
        Rover("R2", 7, 0.0, 0.0, size=(0.1, 0.1, 0.1))
    with pytest.raises(BadRequest, match="drives at 0"):
        Rover("R2", 7, 0.0, 0.0, speed=0.0)
