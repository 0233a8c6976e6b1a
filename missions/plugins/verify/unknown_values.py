"""Unknown values of an exploration, and numbers of which only the bounds are known, as those of ``random``."""

import ast
import math
from collections.abc import Iterator, Mapping
from random import Random

from config.units import NUMBER, Quantity
from drivers.api.fast_dataclass import dataclass
from missions.language.expressions import DataTemplate, Expression, ExpressionError, Template, Value, is_draw
from missions.language.operators import MAX_NUMBER, RANDOM, dimension_of, make_quantity

Bounds = tuple[float, float]

EVERY_NUMBER: Bounds = (-math.inf, math.inf)
BOTH = frozenset({True, False})

MAX_STEPS = 3
"""Maximum number of calculations after which the bounds of a number are still known, so that they are finitely many."""


class Unknown:
    """Unknown value, for example a leaf's result or a param from the caller."""

    def __repr__(self) -> str:
        return "unknown"


UNKNOWN = Unknown()


@dataclass(frozen=True, slots=True)
class NumberRange(Unknown):
    """Unknown number from ``low`` to ``high``, in SI units of ``dimension``; only whole numbers if ``whole``.

    ``steps`` counts the calculations with unknown numbers that led to it.
    """

    low: float
    high: float
    dimension: str
    whole: bool
    steps: int

    def at(self, share: float) -> int | float:
        """Return a number of the range: its lowest for a ``share`` of 0, its highest for 1."""
        number = self.low + share * (self.high - self.low)
        return round(number) if self.whole else make_quantity(number, self.dimension)


SAMPLE_SHARES = (0.0, 0.381966, 1.0)
"""Places in a range, from 0 to 1, of which a conversion is tried: both ends, and a number that is not whole."""


class _FixedRandom(Random):
    """Source of random numbers that always returns ``share``."""

    def __init__(self, share: float) -> None:
        super().__init__(0)
        self._share = share

    def random(self) -> float:
        return self._share


def number_range(value: Value, scope: Mapping[str, object]) -> NumberRange | None:
    """Return the range of a value that is calculated with numbers of known bounds; None if it has none."""
    tree = _single_tree(value)
    if tree is None or not _is_computable(tree, scope):
        return None
    low, high = _bounds(tree, scope)
    steps = 1 + max((known.steps for known in _operands(tree, scope) if isinstance(known, NumberRange)), default=0)
    samples = _samples(value, scope)
    if not samples or steps > MAX_STEPS or not (math.isfinite(low) and math.isfinite(high)):
        return None
    try:
        dimensions = {dimension_of(sample) for sample in samples}
    except ValueError:
        return None
    whole = all(isinstance(sample, int) for sample in samples)
    return NumberRange(low, high, dimensions.pop(), whole, steps)


def never_fails(value: Value, scope: Mapping[str, object]) -> bool:
    """Return whether a value that depends on numbers of known bounds can be calculated and converted in each run."""
    formula = value.template
    if formula is None or isinstance(formula, DataTemplate):
        return False
    parts = formula.parts if isinstance(formula, Template) else (formula,)
    if not all(_is_computable(part.tree, scope) for part in parts if isinstance(part, Expression)):
        return False
    if value.convert is None or value.convert is bool:
        return True
    found = number_range(value, scope)
    if found is None:
        return False
    try:
        for share in SAMPLE_SHARES:
            value.convert(found.at(share))
    except (ValueError, LookupError):
        return False
    return True


def _samples(value: Value, scope: Mapping[str, object]) -> list[object]:
    """Return some values that an evaluation can have; empty if it fails."""
    formula, found = value.template, list[object]()
    if formula is None:
        return []
    for share in SAMPLE_SHARES:
        known: dict[str, object] = {RANDOM: _FixedRandom(share)}
        for name in {read.name for read in formula.reads} & scope.keys():
            held = scope[name]
            known[name] = held.at(share) if isinstance(held, NumberRange) else held
        try:
            found.append(formula.evaluate(known))
        except ExpressionError:
            return []
    return found


def _single_tree(value: Value) -> ast.expr | None:
    """Return the syntax tree of a value that is one expression; None for other values."""
    formula = value.template
    if isinstance(formula, Expression):
        return formula.tree
    if formula is None or isinstance(formula, DataTemplate) or len(formula.parts) != 1:
        return None
    (part,) = formula.parts
    return part.tree if isinstance(part, Expression) else None


