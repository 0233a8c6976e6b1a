"""Values in a mission: constants, ``${...}`` expressions, and texts with expressions in them."""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import field
from typing import TYPE_CHECKING

from config.units import UNITS, Quantity, example, in_dimension, named, unit_of
from drivers.api.quick import dataclass
from missions.language.expressions import Expression, ExpressionError, Read, parse
from missions.language.operators import short

if TYPE_CHECKING:
    from missions.language.inference import Where

Convert = Callable[[object], object]
"""Turns what a mission says into what a leaf takes; raises ValueError that says what is wrong."""

_HOLE = re.compile(r"\$\{((?:[^{}'\"]|'[^']*'|\"[^\"]*\")*)\}")


@dataclass(frozen=True, slots=True)
class Template:
    """A text with holes: literal parts and expressions in turn. One hole alone keeps its value's type."""

    parts: tuple[str | Expression, ...]

    @property
    def reads(self) -> tuple[Read, ...]:
        """All that its expressions read."""
        return tuple(read for part in self.parts if isinstance(part, Expression) for read in part.reads)

    def evaluate(self, scope: Mapping[str, object]) -> object:
        """Fill the holes. Raises ExpressionError."""
        if len(self.parts) == 1 and isinstance(self.parts[0], Expression):
            return self.parts[0].evaluate(scope)
        filled = (part if isinstance(part, str) else shown(part.evaluate(scope)) for part in self.parts)
        try:
            return short("".join(filled))
        except ExpressionError:
            raise
        except ValueError as error:
            raise ExpressionError(str(error)) from None


@dataclass(frozen=True, slots=True)
class Value:
    """What an argument gets: ``constant``, unless there is a ``template`` to fill when the node starts.

    ``where`` is the place of the template in its file.
    """

    constant: object = None
    template: Template | Expression | None = None
    convert: Convert | None = None
    where: "Where | None" = field(default=None, compare=False)

    def resolve(self, scope: Mapping[str, object]) -> object:
        """Return the value now. Raises ExpressionError or ValueError with a reason in a few words."""
        if self.template is None:
            return self.constant
        found = self.template.evaluate(scope)
        return found if self.convert is None else self.convert(found)


UNREAD = Value(template=Template(()))
"""Stands for what a mission says wrongly, which has been noted: nothing is known of it before that is mended."""


def template(text: str) -> Template | None:
    """Read a text with ``${...}`` in it; None when there is none. Raises ExpressionError with its column."""
    parts: list[str | Expression] = []
    end = 0
    for hole in _HOLE.finditer(text):
        _all_closed(text, end, hole.start())
        if text[end : hole.start()]:
            parts.append(text[end : hole.start()])
        parts.append(parse(hole[1], hole.start(1)))
        end = hole.end()
    _all_closed(text, end, len(text))
    if not parts:
        return None
    if text[end:]:
        parts.append(text[end:])
    return Template(tuple(parts))


def _all_closed(text: str, start: int, end: int) -> None:
    """Raise ExpressionError where a ``${`` between the holes was not read as one."""
    at = text.find("${", start, end)
    if at >= 0:
        what = "holds a brace, or a quote that is not closed" if "}" in text[at:] else "has no '}'"
        raise ExpressionError(f"'${{' {what}", at, 2)


def shown(value: object) -> str:
    """Write a value into a text as a person would: no trailing zeros, yes and no for true and false."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None:
        return "nothing"
    if isinstance(value, float) and not isinstance(value, Quantity):
        return f"{float(value):.4g}"
    if isinstance(value, list | tuple):
        return ", ".join(shown(item) for item in value)
    return str(value)


def in_si(value: object, dimension: str) -> float:
    """Return a value in SI units of ``dimension``. Raises ValueError.

    A number that was calculated is a share, and never another quantity.
    """
    if isinstance(value, bool | Quantity) or not isinstance(value, int | float):
        return in_dimension(value, dimension)
    if dimension == "share" and math.isfinite(value):
        return float(value)
    raise ValueError(f"{needs(dimension)}, got the number {shown(float(value))}: {multiply(dimension)}")


def needs(dimension: str) -> str:
    """Return the beginning of a message: what is needed, with an example."""
    return f"needs {named(dimension)}" + (f" such as '{example(dimension)}'" if dimension in UNITS else "")


def divide(dimension: str) -> str:
    """Say how a quantity becomes a number."""
    return f"divide it by 1 {unit_of(dimension)}"


def multiply(dimension: str) -> str:
    """Say how a number becomes a quantity."""
    return f"multiply it by 1 {unit_of(dimension)}" + (" or 1 rad" if dimension == "angle" else "")


def whole(value: object) -> int | None:
    """Return a value as a whole number, None where it is none."""
    if isinstance(value, bool | Quantity) or not isinstance(value, int | float):
        return None
    return int(value) if math.isfinite(value) and value == int(value) else None
