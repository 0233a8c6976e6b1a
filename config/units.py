"""Quantities: unit conversion to SI, and arithmetic of dimensions.

Lengths cannot be added to angles. A dimension is called by its name ("length", "turn rate"), or by its unit if it has
none ("m^2", "rad m"). An angle is a dimension of its own: an arc divided by its radius is a number, and ``* 1 rad``
makes an angle of it.
"""

import math
import re
from functools import cache
from typing import Self

UNITS: dict[str, dict[str, float]] = {  # unit suffixes of each dimension, with their factor to SI
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
    "temperature": {"degC": 1.0},
    "mass": {"kg": 1.0, "g": 0.001},
}
"""Units of each dimension with their factor to SI. A share is 0..1 internally, a temperature in degC."""

MAX_SHOWN_LENGTH = 60
"""Maximum number of characters of a value quoted in a message."""

EXAMPLES = {
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
    "temperature": "60 degC",
    "mass": "1.2 kg",
}
"""Example of a quantity of each dimension, for messages."""
_DIMENSION_OF = {unit: dimension for dimension, units in UNITS.items() for unit in units}
_NUMBER = r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
_WRITTEN = re.compile(rf"({_NUMBER})\s*([A-Za-z%°][A-Za-z/^2²°%]*)")


class Quantity(float):
    """Number in SI units with its dimension, and the text that it was written as, if any."""

    __slots__ = ("_text", "dimension")
    dimension: str
    _text: str

    def __new__(cls, value: float, dimension: str, text: str = "") -> Self:
        quantity = super().__new__(cls, value)
        quantity.dimension = dimension
        quantity._text = text
        return quantity

    @property
    def text(self) -> str:
        """This quantity as it was written, or formatted with its unit."""
        return self._text or quantity_text(self, self.dimension)

    def __str__(self) -> str:
        return self.text

    def __format__(self, spec: str) -> str:
        return format(float(self), spec) if spec else self.text

    def __reduce__(self) -> tuple[type, tuple[float, str, str]]:
        return Quantity, (float(self), self.dimension, self._text)


_UNIT_SYNONYMS = {
    word: unit
    for unit, words in {
        "deg": "° degree degrees grad",
        "rad": "radian radians",
        "s": "sec secs second seconds",
        "ms": "msec millisecond milliseconds",
        "min": "mins minute minutes",
        "h": "hr hour hours",
        "m": "meter meters metre metres",
        "cm": "centimeter centimeters centimetre centimetres",
        "m/s": "mps",
        "deg/s": "°/s dps",
        "Hz": "hz",
        "%": "percent",
        "V": "v volt volts",
        "degC": "°c c celsius",
    }.items()
    for word in words.split()
}
"""Our unit for each other spelling of a unit."""


def parse_quantity(text: str) -> Quantity | None:
    """Return ``text`` as a quantity, or None if it is not a finite number with a known unit."""
    found = _WRITTEN.fullmatch(text.strip())
    if found is None or found[2] not in _DIMENSION_OF:
        return None
    dimension = _DIMENSION_OF[found[2]]
    value = float(found[1]) * UNITS[dimension][found[2]]
    return Quantity(value, dimension, text.strip()) if math.isfinite(value) else None


def corrected_quantity(text: str) -> str:
    """Return ``text`` with our spelling of its unit, "10 s" for "10 sec"; empty if it is no misspelt quantity."""
    match = _WRITTEN.fullmatch(text.strip())
    unit = match and match[2] not in _DIMENSION_OF and _UNIT_SYNONYMS.get(match[2].lower())
    return f"{match[1]} {unit}" if match and unit else ""


def is_unit(word: str) -> bool:
    """Return True for a unit and for its other spellings."""
    return word in _DIMENSION_OF or word.lower() in _UNIT_SYNONYMS


def si_value(value: object, dimension: str) -> float:
    """Return ``value`` (a text such as "30 deg", or a Quantity) in SI units of ``dimension``.

    Raises ValueError that names the expected form: for a bare number, another dimension, an unknown unit, infinity.
    """
    example = f"{with_article(dimension)} such as '{EXAMPLES[dimension]}'"
    found = value if isinstance(value, Quantity) else parse_quantity(value) if isinstance(value, str) else None
    if found is None:
        raise ValueError(f"needs {example}{_dimension_error(value, dimension)}")
    if found.dimension != dimension:
        got = with_article(found.dimension) if found.dimension in UNITS else "a quantity"
        raise ValueError(f"needs {example}, got {got}: {quoted_value(found.text)}")
    if not math.isfinite(found):
        raise ValueError(f"needs {example}: {quoted_value(found.text)} is not finite")
    return float(found)


