"""Breadth-first exploration of all states of a mission, so that the path to each state is a shortest one."""

from collections import Counter, defaultdict, deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise

from py_trees.common import Status

from behaviours.leaf import FAILURE, IDLE, RUNNING, SUCCESS, Leaf
from behaviours.node import Node
from config.diagnostics import Diagnostic
from missions.executive.events import status_word
from missions.plugins.verify.choices import Script
from missions.plugins.verify.model import MissionModel, ModelState
from missions.plugins.verify.places import describe_node
from missions.plugins.verify.rule_monitor import Violation
from missions.plugins.verify.symbolic_time import Zone, includes
from missions.plugins.verify.tick_merging import RunMergedError

GOING, HALTING, RESTED = "going", "halting", "rested"
"""Kinds of a state: the run is ticked; it is halting; it is at rest after a halt."""

MAX_TIMED_VARIANTS = 5
"""Maximum number of states that differ only in their time bounds, with exact bounds.

Further ones get coarser bounds. They are merged with a state whose bounds allow all their timings, if there is one.
"""


MAX_DOUBTS = 20
"""Maximum number of impossible runs to a fact, after which no further run to it is tested."""

MAX_TRANSITIONS_PER_STATE = 40
"""Limit on transitions, as a multiple of the bound on states: many parallel leaves give each state many transitions."""


@dataclass(slots=True)
class ExploredState:
    """An explored state of a mission, and the step by which it was first reached.

    ``kind`` is GOING, HALTING, RESTED, or "success" or "failure" for a run that has ended. ``state`` is None if no step
    follows. ``completes_round`` means that a step from here completes one repetition of a ``repeat: forever``.
    ``is_exact`` is false if a state on the way, or this one, has coarser time bounds: then its run may be impossible.
    """

    kind: str
    state: ModelState | None
    predecessor: int
    script: Script
    depth: int
    live_leaves: frozenset[Leaf]
    happened: tuple[bool, ...]
    is_exact: bool
    successors: set[int] = field(default_factory=set)
    completes_round: bool = False


@dataclass(frozen=True, slots=True)
class FirstViolation:
    """First violation of a rule: in the step from the state number ``place`` with the choices ``script``.

    The step is a halt if ``halted``, otherwise a tick.
    """

    violation: Violation
    place: int
    script: Script
    halted: bool


Step = tuple[int, Script, bool]
"""Step of a run: the number of the state before it, its choices, and whether it is a halt."""


