"""Abstract values: sensor data, results of leaves, and expressions that depend on them.

Values that follow from params and constants are computed as in a run; others are choices, including an error if the
expression can raise one. So the exploration covers all possible runs, and may add impossible ones: two conditions on
one unknown variable may contradict each other.
"""

import ast
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field
from functools import partial
from typing import Any, Self

from config.units import Quantity
from drivers.api.fast_dataclass import dataclass
from drivers.errors import SensorSilent
from missions.language import read_analysis
from missions.language.expressions import (
    Expression,
    ExpressionError,
    NameReference,
    Value,
    draws_number,
    format_value,
)
from missions.language.for_each import ListMembers
from missions.language.operators import RANDOM
from missions.language.read_analysis import always_read_names
from missions.language.robot_state import ROBOT_STATE, state_value
from missions.plugins.verify.choices import Oracle
from missions.plugins.verify.unknown_values import (
    UNKNOWN,
    NumberRange,
    Unknown,
    never_fails,
    number_range,
    truth_values,
)

PLAIN_TYPES = frozenset((bool, int, float, str))
"""Types whose values contain no other values. Checks of nested values test them first, for speed."""

MAX_COUNT = 3
"""Largest whole number, and greatest length of a list, that the exploration stores exactly.

Larger ones become unknown, so that a mission has finitely many states.
"""

MAX_MEMBERS = 10
"""Maximum length of a list over which a ``for_each`` loops member by member.

Lists from a variable are shorter, see MAX_COUNT, so only the lists and params of the mission file have so many members.
"""

MIN_UNBOUNDED_ROUNDS = 2
"""Minimum number of repetitions explored for a loop that has more than MAX_COUNT repetitions.

Whether the loop ends after each further repetition is a choice.
"""

MAX_TEXT_LENGTH = 20
"""Maximum length, in characters, of a text that the exploration stores exactly; a longer one becomes unknown."""


class UnboundedCount(int):
    """Number of a loop's repetitions without an upper bound: any repetition after ``min_rounds`` may be the last."""

    oracle: Oracle
    min_rounds: int
    label: str

    @classmethod
    def of(cls, oracle: Oracle, min_rounds: int, label: str) -> Self:
        """Return a count for which ``oracle`` chooses after each repetition whether it was the last.

        ``label`` is the loop in traces: "'repeat' (line 4)".
        """
        count = cls(min_rounds)
        count.oracle, count.min_rounds, count.label = oracle, min_rounds, label
        return count

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, int) or isinstance(other, UnboundedCount):
            return self is other
        return other >= self.min_rounds and self.oracle.choose((False, True), self._describe_last)

    def _describe_last(self, last: bool) -> str:
        return f"{self.label} has no more rounds" if last else ""

    def __ne__(self, other: object) -> bool:
        return not self == other  # an int compares its value for != by itself, without __eq__

    def __hash__(self) -> int:
        return id(self)


@dataclass(frozen=True, slots=True)
class AbstractList(ListMembers):
    """Members of a list whose length is unknown or has no upper bound."""

    rounds: UnboundedCount

    @property
    def count(self) -> int:
        return self.rounds

    def member(self, place: int) -> object:
        del place
        return UNKNOWN

    number = member


class TopValue:
    """Unknown value that may equal any other value: each comparison is a choice.

    ``label`` is the node that has the value in traces: "'once' (line 4)".
    """

    def __init__(self, oracle: Oracle, label: str) -> None:
        self._oracle = oracle
        self._label = label

    def __eq__(self, other: object) -> bool:
        return self._oracle.choose((True, False), self._describe_comparison)

    def _describe_comparison(self, same: bool) -> str:
        return f"the value of {self._label} is {'the same' if same else 'new'}"

    def __hash__(self) -> int:
        return id(self)


