"""Variables that are not set on every way to where they are read: found by following every way through the tree.

The definite assignment of compilers, over a behaviour tree: for each end of a node, the variables that may be unset by
then, each with a shortest way that leaves it so. What this cannot know is left to ``mission verify``: a reader behind a
condition on a variable may be safe, one whose failure is caught may fail, and of nodes that run at the same time each
may have set something for another.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from behaviours.basics import Fail, Log, Set, Succeed
from drivers.api.quick import dataclass
from missions.language.expressions import Value
from missions.language.for_each import Members
from missions.language.kinds import STATE
from missions.language.nodes import COMPOSITES, FAILURE, FOR_EACH, MISSION, MODIFIERS, SUCCESS, SWITCHES
from missions.language.notes import Notes
from missions.language.outcomes import cuts
from missions.language.outcomes import ends as ends_of
from missions.language.plan import UNKNOWN, Hole, Step
from missions.language.reading import may_fail, never_zero, surely_read

# Sets of variables that may be unset at some place of a tree, each with the events that lead there.


class Event(NamedTuple):
    """The last event of a way, after those ``before``; ``length`` counts them all."""

    text: str
    before: "Way"
    length: int


Way = Event | None
"""What has to happen, in order, for a variable to be unset at some place; None where that is so at first."""


class Unset(NamedTuple):
    """The variables that may be unset at some place: a bit for each in ``bits``, and the shortest ``ways`` of some.

    Every step has such a value. A mapping of all variables to their ways would take time that is quadratic in the
    number of steps, and so would sets.
    """

    bits: int
    ways: Mapping[str, Way]


NONE = Unset(0, {})


class After(NamedTuple):
    """What may be unset after each end of a step; None for an end that it cannot come to."""

    success: Unset | None
    failure: Unset | None


def with_event(event: str, unset: Unset | None) -> Unset | None:
    """Return what is unset, once ``event`` has happened besides."""
    if unset is None or not unset.ways:
        return unset
    ways = {name: Event(event, way, 1 if way is None else way.length + 1) for name, way in unset.ways.items()}
    return Unset(unset.bits, ways)


def either(ways: Iterable[Unset | None]) -> Unset | None:
    """Return what may be unset by one of these ways, each variable by the shortest; None where there is no way."""
    bits: int | None = None
    found: dict[str, Way] = {}
    for unset in ways:
        if unset is None:
            continue
        bits = unset.bits if bits is None else bits | unset.bits
        for name, way in unset.ways.items():
            if name not in found or _length(way) < _length(found[name]):
                found[name] = way
    return None if bits is None else Unset(bits, found)


def _length(way: Way) -> int:
    return 0 if way is None else way.length


CONDITIONS = frozenset({*SWITCHES, *(word for word, kind in MODIFIERS.items() if kind.value == "condition")})
"""The kinds of nodes that ask an expression which way to go."""

MAX_READINGS = 100
"""Readings whose ways are followed: ``config.faults.MAX_FAULTS``, since no more than those are reported."""


@dataclass(frozen=True, slots=True)
class Here:
    """What holds for a step from around it: ``granted`` names count as set, in a ``caught`` one failures do no harm.

    ``granted`` has a bit for each name, as in ``Unset``. A ``guarded`` one stands behind a condition on a variable:
    whether it is ever run with one unset, nobody can say. By ``never_zero`` names anything can be divided.
    """

    granted: int = 0
    caught: bool = False
    guarded: bool = False
    never_zero: frozenset[str] = frozenset()


class Reading(NamedTuple):
    """A step that reads a variable which is unset where the run has come this way."""

    step: Step
    name: str
    way: Way

    @property
    def events(self) -> Sequence[str]:
        """The events of the way, in order."""
        found, way = list[str](), self.way
        while way is not None:
            found.append(way.text)
            way = way.before
        return found[::-1]


def unset_reads(tree: Step, names: Iterable[str], params: Mapping[str, object]) -> list[Reading]:
    """Return what is read in ``tree`` without being set on every way; ``names`` are unset where it begins.

    The first ``MAX_READINGS`` are complete; of others, only those of the same variables are returned.
    """
    here = Here(never_zero=never_zero(tree, params))
    names = tuple(names)
    found = _Ways().read(tree, names, here)  # bits alone: most missions have no such reading
    return _Ways({each.name for each in found[:MAX_READINGS]}).read(tree, names, here) if found else []


class _Ways:
    """Goes through a tree once, and notes in ``found`` what is read too soon. Ways are kept of ``followed`` names."""

    def __init__(self, followed: Collection[str] = frozenset()) -> None:
        self.found: list[Reading] = []
        self._followed = followed
        self._bits: dict[str, int] = {}

    def read(self, tree: Step, names: Iterable[str], here: Here) -> list[Reading]:
        """Return what is read too soon in a tree before which ``names`` are unset."""
        self.after(tree, self._at_first(names), here)
        return [each for each in self.found if each.name in self._followed] if self._followed else self.found

    def after(self, step: Step, unset: Unset, here: Here) -> After:
        """Return what may be unset after ``step``, before which ``unset`` may be."""
        for value in step.arguments.values():
            self._read(step, value, unset, here)
        if step.leaf is not None:
            return self._leaf(step, unset, here)
        if step.kind == MISSION:
            return self._mission(step, unset, here)
        if step.kind in SWITCHES:
            return self.one_of(step, unset, here)
        if step.kind == FOR_EACH:
            return self.for_each(step, unset, here)
        if step.kind in MODIFIERS or step.kind == UNKNOWN:
            return self._modifier(step, unset, here)
        kind = COMPOSITES[step.kind]
        if kind.order == "in order":
            return self.in_order(step, unset, here, passes=kind.passes)
        return self.at_once(step, unset, here, all_succeed=kind.passes == SUCCESS)

    def _bits_of(self, names: Iterable[str]) -> int:
        """Return the bits of some names, each of which has the same one in all steps."""
        found = 0
        for name in names:
            found |= self._bits.setdefault(name, 1 << len(self._bits))
        return found

    def _at_first(self, names: Iterable[str]) -> Unset:
        names = tuple(names)
        return Unset(self._bits_of(names), dict.fromkeys(name for name in names if name in self._followed))

    def _without(self, names: Collection[str], unset: Unset) -> Unset:
        """Return what is unset still, once ``names`` are set."""
        if not names:
            return unset
        ways = {name: way for name, way in unset.ways.items() if name not in names}
        return Unset(unset.bits & ~self._bits_of(names), ways)

    def _among(self, names: Iterable[str], bits: int) -> list[str]:
        """Return those of some names that have a bit."""
        return [name for name in names if bits & self._bits_of((name,))]

    def _read(self, step: Step, value: Value, unset: Unset, here: Here) -> None:
        if here.caught or here.guarded:
            return
        for name in self._among(sorted(surely_read(value)), unset.bits & ~here.granted):
            self.found.append(Reading(step, name, unset.ways.get(name)))

    def _leaf(self, step: Step, unset: Unset, here: Here) -> After:
        known = self._without(step.own_names, unset)
        if step.leaf is Hole:
            return After(known, NONE)  # nobody knows whether it can fail, and with what unset
        ends = {FAILURE} if step.leaf is Fail else set(ends_of(step))
        if step.leaf in (Log, Set, Succeed) and not self._may_fail(step, unset, here):
            ends.discard(FAILURE)
        return After(
            known if SUCCESS in ends else None, with_event(f"{_shown(step)} fails", unset) if FAILURE in ends else None
        )

    def _may_fail(self, step: Step, unset: Unset, here: Here) -> bool:
        for value in step.arguments.values():
            reads = () if value.template is None else value.template.reads
            if may_fail(value, self._among((read.name for read in reads), unset.bits), here.never_zero):
                return True
        return False

    def _mission(self, step: Step, unset: Unset, here: Here) -> After:
        (tree,) = step.children
        held = never_zero(tree, {name: value.constant for name, value in step.arguments.items()})
        inner = replace(here, granted=0, never_zero=held)
        after = self.after(tree, self._at_first(tree.names - step.arguments.keys()), inner)
        for value in step.returns.values():
            self._read(step, value, after.success or NONE, here)
        lacking = 0 if after.failure is None else after.failure.bits
        lost = [name for name, value in step.returns.items() if self._among(surely_read(value), lacking)]
        kept = step.own_names.difference(lost if step.keep_as is None else [step.keep_as] if lost else [])
        return After(
            None if after.success is None else self._without(step.own_names, unset),
            None if after.failure is None else with_event(f"{_shown(step)} fails", self._without(kept, unset)),
        )

    # --- composites -----------------------------------------------------------------------------------------------

    def in_order(self, step: Step, unset: Unset, here: Here, *, passes: str) -> After:
        """Follow a sequence or a selector: the next child has its turn where the one before it ``passes``."""
        stops: list[Unset | None] = []
        now: Unset | None = unset
        for child in step.children:
            if now is None:
                break
            after = self.after(child, now, replace(here, caught=here.caught or catches(step, child)))
            now, stopped = after if passes == SUCCESS else (after.failure, after.success)
            stops.append(stopped)
            if stopped is not None and _asks_variables(child):
                here = replace(here, guarded=True)  # what goes on has been asked for
        return After(now, either(stops)) if passes == SUCCESS else After(either(stops), now)

    def at_once(self, step: Step, unset: Unset, here: Here, *, all_succeed: bool) -> After:
        """Follow children that run at once, or in any order; ``all_succeed`` where a success needs all of them."""
        found = []
        once = twice = 0
        for child in step.children:
            own = self._bits_of(child.names)
            once, twice = once | own, twice | (once & own)
        for child in step.children:
            beside = twice | (once & ~self._bits_of(child.names))  # what another child sets
            inner = replace(here, caught=here.caught or catches(step, child), granted=here.granted | beside)
            found.append(self.after(child, unset, inner))
        if step.kind == "race":
            found = [
                After(with_event(f"{_shown(child)} ends first", after.success), after.failure)
                for child, after in zip(step.children, found, strict=True)
            ]
        success = either(after.success for after in found)
        if all_succeed and not step.arguments and success is not None:
            still = success.bits
            for each in found:
                still &= -1 if each.success is None else each.success.bits
            success = Unset(still, {name: success.ways[name] for name in self._among(success.ways, still)})
        elif step.arguments and success is not None:
            enough = Event(f"{_shown(step)} succeeds without it", None, 1)
            ways = {name: way or (enough if name in step.names else way) for name, way in success.ways.items()}
            success = Unset(success.bits, ways)
        return After(success, either(after.failure for after in found))

    def one_of(self, step: Step, unset: Unset, here: Here) -> After:
        """Follow a switch."""
        here = replace(here, guarded=here.guarded or _asks_variables(step))
        cases = [f"{_shown(step)} takes the case '{_case(case)}'" for case in step.cases]
        found = [
            After(with_event(case, child.success), with_event(case, child.failure))
            for case, child in zip(
                [*cases, f"{_shown(step)} takes the default"],
                (self.after(child, unset, here) for child in step.children),
                strict=False,
            )
        ]
        none = [] if len(step.children) > len(step.cases) else [with_event(f"{_shown(step)} has no case for it", unset)]
        return After(either(each.success for each in found), either([*(each.failure for each in found), *none]))

    def for_each(self, step: Step, unset: Unset, here: Here) -> After:
        """Follow one round of a for_each, and the way around it where its list may be empty."""
        after = self.after(step.children[0], self._without(step.binds, unset), here)
        among = step.arguments["in"].constant
        has_member = isinstance(among, Members) and among.count
        empty = None if has_member else with_event(f"{_shown(step)} has no member", unset)
        return After(either((after.success, empty)), after.failure)

    # --- modifiers ------------------------------------------------------------------------------------------------

    def _modifier(self, step: Step, unset: Unset, here: Here) -> After:
        if step.kind == UNKNOWN:  # it may make one end of another, or let one never be: nobody after it is blamed
            self.after(step.children[0], unset, replace(here, guarded=True, caught=True))
            return After(NONE, NONE)
        kind = MODIFIERS[step.kind]
        guarded = here.guarded or (bool(kind.cut_when) and _asks_variables(step))
        caught = here.caught or catches(step, step.children[0])
        value = step.arguments["value"]
        known = value.template is None
        if step.kind == "if" and known and not value.constant:
            return After(with_event(_cut(step), unset), None)
        after = self.after(step.children[0], unset, replace(here, guarded=guarded, caught=caught))
        endless = known and value.constant is None
        ways = [
            (None if endless and kind.without_limit(end) else each, onward)
            for end, onward, each in ((SUCCESS, kind.success, after.success), (FAILURE, kind.failure, after.failure))
        ]
        cut = with_event(_cut(step), unset) if kind.cut_when else after.success
        always = kind.value == "condition" and known and bool(value.constant) == (step.kind != "until")
        cut_to = frozenset[str]() if always else cuts(step)
        return After(
            *(
                either([*(each for each, onward in ways if end in onward), *([cut] if end in cut_to else ())])
                for end in (SUCCESS, FAILURE)
            )
        )


def _cut(step: Step) -> str:
    return f"'{step.kind}' (line {step.mark.line}) {MODIFIERS[step.kind].cut_when}"


def catches(step: Step, child: Step) -> bool:
    """Say whether a failure of ``child`` is nothing bad to ``step``: another has its turn, or it is taken otherwise."""
    if step.kind in MODIFIERS:
        return FAILURE not in MODIFIERS[step.kind].failure
    kind = COMPOSITES.get(step.kind)
    if kind is None:
        return False
    if kind.passes == FAILURE:
        return kind.order != "in order" or child is not step.children[-1]
    return step.kind == "parallel" and bool(step.arguments)


def _shown(step: Step) -> str:
    return f"'{step.name}' (line {step.mark.line})"


def _case(case: object) -> str:
    return str(case).lower() if isinstance(case, bool) else str(case)


def _asks_variables(step: Step) -> bool:
    """Say whether a condition in ``step`` asks for anything but what the robot senses."""
    asked = (each for each in step.walk() if each.kind in CONDITIONS)
    values = (value.template for each in asked for value in each.arguments.values())
    return any(read.name not in STATE for template in values if template is not None for read in template.reads)


# Which variables have a value where they are read: what nothing before sets, or not on every way, is a mistake.

AGAIN = frozenset(
    {
        *(word for word, kind in COMPOSITES.items() if kind.at_once or kind.reactive),
        *(word for word, kind in MODIFIERS.items() if kind.repeats or kind.every_tick),
    }
)
"""The kinds below which one part may follow any other: in a later round, or at the same time."""


MAX_EVENTS = 10
"""Events of a way that a message lists."""

HINT = "set it before, such as set: {{{0}: null}}, and ask for it here with if: {0} != null"


def check_flow(notes: Notes, tree: Step) -> None:
    """Note every variable that is read where no step that can come before has set it, or not every way to there."""
    before = len(notes.faults)
    _flow(notes, tree, set(notes.params) | (notes.stored - tree.names))
    if len(notes.faults) > before:
        return
    for each in unset_reads(tree, tree.names - notes.params.keys() - notes.awaited, notes.params):
        when = f"it is not set where {_told(each.events)}" if each.way else "it is set only after this"
        notes.fault_at(each.step, f"'{each.name}' is read here, but {when}", HINT.format(each.name))


def _told(events: Sequence[str]) -> str:
    """Return the events of a way for people: the first ones of many."""
    more = len(events) - MAX_EVENTS
    return ", ".join([*events[:MAX_EVENTS], *([f"and {more} more things happen"] if more > 0 else [])])


def _flow(notes: Notes, step: Step, known: set[str]) -> None:
    """Check ``step``, before which ``known`` can have been set; add to that what can have been set after it."""
    if step.kind in AGAIN:
        known |= step.names
    for value in step.arguments.values():
        _check(notes, step, value, known)
    if step.kind == FOR_EACH:  # its list is asked for before any of its rounds
        known |= step.names
    if step.kind == MISSION:
        own = set(step.arguments)
        _flow(notes, step.children[0], own)
        for value in step.returns.values():
            _check(notes, step, value, own)
    else:
        for child in step.children:
            _flow(notes, child, known)
    known |= step.own_names


def _check(notes: Notes, step: Step, value: Value, known: set[str]) -> None:
    if value.template is None:
        return
    for read in value.template.reads:
        if read.name not in known and read.name not in STATE:
            notes.fault_at(step, f"'{read.name}' is read here, but nothing before this sets it")