class StateSpace:
    """Explored state space of a mission. ``open`` are the states that were not completely expanded.

    The exploration ends at ``bound`` states, or when ``is_late`` returns true. ``facts`` are true in some run: nodes
    that are reached, nodes whose time is over, broken rules, and ends. ``doubtful`` counts how often a fact was only
    found in a run whose times are impossible.
    """

    def __init__(self, model: MissionModel, bound: int, is_late: Callable[[], bool] = lambda: False) -> None:
        self.model = model
        self.bound = bound
        self.out_of_time = False
        self._is_late = is_late
        self.places: list[ExploredState] = []
        self.violations: dict[str, FirstViolation] = {}
        self.facts: set[object] = set()
        self.doubtful: Counter[object] = Counter()
        self.transitions = 0
        self.open: set[int] = set()
        self._numbers: dict[object, int] = {}
        self._variants: defaultdict[object, list[int]] = defaultdict(list)
        self._frontier: deque[int] = deque()

    @property
    def is_complete(self) -> bool:
        """Whether all reachable states, and all orders of random composites, were explored."""
        return not self.open and not self.model.shuffler.is_sampled

    @property
    def explored_depth(self) -> int:
        """Number of ticks from the start up to which all runs were explored."""
        return min((self.places[number].depth for number in self.open), default=self.depth)

    @property
    def depth(self) -> int:
        """Number of steps from the start to the farthest state."""
        return self.places[-1].depth

    def explore(self) -> None:
        """Explore all choices from every state, until no new state is found or a limit is reached.

        The limits are the bound on states and the time limit.
        """
        self._add(GOING, -1, ())
        while self._frontier:
            number = self._frontier.popleft()
            if self.places[number].kind == GOING:
                self._expand(number, halted=False)
            self._expand(number, halted=True)

    def _is_full(self) -> bool:
        """Return whether the bound of states or the time limit is reached."""
        self.out_of_time = self.out_of_time or self._is_late()
        return (
            self.out_of_time
            or len(self.places) > self.bound
            or self.transitions >= self.bound * MAX_TRANSITIONS_PER_STATE
        )

    def _expand(self, number: int, *, halted: bool) -> None:
        """Take every possible step from the state with this number: all ticks, or all halts if ``halted``."""
        self.model.merger.start()
        found = self._take_steps(number, halted=halted)
        self.model.merger.stop()
        for script, facts, violations in found:
            if all(fact in self.facts or self.doubtful[fact] >= MAX_DOUBTS for fact in facts):
                continue
            if self.is_possible(number, (number, script, halted)):
                self.facts |= facts
                for violation in violations:
                    self.violations.setdefault(violation.rule, FirstViolation(violation, number, script, halted))
            else:
                self.doubtful.update(facts)

    def _take_steps(self, number: int, *, halted: bool) -> list[tuple[Script, set[object], list[Violation]]]:
        """Take the steps from a state; return the scripts that show new facts, with these facts and violations."""
        watch, found = self.model.watch, []
        script: Script | None = ()
        while script is not None:
            if self._is_full():
                self.open.add(number)
                break
            self.transitions += 1
            try:
                kind = self.step(number, script, halted=halted)
            except RunMergedError:
                kind = ""
            taken, facts = self.model.oracle.script, watch.facts
            if kind:
                facts |= {kind, *(violation.rule for violation in watch.violations)}
                place = self.places[number]
                place.successors.add(self._add(kind, number, taken))
                place.completes_round = place.completes_round or watch.completed_round
            if not facts <= self.facts:
                found.append((taken, facts - self.facts, watch.violations))
            script = self.model.oracle.next_script()
        return found

    def is_possible(self, number: int, *then: Step) -> bool:
        """Return whether a run can reach the state ``number``, and then take the steps ``then``.

        The times of all its ticks are compared, since the bounds in a state may be coarser.
        """
        if self.places[number].is_exact:
            return True
        steps = [*self.steps_to(number), *then]
        zone = Zone.of_ticks(len(steps))
        ticks: list[int] = []
        for tick, (before, script, halted) in enumerate(steps):
            self.step(before, script, halted=halted)
            ticks.append(tick)
            for later, earlier, seconds, over in self.model.timing.decisions:
                if not zone.add(ticks[later], ticks[earlier], seconds, over):
                    return False
            ticks = [ticks[place] for place in self.model.instants()]
        return True

    def steps_to(self, number: int) -> list[Step]:
        """Return the steps on the path from the start to the state ``number``."""
        return [
            (before, self.places[after].script, is_halt_step(self.places[after]))
            for before, after in pairwise(self.path_to(number))
        ]

    def step(self, number: int, script: Script, *, halted: bool) -> str:
        """Take one step from a state with the choices of a script; return the kind of the state reached."""
        model = self.model
        state = self.places[number].state
        if state is not None:
            model.restore(state)
        model.oracle.follow(script)
        model.merger.begin_run()
        if halted:
            kind = RESTED if model.halt() else HALTING
        else:
            model.tick()
            kind = _KINDS[model.root.status]
        if kind not in (GOING, HALTING):
            model.watch.check_rest()
        return kind

    def _add(self, kind: str, predecessor: int, script: Script) -> int:
        """Return the number of the model's present state, adding the state to the explored ones if it is new.

        ``predecessor`` is the number of the state before, and ``script`` the choices of the step between the two.
        """
        model = self.model
        live, happened = frozenset(model.watch.live_leaves), model.watch.happened
        goes_on = kind in (GOING, HALTING)
        state = model.state() if goes_on else None
        key: object = (kind, live, happened) if state is None else (kind, state)
        if key in self._numbers:
            return self._numbers[key]
        number = self._numbers[key] = len(self.places)
        is_exact = number == 0 or self.places[predecessor].is_exact
        if state is not None:
            variants = self._variants[kind, state.rows, state.variables, state.happened, state.moving]
            if len(variants) >= MAX_TIMED_VARIANTS:
                state = model.coarsen(state)
                for variant in variants:
                    known = self.places[variant].state
                    if known is not None and includes(known.times, state.times):
                        self._numbers[key] = variant
                        return variant
                is_exact = False
            variants.append(number)
        depth = self.places[predecessor].depth + 1 if number else 0
        self.places.append(ExploredState(kind, state, predecessor, script, depth, live, happened, is_exact))
        if goes_on:
            self._frontier.append(number)
        return number

    def path_to(self, number: int) -> list[int]:
        """Return the numbers of the states on the path from the start to the state ``number``, both ends included."""
        way = [number]
        while (before := self.places[way[-1]].predecessor) >= 0:
            way.append(before)
        return way[::-1]

    def reachable_from(self, number: int) -> set[int]:
        """Return the numbers of the states that are reachable from the state ``number``, itself included."""
        found, rest = {number}, [number]
        while rest:
            new = self.places[rest.pop()].successors - found
            found |= new
            rest += new
        return found

    def can_reach(self, goals: Iterable[int]) -> set[int]:
        """Return the numbers of the states from which one of ``goals`` can be reached, the goals included."""
        before: defaultdict[int, list[int]] = defaultdict(list)
        for number, place in enumerate(self.places):
            for later in place.successors:
                before[later].append(number)
        found = set(goals)
        rest = list(found)
        while rest:
            for number in before[rest.pop()]:
                if number not in found:
                    found.add(number)
                    rest.append(number)
        return found


_KINDS: dict[Status, str] = {RUNNING: GOING, SUCCESS: "success", FAILURE: "failure"}


def is_halt_step(place: ExploredState) -> bool:
    """Return whether a state was reached by a halt instead of a tick."""
    return place.kind in (HALTING, RESTED)


# Verdicts: proved, refuted and undecided rules of a mission.

# Traces: a run of the exploration, replayed step by step and formatted as lines.


