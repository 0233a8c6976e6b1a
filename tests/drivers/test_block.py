"""Solid shapes, against what many small steps along a line find."""

from math import cos, hypot, inf, pi, sin

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from drivers.sim.solids import Point3, UprightBox, UprightCylinder

place = st.floats(-4, 4)
blocks = st.builds(
    UprightBox,
    place,
    place,
    st.floats(0.1, 3),
    st.floats(0.1, 3),
    st.floats(-pi, pi),
    st.floats(0, 1),
    st.floats(1.1, 2),
)
discs = st.builds(UprightCylinder, place, place, st.floats(0.05, 1), st.floats(0, 1), st.floats(1.1, 2))
solids = st.one_of(blocks, discs)
points = st.tuples(place, place, st.floats(0, 2.5))


def within(solid: UprightBox | UprightCylinder, x: float, y: float) -> bool:
    if isinstance(solid, UprightCylinder):
        return hypot(x - solid.x, y - solid.y) <= solid.radius
    u, v = solid.to_local(x, y)
    return abs(u) <= solid.length / 2 and abs(v) <= solid.width / 2


@given(solids, place, place)
def test_nearest_offset_reaches_the_solid_and_nothing_is_nearer(
    solid: UprightBox | UprightCylinder, x: float, y: float
) -> None:
    dx, dy = solid.nearest_offset(x, y)
    away = hypot(dx, dy)
    assert (
        within(solid, x + dx * 1.0001 + 1e-9, y + dy * 1.0001 + 1e-9)
        or away < 1e-6
        or hypot(*solid.nearest_offset(x + dx, y + dy)) < 1e-6
    )
    for step in range(24):
        angle = 2 * pi * step / 24
        assert not within(solid, x + 0.99 * away * cos(angle), y + 0.99 * away * sin(angle)) or within(solid, x, y)


@given(solids, place, place, st.floats(-pi, pi))
def test_ray_ends_at_the_first_point_within_the_solid(
    solid: UprightBox | UprightCylinder, x: float, y: float, angle: float
) -> None:
    far = solid.intersect_ray(x, y, cos(angle), sin(angle))
    steps = [step * 0.05 for step in range(240)]
    first = next((s for s in steps if within(solid, x + s * cos(angle), y + s * sin(angle))), None)
    if first is not None:
        assert far - 1e-6 <= first
    if far < inf:
        hit = (x + far * cos(angle), y + far * sin(angle))
        assert hypot(*solid.nearest_offset(*hit)) < 1e-6


@given(solids, points, points)
def test_line_of_sight_is_blocked_by_a_point_within_the_solid(
    solid: UprightBox | UprightCylinder, eye: Point3, point: Point3
) -> None:
    shares = [step / 200 for step in range(201)]
    line = [tuple(a + share * (b - a) for a, b in zip(eye, point, strict=True)) for share in shares]
    deep = [p for p in line if within(solid, p[0], p[1]) and solid.bottom + 1e-6 < p[2] < solid.top - 1e-6]
    assume(len(deep) != 1)  # it may just touch
    if deep:
        assert solid.blocks_sight(eye, point)
    assert solid.blocks_sight(eye, point) == solid.blocks_sight(point, eye)


def test_line_of_sight_above_or_below_the_box_is_free() -> None:
    shelf = UprightBox(2.0, 0.0, 1.0, 1.0, 0.3, bottom=0.5, top=1.0)
    assert shelf.blocks_sight((0.0, 0.0, 0.7), (4.0, 0.0, 0.7))
    assert not shelf.blocks_sight((0.0, 0.0, 1.2), (4.0, 0.0, 1.2))
    assert not shelf.blocks_sight((0.0, 0.0, 0.3), (4.0, 0.0, 0.3))
    assert shelf.blocks_sight((0.0, 0.0, 1.5), (4.0, 0.0, 0.0))
    assert not shelf.blocks_sight((0.0, 0.0, 0.7), (1.0, 0.0, 0.7))  # it ends before


def test_vertical_lines_and_rays_beside_a_solid_are_free() -> None:
    for solid in (UprightBox(0.0, 0.0, 1.0, 1.0), UprightCylinder(0.0, 0.0, 0.5)):
        assert solid.blocks_sight((0.1, 0.1, 0.2), (0.1, 0.1, 2.0))
        assert not solid.blocks_sight((0.9, 0.0, 0.2), (0.9, 0.0, 2.0))
        assert solid.intersect_ray(0.1, 0.0, 1.0, 0.0) == 0.0
        assert solid.intersect_ray(2.0, 0.0, 1.0, 0.0) == inf
        assert solid.nearest_offset(0.2, 0.2) == pytest.approx((0.0, 0.0))
