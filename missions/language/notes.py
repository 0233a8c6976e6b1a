"""What the checker knows while it reads one mission, and the faults that it has found."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from behaviours.leaf import Leaf
from config.faults import Fault, Mark, Source, one_of
from config.marked import Node, Scalar
from missions.language.expressions import Expression, ExpressionError
from missions.language.values import Convert, Template, Value, template

STATE = frozenset({"base", "battery", "face", "head"})
"""The names under which expressions read the robot's state."""

Lookup = Callable[[str], object]
"""Finds a thing by its name; raises LookupError that says what is there."""


@dataclass(slots=True)
class Notes:
    """The mission being read: its text, its params' values, what it may name, and what is wrong with it.

    ``stored`` are the variables that some step of the mission sets. ``things`` finds gestures and controllers by name.
    """

    source: Source
    leaves: Mapping[str, type[Leaf]]
    things: Mapping[str, Lookup]
    params: dict[str, object] = field(default_factory=dict)
    stored: set[str] = field(default_factory=set)
    faults: list[Fault] = field(default_factory=list)

    def fault(self, mark: Mark, message: str, suggestion: str = "") -> None:
        """Note a mistake."""
        self.faults.append(Fault(self.source, mark, message, suggestion))

    def value(self, node: Scalar, what: str, convert: Convert) -> Value:
        """Read a scalar: a constant, or a text with ``${...}`` to be filled; ``what`` begins the message of a fault."""
        try:
            filled = template(node.text)
        except ExpressionError as error:
            self.fault(within(node, error.column or 0), f"{what}: {error}")
            return Value()
        if filled is None:
            return self.constant(node, node.value, what, convert)
        return self.computed(node, filled, what, convert)

    def constant(self, node: Node, value: object, what: str, convert: Convert) -> Value:
        """Convert a value that is known now."""
        try:
            return Value(convert(value))
        except (ValueError, LookupError) as error:
            self.fault(node.mark, f"{what} {error.args[0] if error.args else error}")
            return Value()

    def computed(self, node: Scalar, formula: Template | Expression, what: str, convert: Convert) -> Value:
        """Check the names that an expression reads; where all are params its value is known now."""
        names = formula.names
        known = {*self.params, *self.stored, *STATE}
        for name in names:
            if name not in known:
                self.fault(
                    within(node, max(0, node.text.find(name)), len(name)),
                    f"{what}: unknown name '{name}'",
                    one_of(name, known),
                )
        if any(name not in self.params or name in self.stored for name in names):
            return Value(template=formula, convert=convert)
        try:
            found = formula.evaluate(self.params)
        except ExpressionError as error:
            self.fault(node.mark, f"{what}: {error}")
            return Value()
        return self.constant(node, found, what, convert)


def within(node: Scalar, column: int, length: int = 1) -> Mark:
    """Return the place of a character in a scalar's text."""
    return Mark(node.mark.line, node.mark.column + column + node.quoted, length)
