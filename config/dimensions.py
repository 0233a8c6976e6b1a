"""Dimensions: what kind of thing a quantity measures, so that no length is added to an angle.

A dimension goes by its name ("length", "turn rate"), or where it has none by its unit ("m^2", "rad m"). An angle is a
dimension of its own: an arc divided by its radius is a number, and ``* 1 rad`` makes an angle of it.
"""

import re
from functools import cache

from config.units import EXAMPLES, UNITS, article

NUMBER = "number"
"""The dimension of a plain number: none. A share has none either."""

BASES = ("m", "rad", "s", "V", "degC", "kg")
"""The units of which all others are made."""

MAX_POWER = 9
"""The highest power of a base: what a mission multiplies at every tick must end somewhere."""

Powers = tuple[int, ...]

NAMED: dict[Powers, str] = {
    (0, 0, 0, 0, 0, 0): NUMBER,
    (1, 0, 0, 0, 0, 0): "length",
    (0, 1, 0, 0, 0, 0): "angle",
    (0, 0, 1, 0, 0, 0): "duration",
    (1, 0, -1, 0, 0, 0): "speed",
    (0, 1, -1, 0, 0, 0): "turn rate",
    (1, 0, -2, 0, 0, 0): "acceleration",
    (0, 1, -2, 0, 0, 0): "turn acceleration",
    (0, 0, -1, 0, 0, 0): "frequency",
    (0, 0, 0, 1, 0, 0): "voltage",
    (0, 0, 0, 0, 1, 0): "temperature",
    (0, 0, 0, 0, 0, 1): "mass",
}
"""The names of dimensions, by the powers of BASES."""

_POWERS = {name: powers for powers, name in NAMED.items()} | dict.fromkeys(("share", "percent"), (0, 0, 0, 0, 0, 0))


class DimensionError(ValueError):
    """Two dimensions that do not go together."""


def product(one: str, other: str) -> str:
    """Return the dimension of a product."""
    return _combined(one, other, 1)


def quotient(one: str, other: str) -> str:
    """Return the dimension of a quotient."""
    return _combined(one, other, -1)


def common(one: str, other: str) -> str:
    """Return the dimension of a sum of both. Raises DimensionError where there is none.

    What counts to 100 is a number, but does not go together with a share.
    """
    if one == other:
        return one
    if powers(one) != powers(other) or {one, other} == {"share", "percent"}:
        raise DimensionError(f"{named(one)} and {named(other)}")
    return NUMBER


@cache
def powers(dimension: str) -> Powers:
    """Return the powers of BASES that a dimension has."""
    known = _POWERS.get(dimension)
    if known is not None:
        return known
    above, _, below = dimension.partition("/")
    found = dict.fromkeys(BASES, 0)
    for part, sign in ((above, 1), (below, -1)):
        for unit, power in re.findall(r"([A-Za-z]+)(?:\^(\d+))?", part):
            found[unit] += sign * int(power or 1)
    return tuple(found.values())


def named(dimension: str) -> str:
    """Return "a length", "a number", "a quantity in m^2"..."""
    return article(dimension) if dimension in _POWERS else f"a quantity in {dimension}"


def unit_of(dimension: str) -> str:
    """Return the unit in which people are told of a dimension; none for a plain number."""
    return "" if dimension == NUMBER else next(iter(UNITS[dimension])) if dimension in UNITS else dimension


def factor_of(dimension: str) -> float:
    """Return how many SI units that unit is."""
    return next(iter(UNITS[dimension].values())) if dimension in UNITS else 1.0


def example(dimension: str) -> str:
    """Return a quantity as a mission would write it."""
    return EXAMPLES.get(dimension, "2" if dimension == NUMBER else f"2 {dimension}")


@cache
def _combined(one: str, other: str, sign: int) -> str:
    found = tuple(a + sign * b for a, b in zip(powers(one), powers(other), strict=True))
    if max(map(abs, found)) > MAX_POWER:
        raise ValueError("a dimension out of range")
    return NAMED.get(found) or _unit(found)


def _unit(found: Powers) -> str:
    above, below = (
        " ".join(
            base + (f"^{abs(power)}" if abs(power) > 1 else "")
            for base, power in zip(BASES, found, strict=True)
            if power * sign > 0
        )
        for sign in (1, -1)
    )
    return f"{above or '1'}/{below}" if below else above