class NondetSensor:
    """Part of the robot's state, such as the battery: each flag has any of its possible values at each read.

    Raises SensorSilent while the part does not report.
    """

    def __init__(self, oracle: Oracle, part: str) -> None:
        self._oracle = oracle
        self._part = part

    def __getattr__(self, name: str) -> Any:
        value = state_value(self._part, name)
        if value is None or not value.options:
            raise AttributeError(name)
        if not value.is_always_known:
            require_report(self._oracle, ROBOT_STATE[self._part].sensor)
        return self._oracle.choose(value.options, partial(_describe_reading, f"{self._part}.{name}"))


def require_report(oracle: Oracle, sensor: str) -> None:
    """Raise SensorSilent if ``sensor`` does not report in this step."""
    if not oracle.sensor_reports(sensor):
        raise SensorSilent(f"the {sensor} does not report")


class UnknownReadError(Exception):
    """Raised when the evaluation of an expression reads a variable whose value the exploration does not know."""


class KnownScope(dict[str, object]):
    """Variables of which an expression may read only the known ones. Raises UnknownReadError for any other."""

    def __contains__(self, name: object) -> bool:
        if name == RANDOM:
            raise UnknownReadError
        return super().__contains__(name)

    def __getitem__(self, name: str) -> object:
        found = super().__getitem__(name)
        if isinstance(found, NondetSensor) or contains_unknown(found):
            raise UnknownReadError
        return found


def reads_sensor(read: NameReference) -> bool:
    """Return whether an expression's variable is reported by a sensor."""
    value = state_value(read.name, read.member)
    return read.name in ROBOT_STATE and not (value is not None and value.is_always_known)


def _describe_reading(name: str, value: object) -> str:
    return f"{name} is {value_text(value)}"


