"""Verdicts of an exploration, rule by rule: proved, refuted by a counterexample, or undecided."""

from collections.abc import Callable, Container, Iterable, Sequence
from math import inf

from behaviours.leaf import RUNNING
from behaviours.node import Node
from behaviours.run import SENSOR_TIMEOUT
from config.diagnostics import Diagnostic, Mark, SourceText
from config.units import quantity_text
from drivers.clock import Clock
from missions.executive.modifiers import RepeatModifier, RetryModifier
from missions.language.nodes import NODES, TIME_LIMITS, WEIGHTS
from missions.language.plan import Plan, Step, composite_kind
from missions.plugins.verify.explore import (
    GOING,
    HALTING,
    PROVED,
    REFUTED,
    RESTED,
    UNDECIDED,
    RuleFinding,
    RuleVerdict,
    StateSpace,
    VerificationReport,
    trace_to,
    trace_to_violation,
)
from missions.plugins.verify.model import MissionModel, steps_by_key
from missions.plugins.verify.places import place_text
from missions.plugins.verify.rule_monitor import (
    EXCLUSIVE_ACTUATORS,
    REST_AFTER_END,
    VARIABLES_SET,
    PropertyMonitor,
    TimeOver,
)
from missions.plugins.verify.stand_ins import StandIn

ENDS = ("success", "failure")

MAX_CANDIDATES = 20
"""Maximum number of states of which a verdict tests whether a run can reach them."""


