"""The rendered things: real detectors must find markers, balls and nods, and what is nearer hides what is farther."""

from math import cos, hypot, pi, radians, sin

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.api import Image, Pose2D
from drivers.sim.people import Person
from drivers.sim.person_actions import NOD_TIME, PersonAction
from drivers.sim.render import Renderer, sort_back_to_front
from drivers.sim.solids import UprightBox, UprightCylinder
from drivers.sim.topview import TopView
from drivers.sim.viewpoint import PinholeLens, Viewpoint
from drivers.sim.world import Light, LightChange, SimulatedWorld
from drivers.sim.world_objects import MARKER_SIZE, Edge, Rover, Wall, WorldBall, WorldBox

LENS = PinholeLens(640, 480, radians(60))
EYE = Viewpoint(z=0.6)
RED, GREEN, BLUE, YELLOW = (200, 40, 40), (40, 150, 60), (40, 80, 190), (240, 205, 40)
ARUCO = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50))


def drawn(world: SimulatedWorld, view: Viewpoint = EYE, *, time: float = 0.0, noise: float = 0.0) -> Image:
    return Renderer(world, LENS, noise=noise).draw(view, time)


def markers(image: Image) -> dict[int, np.ndarray[tuple[int, ...], np.dtype[np.float32]]]:
    corners, ids, _ = ARUCO.detectMarkers(image)
    return {} if not corners else {int(i[0]): np.asarray(c[0], np.float32) for i, c in zip(ids, corners, strict=True)}


def hue_mask(image: Image, hue: int) -> Image:
    hsv = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)
    mask = cv2.inRange(hsv, np.array((hue - 6, 150, 60)), np.array((hue + 6, 255, 255)))
    return np.asarray(mask, np.uint8)


# Markers


@pytest.mark.parametrize("number", [0, 7, 23, 49])
@pytest.mark.parametrize("away", [0.7, 1.5, 2.5])
def test_rendered_marker_is_detected_with_number_and_size(number: int, away: float) -> None:
    rover = Rover("R2", number, x=away + 0.175, y=0.0, heading=pi)
    found = markers(drawn(SimulatedWorld(robots=(rover,)), Viewpoint(z=0.3), noise=3.0))
    assert list(found) == [number]
    corners = found[number]
    side = float(np.mean(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)))
    assert side == pytest.approx(MARKER_SIZE * LENS.focal / away, rel=0.06)


@pytest.mark.parametrize("heading", [0.0, 0.5, 0.5 + pi / 2, 0.5 + pi, -1.0])
def test_a_marker_shows_on_every_side(heading: float) -> None:
    world = SimulatedWorld(robots=(Rover("R2", 12, x=1.2, y=0.1, heading=heading),))
    assert 12 in markers(drawn(world, Viewpoint(z=0.4), noise=3.0))


def test_rendered_marker_is_upright_and_not_mirrored() -> None:
    found = markers(drawn(SimulatedWorld(robots=(Rover("R2", 7, x=1.0, y=0.0, heading=pi),)), Viewpoint(z=0.3)))
    top_left, top_right, _, bottom_left = found[7]  # ArUco's order for a marker that stands upright
    assert top_left[0] < top_right[0]
    assert top_left[1] < bottom_left[1]


# Balls, boxes, walls, edges


