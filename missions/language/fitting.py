"""Whether what an expression makes fits the place in which it stands."""

import ast
import re
from collections.abc import Mapping

from config.dimensions import NUMBER, DimensionError, common
from config.faults import Diagnostic, Mark, Source
from config.marked import Scalar
from config.units import UNITS, is_unit, quantity
from drivers.api.quick import dataclass
from missions.language.expressions import Expression
from missions.language.inference import Inference
from missions.language.kinds import FLAG, PERCENT, TEXT, Kind, ListOf, is_size, told
from missions.language.values import Template, divide, multiply, needs


@dataclass(frozen=True, slots=True)
class Where:
    """Where an expression stands: in which scalar of a file, as ``what``; ``wants`` is the kind of the argument."""

    source: Source
    node: Scalar
    what: str
    wants: str = ""

    def place(self, column: int, length: int) -> Mark:
        """Return the place of a part of the scalar's text: the whole of it where the file writes it otherwise."""
        begin = self.node.mark.column - 1 + self.node.quoted
        if self.source.line(self.node.mark.line).startswith(self.node.text[: column + length], begin):
            return Mark(self.node.mark.line, begin + column + 1, length)
        return self.node.mark


def mismatches(formula: Template | Expression, where: Where, kinds: Mapping[str, Kind]) -> list[Diagnostic]:
    """Return the mistakes in what is calculated here, where names are of these kinds."""
    faults: list[Diagnostic] = []

    def note(part: Expression, node: ast.expr, message: str, hint: str) -> None:
        faults.append(Diagnostic(where.source, where.place(*part.place(node)), f"{where.what}{message}", hint))

    parts = formula.parts if isinstance(formula, Template) else (formula,)
    for number, part in enumerate(parts):
        if isinstance(part, str):
            continue

        def report(node: ast.expr, message: str, hint: str, part: Expression = part) -> None:
            note(part, node, f": {message}", hint)

        kind = Inference(kinds, report).kind(part.tree)
        after = parts[number + 1] if number + 1 < len(parts) else ""
        wrong = _alone(kind, where.wants) if len(parts) == 1 else _before(kind, after, where.wants)
        if wrong is not None:
            note(part, part.tree, *wrong)
    return faults


def _alone(kind: Kind, wants: str) -> tuple[str, str] | None:
    """Return what is wrong with a value of this kind, and what to write."""
    if wants in UNITS:
        if (is_size(kind) and not _same(kind, wants)) or kind in (TEXT, FLAG) or isinstance(kind, ListOf):
            return f" {needs(wants)}, got {told(kind)}", multiply(wants) if kind in (NUMBER, PERCENT) else ""
    elif wants in (NUMBER, "count") and is_size(kind) and not _same(kind, NUMBER):
        return f" needs a number, got {told(kind)}", divide(str(kind))
    return None


def _before(kind: Kind, after: str | Expression, wants: str) -> tuple[str, str] | None:
    """Return what is wrong with a value of this kind in a text, before a unit: "${n} deg"."""
    word = _WORD.match(after) if isinstance(after, str) else None
    if word is None or not is_unit(word[1]):
        return None
    if is_size(kind) and not _same(kind, NUMBER):
        return f": {told(kind)} is written with its unit", f"leave '{word[1]}' out, or {divide(str(kind))}"
    written = quantity(f"1 {word[1]}")
    if wants in UNITS and written is not None and written.dimension != wants:
        return f" {needs(wants)}, got {told(written.dimension)}", ""
    return None


_WORD = re.compile(r"\s*([A-Za-z%°][A-Za-z/^2²°%]*)")


def _same(kind: Kind, dimension: str) -> bool:
    try:
        common(str(kind), dimension)
    except DimensionError:
        return False
    return True