@dataclass(frozen=True, slots=True)
class NondetValue(Value):
    """Value of an expression that is computed if all its variables are known, and otherwise a choice of ``options``.

    - If ``never_computed``, it is always a choice.
    - ``abstraction`` is applied to a computed value.
    - If ``only_checked``, the value itself has no effect, but an unset variable raises an error, and a silent sensor
      suspends the node.
    - If it is evaluated at ``every_tick``, all evaluations in one tick have the same result: a ``while`` makes two when
      it starts.
    """

    oracle: Oracle = field(default_factory=Oracle)
    options: Sequence[object] = (UNKNOWN,)
    never_computed: bool = False
    only_checked: bool = False
    every_tick: bool = False
    abstraction: Callable[[object], object] = lambda found: found
    needed: frozenset[str] = field(init=False)
    """Variables that the expression certainly reads. Precomputed, since they are used tens of thousands of times."""
    sensed: bool = field(init=False)
    sensors: Sequence[str] = field(init=False)
    """Sensors whose data the expression reads. Whether each sensor reports is a choice of the exploration."""
    certain_sensors: frozenset[str] = field(init=False)
    """Sensors that each evaluation reads: none behind ``and``, ``or`` or ``if``."""
    has_shortcuts: bool = field(init=False)
    is_draw: bool = field(init=False)
    """Whether the expression calls ``random``."""
    choices: Sequence[tuple[object, bool]] = field(init=False)

    def __post_init__(self) -> None:
        reads = self.template.reads if self.template is not None else ()
        values = (state_value(read.name, read.member) for read in reads if read.name in ROBOT_STATE)
        is_draw = draws_number(self.template)
        sensed = is_draw or any(value is None or not value.options for value in values)
        choices = [(found, False) for found in self.options] + [(None, True)] * may_fail(self)
        sensors = tuple(dict.fromkeys(ROBOT_STATE[read.name].sensor for read in reads if reads_sensor(read)))
        found = {
            "needed": always_read_names(self),
            "sensed": sensed,
            "choices": choices,
            "sensors": sensors,
            "certain_sensors": frozenset(sensor for tree in syntax_trees(self) for sensor in _certain_sensors(tree)),
            "is_draw": is_draw,
            "has_shortcuts": any(_has_shortcuts(tree) for tree in syntax_trees(self)),
        }
        for name, value in found.items():
            object.__setattr__(self, name, value)

    def resolve(self, scope: Mapping[str, object]) -> object:
        if not self.every_tick:
            return self._resolve(scope)
        known = self.oracle.conditions
        if id(self) not in known:
            try:
                known[id(self)] = self._resolve(scope), None
            except ExpressionError as error:
                known[id(self)] = None, error
        found, problem = known[id(self)]
        if problem is not None:
            raise problem
        return found

    def _resolve(self, scope: Mapping[str, object]) -> object:
        if not self.never_computed and not self.only_checked:
            if not self._reads_unknown(scope):
                return self.abstraction(Value.resolve(self, scope))
            if self.has_shortcuts and self.local_names is None:
                try:
                    return self.abstraction(Value.resolve(self, KnownScope(scope)))
                except UnknownReadError:
                    pass
        self._check_readable(scope)
        if self.only_checked:
            return UNKNOWN
        found, failed = self.oracle.choose(self._possible_choices(scope), self._describe_choice)
        if failed:
            raise ExpressionError("cannot be calculated")
        if found is UNKNOWN and self._reads_range(scope):
            return number_range(self, scope) or UNKNOWN
        return found

    def _possible_choices(self, scope: Mapping[str, object]) -> Sequence[tuple[object, bool]]:
        """Return the values that the exploration can choose from, each with False; and (None, True) if it can fail.

        Of numbers with known bounds, such as those of ``random``, only possible results are tried.
        """
        if not self._reads_range(scope):
            return self.choices
        possible = self.choices
        if isinstance(self.template, Expression) and self.options == (True, False):
            truths = truth_values(self.template.tree, scope)
            possible = [(found, failed) for found, failed in possible if failed or found in truths]
        if any(failed for _, failed in possible) and never_fails(self, scope):
            possible = [(found, failed) for found, failed in possible if not failed]
        return possible or self.choices

    def _reads_range(self, scope: Mapping[str, object]) -> bool:
        """Return whether the expression draws a number, or reads a variable with a number of known bounds."""
        return self.is_draw or any(isinstance(scope.get(name), NumberRange) for name in self.needed)

    def _check_readable(self, scope: Mapping[str, object]) -> None:
        """Raise ExpressionError if a variable that the expression needs is not set, SensorSilent if a sensor is silent.

        If both are the case, the exploration chooses which is met first.
        """
        unset = "" if self.never_computed else next((name for name in self.needed if name not in scope), "")
        silent = next((sensor for sensor in self.sensors if self._is_silent(sensor)), "")
        if silent and (not unset or self.oracle.choose((True, False), _describe_nothing)):
            raise SensorSilent(f"the {silent} does not report")
        if unset:
            raise ExpressionError(f"'{unset}' is not set")

    def _is_silent(self, sensor: str) -> bool:
        """Return whether ``sensor`` does not report and the expression reads it.

        If an evaluation may leave out the sensor, as behind ``and``, the exploration chooses whether it is read.
        """
        if self.oracle.sensor_reports(sensor):
            return False
        return sensor in self.certain_sensors or self.oracle.choose((True, False), _describe_nothing)

    def _reads_unknown(self, scope: Mapping[str, object]) -> bool:
        """Return whether the expression reads a variable that is unknown in ``scope``."""
        reads = self.template.reads if self.template is not None else ()
        return self.sensed or any(contains_unknown(scope.get(read.name)) for read in reads)

    def _describe_choice(self, answer: tuple[object, bool]) -> str:
        found, failed = answer
        if failed:
            return f"'{expression_text(self)}' cannot be calculated"
        return f"'{expression_text(self)}' is {text}" if (text := value_text(found)) else ""


def value_text(value: object) -> str:
    """Return a chosen value as a trace shows it; empty for a value that stands for many."""
    if value is None or type(value) is bool:
        return str(value).lower()
    if isinstance(value, tuple):  # weights
        return str(value)
    return format_value(value) if type(value) in (int, float, str, Quantity) else ""


