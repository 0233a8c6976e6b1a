"""Values in a mission: constants, ``${...}`` expressions, and texts with expressions in them."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from missions.language.expressions import Expression, ExpressionError, parse

Convert = Callable[[object], object]
"""Turns what a mission says into what a leaf takes; raises ValueError that says what is wrong."""

_HOLE = re.compile(r"\$\{((?:[^{}'\"]|'[^']*'|\"[^\"]*\")*)\}")


@dataclass(frozen=True, slots=True)
class Template:
    """A text with holes: literal parts and expressions in turn. One hole alone keeps its value's type."""

    parts: tuple[str | Expression, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The names that its expressions read."""
        return tuple(name for part in self.parts if isinstance(part, Expression) for name in part.names)

    def evaluate(self, scope: Mapping[str, object]) -> object:
        """Fill the holes. Raises ExpressionError."""
        if len(self.parts) == 1 and isinstance(self.parts[0], Expression):
            return self.parts[0].evaluate(scope)
        return "".join(part if isinstance(part, str) else shown(part.evaluate(scope)) for part in self.parts)


@dataclass(frozen=True, slots=True)
class Value:
    """What an argument gets: ``constant``, unless there is a ``template`` to fill when the node starts."""

    constant: object = None
    template: Template | Expression | None = None
    convert: Convert | None = None

    def resolve(self, scope: Mapping[str, object]) -> object:
        """Return the value now. Raises ExpressionError or ValueError with a reason in a few words."""
        if self.template is None:
            return self.constant
        found = self.template.evaluate(scope)
        return found if self.convert is None else self.convert(found)


def template(text: str) -> Template | None:
    """Read a text with ``${...}`` in it; None when there is none. Raises ExpressionError with its column."""
    parts: list[str | Expression] = []
    end = 0
    for hole in _HOLE.finditer(text):
        if text[end : hole.start()]:
            parts.append(text[end : hole.start()])
        try:
            parts.append(parse(hole[1]))
        except ExpressionError as error:
            raise ExpressionError(str(error), hole.start(1) + (error.column or 0)) from None
        end = hole.end()
    rest = text[end:]
    if "${" in rest:
        raise ExpressionError("'${' without its '}'", end + rest.index("${"))
    if not parts:
        return None
    if rest:
        parts.append(rest)
    return Template(tuple(parts))


def shown(value: object) -> str:
    """Write a value into a text as a person would: no trailing zeros, yes and no for true and false."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None:
        return "nothing"
    if type(value) is float:
        return f"{value:.4g}"
    return str(value)
