"""The order in which solid things are painted: what may be hidden comes before what may hide it."""

from collections.abc import Sequence
from typing import Protocol, TypeVar

from drivers.sim.block import Block, Disc, Point3

_SLACK = 0.01
"""Metres by which two things may overlap and yet count as beside each other: a ball lies on a table."""


class Shaped(Protocol):
    """Something with a shape."""

    @property
    def solid(self) -> Block | Disc:
        """Its shape."""
        ...


S = TypeVar("S", bound=Shaped)


def back_to_front(things: Sequence[S], eye: Point3) -> list[S]:
    """Return ``things`` in the order of painting, as seen from ``eye``.

    Of two things between which a plane lies, the one on the eye's side cannot be hidden by the other. That orders all
    but a few: those that overlap, and rings of things, of which the farther one comes first.
    """
    far = sorted(things, key=lambda thing: -_distance(thing.solid, eye))
    done: list[S] = []
    waiting = dict(enumerate(far))

    def paint(number: int) -> None:
        thing = waiting.pop(number)
        for other in list(waiting):
            if other in waiting and _is_behind(waiting[other].solid, thing.solid, eye):
                paint(other)
        done.append(thing)

    while waiting:
        paint(next(iter(waiting)))
    return done


def _is_behind(one: Block | Disc, other: Block | Disc, eye: Point3) -> bool:
    """Say whether a plane lies between the two, with the eye on the side of the other."""
    if one.top <= other.bottom + _SLACK:
        return eye[2] > other.bottom
    if other.top <= one.bottom + _SLACK:
        return eye[2] < one.bottom
    if isinstance(one, Block):
        beyond = _beyond(one, other, eye)
        if beyond is not None:
            return beyond
    if isinstance(other, Block):
        beyond = _beyond(other, one, eye)
        if beyond is not None:
            return not beyond
    return False


def _beyond(block: Block, other: Block | Disc, eye: Point3) -> bool | None:
    """Say whether a side of ``block`` has the eye and the other before it; None where no side parts the two."""
    if isinstance(other, Disc):
        u, v = block.local(other.x, other.y)
        spans = ((u - other.radius, u + other.radius), (v - other.radius, v + other.radius))
    else:
        us, vs = zip(*(block.local(*corner) for corner in other.corners()), strict=True)
        spans = ((min(us), max(us)), (min(vs), max(vs)))
    halves = (block.length / 2, block.width / 2)
    for place, (low, high), half in zip(block.local(eye[0], eye[1]), spans, halves, strict=True):
        if low >= half - _SLACK:
            return place > half
        if high <= _SLACK - half:
            return place < -half
    return None


def _distance(solid: Block | Disc, eye: Point3) -> float:
    return (solid.x - eye[0]) ** 2 + (solid.y - eye[1]) ** 2
