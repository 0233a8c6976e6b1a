"""Variables whose values have no effect on a run: two states that differ only in such values have the same future.

A text that is only spoken, or a count that is only reported, would otherwise multiply the states of a mission. Of such
a variable, a state keeps only whether it is set.

The analysis is exact, since a value in this set is used in three ways only. A leaf may check that the variable is set.
It may be formatted into the argument of a stand-in, which ignores its arguments. Or a variable in the set is computed
from it, without a choice, by a formula that never fails: the value itself, or sums of numbers.
"""

import ast
from collections import defaultdict
from collections.abc import Collection, Mapping
from typing import NamedTuple

from config.units import Quantity
from missions.language.expressions import Expression, Value
from missions.language.nodes import FOR_EACH, MISSION
from missions.language.plan import Step
from missions.plugins.verify.abstract_values import NondetValue

MAX_NUMBER = 1e6
"""Maximum of a constant number in a sum that is treated as always computable.

Sums of such numbers stay far below the largest number that a mission accepts.
"""


class Variable(NamedTuple):
    """A variable: the number of its mission (0 is the verified one, then each sub-mission), and its name."""

    mission: int
    name: str


class Use(NamedTuple):
    """A use of variables of ``mission``: ``value`` is computed from them, and may be stored in the variable ``target``.

    ``target`` is None if the value is not stored. ``ignored`` is true if nothing depends on the value itself.
    """

    mission: int
    value: Value
    target: Variable | None = None
    ignored: bool = False


def ineffective_variables(
    tree: Step, params: Mapping[str, object], unknown: Collection[str] = ()
) -> list[frozenset[str]]:
    """Return the variables without effect, for the mission with ``tree`` and each sub-mission in the order of the tree.

    The steps must be abstract (see missions.plugins.verify.model). ``params`` are those of the mission with a value,
    ``unknown`` those without.
    """
    return _ValueFlow(tree, params, unknown).ineffective()


class _ValueFlow:
    """Flow of values between the variables of all missions.

    ``_opaque`` are variables that also get values from elsewhere than constants and uses, such as results of leaves.
    """

    def __init__(self, tree: Step, params: Mapping[str, object], unknown: Collection[str]) -> None:
        self._missions = 1
        self._uses: list[Use] = []
        self._constants: defaultdict[Variable, list[object]] = defaultdict(list)
        self._opaque = {Variable(0, name) for name in unknown}
        for name, value in params.items():
            self._constants[Variable(0, name)].append(value)
        self._names = {Variable(0, name) for name in params}
        self._collect(tree, 0)
        self._numbers = self._find_numbers()

    def ineffective(self) -> list[frozenset[str]]:
        """Return the variables without effect of each mission."""
        effective = set(self._opaque)
        grown = True
        while grown:
            before = len(effective)
            for use in self._uses:
                if not self._is_harmless(use, effective):
                    effective |= _reads(use)
            grown = len(effective) > before
        left = self._names - effective
        return [frozenset(name for place, name in left if place == mission) for mission in range(self._missions)]

    def _is_harmless(self, use: Use, effective: set[Variable]) -> bool:
        """Return whether a use has the same effect whatever the values of its variables are."""
        value = use.value
        if isinstance(value, NondetValue) and value.only_checked:
            return True
        unused = use.ignored or (use.target is not None and use.target not in effective)
        return unused and isinstance(value, NondetValue) and self._never_fails(use.mission, value)

    def _never_fails(self, mission: int, value: NondetValue) -> bool:
        """Return whether a value is computed without a choice: a text with variables, or a sum of numbers."""
        if value.never_computed or value.sensors or value.sensed or len(value.choices) > 1 or value.template is None:
            return False
        formula = value.template
        parts = (formula,) if isinstance(formula, Expression) else formula.parts
        trees = [part.tree for part in parts if isinstance(part, Expression)]
        return all(isinstance(tree, ast.Name) or self._is_sum(mission, tree, self._numbers) for tree in trees)

    def _is_sum(self, mission: int, tree: ast.expr, numbers: set[Variable]) -> bool:
        match tree:
            case ast.Constant(value=value):
                return _is_number(value)
            case ast.Name(id=name):
                return Variable(mission, name) in numbers
            case ast.BinOp(left=left, op=ast.Add() | ast.Sub(), right=right):
                return self._is_sum(mission, left, numbers) and self._is_sum(mission, right, numbers)
        return False

    def _find_numbers(self) -> set[Variable]:
        """Return the variables that can only hold numbers without a dimension, or be unknown sums of such numbers."""
        stored: defaultdict[Variable, list[Use]] = defaultdict(list)
        for use in self._uses:
            if use.target is not None:
                stored[use.target].append(use)
        numbers = {
            variable
            for variable in self._names - self._opaque
            if all(map(_is_number, self._constants[variable])) and (self._constants[variable] or stored[variable])
        }
        shrunk = True
        while shrunk:
            wrong = {
                variable for variable in numbers if not all(self._is_number(use, numbers) for use in stored[variable])
            }
            numbers -= wrong
            shrunk = bool(wrong)
        return numbers

    def _is_number(self, use: Use, numbers: set[Variable]) -> bool:
        formula = use.value.template
        if formula is None:
            return _is_number(use.value.constant)
        parts = (formula,) if isinstance(formula, Expression) else formula.parts
        if len(parts) != 1 or not isinstance(parts[0], Expression):
            return False
        return self._is_sum(use.mission, parts[0].tree, numbers)

    def _collect(self, step: Step, mission: int) -> None:
        """Collect the uses of ``step`` and the steps below it, which belong to ``mission``."""
        if step.output_variable is not None:
            self._opaque.add(Variable(mission, step.output_variable))
        if step.kind == MISSION:
            self._collect_submission(step, mission)
            return
        if step.kind == FOR_EACH:
            self._opaque |= {Variable(mission, name) for name in step.binds}
        for name, value in step.arguments.items():
            if step.leaf is None:
                self._add(Use(mission, value))
            elif step.leaf.open_ended:
                self._add(Use(mission, value, Variable(mission, name)))
            else:
                self._add(Use(mission, value, ignored=True))
        for child in step.children:
            self._collect(child, mission)

    def _collect_submission(self, step: Step, mission: int) -> None:
        inner = self._missions
        self._missions += 1
        for name, value in step.arguments.items():
            self._add(Use(mission, value, Variable(inner, name)))
        for name, value in step.returns.items():
            kept = step.output_variable is not None
            self._add(Use(inner, value) if kept else Use(inner, value, Variable(mission, name)))
        self._collect(step.children[0], inner)

    def _add(self, use: Use) -> None:
        self._uses.append(use)
        self._names |= _reads(use)
        if use.target is not None:
            self._names.add(use.target)


def _reads(use: Use) -> set[Variable]:
    reads = () if use.value.template is None else use.value.template.reads
    return {Variable(use.mission, read.name) for read in reads}


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool | Quantity) and abs(value) <= MAX_NUMBER