def _operands(tree: ast.expr, scope: Mapping[str, object]) -> Iterator[object]:
    """Yield the constants of an expression, and the values of the variables that it reads."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant):
            yield node.value
        elif isinstance(node, ast.Name):
            yield scope.get(node.id)


def _is_computable(node: ast.expr, scope: Mapping[str, object]) -> bool:  # noqa: C901, PLR0912 - an arm for each form
    """Return whether an evaluation of an expression never fails, whatever numbers within the bounds it reads.

    Dimensions are not considered, since `mission check` refuses those that do not fit.
    """
    match node:
        case ast.Constant(value=int() | float()):
            return True
        case ast.Name(id=name):
            return isinstance(scope.get(name), int | float | NumberRange)
        case ast.Call(args=[low, high]) if is_draw(node):
            parts = [low, high]
            if _bounds(low, scope)[1] > _bounds(high, scope)[0]:
                return False
        case ast.Call(func=ast.Name(id="abs" | "round" | "min" | "max" as name), args=parts):
            if len(parts) == 1 and name in ("min", "max"):
                return False  # the members of a list
        case ast.BinOp(left=left, op=ast.Div() | ast.FloorDiv() | ast.Mod(), right=right):
            parts = [left, right]
            if not _excludes_zero(_bounds(right, scope)):
                return False
        case ast.BinOp(left=left, right=right):
            parts = [left, right]
            if max(map(abs, _bounds(node, scope))) > MAX_NUMBER:
                return False
        case ast.UnaryOp(operand=part):
            parts = [part]
        case ast.Compare(left=left, ops=ops, comparators=others):
            parts = [left, *others]
            if any(isinstance(op, ast.In | ast.NotIn) for op in ops):
                return False
        case ast.BoolOp(values=parts):
            pass
        case ast.IfExp(test=test, body=body, orelse=orelse):
            parts = [test, body, orelse]
        case _:
            return False
    return all(_is_computable(part, scope) for part in parts)


def truth_values(node: ast.expr, scope: Mapping[str, object]) -> frozenset[bool]:
    """Return the truth values that a condition can have, given the known variables in ``scope``.

    It may contain a truth value that no evaluation has, but never lacks one that an evaluation has.
    """
    match node:
        case ast.Constant(value=bool() as value):
            return frozenset({value})
        case ast.UnaryOp(op=ast.Not(), operand=part):
            return frozenset(not value for value in truth_values(part, scope))
        case ast.BoolOp(op=op, values=parts):
            found = [truth_values(part, scope) for part in parts]
            decisive, other = (True, False) if isinstance(op, ast.Or) else (False, True)
            may_decide = any(decisive in each for each in found)
            may_pass = all(other in each for each in found)
            return frozenset([decisive] * may_decide + [other] * may_pass)
        case ast.Compare(left=left, ops=[op], comparators=[right]):
            return _comparison_values(op, _bounds(left, scope), _bounds(right, scope))
    return BOTH


def _comparison_values(op: ast.cmpop, left: Bounds, right: Bounds) -> frozenset[bool]:
    match op:
        case ast.Lt():
            can_be = left[0] < right[1], left[1] >= right[0]
        case ast.LtE():
            can_be = left[0] <= right[1], left[1] > right[0]
        case ast.Gt():
            can_be = left[1] > right[0], left[0] <= right[1]
        case ast.GtE():
            can_be = left[1] >= right[0], left[0] < right[1]
        case _:
            return BOTH
    return frozenset(value for value, can in zip((True, False), can_be, strict=True) if can)


def _bounds(node: ast.expr, scope: Mapping[str, object]) -> Bounds:
    """Return the lowest and the highest value that the number expression ``node`` can have."""
    match node:
        case ast.Constant(value=int() | float() as value):
            return float(value), float(value)
        case ast.Name(id=name):
            known = scope.get(name)
            if isinstance(known, NumberRange):
                return known.low, known.high
            return (float(known), float(known)) if isinstance(known, int | float) else EVERY_NUMBER
        case ast.Call(args=[low, high]) if is_draw(node):
            return _bounds(low, scope)[0], _bounds(high, scope)[1]
        case ast.Call(func=ast.Name(id="round"), args=[part]) if not _has_dimension(part, scope):
            return _rounded(_bounds(part, scope))
        case ast.Call(func=ast.Name(id="min" | "max" as name), args=[_, _, *_] as parts):
            choose = min if name == "min" else max
            found = [_bounds(part, scope) for part in parts]
            return choose(least for least, _ in found), choose(most for _, most in found)
        case ast.UnaryOp(op=ast.USub(), operand=part):
            least, most = _bounds(part, scope)
            return -most, -least
        case ast.BinOp(left=left, op=op, right=right):
            return _combined_bounds(op, _bounds(left, scope), _bounds(right, scope))
    return EVERY_NUMBER


def _combined_bounds(op: ast.operator, left: Bounds, right: Bounds) -> Bounds:
    match op:
        case ast.Add():
            return left[0] + right[0], left[1] + right[1]
        case ast.Sub():
            return left[0] - right[1], left[1] - right[0]
        case ast.Mult():
            corners = [one * other for one in left for other in right]
        case ast.Div() | ast.FloorDiv() if _excludes_zero(right):
            corners = [one / other for one in left for other in right]
        case _:
            return EVERY_NUMBER
    if any(map(math.isnan, corners)):
        return EVERY_NUMBER
    least, most = min(corners), max(corners)
    if isinstance(op, ast.FloorDiv) and math.isfinite(least) and math.isfinite(most):
        return float(math.floor(least)), float(math.floor(most))
    return least, most


def _rounded(found: Bounds) -> Bounds:
    return (float(round(found[0])), float(round(found[1]))) if all(map(math.isfinite, found)) else EVERY_NUMBER


def _excludes_zero(found: Bounds) -> bool:
    return found[0] > 0 or found[1] < 0


def _has_dimension(tree: ast.expr, scope: Mapping[str, object]) -> bool:
    """Return whether an expression reads a quantity, such as 2 s."""
    return any(
        known.dimension != NUMBER if isinstance(known, NumberRange) else isinstance(known, Quantity)
        for known in _operands(tree, scope)
    )
