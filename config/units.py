"""Quantities: a number with its unit as people write it, SI inside."""

import math
import re
from typing import Self

UNITS: dict[str, dict[str, float]] = {
    "angle": {"deg": math.pi / 180, "rad": 1.0},
    "length": {"m": 1.0, "cm": 0.01, "mm": 0.001},
    "duration": {"s": 1.0, "ms": 0.001, "min": 60.0, "h": 3600.0},
    "speed": {"m/s": 1.0, "cm/s": 0.01, "mm/s": 0.001},
    "turn rate": {"deg/s": math.pi / 180, "rad/s": 1.0},
    "acceleration": {"m/s^2": 1.0, "cm/s^2": 0.01},
    "turn acceleration": {"deg/s^2": math.pi / 180, "rad/s^2": 1.0},
    "frequency": {"Hz": 1.0},
    "share": {"%": 0.01},
    "voltage": {"V": 1.0},
}
"""The units of each dimension, and how many SI units one of them is. A share is 0..1 inside."""

_EXAMPLES = {
    "angle": "30 deg",
    "length": "0.5 m",
    "duration": "2 s",
    "speed": "0.2 m/s",
    "turn rate": "45 deg/s",
    "acceleration": "0.5 m/s^2",
    "turn acceleration": "200 deg/s^2",
    "frequency": "20 Hz",
    "share": "20 %",
    "voltage": "12 V",
}
_DIMENSION_OF = {unit: dimension for dimension, units in UNITS.items() for unit in units}
_WRITTEN = re.compile(r"([-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?)\s*([A-Za-z%°][A-Za-z/^2°%]*)")


class Quantity(float):
    """A number in SI units that remembers its dimension and how it was written."""

    dimension: str
    text: str

    def __new__(cls, value: float, dimension: str, text: str) -> Self:
        """Make a quantity of ``value`` SI units."""
        quantity = super().__new__(cls, value)
        quantity.dimension = dimension
        quantity.text = text
        return quantity

    def __str__(self) -> str:
        return self.text

    def __format__(self, spec: str) -> str:
        return format(float(self), spec) if spec else self.text

    def __reduce__(self) -> tuple[type, tuple[float, str, str]]:
        return Quantity, (float(self), self.dimension, self.text)


def quantity(text: str) -> Quantity | None:
    """Read ``text`` as a number with a unit that we know; None when it is something else."""
    found = _WRITTEN.fullmatch(text.strip())
    if found is None or found[2] not in _DIMENSION_OF:
        return None
    dimension = _DIMENSION_OF[found[2]]
    return Quantity(float(found[1]) * UNITS[dimension][found[2]], dimension, text.strip())


def in_dimension(value: object, dimension: str) -> float:
    """Return ``value`` (a text such as "30 deg", or a Quantity) in SI units of ``dimension``.

    Raises ValueError that names what was expected: for a bare number, another dimension, an unknown unit, infinity.
    """
    example = f"{article(dimension)} such as '{_EXAMPLES[dimension]}'"
    found = value if isinstance(value, Quantity) else quantity(value) if isinstance(value, str) else None
    if found is None:
        if isinstance(value, int | float) and not isinstance(value, bool):
            raise ValueError(f"needs {example}: '{value}' has no unit ({_listed(dimension)})")
        written = _WRITTEN.fullmatch(value.strip()) if isinstance(value, str) else None
        if written is not None:
            raise ValueError(f"needs {example}: unknown unit '{written[2]}' ({_listed(dimension)})")
        raise ValueError(f"needs {example}, got {_shown(value)}")
    if found.dimension != dimension:
        raise ValueError(f"needs {example}, got {article(found.dimension)}: '{found}'")
    if not math.isfinite(found):
        raise ValueError(f"needs {example}: '{found}' is not finite")
    return float(found)


def written(value: float, dimension: str) -> str:
    """Write an SI value as people do: angles in degrees, the rest in its first unit ("0.5 m")."""
    unit, factor = next(iter(UNITS[dimension].items()))
    return f"{round(value / factor, 4):g} {unit}"


def article(dimension: str) -> str:
    """Return "an angle", "a length"..."""
    return f"{'an' if dimension[0] in 'aeiou' else 'a'} {dimension}"


def _listed(dimension: str) -> str:
    return "units: " + ", ".join(UNITS[dimension])


def _shown(value: object) -> str:
    if value is None:
        return "nothing"
    if isinstance(value, str | bool | int | float):
        return f"'{value}'"
    return "a list" if isinstance(value, list | tuple) else "a mapping"
