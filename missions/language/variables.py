"""Kinds (static types) of the variables of a mission, and type errors in expressions with them."""

from collections import Counter, defaultdict, deque
from collections.abc import Callable, Iterator, Mapping
from functools import partial

from config.diagnostics import MAX_DIAGNOSTICS, Diagnostic, add_diagnostic
from config.units import NUMBER
from missions.language.check_context import CheckContext
from missions.language.expressions import Value, plain_values
from missions.language.for_each import ListMembers, steps_in_scope
from missions.language.inference import find_mismatches, kind_of_result
from missions.language.kinds import (
    NOTHING,
    TEXT,
    UNSETTLED,
    Kind,
    ListKind,
    RecordKind,
    join_kinds,
    kind_of_type,
    kind_of_value,
)
from missions.language.nodes import FAILURE_NAME, FOR_EACH, MISSION, SWITCHES
from missions.language.param_types import param_kind
from missions.language.plan import PlaceholderLeaf, Step
from missions.language.switches import impossible_cases

Kinds = Mapping[str, Kind]

MAX_ROUNDS = 8
"""Maximum number of times that one step can change the kind (static type) of a variable; after them, it is unknown."""


def check_kinds(context: CheckContext, tree: Step, returns: Mapping[str, Value]) -> None:
    """Report each expression with a type error, or of a wrong type for its place."""
    param_kinds = {name: kind_of_value(value) for name, value in context.params.items()} | context.param_kinds
    found: dict[Diagnostic, None] = {}  # reports the errors of a sub-mission that is used twice once
    _check_mission(tree, returns, param_kinds, found)
    for fault in found:
        if not context.has_unreadable_line:
            add_diagnostic(context.faults, fault)


def _check_mission(tree: Step, returns: Mapping[str, Value], params: Kinds, found: dict[Diagnostic, None]) -> None:
    """Add the type errors of one mission and its sub-missions to ``found``."""
    kinds = variable_kinds(tree, params)
    arguments = [value for step in steps_in_scope(tree) for value in step.arguments.values()]
    for value in (each for whole in (*arguments, *returns.values()) for each in plain_values(whole)):
        if value.template is not None and value.location is not None:
            found |= dict.fromkeys(find_mismatches(value.template, value.location, kinds))
        if len(found) > MAX_DIAGNOSTICS:
            return  # more are not reported, and each lookup of a place scans the whole text
    for step in steps_in_scope(tree):
        if step.kind == MISSION:
            _check_mission(step.children[0], step.returns, _param_kinds(step), found)
        elif step.kind in SWITCHES:
            found |= dict.fromkeys(impossible_cases(step, kind_of_result(step.arguments["on"], kinds)))


def variable_kinds(tree: Step, params: Kinds) -> Kinds:
    """Return the kinds (static types) of the variables of one mission, given the kinds of its ``params``."""
    setters = [setter for step in steps_in_scope(tree) for setter in _setters(step)]
    kinds: dict[str, Kind] = {**dict.fromkeys((name for name, _ in setters), UNSETTLED), **params, FAILURE_NAME: TEXT}
    readers: dict[str, list[int]] = defaultdict(list)
    for place, (_, what) in enumerate(setters):
        for name in _names_read(what) & kinds.keys():
            readers[name].append(place)
    # Only readers of a variable whose type has changed are inferred again: a round over all setters for each change
    # would take quadratic time.
    waiting, rounds = deque(range(len(setters))), Counter[int]()
    while waiting:
        place = waiting.popleft()
        name, what = setters[place]
        kind = kind_of_result(what, kinds) if isinstance(what, Value) else what(kinds) if callable(what) else what
        settled = join_kinds(kinds[name], kind)
        if settled != kinds[name] and rounds[place] < MAX_ROUNDS:
            rounds[place] += 1
            kinds[name] = settled if rounds[place] < MAX_ROUNDS else None
            waiting.extend(readers[name])
    return kinds


def return_kinds(step: Step) -> Kinds:
    """Return the kinds (static types) of the results of a sub-mission by name."""
    inner = variable_kinds(step.children[0], _param_kinds(step)) if step.returns else {}
    return {name: kind_of_result(value, inner) for name, value in step.returns.items()}


def _names_read(what: object) -> set[str]:
    """Return the variables that the expression ``what`` reads; their kinds (static types) determine its kind."""
    value = what.args[0] if isinstance(what, partial) else what
    formula = value.template if isinstance(value, Value) else None
    return set() if formula is None else {read.name for read in formula.reads}


def _setters(step: Step) -> Iterator[tuple[str, Value | Kind | Callable[[Kinds], Kind]]]:
    """Yield the variables that a step sets, each with the source of its kind (static type).

    The source is the value of the variable, or the kind itself, or a function that returns the kind.
    """
    if step.kind == MISSION:
        results = return_kinds(step)
        if step.output_variable is None:
            yield from results.items()
        else:
            yield step.output_variable, RecordKind("what it returns", members=results)
    elif step.output_variable is not None:
        yield (
            step.output_variable,
            None if step.leaf is None or step.leaf.output_type is None else kind_of_type(step.leaf.output_type),
        )
    elif step.leaf is PlaceholderLeaf:
        yield from ((name, None) for name in step.binds)
    elif step.leaf is not None and step.leaf.open_ended:
        yield from step.arguments.items()
    elif step.kind == FOR_EACH:
        yield from zip(step.binds, (partial(_member_kind, step.arguments["in"]), NUMBER), strict=False)


def _member_kind(among: Value, kinds: Kinds) -> Kind:
    """Return the kind (static type) of the members of the list ``among``; ``kinds`` are those of variables."""
    if isinstance(among.constant, ListMembers):
        return kind_of_value(among.constant.values[0]) if among.constant.values else UNSETTLED
    kind = kind_of_result(among, kinds)
    return kind.member_kind if isinstance(kind, ListKind) else UNSETTLED if kind == UNSETTLED else None


def _param_kinds(step: Step) -> Kinds:
    """Return the kinds (static types) of the params of the sub-mission ``step``, by name."""
    return {name: _declared_kind(value) for name, value in step.arguments.items()}


def _declared_kind(value: Value) -> Kind:
    """Return the kind (static type) of a sub-mission's param from the value that it gets; None if unknown.

    If the value is an expression, it is the kind that the param declares.
    """
    if value.template is None:
        kind = kind_of_value(value.constant)
        return None if kind == NOTHING else kind
    kind = None if value.location is None else value.location.wanted_kind
    return param_kind(kind) if isinstance(kind, str) else kind
