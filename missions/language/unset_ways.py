"""Sets of variables that may be unset at some place of a tree, each with the events that lead there."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple


class Event(NamedTuple):
    """The last event of a way, after those ``before``; ``length`` counts them all."""

    text: str
    before: "Way"
    length: int


Way = Event | None
"""What has to happen, in order, for a variable to be unset at some place; None where that is so at first."""


class Unset(NamedTuple):
    """The variables that may be unset at some place: a bit for each in ``bits``, and the shortest ``ways`` of some.

    Every step has such a value. A mapping of all variables to their ways would take time that is quadratic in the
    number of steps, and so would sets.
    """

    bits: int
    ways: Mapping[str, Way]


NONE = Unset(0, {})


class After(NamedTuple):
    """What may be unset after each end of a step; None for an end that it cannot come to."""

    success: Unset | None
    failure: Unset | None


def with_event(event: str, unset: Unset | None) -> Unset | None:
    """Return what is unset, once ``event`` has happened besides."""
    if unset is None or not unset.ways:
        return unset
    ways = {name: Event(event, way, 1 if way is None else way.length + 1) for name, way in unset.ways.items()}
    return Unset(unset.bits, ways)


def either(ways: Iterable[Unset | None]) -> Unset | None:
    """Return what may be unset by one of these ways, each variable by the shortest; None where there is no way."""
    bits: int | None = None
    found: dict[str, Way] = {}
    for unset in ways:
        if unset is None:
            continue
        bits = unset.bits if bits is None else bits | unset.bits
        for name, way in unset.ways.items():
            if name not in found or _length(way) < _length(found[name]):
                found[name] = way
    return None if bits is None else Unset(bits, found)


def _length(way: Way) -> int:
    return 0 if way is None else way.length
