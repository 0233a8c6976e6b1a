"""From a checked plan to one whose leaves are stand-ins and whose unknown values are choices."""

from dataclasses import replace

from behaviours.leaf import FAILURE, Leaf
from missions.language.for_each import Members, own_steps
from missions.language.kinds import STATE
from missions.language.nodes import FOR_EACH, MISSION, MODIFIERS, SWITCHES
from missions.language.plan import Plan, Step
from missions.language.reading import surely_read
from missions.language.values import Value
from missions.testing.verify.choices import Oracle
from missions.testing.verify.guesses import (
    MAX_COUNT,
    TWICE,
    UNKNOWN,
    Anything,
    Guess,
    Many,
    Several,
    asks_sensor,
    widened,
)
from missions.testing.verify.instants import Some
from missions.testing.verify.mocks import outcomes, stand_in, waits
from missions.testing.verify.watch import Watch

TIMES = frozenset(word for word, kind in MODIFIERS.items() if kind.value == "duration")
COUNTS = frozenset(word for word, kind in MODIFIERS.items() if kind.value == "count")

OTHERWISE = "anything else"
"""What a ``switch`` finds that is none of its cases."""


def abstract(step: Step, oracle: Oracle, watch: Watch, names: frozenset[str]) -> Step:
    """Return ``step``, and all below it, for a model that asks ``oracle`` and is followed by ``watch``.

    ``names`` are the variables that something sets in its mission.
    """
    inner = step.children[0].names if step.kind == MISSION else names
    children = tuple(abstract(child, oracle, watch, inner) for child in step.children)
    if step.leaf is not None:
        return replace(step, leaf=stand_in(step, oracle, watch), arguments=_arguments(step, step.leaf, oracle, names))
    returns = {name: _stored(value, oracle) for name, value in step.returns.items()}
    arguments = {name: _setting(step, value, oracle) for name, value in step.arguments.items()}
    return replace(step, children=children, arguments=arguments, returns=returns)


def _arguments(step: Step, leaf: type[Leaf], oracle: Oracle, names: frozenset[str]) -> dict[str, Value]:
    """Return the arguments that matter: what a leaf stores, and what can keep one from starting that cannot fail."""
    if leaf.open_ended:
        return {name: _stored(replace(value, convert=None), oracle) for name, value in step.arguments.items()}
    if any(outcome.status is FAILURE for outcome in outcomes(step)):
        asked = {name: value for name, value in step.arguments.items() if surely_read(value) & names or _senses(value)}
        return {f"argument_{name}": replace(_guess(value, oracle), asked=True) for name, value in asked.items()}
    computed = {name: value for name, value in step.arguments.items() if value.template is not None}
    return {f"argument_{name}": _guess(value, oracle) for name, value in computed.items()}


def _senses(value: Value) -> bool:
    """Say whether a value is computed from what a sensor reports."""
    return value.template is not None and any(map(asks_sensor, value.template.reads))


def _setting(step: Step, value: Value, oracle: Oracle) -> Value:
    """Return what a modifier, a switch or a sub-mission is given."""
    if step.kind == MISSION:
        return _stored(value, oracle)
    if step.kind in COUNTS:
        return _count(value, oracle)
    if step.kind == FOR_EACH:
        return _members(value, oracle)
    if value.template is None:
        return value
    if step.kind in TIMES:
        return Guess(template=value.template, oracle=oracle, options=(Some.of(oracle),), blind=True)
    if step.kind in SWITCHES:
        return _guess(value, oracle, *dict.fromkeys(step.cases), OTHERWISE)
    if step.kind == "once":
        return _guess(value, oracle, Anything(oracle))
    if step.kind == "parallel":
        return _guess(value, oracle, *range(1, len(step.children) + 1))
    return _guess(value, oracle, True, False)


def _guess(value: Value, oracle: Oracle, *options: object) -> Guess:
    return Guess(
        template=value.template,
        convert=value.convert,
        constant=value.constant,
        oracle=oracle,
        options=options or (UNKNOWN,),
    )


def _stored(value: Value, oracle: Oracle) -> Value:
    if value.template is None:
        return value
    return Guess(template=value.template, convert=value.convert, oracle=oracle, kept=widened)


def _count(value: Value, oracle: Oracle) -> Value:
    many = Many.of(oracle, TWICE)
    if value.template is None:
        return Value(many) if isinstance(value.constant, int) and value.constant > MAX_COUNT else value
    return Guess(
        template=value.template,
        convert=value.convert,
        oracle=oracle,
        options=(Many.of(oracle, 0),),
        kept=lambda found: many if isinstance(found, int) and found > MAX_COUNT else found,
    )


def _members(value: Value, oracle: Oracle) -> Value:
    many = Several((UNKNOWN,), Many.of(oracle, TWICE))

    def kept(found: object) -> object:
        return many if isinstance(found, Members) and found.count > MAX_COUNT else found

    if value.template is None:
        return Value(kept(value.constant))
    unknown = Several((UNKNOWN,), Many.of(oracle, 0))
    return Guess(
        template=value.template,
        convert=value.convert,
        oracle=oracle,
        options=(unknown,),
        kept=kept,
    )


def durations(tree: Step) -> frozenset[float]:
    """Return the times that a run can wait for, in seconds."""
    found = set()
    for step in tree.walk():
        value = step.arguments.get("value")
        if step.kind in TIMES and value is not None and isinstance(value.constant, float):
            found.add(value.constant)
        if step.leaf is not None and step.leaf.halting is not Leaf.halting:
            found.add(step.leaf.halt_limit)
        seconds = waits(step)
        if seconds is not None:
            found.add(seconds)
    return frozenset(found)


def missing(plan: Plan) -> frozenset[str]:
    """Return the params that only a caller can give, and that this one did not."""
    reads = {
        read.name
        for step in own_steps(plan.tree)
        for value in step.arguments.values()
        if value.template is not None
        for read in value.template.reads
    }
    return frozenset(reads - plan.params.keys() - plan.tree.names - STATE.keys())
