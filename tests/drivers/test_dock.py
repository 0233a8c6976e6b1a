"""The dock of a base: what is heard of it from where, when its contacts meet, and that its beams lead home."""

from math import cos, pi, radians, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.api import BASE_RADIUS, DockBeam, DockSignals, Pose2D, Sides
from drivers.sim.base_body import BaseBody
from drivers.sim.battery import Battery
from drivers.sim.wheels import SimulatedWheels
from drivers.sim.world import SimulatedWorld
from drivers.sim.world_objects import CONTACT_REACH, DOCK_SIZE, FAR_RANGE, NEAR_RANGE, NO_SIGNALS, WorldBox, WorldDock

DOCK = WorldDock(-2.95, 0.5, 0.0)
"""At the back wall of the usual room."""

TOUCHING = DOCK_SIZE[0] / 2 + BASE_RADIUS
"""Metres from the middle of the dock to that of a base which just touches its front."""

NEAR_BEAMS = DockBeam.NEAR_LEFT | DockBeam.NEAR_CENTRE | DockBeam.NEAR_RIGHT
LEFT = DockBeam.NEAR_LEFT | DockBeam.FAR_LEFT
RIGHT = DockBeam.NEAR_RIGHT | DockBeam.FAR_RIGHT


def before(dock: WorldDock, away: float, bearing: float = 0.0, turned: float = 0.0) -> Pose2D:
    """A base that looks at the dock from ``away`` metres, ``bearing`` degrees left of where it faces."""
    way = dock.heading + radians(bearing)
    return Pose2D(dock.x + away * cos(way), dock.y + away * sin(way), way + pi + radians(turned))


def heard(base: Pose2D, *, clear: bool = True) -> DockSignals:
    return DOCK.signals(base, lambda *_: clear)


@pytest.mark.parametrize(
    ("bearing", "near", "far"),
    [
        (0, DockBeam.NEAR_CENTRE, DockBeam.FAR_CENTRE),
        (8, DockBeam.NEAR_CENTRE | DockBeam.NEAR_LEFT, DockBeam.FAR_CENTRE | DockBeam.FAR_LEFT),
        (30, DockBeam.NEAR_LEFT, DockBeam.FAR_LEFT),
        (-8, DockBeam.NEAR_CENTRE | DockBeam.NEAR_RIGHT, DockBeam.FAR_CENTRE | DockBeam.FAR_RIGHT),
        (-30, DockBeam.NEAR_RIGHT, DockBeam.FAR_RIGHT),
        (60, DockBeam(0), DockBeam(0)),
        (180, DockBeam(0), DockBeam(0)),
    ],
)
def test_each_sector_has_its_near_and_far_beam(bearing: float, near: DockBeam, far: DockBeam) -> None:
    assert heard(before(DOCK, NEAR_RANGE - 0.01, bearing)) == DockSignals(centre=near)
    assert heard(before(DOCK, NEAR_RANGE + 0.01, bearing)) == DockSignals(centre=far)
    assert heard(before(DOCK, FAR_RANGE + 0.01, bearing)) == NO_SIGNALS


@pytest.mark.parametrize(
    ("turned", "receiver"), [(0, "centre"), (14, "centre"), (-14, "centre"), (-60, "left"), (60, "right")]
)
def test_receiver_facing_the_dock_receives_its_signal(turned: float, receiver: str) -> None:
    signals = heard(before(DOCK, 1.0, turned=turned))
    assert signals == DockSignals(**{receiver: DockBeam.FAR_CENTRE})


def test_base_facing_away_or_behind_an_obstacle_receives_nothing() -> None:
    assert heard(before(DOCK, 1.0, turned=180)) == NO_SIGNALS
    assert heard(before(DOCK, 1.0), clear=False) == NO_SIGNALS


@given(st.floats(-3, 5), st.floats(-3, 3), st.floats(-10, 10), st.floats(-pi, pi))
def test_dock_signals_depend_only_on_the_relative_pose(x: float, y: float, heading: float, facing: float) -> None:
    turned = WorldDock(DOCK.x, DOCK.y, facing)
    dx, dy, c, s = x - DOCK.x, y - DOCK.y, cos(facing), sin(facing)
    moved = Pose2D(DOCK.x + dx * c - dy * s, DOCK.y + dx * s + dy * c, heading + facing)
    one, other = heard(Pose2D(x, y, heading)), turned.signals(moved, lambda *_: True)
    nearby = {
        heard(Pose2D(x + e, y + f, heading + g)) for e in (-1e-6, 1e-6) for f in (-1e-6, 1e-6) for g in (-1e-6, 1e-6)
    }
    assert one == other or other in nearby


