"""Cuts a room into flat coloured quadrilaterals, ready to be projected into a picture."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from drivers.sim.painter import Floats
from drivers.sim.room import Colour, Fixture, Room, WallName
from drivers.sim.things import Edge

_SHADES: dict[WallName, float] = {"front": 1.0, "left": 0.9, "back": 0.96, "right": 0.84}
_SKIRTING = 0.09  # metres
_STEPS = 6
_STAIRS: Colour = (58, 48, 42)
_PLANK = 0.5  # metres, width of a floor board


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """A quadrilateral: ``corners`` in metres, float64 of shape (4, 3), in order round its edge."""

    corners: Floats
    colour: Colour


def panels(room: Room) -> tuple[Panel, ...]:
    """Return what the room consists of, in the order of painting."""
    fixtures = (part for item in room.fixtures for part in _fixture(room, item))
    return (*_floor_and_ceiling(room), *_walls(room), *fixtures)


def holes(edges: Iterable[Edge]) -> Iterator[Panel]:
    """Yield what is seen where the floor ends: steps that go down into the dark, the rim before them light."""
    for edge in edges:
        low, high = edge.y - edge.width / 2, edge.y + edge.width / 2
        places = np.linspace(edge.x - edge.length / 2, edge.x + edge.length / 2, _STEPS + 1)
        for number, (x0, x1) in enumerate(pairwise(places)):
            step = np.array(((x0, low, 0.0), (x1, low, 0.0), (x1, high, 0.0), (x0, high, 0.0)))
            yield Panel(step, shaded(_STAIRS, 1.0 - number / _STEPS))


def shaded(colour: Colour, share: float) -> Colour:
    """Return ``colour`` times ``share``, within 0..255."""
    red, green, blue = (min(255, max(0, round(value * share))) for value in colour)
    return red, green, blue


def _floor_and_ceiling(room: Room) -> Iterator[Panel]:
    (x0, x1), (y0, y1) = room.extent()
    ceiling = ((x0, y0, room.height), (x1, y0, room.height), (x1, y1, room.height), (x0, y1, room.height))
    yield Panel(np.array(ceiling), room.ceiling)
    edges = [*np.arange(y0, y1, _PLANK), y1]
    for number, (low, high) in enumerate(pairwise(edges)):
        board = np.array(((x0, low, 0.0), (x1, low, 0.0), (x1, high, 0.0), (x0, high, 0.0)))
        yield Panel(board, shaded(room.floor, (1.0, 0.94, 1.04)[number % 3]))


def _walls(room: Room) -> Iterator[Panel]:
    for wall, shade in _SHADES.items():
        half = room.wall_length(wall) / 2
        colour = shaded(room.wall, shade)
        yield Panel(_rectangle(room, wall, (-half, half), (0.0, room.height)), colour)
        yield Panel(_rectangle(room, wall, (-half, half), (0.0, _SKIRTING)), shaded(colour, 0.62))


def _fixture(room: Room, item: Fixture) -> Iterator[Panel]:
    """Yield the parts of one fixture; places within it are shares of its width and height, from the lower left."""
    for left, right, low, high, colour in _PARTS[item.kind](item.colour):
        along = (item.along + item.width * (left - 0.5), item.along + item.width * (right - 0.5))
        up = (item.bottom + item.height * low, item.bottom + item.height * high)
        yield Panel(_rectangle(room, item.wall, along, up), colour)


def _rectangle(room: Room, wall: WallName, along: tuple[float, float], up: tuple[float, float]) -> Floats:
    """Return the corners (4, 3) of a part of a wall: ``along`` to the right from inside, ``up`` from the floor."""
    (x0, x1), (y0, y1) = room.extent()
    x, y = room.centre
    origin, right = {
        "front": ((x1, y), (0.0, -1.0)),
        "left": ((x, y1), (1.0, 0.0)),
        "back": ((x0, y), (0.0, 1.0)),
        "right": ((x, y0), (-1.0, 0.0)),
    }[wall]
    corners = ((along[0], up[0]), (along[1], up[0]), (along[1], up[1]), (along[0], up[1]))
    return np.array([(origin[0] + a * right[0], origin[1] + a * right[1], z) for a, z in corners])


_Parts = Iterator[tuple[float, float, float, float, Colour]]


def _door(colour: Colour) -> _Parts:
    yield 0.0, 1.0, 0.0, 1.0, shaded(colour, 0.7)
    yield 0.06, 0.94, 0.0, 0.97, colour
    yield 0.18, 0.82, 0.08, 0.46, shaded(colour, 0.88)
    yield 0.18, 0.82, 0.56, 0.9, shaded(colour, 0.9)
    yield 0.84, 0.92, 0.5, 0.52, (200, 190, 150)


def _window(colour: Colour) -> _Parts:
    yield 0.0, 1.0, 0.0, 1.0, (232, 230, 224)
    yield 0.05, 0.95, 0.07, 0.95, colour
    yield 0.05, 0.95, 0.07, 0.3, shaded(colour, 0.78)
    yield 0.48, 0.52, 0.07, 0.95, (232, 230, 224)
    yield -0.04, 1.04, -0.05, 0.0, (214, 212, 206)


def _picture(colour: Colour) -> _Parts:
    yield 0.0, 1.0, 0.0, 1.0, (62, 50, 42)
    yield 0.06, 0.94, 0.08, 0.92, (226, 222, 212)
    yield 0.14, 0.86, 0.18, 0.82, shaded(colour, 1.3)
    yield 0.14, 0.86, 0.18, 0.46, colour
    yield 0.5, 0.86, 0.18, 0.38, shaded(colour, 0.7)


_PARTS = {"door": _door, "window": _window, "picture": _picture}