@pytest.mark.parametrize(("colour", "hue"), [(YELLOW, 25), (GREEN, 65), (BLUE, 112)])
def test_rendered_ball_has_its_colour_shape_and_place(colour: tuple[int, int, int], hue: int) -> None:
    world = SimulatedWorld(objects=(WorldBall("ball", 1.5, 0.3, 0.2, colour, bottom=0.4),))
    contours, _ = cv2.findContours(hue_mask(drawn(world), hue), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    (x, y), radius = cv2.minEnclosingCircle(max(contours, key=cv2.contourArea))
    right, down, ahead = EYE.to_camera_axes(1.5, 0.3, 0.5)
    assert (x, y) == pytest.approx((319.5 + LENS.focal * right / ahead, 239.5 + LENS.focal * down / ahead), abs=3)
    assert radius == pytest.approx(LENS.focal * 0.1 / ahead, rel=0.12)


def test_rendered_box_has_one_hue_on_all_sides() -> None:
    image = drawn(SimulatedWorld(objects=(WorldBox("crate", 1.2, 0.0, (0.4, 0.4, 0.4), BLUE, heading=0.6),)))
    contours, _ = cv2.findContours(hue_mask(image, 112), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    largest = max(contours, key=cv2.contourArea)
    assert cv2.contourArea(largest) > 0.97 * cv2.contourArea(cv2.convexHull(largest))


def test_wall_hides_people_behind_but_not_before() -> None:
    wall = Wall((2.0, -1.0), (2.0, 1.0))
    behind, before = Person("Anna", x=3.0), Person("Anna", x=1.2)
    bare = drawn(SimulatedWorld(walls=(wall,)), Viewpoint(z=1.5))
    assert np.array_equal(drawn(SimulatedWorld(walls=(wall,), people=(behind,)), Viewpoint(z=1.5)), bare)
    assert not np.array_equal(drawn(SimulatedWorld(walls=(wall,), people=(before,)), Viewpoint(z=1.5)), bare)


def test_long_wall_does_not_hide_a_person_before_its_end() -> None:
    """The middle of the wall is nearer than they are: an order by distance alone would paint them over."""
    wall = Wall((0.8, 0.5), (4.8, 0.7))
    anna = Person("Anna", x=3.2, y=0.2)
    with_her = drawn(SimulatedWorld(walls=(wall,), people=(anna,)), Viewpoint(z=1.5))
    right, _, ahead = Viewpoint(z=1.5).to_camera_axes(3.2, 0.2, 1.5)
    column = round(319.5 + LENS.focal * right / ahead)
    shirt = with_her[330, column].astype(int)
    assert shirt[0] > shirt[2] + 30  # blue, not the wall


def test_floor_is_dark_beyond_its_edge() -> None:
    plain = drawn(SimulatedWorld())
    pit = drawn(SimulatedWorld(edges=(Edge(2.0, 0.0, 1.0, 1.0),)))
    _, down, ahead = EYE.to_camera_axes(2.0, 0.0, 0.0)
    row = round(239.5 + LENS.focal * down / ahead)
    assert pit[row, 320].mean() < 0.4 * plain[row, 320].mean()
    assert np.array_equal(pit[:200], plain[:200])


def test_fading_light_darkens_the_picture() -> None:
    renderer = Renderer(SimulatedWorld(light=Light(1.0, (LightChange(1.0, 0.2, duration=2.0),))), LENS, noise=0.0)
    bright, half, dark = (float(renderer.draw(EYE, time).mean()) for time in (0.5, 2.0, 4.0))
    assert half == pytest.approx(0.6 * bright, rel=0.02)
    assert dark == pytest.approx(0.2 * bright, rel=0.03)


def test_nod_moves_the_face_down_and_keeps_the_feet() -> None:
    world = SimulatedWorld(people=(Person("Anna", x=2.5, acts=(PersonAction(at=1.0, nod=True),)),))
    renderer = Renderer(world, LENS, noise=0.0)
    view = Viewpoint(z=1.0)
    still, nodding = (renderer.draw(view, time) for time in (0.0, 1.0 + NOD_TIME / 4))
    blank = drawn(SimulatedWorld(), view)

    def top_and_bottom(image: Image) -> tuple[int, int]:
        rows = np.flatnonzero((np.abs(image.astype(int) - blank).sum(axis=2) > 60).any(axis=1))
        return int(rows[0]), int(rows[-1])

    (top, bottom), (lower, same) = top_and_bottom(still), top_and_bottom(nodding)
    assert lower - top == pytest.approx(0.05 * LENS.focal / 2.5, abs=3)
    assert abs(same - bottom) <= 1


def test_cached_picture_is_redrawn_when_anything_moves() -> None:
    world = SimulatedWorld(
        people=(Person("Anna", x=2.0, path=((2.0, 1.0),), start=5.0),), robots=(Rover("R2", 1, 1.5, -0.5),)
    )
    renderer = Renderer(world, LENS, noise=0.0)
    first = renderer.draw(EYE, 0.0)
    assert np.array_equal(renderer.draw(EYE, 1.0), first)
    walked = renderer.draw(EYE, 6.0)
    assert np.array_equal(walked, drawn(world, time=6.0))
    assert not np.array_equal(walked, first)
    assert np.array_equal(
        renderer.draw(Viewpoint(z=0.6, yaw=0.1), 6.0), drawn(world, Viewpoint(z=0.6, yaw=0.1), time=6)
    )


CROWD = Renderer(
    SimulatedWorld(
        walls=(Wall((1.0, -3.0), (1.0, -1.0)),),
        furniture=(WorldBox("table", 2.0, 1.0, (1.2, 0.8, 0.7), RED, heading=0.4),),
        objects=(
            WorldBall("ball", 2.0, 1.0, 0.2, YELLOW, bottom=0.7),
            WorldBox("crate", 0.5, 0.0, (0.3, 0.3, 0.3), BLUE),
        ),
        robots=(Rover("R2", 7, 1.5, -0.4),),
        people=(Person("Anna", x=2.5),),
        edges=(Edge(3.5, 0.0, 1.0, 1.0),),
    ),
    LENS,
)


@settings(max_examples=60)
@given(st.floats(-4, 6), st.floats(-4, 4), st.floats(-1, 3), st.floats(-10, 10), st.floats(-1.6, 1.6))
def test_every_viewpoint_of_a_full_room_renders(x: float, y: float, z: float, yaw: float, pitch: float) -> None:
    assert CROWD.draw(Viewpoint(x, y, z, yaw, pitch), 0.0).shape == (480, 640, 3)


# The order of painting


class Thing:
    """A shape."""

    def __init__(self, solid: UprightBox | UprightCylinder) -> None:
        self.solid = solid


def test_painting_order_of_table_and_ball_depends_on_the_eye_height() -> None:
    table, ball = Thing(UprightBox(2.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.7)), Thing(UprightCylinder(2.4, 0.0, 0.1, 0.7, 0.9))
    assert sort_back_to_front([ball, table], (0.0, 0.0, 1.5)) == [table, ball]
    assert sort_back_to_front([table, ball], (0.0, 0.0, 0.3)) == [ball, table]


spot = st.floats(-5, 5)
footprints = st.builds(
    lambda x, y, a, b, turn: UprightBox(x, y, a, b, turn, 0.0, 1.0),
    spot,
    spot,
    st.floats(0.2, 3),
    st.floats(0.2, 3),
    spot,
)


@given(footprints, footprints, st.tuples(spot, spot))
def test_nearer_solid_along_the_rays_is_painted_last(
    one: UprightBox, other: UprightBox, eye: tuple[float, float]
) -> None:
    order = sort_back_to_front([Thing(one), Thing(other)], (*eye, 0.5))
    last = order[-1].solid
    first = order[0].solid
    if _apart(one, other):
        for step in range(180):
            way = (cos(radians(2 * step)), sin(radians(2 * step)))
            near, far = last.intersect_ray(*eye, *way), first.intersect_ray(*eye, *way)
            if 0 < far < 1e9 and near < 1e9:
                assert near <= far + 0.02 * hypot(*way)


def _apart(one: UprightBox, other: UprightBox) -> bool:
    """Whether a side of one of them parts the two."""
    for a, b in ((one, other), (other, one)):
        us, vs = zip(*(a.to_local(*corner) for corner in b.corners()), strict=True)
        if min(us) > a.length / 2 or max(us) < -a.length / 2 or min(vs) > a.width / 2 or max(vs) < -a.width / 2:
            return True
    return False


# From above


def test_the_map_shows_people_things_and_the_robot_in_their_places() -> None:
    world = SimulatedWorld(
        people=(Person("Anna", x=3.0, y=1.0),), furniture=(WorldBox("t", 1.0, -2.0, (1.0, 0.6, 0.7), GREEN),)
    )
    size = (870, 670)  # 100 pixels to the metre of a room of 8 m by 6 m and its margin
    image = TopView(world, size).draw(0.0, Pose2D(-1.0, 1.0, pi / 2))

    def at(x: float, y: float) -> list[int]:
        column, row = size[0] / 2 + 100 * (x - 1.0), size[1] / 2 - 100 * y
        return [int(value) for value in image[round(row), round(column)]]

    assert at(1.3, -2.2) == list(reversed(GREEN))
    assert at(3.0, 1.2) == [150, 92, 40]  # the shirt of Anna
    assert at(-1.0, 0.9) == [180, 96, 38]  # the robot's back
    assert at(-1.0, 1.1) == [255, 255, 255]  # the line that says which way it looks: up
    assert at(0.5, 2.5) == [242, 248, 250]  # floor


def test_map_shows_the_camera_view_up_to_a_wall() -> None:
    view = TopView(SimulatedWorld(walls=(Wall((2.0, -1.0), (2.0, 1.0)),)), (870, 670))
    pose = Pose2D(0.0, 0.0, 0.0)
    plain, lit = view.draw(0.0, pose), view.draw(0.0, pose, camera=Viewpoint(z=1.0), field_of_view=radians(60))
    changed = np.abs(lit.astype(int) - plain).sum(axis=2) > 20
    middle = 335
    assert changed[middle - 10, 435 - 100 + 150]  # 1.5 m ahead
    assert not changed[middle - 10, 435 - 100 + 250]  # behind the wall
    assert not changed[middle - 10, 435 - 100 - 50]  # behind the robot


def test_map_omits_gone_people_and_draws_the_trail() -> None:
    view = TopView(
        SimulatedWorld(people=(Person("Anna", x=4.0, acts=(PersonAction(at=0.0, leave=True),)),)), (870, 670)
    )
    pose = Pose2D(0.0, 0.0, 0.0)
    assert not np.array_equal(view.draw(0.0, pose), view.draw(30.0, pose))
    empty = TopView(SimulatedWorld(), (870, 670))
    assert np.array_equal(view.draw(30.0, pose), empty.draw(0.0, pose))
    assert not np.array_equal(empty.draw(0.0, pose, trail=[(-1.0, 0.0), (-1.0, 1.0)]), empty.draw(0.0, pose))