def _describe_nothing(_: bool) -> str:
    return ""


def syntax_trees(value: Value) -> list[ast.expr]:
    """Return the syntax trees of the expressions in a value."""
    formula = value.template
    parts = () if formula is None else (formula,) if isinstance(formula, Expression) else formula.parts
    return [part.tree for part in parts if isinstance(part, Expression)]


def _has_shortcuts(tree: ast.expr) -> bool:
    """Return whether an evaluation may leave out a part of an expression, as in ``a and b`` if a is false."""
    return any(isinstance(node, ast.BoolOp | ast.IfExp) for node in ast.walk(tree))


def _certain_sensors(node: ast.expr) -> Iterator[str]:
    """Yield the sensors that each evaluation of an expression reads."""
    match node:
        case ast.Attribute(value=ast.Name(id=part), attr=name) if part in ROBOT_STATE:
            value = state_value(part, name)
            if value is None or not value.is_always_known:
                yield ROBOT_STATE[part].sensor
        case ast.BoolOp(values=[first, *_]) | ast.IfExp(test=first):
            yield from _certain_sensors(first)
        case _:
            for below in ast.iter_child_nodes(node):
                if isinstance(below, ast.expr):
                    yield from _certain_sensors(below)


def expression_text(value: Value) -> str:
    """Return an expression as it is written in the mission file."""
    formula = value.template
    if formula is None:
        return str(value.constant)
    if isinstance(formula, Expression):
        return formula.text
    return "".join(part if isinstance(part, str) else f"${{{part.text}}}" for part in formula.parts)


def contains_unknown(value: object) -> bool:
    """Return whether a value is or contains an unknown value."""
    if isinstance(value, Unknown):
        return True
    if value is None or type(value) in PLAIN_TYPES:
        return False
    if isinstance(value, Mapping):
        return any(map(contains_unknown, value.values()))
    return isinstance(value, list | tuple) and any(map(contains_unknown, value))


def widen(found: object) -> object:
    """Return a computed value, or UNKNOWN if its type could produce too many values."""
    if found is None or isinstance(found, bool | UnboundedCount):
        return found
    if isinstance(found, int):
        return found if abs(found) <= MAX_COUNT else UNKNOWN
    if isinstance(found, Mapping):
        return {name: widen(each) for name, each in found.items()}
    if isinstance(found, list) and len(found) <= MAX_COUNT:
        return [widen(each) for each in found]
    return found if isinstance(found, str) and len(found) <= MAX_TEXT_LENGTH else UNKNOWN


def may_fail(value: Value) -> bool:
    """Return whether computing a value can raise. A conversion can, except to a truth value.

    For variables, the rules are those of `mission check`. Sensor data may be missing: then all operators raise except
    ``==``, ``not``, ``and`` and ``or``.
    """
    formula = value.template
    if formula is None:
        return value.convert not in (None, bool)
    parts = (formula,) if isinstance(formula, Expression) else formula.parts
    senses = any(read.name in ROBOT_STATE for read in formula.reads)
    risky = senses and any(_may_raise(part.tree) for part in parts if isinstance(part, Expression))
    return value.convert not in (None, bool) or risky or read_analysis.may_fail(value, (), ())


def _may_raise(node: ast.expr) -> bool:
    match node:
        case ast.Constant() | ast.Name():
            return False
        case ast.Attribute(value=ast.Name(id=name)):
            return name not in ROBOT_STATE
        case ast.BoolOp(values=parts):
            return any(map(_may_raise, parts))
        case ast.UnaryOp(op=ast.Not(), operand=part):
            return _may_raise(part)
        case ast.Compare(left=left, ops=ops, comparators=others):
            equal = all(isinstance(op, ast.Eq | ast.NotEq) for op in ops)
            return not equal or any(map(_may_raise, (left, *others)))
    return True