def _dimension_error(value: object, dimension: str) -> str:
    units = "units: " + ", ".join(UNITS[dimension])
    if isinstance(value, int | float) and not isinstance(value, bool):
        return f": {quoted_value(value)} has no unit ({units})"
    text = value.strip() if isinstance(value, str) else ""
    if re.match(r"[-+]?\d+,\d", text):
        return f": write '{text.replace(',', '.', 1)}', with a point"
    match = _WRITTEN.fullmatch(text)
    if match is None:
        return (
            f": {quoted_value(value)} has no unit ({units})"
            if re.fullmatch(_NUMBER, text)
            else f", got {quoted_value(value)}"
        )
    if match[2] in _DIMENSION_OF:
        return f": {quoted_value(value)} is too large"
    unit = _UNIT_SYNONYMS.get(match[2].lower())
    hint = f"write '{match[1]} {unit}'" if unit else units
    return f": unknown unit {quoted_value(match[2])} ({hint})"


def quantity_text(value: float, dimension: str) -> str:
    """Return an SI value with its usual unit: angles in degrees, others in the dimension's first unit ("0.5 m").

    A dimension without a name is its own unit ("2 m^2").
    """
    unit, factor = next(iter(UNITS.get(dimension, {dimension: 1.0}).items()))
    return f"{round(value / factor, 4) + 0.0:g} {unit}"


def with_article(dimension: str) -> str:
    """Return a dimension's name with its article: "an angle", "a length"."""
    return f"{'an' if dimension[0] in 'aeiou' else 'a'} {dimension}"


def quoted_value(value: object) -> str:
    """Return a value for a message, as in the file: quoted, and shortened if it is long."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "'true'" if value else "'false'"
    if isinstance(value, str | int | float):
        text = str(value)
        return f"'{text}'" if len(text) <= MAX_SHOWN_LENGTH else f"'{text[:MAX_SHOWN_LENGTH]}...'"
    return "a list" if isinstance(value, list | tuple) else "a mapping"


NUMBER = "number"
"""Dimension of a plain number. A share has no dimension either."""

BASE_UNITS = ("m", "rad", "s", "V", "degC", "kg")
"""Base units from which all other units are derived."""

MAX_POWER = 9
"""Highest power of a base unit: a mission that multiplies a quantity by itself at every tick gets an error beyond it.
"""

Powers = tuple[int, ...]

DIMENSION_NAMES: dict[Powers, str] = {
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
"""Names of dimensions, by the powers of BASE_UNITS."""

_POWERS = {name: powers for powers, name in DIMENSION_NAMES.items()} | dict.fromkeys(
    ("share", "percent"), (0, 0, 0, 0, 0, 0)
)


class DimensionError(ValueError):
    """Quantities whose dimensions cannot be added or compared; the message names both."""


def product(one: str, other: str) -> str:
    """Return the dimension of the product of two quantities with dimensions ``one`` and ``other``."""
    return _combined(one, other, 1)


def quotient(one: str, other: str) -> str:
    """Return the dimension of the quotient of two quantities with dimensions ``one`` and ``other``."""
    return _combined(one, other, -1)


def common_dimension(one: str, other: str) -> str:
    """Return the dimension of the sum of two quantities. Raises DimensionError if their dimensions differ.

    A percentage (0 to 100) and a share are both numbers, but cannot be added.
    """
    if one == other:
        return one
    if powers(one) != powers(other) or {one, other} == {"share", "percent"}:
        raise DimensionError(f"{dimension_text(one)} and {dimension_text(other)}")
    return NUMBER


@cache
def powers(dimension: str) -> Powers:
    """Return a dimension as the power of each base unit, in the order of BASE_UNITS."""
    known = _POWERS.get(dimension)
    if known is not None:
        return known
    above, _, below = dimension.partition("/")
    found = dict.fromkeys(BASE_UNITS, 0)
    for part, sign in ((above, 1), (below, -1)):
        for unit, power in re.findall(r"([A-Za-z]+)(?:\^(\d+))?", part):
            found[unit] += sign * int(power or 1)
    return tuple(found.values())


def dimension_text(dimension: str) -> str:
    """Return a dimension as text: "a length", "a number", "a quantity in m^2"."""
    return with_article(dimension) if dimension in _POWERS else f"a quantity in {dimension}"


def unit_of(dimension: str) -> str:
    """Return the unit in which a dimension is shown; empty for a plain number."""
    return "" if dimension == NUMBER else next(iter(UNITS[dimension])) if dimension in UNITS else dimension


def factor_of(dimension: str) -> float:
    """Return the factor that converts the unit of ``unit_of(dimension)`` to SI."""
    return next(iter(UNITS[dimension].values())) if dimension in UNITS else 1.0


def example(dimension: str) -> str:
    """Return an example of a quantity of a dimension, as written in a mission."""
    return EXAMPLES.get(dimension, "2" if dimension == NUMBER else f"2 {dimension}")


@cache
def _combined(one: str, other: str, sign: int) -> str:
    found = tuple(a + sign * b for a, b in zip(powers(one), powers(other), strict=True))
    if max(map(abs, found)) > MAX_POWER:
        raise ValueError("a dimension out of range")
    return DIMENSION_NAMES.get(found) or _unit(found)


def _unit(found: Powers) -> str:
    above, below = (
        " ".join(
            base + (f"^{abs(power)}" if abs(power) > 1 else "")
            for base, power in zip(BASE_UNITS, found, strict=True)
            if power * sign > 0
        )
        for sign in (1, -1)
    )
    return f"{above or '1'}/{below}" if below else above
