"""Many rays at once: each as long as the world says, and quick enough for a range finder in simulated time."""

from collections.abc import Callable, Iterator
from math import cos, pi, radians, sin, tau
from time import process_time

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from drivers.api import Angles, Pose2D
from drivers.sim.people import Person
from drivers.sim.room import Room
from drivers.sim.scanner import cast_rays, make_range_function
from drivers.sim.solids import Point3, Solid, UprightBox
from drivers.sim.world import SimulatedWorld
from drivers.sim.world_objects import Rover, Wall, WorldBall, WorldBox

GREY = (120, 120, 120)
ALL_ROUND: Angles = np.arange(-pi, pi, tau / 360)
EMPTY = SimulatedWorld(room=Room(8.0, 6.0, 2.6, (1.0, 0.0), fixtures=()))
FULL = SimulatedWorld(
    walls=(Wall((0.0, -3.0), (0.5, -1.5)), Wall((3.0, 1.0), (3.0, 2.5))),
    furniture=(
        WorldBox("table", 1.0, 1.0, (1.2, 0.6, 0.05), GREY, 0.3, bottom=0.7),
        WorldBox("shelf", -2.0, 0.5, (0.4, 1.0, 1.8), GREY, 0.7),
        WorldBox("box", 2.0, -2.0, (0.3, 0.3, 0.2), GREY),
    ),
    objects=(WorldBall("ball", 2.0, 0.0, 0.25, GREY), WorldBall("high", 1.0, -1.0, 0.2, GREY, bottom=1.0)),
    people=(Person("anna", x=3.5, y=-1.0), Person("ben", x=0.0, y=2.0, path=((3.0, 2.0),))),
    robots=(Rover("rover", 7, -1.0, -1.0, path=((1.0, -2.5),)),),
)

places = st.tuples(st.floats(-2.9, 4.9), st.floats(-2.9, 2.9))


@given(places, st.lists(st.floats(-7, 7), min_size=1, max_size=8), st.floats(0, 60), st.floats(0, 2))
def test_ray_lengths_match_the_world(
    place: tuple[float, float], angles: list[float], time: float, height: float
) -> None:
    assume(FULL.contact_directions(*place, 1e-6, time) == [])  # on the very edge of something is both in it and not
    lengths = cast_rays(FULL, *place, np.array(angles), time, height=height)
    for angle, length in zip(angles, lengths, strict=True):
        # A ray that grazes something may miss it by the last bit of a sine.
        beside = [FULL.distance(*place, angle + off, time, height=height) for off in (-1e-9, 0.0, 1e-9)]
        assert min(beside) - 1e-6 <= length <= max(beside) + 1e-6


@pytest.mark.parametrize("world", [EMPTY, FULL])
def test_rays_along_the_axes_and_from_within_things_are_exact(world: SimulatedWorld) -> None:
    angles = np.array([0.0, pi / 2, pi, -pi / 2])
    for x, y in ((0.3, 0.2), (3.0, 1.5), (2.0, 0.0), (-3.0, -3.0), (9.0, 9.0)):
        said = [world.distance(x, y, float(angle), 0.0) for angle in angles]
        assert cast_rays(world, x, y, angles, 0.0).tolist() == pytest.approx(said, abs=1e-9)


def test_range_finder_sees_only_at_its_height() -> None:
    to_ball = np.array([0.0])
    assert cast_rays(FULL, 1.0, 0.0, to_ball, 0.0, height=0.2)[0] == pytest.approx(1.0 - 0.125)
    assert cast_rays(FULL, 1.0, 0.0, to_ball, 0.0, height=0.3)[0] == pytest.approx(4.0)


def test_walking_person_is_scanned_at_the_present_position() -> None:
    ahead = np.array([0.0])
    first, later = (cast_rays(FULL, -1.0, 2.0, ahead, time, height=0.2)[0] for time in (0.0, 4.0))
    assert later == pytest.approx(first + 2.0)


def test_unknown_shape_is_scanned_by_its_own_method() -> None:
    class Post:
        """A block by another name."""

        x, y, bottom, top, bounding_radius = 2.0, 0.0, 0.0, 1.0, 0.3

        def __init__(self) -> None:
            self._block = UprightBox(2.0, 0.0, 0.4, 0.4)

        def nearest_offset(self, x: float, y: float) -> tuple[float, float]:
            return self._block.nearest_offset(x, y)

        def intersect_ray(self, x: float, y: float, dx: float, dy: float) -> float:
            return self._block.intersect_ray(x, y, dx, dy)

        def blocks_sight(self, eye: Point3, point: Point3) -> bool:
            return self._block.blocks_sight(eye, point)

    class Odd(SimulatedWorld):
        def solids(self, time: float) -> Iterator[Solid]:
            del time
            yield Post()

    assert cast_rays(Odd(), 0.0, 0.0, np.array([0.0, pi]), 0.0).tolist() == pytest.approx([1.8, 3.0])


@given(places, st.floats(-4, 4), st.floats(-0.1, 0.1), st.floats(-0.1, 0.1))
def test_range_finder_scans_from_its_mounting_on_the_base(
    place: tuple[float, float], heading: float, ahead: float, left: float
) -> None:
    look = make_range_function(EMPTY, (ahead, left, 1.0), lambda time: Pose2D(*place, heading + time))
    now = heading + 0.5
    x = place[0] + ahead * cos(now) - left * sin(now)
    y = place[1] + ahead * sin(now) + left * cos(now)
    for bearing, length in zip((0.0, radians(77)), look(np.array([0.0, radians(77)]), 0.5), strict=True):
        assert length == pytest.approx(EMPTY.distance(x, y, now + bearing, 0.5), abs=1e-6)


def test_scan_is_much_cheaper_than_single_rays() -> None:
    def cost(scan: Callable[[], object]) -> float:
        began = process_time()
        for _ in range(5):
            scan()
        return process_time() - began

    at_once = min(cost(lambda: cast_rays(FULL, 0.0, 0.0, ALL_ROUND, 0.0)) for _ in range(5))
    singly = min(cost(lambda: [FULL.distance(0.0, 0.0, a, 0.0) for a in ALL_ROUND.tolist()]) for _ in range(2))
    assert at_once < singly / 3