@dataclass(frozen=True, slots=True)
class TraceStep:
    """Step of a trace: tick or halt, its choices, and the status changes of nodes."""

    halted: bool
    choices: tuple[str, ...]
    changed: Mapping[str, str]

    def __str__(self) -> str:
        choices = "; ".join(("halt", *self.choices) if self.halted else self.choices) or "no change"
        changed = ", ".join(f"{who} {status}" for who, status in self.changed.items())
        return f"{choices} -> {changed}" if changed else choices


RunTrace = tuple[TraceStep, ...]


def trace_to(space: StateSpace, place: int) -> RunTrace:
    """Return a shortest trace from the start to the state number ``place``."""
    return tuple(_replay_step(space, *step) for step in space.steps_to(place))


def trace_to_violation(space: StateSpace, violation: FirstViolation) -> RunTrace:
    """Return the trace that ends with the step of a violation."""
    last = _replay_step(space, violation.place, violation.script, violation.halted)
    return (*trace_to(space, violation.place), last)


def _replay_step(space: StateSpace, before: int, script: Script, halted: bool) -> TraceStep:
    space.step(before, script, halted=halted)
    model = space.model
    choices = tuple(text for choice in model.oracle.choices if (text := str(choice)))
    last = {node: status for node, status in model.watch.changes if _is_reported(node) or status is IDLE}
    changed = {describe_node(node): "halted" if status is IDLE else status_word(node) for node, status in last.items()}
    return TraceStep(halted, choices, changed)


def _is_reported(node: Node) -> bool:
    """Return whether a trace shows the changes of a node; changes of leaves already follow from the choices."""
    return not isinstance(node, Leaf)


PROVED, REFUTED, UNDECIDED = "proved", "refuted", "not decided"


@dataclass(frozen=True, slots=True)
class RuleFinding:
    """Position of a broken rule, and a shortest trace to it.

    There is no trace if the rule demands something that happens in no run, such as that a node is reached.
    """

    fault: Diagnostic
    run: RunTrace | None = None


@dataclass(frozen=True, slots=True)
class RuleVerdict:
    """Verdict on one rule. If it is undecided, ``so_far`` describes the result for the part that was explored."""

    rule: str
    outcome: str
    findings: tuple[RuleFinding, ...] = ()
    so_far: str = ""

    def __str__(self) -> str:
        return f"{self.outcome:<11}  {self.rule}" + (f": {self.so_far}" if self.so_far else "")


@dataclass(frozen=True, slots=True)
class VerificationReport:
    """All verdicts on a mission, and the extent of the exploration: states, transitions, ticks from the start.

    ``left_out`` describes the unexplored part, if any.
    """

    file: str
    mission: str
    verdicts: tuple[RuleVerdict, ...]
    states: int
    transitions: int
    depth: int
    seconds: float
    left_out: str = ""
    outcome: str = field(init=False)

    def __post_init__(self) -> None:
        outcomes = [verdict.outcome for verdict in self.verdicts]
        worst = next((outcome for outcome in (REFUTED, UNDECIDED) if outcome in outcomes), PROVED)
        object.__setattr__(self, "outcome", worst)

    def __str__(self) -> str:
        return "\n".join(self._lines())

    def _lines(self) -> Iterable[str]:
        figures = (
            f"{self.states} states, {self.transitions} transitions, {_ticks(self.depth)} deep, {self.seconds:.1f} s"
        )
        yield f"{self.file}: {self.outcome} ({figures})"
        for verdict in self.verdicts:
            yield f"  {verdict}"
        for finding in (finding for verdict in self.verdicts for finding in verdict.findings):
            yield ""
            yield str(finding.fault)
            if finding.run is not None:
                yield f"  a shortest run to it, of {_ticks(len(finding.run))}:" if finding.run else "  from the start"
            for number, turn in enumerate(finding.run or (), start=1):
                yield f"  {number:4d}. {turn}"
        if self.left_out:
            yield f"  not fully explored: {self.left_out}"

    def as_dict(self) -> dict[str, object]:
        """Return the report as plain data for other programs; line and column count from 1."""
        return {
            "file": self.file,
            "mission": self.mission,
            "outcome": self.outcome,
            "states": self.states,
            "transitions": self.transitions,
            "depth": self.depth,
            "seconds": round(self.seconds, 3),
            "left_out": self.left_out,
            "verdicts": [
                {
                    "rule": verdict.rule,
                    "outcome": verdict.outcome,
                    "so_far": verdict.so_far,
                    "findings": [_as_dict(finding) for finding in verdict.findings],
                }
                for verdict in self.verdicts
            ],
        }


def _as_dict(finding: RuleFinding) -> dict[str, object]:
    fault = finding.fault
    turns = [{"halted": t.halted, "given": list(t.choices), "changed": dict(t.changed)} for t in finding.run or ()]
    return {
        "file": fault.source.name,
        "line": fault.mark.line,
        "column": fault.mark.column,
        "length": fault.mark.length,
        "message": fault.message,
        "suggestion": fault.suggestion,
        "run": None if finding.run is None else turns,
    }


def _ticks(count: int) -> str:
    return "1 tick" if count == 1 else f"{count} ticks"