@pytest.mark.parametrize(
    ("away", "bearing", "turned", "meets"),
    [
        (TOUCHING, 0, 0, True),
        (TOUCHING + CONTACT_REACH - 0.001, 0, 0, True),
        (TOUCHING + CONTACT_REACH + 0.001, 0, 0, False),
        (TOUCHING, 9, 0, True),
        (TOUCHING, 12, 0, False),
        (TOUCHING, 0, 19, True),
        (TOUCHING, 0, -21, False),
        (TOUCHING, 180, 0, False),
        (TOUCHING, 0, 180, False),
    ],
)
def test_contacts_meet_only_straight_ahead(away: float, bearing: float, turned: float, meets: bool) -> None:
    assert DOCK.has_contact(before(DOCK, away, bearing, turned), BASE_RADIUS) is meets


def test_dock_is_bumped_into_but_below_the_range_finder() -> None:
    world = SimulatedWorld(dock=DOCK)
    assert world.contact_directions(DOCK.x + TOUCHING - 0.001, DOCK.y, BASE_RADIUS, 0.0) == pytest.approx([pi])
    assert world.distance(0.0, DOCK.y, pi, 0.0) == pytest.approx(3.0)
    assert world.distance(0.0, DOCK.y, pi, 0.0, height=0.05) == pytest.approx(2.9)


def test_obstacle_hides_the_dock() -> None:
    screen = WorldBox("screen", -2.2, 0.5, (0.1, 1.0, 0.5), (1, 2, 3))
    body = BaseBody(
        wheels=SimulatedWheels(pose=before(DOCK, 1.5)), ground=SimulatedWorld(dock=DOCK, furniture=(screen,))
    )
    body.advance(0.0)
    assert body.dock_signals() == NO_SIGNALS
    free = BaseBody(wheels=SimulatedWheels(pose=before(DOCK, 1.5)), ground=SimulatedWorld(dock=DOCK))
    free.advance(0.0)
    assert free.dock_signals() == DockSignals(centre=DockBeam.FAR_CENTRE)


def test_base_on_the_contacts_is_docked_until_it_leaves_or_is_lifted() -> None:
    body = BaseBody(
        wheels=SimulatedWheels(pose=before(DOCK, TOUCHING + 0.01)),
        ground=SimulatedWorld(dock=DOCK),
        battery=Battery(50.0),
    )
    body.advance(0.0)
    body.advance(1.0)
    assert (body.docked, body.battery.is_charging, body.bumper) == (True, True, Sides())
    assert body.battery.percent > 50.0
    body.lifted = True
    body.advance(2.0)
    assert (body.docked, body.battery.is_charging) == (False, False)
    body.lifted = False
    body.command(-0.2, 0.0, 3.0)
    body.advance(3.3)
    assert not body.docked


def home(body: BaseBody, seconds: float) -> bool:
    """Steer by the beams alone, as the vendor's program does: towards what the centre receiver hears; else turn."""
    now = 0.0
    body.advance(now)
    turn = 0.5
    while not body.docked and now < seconds:
        centre = body.dock_signals().centre
        if not centre:
            speed, aside = 0.0, turn
        else:
            speed = 0.05 if centre & NEAR_BEAMS else 0.1
            aside = 0.3 * (bool(centre & LEFT) - bool(centre & RIGHT))
            turn = -0.5 if aside > 0 else 0.5 if aside < 0 else turn
        now += 0.02
        body.command(speed, aside, now)
    return body.docked


@pytest.mark.parametrize("bearing", [-11, -3, 6])
@pytest.mark.parametrize("dead_time", [0.0, 0.2])
def test_middle_beam_leads_home_without_a_bump(bearing: float, dead_time: float) -> None:
    wheels = SimulatedWheels(pose=before(DOCK, 1.2, bearing, turned=100), dead_time=dead_time)
    body = BaseBody(wheels=wheels, ground=SimulatedWorld(dock=DOCK))
    assert home(body, 120.0)
    assert not body.bumper
