"""Which kinds of values the variables of a mission hold, and whether all that is calculated from them goes together."""

from collections import Counter, defaultdict, deque
from collections.abc import Callable, Iterator, Mapping
from functools import partial

from config.faults import MAX_FAULTS, Diagnostic, note
from config.units import NUMBER
from missions.language.expressions import Value
from missions.language.for_each import Members, own_steps
from missions.language.inference import kind_made, mismatches
from missions.language.kinds import NOTHING, UNSETTLED, Kind, ListOf, Record, joined, kind_of_type, kind_of_value
from missions.language.nodes import FOR_EACH, MISSION, SWITCHES
from missions.language.notes import Notes
from missions.language.param_types import param_kind
from missions.language.plan import Hole, Step
from missions.language.switches import misfit_cases

Kinds = Mapping[str, Kind]

MAX_ROUNDS = 8
"""Changes of a variable's kind by one setter: a kind is settled, widened at most twice, and then unknown."""


def check_kinds(notes: Notes, tree: Step, returns: Mapping[str, Value]) -> None:
    """Note every expression whose parts do not go together, or that does not fit where it stands."""
    given = {name: kind_of_value(value) for name, value in notes.params.items()} | notes.kinds
    found: dict[Diagnostic, None] = {}  # a mission that is used twice has its mistakes once
    _check(tree, returns, given, found)
    for fault in found:
        if not notes.torn:
            note(notes.faults, fault)


def _check(tree: Step, returns: Mapping[str, Value], given: Kinds, found: dict[Diagnostic, None]) -> None:
    """Check one mission, and those in it."""
    kinds = kinds_in(tree, given)
    values = [value for step in own_steps(tree) for value in step.arguments.values()]
    for value in (*values, *returns.values()):
        if value.template is not None and value.where is not None:
            found |= dict.fromkeys(mismatches(value.template, value.where, kinds))
        if len(found) > MAX_FAULTS:
            return  # no more than these are told, and the place of each is looked up in the whole text
    for step in own_steps(tree):
        if step.kind == MISSION:
            _check(step.children[0], step.returns, _given(step), found)
        elif step.kind in SWITCHES:
            found |= dict.fromkeys(misfit_cases(step, kind_made(step.arguments["on"], kinds)))


def kinds_in(tree: Step, given: Kinds) -> Kinds:
    """Return the kinds of the variables of one mission, where its params are of the kinds ``given``."""
    setters = [setter for step in own_steps(tree) for setter in _set_by(step)]
    kinds: dict[str, Kind] = {**dict.fromkeys((name for name, _ in setters), UNSETTLED), **given}
    readers: dict[str, list[int]] = defaultdict(list)
    for place, (_, what) in enumerate(setters):
        for name in _read_by(what) & kinds.keys():
            readers[name].append(place)
    # Only what reads a variable whose kind has changed is inferred anew: a round over all setters for each of them
    # would take time that is quadratic in their number.
    waiting, rounds = deque(range(len(setters))), Counter[int]()
    while waiting:
        place = waiting.popleft()
        name, what = setters[place]
        kind = kind_made(what, kinds) if isinstance(what, Value) else what(kinds) if callable(what) else what
        settled = joined(kinds[name], kind)
        if settled != kinds[name] and rounds[place] < MAX_ROUNDS:
            rounds[place] += 1
            kinds[name] = settled
            waiting.extend(readers[name])
    return kinds


def _read_by(what: object) -> set[str]:
    """Return the variables by whose kinds the kind of a value is inferred."""
    value = what.args[0] if isinstance(what, partial) else what
    formula = value.template if isinstance(value, Value) else None
    return set() if formula is None else {read.name for read in formula.reads}


def _set_by(step: Step) -> Iterator[tuple[str, Value | Kind | Callable[[Kinds], Kind]]]:
    """Yield the variables that a step sets, each with its value, or with the kind of that, or with what finds that."""
    if step.kind == MISSION:
        inner = kinds_in(step.children[0], _given(step)) if step.returns else {}
        results = {name: kind_made(value, inner) for name, value in step.returns.items()}
        if step.keep_as is None:
            yield from results.items()
        else:
            yield step.keep_as, Record("what it returns", named=results)
    elif step.keep_as is not None:
        yield step.keep_as, None if step.leaf is None or step.leaf.keeps is None else kind_of_type(step.leaf.keeps)
    elif step.leaf is Hole:
        yield from ((name, None) for name in step.binds)
    elif step.leaf is not None and step.leaf.open_ended:
        yield from step.arguments.items()
    elif step.kind == FOR_EACH:
        yield from zip(step.binds, (partial(_member, step.arguments["in"]), NUMBER), strict=False)


def _member(among: Value, kinds: Kinds) -> Kind:
    """Return the kind of the members of a list."""
    if isinstance(among.constant, Members):
        return kind_of_value(among.constant.values[0]) if among.constant.values else UNSETTLED
    kind = kind_made(among, kinds)
    return kind.of if isinstance(kind, ListOf) else UNSETTLED if kind == UNSETTLED else None


def _given(step: Step) -> Kinds:
    """Return the kinds of the params of a sub-mission."""
    return {name: _declared(value) for name, value in step.arguments.items()}


def _declared(value: Value) -> Kind:
    """Return the kind of a param: that of its type, where it is calculated."""
    if value.template is None:
        kind = kind_of_value(value.constant)
        return None if kind == NOTHING else kind
    return param_kind(value.where.wants) if value.where is not None else None