class RuleChecker:
    """Derives verdicts from a finished exploration."""

    def __init__(self, space: StateSpace, plan: Plan) -> None:
        self._space = space
        self._plan = plan
        self._steps = dict(steps_by_key(plan.tree))
        self._unproved = PROVED if space.is_complete else UNDECIDED
        ticks = "1 tick" if space.explored_depth == 1 else f"{space.explored_depth} ticks"
        self._shallow = f"true of all runs of up to {ticks}" if space.open and space.explored_depth else ""

    def verdicts(self) -> list[RuleVerdict]:
        """Return all verdicts: first the rules for every mission, then its own properties."""
        return [
            self._check_termination(),
            self._check_reachability(),
            *self._check_timeouts(),
            self._check_safety(EXCLUSIVE_ACTUATORS, "no two behaviours drive one actuator at the same time"),
            self._check_rest(),
            *(
                [self._check_safety(VARIABLES_SET, "every variable is set when it is read")]
                if self._space.model.watch.reads
                else []
            ),
            *(self._check_property(place, each) for place, each in enumerate(self._space.model.monitors)),
        ]

    # --- the rules ----------------------------------------------------------------------------------------------------

    def _check_termination(self) -> RuleVerdict:
        places = self._space.places
        ends = [number for number, place in enumerate(places) if place.kind in ENDS]
        rounds = [number for number, place in enumerate(places) if place.completes_round]
        rule = "it can end from every state"
        if rounds:
            rule = f"{rule}, or goes on with its 'repeat: forever'" if ends else "it runs until it is stopped"
        trap, unproved = self._first_state_without((*ends, *rounds), lambda kind: kind == GOING)
        if trap is None:
            known = self._space.can_reach((*ends, *rounds))
            so_far = f"true of {len(known)} of {len(places)} states" if self._space.open else ""
            return RuleVerdict(rule, unproved, so_far=so_far)
        holder = self._node_without_end(self._bottom_component(trap))
        step = self._steps[holder.key]
        message = f"no end can be reached {'at all' if trap == 0 else 'any more'}: '{step.kind}' goes on for ever"
        fault = Diagnostic(step.source, step.mark, message)
        return RuleVerdict(rule, REFUTED, (RuleFinding(fault, trace_to(self._space, trap)),))

    def _check_reachability(self) -> RuleVerdict:
        """Return the verdict on whether each node is reached, except children that always have the weight 0.

        A node of a sub-mission that runs in several places is reached if one of them reaches it.
        """
        reached, nodes = self._space.facts, self._space.model.nodes
        unreached = [node for node in nodes if node not in reached and (node.parent is None or node.parent in reached)]
        decided = self._space.is_complete and not any(node in self._space.doubtful for node in unreached)
        places = {self._place_key(node) for node in nodes if node in reached}
        missed = [node for node in self._one_per_place(unreached, places) if not (decided and self._has_weight(node))]
        count = len(nodes) - sum(len(list(node.iterate())) for node in unreached if node not in missed)
        rule = "its node can be reached" if count == 1 else f"each of its {count} nodes can be reached"
        if not missed or not decided:
            return self._partial_verdict(rule, count, len(missed))
        return RuleVerdict(rule, REFUTED, tuple(RuleFinding(self._unreached_diagnostic(node)) for node in missed))

    def _place_key(self, node: Node) -> tuple[str, Mark, str]:
        """Return the place of a node in its file; the copies of a sub-mission share the places of their nodes."""
        step = self._steps[node.key]
        return step.source.name, step.mark, step.kind

    def _one_per_place(self, nodes: Sequence[Node], without: Container[object]) -> list[Node]:
        """Return the first of ``nodes`` at each place in the files that is not in ``without``."""
        first = {self._place_key(node): node for node in reversed(nodes)}
        return [node for node in nodes if first[self._place_key(node)] is node and self._place_key(node) not in without]

    def _has_weight(self, node: Node) -> bool:
        """Return whether a node is a child with a weight; with one above 0, some run draws it first."""
        return isinstance(node.parent, Node) and WEIGHTS in self._steps[node.parent.key].arguments

    def _partial_verdict(self, rule: str, count: int, missed: int) -> RuleVerdict:
        """Return the verdict on a rule that must come true for ``count`` nodes, such as that each is reached.

        For ``missed`` of the nodes it has not come true so far. Then the rule is undecided, otherwise proved.
        """
        return (
            RuleVerdict(rule, UNDECIDED, so_far=f"true of {count - missed} so far")
            if missed
            else RuleVerdict(rule, PROVED)
        )

    def _unreached_diagnostic(self, node: Node) -> Diagnostic:
        step = _unwrap_modifiers(self._steps[node.key])
        parent = self._steps[node.key.rpartition(".")[0] or node.key]
        reason = (composite_kind(parent) or NODES[parent.kind]).unreached_reason
        return Diagnostic(
            step.source,
            step.mark,
            f"'{step.name}' is never reached",
            f"'{parent.kind}' {_place(parent, step)}: {reason or 'never reached'}",
        )

    def _check_timeouts(self) -> list[RuleVerdict]:
        watch = self._space.model.watch
        if not watch.timed_nodes:
            return []
        one = next(iter(watch.timed_nodes))
        rule = f"its {len(watch.timed_nodes)} waits and timeouts" if len(watch.timed_nodes) > 1 else f"its '{one.kind}'"
        rule = f"{rule} can be over"
        facts, doubtful = self._space.facts, self._space.doubtful
        over = {self._place_key(node) for node in watch.timed_nodes if TimeOver(node) in facts}
        lasting = [node for node in watch.timed_nodes if node in facts and TimeOver(node) not in facts]
        missed = self._one_per_place(lasting, over)
        if not missed or not self._space.is_complete or any(TimeOver(node) in doubtful for node in missed):
            return [self._partial_verdict(rule, len(watch.timed_nodes), len(missed))]
        return [RuleVerdict(rule, REFUTED, tuple(RuleFinding(self._never_over_diagnostic(node)) for node in missed))]

    def _never_over_diagnostic(self, node: Node) -> Diagnostic:
        step = self._steps[node.key]
        own = _seconds(step)
        around = [self._steps[node.key[:end]] for end, sign in enumerate(node.key) if sign == "."][::-1]
        limits = [each for each in around if each.kind in TIME_LIMITS]
        sooner = [each for each in limits if own is not None and (_seconds(each) or inf) <= own]
        if sooner:
            first = sooner[0]
            why = f"the '{first.kind}' of {first.text} around it {_place(first, step)} is over first"
        elif step.kind in TIME_LIMITS:
            why = f"'{_unwrap_modifiers(step).name}' has always ended before"
        elif limits:
            why = f"the '{limits[0].kind}' around it {_place(limits[0], step)} leaves it no time"
        else:
            why = "a node around it always ends it before"
        return Diagnostic(step.source, step.mark, f"'{step.kind}' of {step.text} is never over", why)

    def _check_rest(self) -> RuleVerdict:
        rule = "after every halt and every end all is at rest"
        found = self._check_safety(REST_AFTER_END, rule)
        stuck, _ = self._first_state_without(
            (number for number, place in enumerate(self._space.places) if place.kind not in (GOING, HALTING)),
            lambda kind: kind == HALTING,
        )
        restless = tuple(
            RuleFinding(self._restless_diagnostic(leaf)) for leaf in self._space.model.watch.leaves if leaf.never_rests
        )
        if restless:
            return RuleVerdict(rule, REFUTED, (*found.findings, *restless))
        if found.outcome == REFUTED or stuck is None:
            return found
        fault = Diagnostic(self._plan.source, self._plan.tree.mark, "after a halt, it never comes to rest")
        return RuleVerdict(rule, REFUTED, (RuleFinding(fault, trace_to(self._space, stuck)),))

    def _restless_diagnostic(self, leaf: StandIn) -> Diagnostic:
        step = self._steps[leaf.key]
        message = f"after a halt, '{step.kind}' never comes to rest: its 'halting' always returns true"
        return Diagnostic(
            step.source, step.mark, message, f"its actuators are stopped for it after {leaf.halt_limit:g} s"
        )

    # --- the mission's own properties ---------------------------------------------------------------------------------

    def _check_property(self, place: int, monitor: PropertyMonitor) -> RuleVerdict:
        promise = monitor.promise
        if promise.form == "can":
            return self._check_can_end(monitor)
        if promise.form == "stopped":
            return self._check_eventually(
                monitor, [monitor.is_stopped(each.live_leaves) for each in self._space.places]
            )
        if promise.form == "eventually":
            return self._check_eventually(monitor, [each.happened[place] for each in self._space.places])
        return self._check_safety(monitor.rule, monitor.rule, promise.mark)

    def _check_can_end(self, monitor: PropertyMonitor) -> RuleVerdict:
        end = {"succeed": "success", "fail": "failure"}[monitor.promise.subject]
        if end in self._space.facts:
            return RuleVerdict(monitor.rule, PROVED)
        if not self._space.is_complete or end in self._space.doubtful:
            return RuleVerdict(monitor.rule, UNDECIDED)
        fault = Diagnostic(self._plan.source, monitor.promise.mark, f"no run ends with {end}")
        return RuleVerdict(monitor.rule, REFUTED, (RuleFinding(fault),))

    def _check_eventually(self, monitor: PropertyMonitor, good: list[bool]) -> RuleVerdict:
        places = self._space.places  # an end by a halt from outside does not count
        goals = (n for n, is_good in enumerate(good) if is_good and places[n].kind not in (HALTING, RESTED))
        lost, unproved = self._first_state_without(goals, lambda kind: kind == GOING or kind in ENDS)
        if lost is None:
            return RuleVerdict(monitor.rule, unproved)
        what = (
            f"{monitor.promise.subject} does not run" if monitor.promise.form == "eventually" else "it goes on moving"
        )
        fault = Diagnostic(self._plan.source, monitor.promise.mark, f"{monitor.rule}: from here on {what}")
        return RuleVerdict(monitor.rule, REFUTED, (RuleFinding(fault, trace_to(self._space, lost)),))

    def _check_safety(self, key: str, rule: str, mark: Mark | None = None) -> RuleVerdict:
        """Return the verdict on a safety rule, which a single step can break."""
        found = self._space.violations.get(key)
        if found is None:
            outcome = UNDECIDED if key in self._space.doubtful else self._unproved
            return RuleVerdict(rule, outcome, so_far=self._shallow)
        step = self._steps[found.violation.node.key]
        place: tuple[SourceText, Mark] = (step.source, step.mark) if mark is None else (self._plan.source, mark)
        fault = Diagnostic(*place, found.violation.message)
        return RuleVerdict(rule, REFUTED, (RuleFinding(fault, trace_to_violation(self._space, found)),))

    # --- where a run is lost ------------------------------------------------------------------------------------------

    def _first_state_without(self, goals: Iterable[int], matters: Callable[[str], bool]) -> tuple[int | None, str]:
        """Return the number of the state nearest to the start from which no goal is reachable, None if there is none.

        Only states are considered for whose kind ``matters`` is true. Unexplored states count as goals, since they
        might lead to one. If there is none, also return the outcome of the rule that all states lead to a goal.
        """
        if self._space.model.shuffler.is_sampled:
            return None, UNDECIDED  # an unexplored order could lead there
        can = self._space.can_reach((*goals, *self._space.open))
        places = enumerate(self._space.places)
        lost = [number for number, place in places if matters(place.kind) and number not in can][:MAX_CANDIDATES]
        first = next(filter(self._space.is_possible, lost), None)
        return first, UNDECIDED if lost else self._unproved

    def _bottom_component(self, place: int) -> int:
        """Return a state reachable from ``place`` to which every run that leaves it can always return."""
        while True:
            back = self._space.can_reach((place,))
            onward = [n for n in self._space.reachable_from(place) if self._space.places[n].kind == GOING]
            left = [number for number in onward if number not in back]
            if not left:
                return max(onward)
            place = min(left)

    def _node_without_end(self, place: int) -> Node:
        """Return the innermost running node that prevents the run's end: a leaf that never ends, or an endless loop."""
        state = self._space.places[place].state
        if state is not None:
            self._space.model.restore(state)
        running = [node for node in self._space.model.nodes if node.status is RUNNING] or [self._space.model.root]
        endless = [node for node in running if isinstance(node, StandIn) and not node.can_end]
        loops = [node for node in running if isinstance(node, RetryModifier | RepeatModifier) and node.setting is None]
        return max(endless or loops or running, key=lambda node: node.key.count("."))


def _place(step: Step, here: Step) -> str:
    """Return the place of ``step`` for an error at the step ``here``: its line, and its file if that is another."""
    return place_text(step.source.name, step.mark.line, here.source.name)


def _seconds(step: Step) -> float | None:
    """Return the waiting time of a step in seconds; None if unknown."""
    value = step.arguments.get("value") or step.arguments.get("duration")
    return value.constant if value is not None and isinstance(value.constant, float) else None


def _unwrap_modifiers(step: Step) -> Step:
    """Return the behaviour inside its modifiers, where a user looks for it."""
    while "value" in step.arguments and step.leaf is None and step.children:
        step = step.children[0]
    return step


# Verification of a checked mission.

MAX_STATES = 10_000
"""Default maximum of explored states; the shipped missions have a few hundred at most."""

TIME_LIMIT = 60.0
"""Default limit on the CPU time of an exploration, in seconds: the load of the computer does not decide a verdict."""


def verify(
    plan: Plan,
    clock: Clock,
    *,
    bound: int = MAX_STATES,
    limit: float = TIME_LIMIT,
    sensor_timeout: float = SENSOR_TIMEOUT,
) -> VerificationReport:
    """Explore a mission and return the report.

    The exploration is limited to ``bound`` states and ``limit`` seconds by ``clock``, a clock of CPU time. The robot
    waits for its sensors for ``sensor_timeout`` seconds.
    """
    began = clock.now()
    space = StateSpace(MissionModel(plan, sensor_timeout), bound, lambda: clock.now() - began >= limit)
    space.explore()
    verdicts = tuple(RuleChecker(space, plan).verdicts())
    seconds = clock.now() - began
    figures = len(space.places), space.transitions, space.depth
    return VerificationReport(
        plan.source.name, plan.mission, verdicts, *figures, seconds, _describe_omissions(space, limit)
    )


def _describe_omissions(space: StateSpace, limit: float) -> str:
    """Return a text on the unexplored part, and the option that helps."""
    if space.open:
        more = (
            f"--limit '{quantity_text(10 * limit, 'duration')}'" if space.out_of_time else f"--bound {10 * space.bound}"
        )
        when = f"after {quantity_text(limit, 'duration')} of CPU time " if space.out_of_time else ""
        return f"{when}{len(space.open)} of {len(space.places)} states were not fully explored; try {more}"
    if not space.is_complete:
        return "not every order of a random composite with many children was tried"
    if space.doubtful.keys() <= space.facts:
        return ""
    return "too many combinations of times; some were merged, and led only to runs whose times are impossible"
