"""The judge: what an exploration proves and refutes, rule by rule, and where a run is lost for good."""

from collections.abc import Callable, Iterable
from math import inf

from behaviours.leaf import RUNNING
from behaviours.node import Node
from behaviours.run import SENSOR_TIMEOUT
from config.faults import Diagnostic, Mark, Source
from config.units import written
from drivers.clock import Clock
from missions.executive.modifiers import Repeat, Retry
from missions.language.nodes import NODES
from missions.language.plan import Plan, Step
from missions.plugins.verify.explore import (
    GOING,
    HALTING,
    PROVED,
    REFUTED,
    RESTED,
    UNDECIDED,
    Finding,
    Report,
    Space,
    Verdict,
    run_that_found,
    run_to,
)
from missions.plugins.verify.mocks import StandIn
from missions.plugins.verify.model import Model
from missions.plugins.verify.watch import ALONE, CLEAN, SET, Following

ENDS = ("success", "failure")


class Judge:
    """Reads verdicts from an exploration that is done."""

    def __init__(self, space: Space, plan: Plan) -> None:
        self._space = space
        self._plan = plan
        self._steps = dict(_keyed(plan.tree, "1"))
        self._unproved = PROVED if space.whole else UNDECIDED
        ticks = "1 tick" if space.followed == 1 else f"{space.followed} ticks"
        self._shallow = f"true of all runs of up to {ticks}" if space.open and space.followed else ""

    def verdicts(self) -> list[Verdict]:
        """Return all verdicts: the rules for every mission first, then its own properties."""
        nodes = len(self._space.model.nodes)
        return [
            self._ends(),
            self._reached("its node can be reached" if nodes == 1 else f"each of its {nodes} nodes can be reached"),
            *self._times(),
            self._unbroken(ALONE, "no two behaviours drive one actuator at the same time"),
            self._clean(),
            *([self._unbroken(SET, "every variable is set when it is read")] if self._space.model.watch.reads else []),
            *(self._property(place, each) for place, each in enumerate(self._space.model.monitors)),
        ]

    # --- the rules ----------------------------------------------------------------------------------------------------

    def _ends(self) -> Verdict:
        places = self._space.places
        ends = [number for number, place in enumerate(places) if place.kind in ENDS]
        rounds = [number for number, place in enumerate(places) if place.round]
        rule = "it can end from every state"
        if rounds:
            rule = f"{rule}, or goes on with its 'repeat: forever'" if ends else "it runs until it is stopped"
        trap = self._first_without((*ends, *rounds), lambda kind: kind == GOING)
        if trap is None:
            known = self._space.can_reach((*ends, *rounds))
            so_far = f"true of {len(known)} of {len(places)} states" if self._space.open else ""
            return Verdict(rule, self._unproved, so_far=so_far)
        holder = self._holder(self._bottom(trap))
        step = self._steps[holder.key]
        message = f"no end can be reached {'at all' if trap == 0 else 'any more'}: '{step.kind}' goes on for ever"
        fault = Diagnostic(step.source, step.mark, message)
        return Verdict(rule, REFUTED, (Finding(fault, run_to(self._space, trap)),))

    def _reached(self, rule: str) -> Verdict:
        reached = self._space.model.watch.reached
        missed = [
            node
            for node in self._space.model.nodes
            if node not in reached and (node.parent is None or node.parent in reached)
        ]
        if not missed or not self._space.whole:
            return self._met(rule, len(self._space.model.nodes), len(missed))
        return Verdict(rule, REFUTED, tuple(Finding(self._never_reached(node)) for node in missed))

    def _met(self, rule: str, count: int, missed: int) -> Verdict:
        """Return the verdict on a rule that asks each of ``count`` nodes for something that some run shows."""
        return Verdict(rule, UNDECIDED, so_far=f"true of {count - missed} so far") if missed else Verdict(rule, PROVED)

    def _never_reached(self, node: Node) -> Diagnostic:
        step = _innermost(self._steps[node.key])
        parent = self._steps[node.key.rpartition(".")[0] or node.key]
        return Diagnostic(
            step.source,
            step.mark,
            f"'{step.name}' is never reached",
            f"'{parent.kind}' (line {parent.mark.line}): {NODES[parent.kind].unreached or 'it never comes to it'}",
        )

    def _times(self) -> list[Verdict]:
        watch = self._space.model.watch
        if not watch.timed:
            return []
        one = next(iter(watch.timed))
        rule = f"its {len(watch.timed)} waits and timeouts" if len(watch.timed) > 1 else f"its '{one.kind}'"
        rule = f"{rule} can be over"
        missed = [node for node in watch.timed if node in watch.reached and node not in watch.over]
        if not missed or not self._space.whole:
            return [self._met(rule, len(watch.timed), len(missed))]
        return [Verdict(rule, REFUTED, tuple(Finding(self._never_over(node)) for node in missed))]

    def _never_over(self, node: Node) -> Diagnostic:
        step = self._steps[node.key]
        own = _seconds(step)
        around = [self._steps[node.key[:end]] for end, sign in enumerate(node.key) if sign == "."][::-1]
        limits = [each for each in around if each.kind == "timeout"]
        sooner = [each for each in limits if own is not None and (_seconds(each) or inf) <= own]
        if sooner:
            why = f"the 'timeout' of {sooner[0].text} around it (line {sooner[0].mark.line}) is over first"
        elif step.kind == "timeout":
            why = f"'{_innermost(step).name}' has always ended before"
        else:
            why = f"the 'timeout' around it (line {limits[0].mark.line}) leaves it no time" if limits else "see above"
        return Diagnostic(step.source, step.mark, f"'{step.kind}' of {step.text} is never over", why)

    def _clean(self) -> Verdict:
        rule = "after every halt and every end all is at rest"
        found = self._unbroken(CLEAN, rule)
        stuck = self._first_without(
            (number for number, place in enumerate(self._space.places) if place.kind not in (GOING, HALTING)),
            lambda kind: kind == HALTING,
        )
        restless = tuple(
            Finding(self._never_rests(leaf)) for leaf in self._space.model.watch.leaves if leaf.never_rests
        )
        if restless:
            return Verdict(rule, REFUTED, (*found.findings, *restless))
        if found.outcome == REFUTED or stuck is None:
            return found
        fault = Diagnostic(self._plan.source, self._plan.tree.mark, "told to stop, it never comes to rest")
        return Verdict(rule, REFUTED, (Finding(fault, run_to(self._space, stuck)),))

    def _never_rests(self, leaf: StandIn) -> Diagnostic:
        step = self._steps[leaf.key]
        message = f"told to stop, '{step.kind}' never comes to rest: its 'halting' always says that it still stops"
        return Diagnostic(
            step.source, step.mark, message, f"its actuators are stopped for it after {leaf.halt_limit:g} s"
        )

    # --- the mission's own properties ---------------------------------------------------------------------------------

    def _property(self, place: int, monitor: Following) -> Verdict:
        promise = monitor.promise
        if promise.form == "can":
            return self._can(monitor)
        if promise.form == "stopped":
            return self._always_reaches(monitor, [monitor.stopped(each.live) for each in self._space.places])
        if promise.form == "eventually":
            return self._always_reaches(monitor, [each.happened[place] for each in self._space.places])
        return self._unbroken(monitor.rule, monitor.rule, promise.mark)

    def _can(self, monitor: Following) -> Verdict:
        end = {"succeed": "success", "fail": "failure"}[monitor.promise.subject]
        if any(place.kind == end for place in self._space.places):
            return Verdict(monitor.rule, PROVED)
        if not self._space.whole:
            return Verdict(monitor.rule, UNDECIDED)
        fault = Diagnostic(self._plan.source, monitor.promise.mark, f"no run ends with {end}")
        return Verdict(monitor.rule, REFUTED, (Finding(fault),))

    def _always_reaches(self, monitor: Following, good: list[bool]) -> Verdict:
        places = self._space.places  # a halt from outside is no way for a mission to keep its promise
        goals = (n for n, is_good in enumerate(good) if is_good and places[n].kind not in (HALTING, RESTED))
        lost = self._first_without(goals, lambda kind: kind == GOING or kind in ENDS)
        if lost is None:
            return Verdict(monitor.rule, self._unproved)
        what = (
            f"{monitor.promise.subject} does not run" if monitor.promise.form == "eventually" else "it goes on moving"
        )
        fault = Diagnostic(self._plan.source, monitor.promise.mark, f"{monitor.rule}: from here on {what}")
        return Verdict(monitor.rule, REFUTED, (Finding(fault, run_to(self._space, lost)),))

    def _unbroken(self, key: str, rule: str, mark: Mark | None = None) -> Verdict:
        """Return the verdict on a rule that a single step can break."""
        found = self._space.found.get(key)
        if found is None:
            return Verdict(rule, self._unproved, so_far=self._shallow)
        step = self._steps[found.breach.node.key]
        place: tuple[Source, Mark] = (step.source, step.mark) if mark is None else (self._plan.source, mark)
        fault = Diagnostic(*place, found.breach.what)
        return Verdict(rule, REFUTED, (Finding(fault, run_that_found(self._space, found)),))

    # --- where a run is lost ------------------------------------------------------------------------------------------

    def _first_without(self, goals: Iterable[int], matters: Callable[[str], bool]) -> int | None:
        """Return the place nearest to the start from which none of ``goals`` can be reached, whatever was left out."""
        if self._space.model.shuffler.sampled:
            return None  # an order that was not tried could lead there
        can = self._space.can_reach((*goals, *self._space.open))
        places = enumerate(self._space.places)
        return next((number for number, place in places if matters(place.kind) and number not in can), None)

    def _bottom(self, place: int) -> int:
        """Return a place, reachable from this one, to which every run from it comes back again and again."""
        while True:
            back = self._space.can_reach((place,))
            onward = [n for n in self._space.reachable_from(place) if self._space.places[n].kind == GOING]
            left = [number for number in onward if number not in back]
            if not left:
                return max(onward)
            place = min(left)

    def _holder(self, place: int) -> Node:
        """Return the node that keeps a run going: a leaf that has no end, else the innermost endless loop that runs."""
        state = self._space.places[place].state
        if state is not None:
            self._space.model.put(state)
        running = [node for node in self._space.model.nodes if node.status is RUNNING] or [self._space.model.root]
        endless = [node for node in running if isinstance(node, StandIn) and not node.can_end]
        loops = [node for node in running if isinstance(node, Retry | Repeat) and node.setting is None]
        return max(endless or loops or running, key=lambda node: node.key.count("."))


def _seconds(step: Step) -> float | None:
    """Return the time that a step waits for, where that is known."""
    value = step.arguments.get("value") or step.arguments.get("duration")
    return value.constant if value is not None and isinstance(value.constant, float) else None


def _keyed(step: Step, key: str) -> Iterable[tuple[str, Step]]:
    """Return the steps by the keys of their nodes."""
    yield key, step
    for place, child in enumerate(step.children, start=1):
        yield from _keyed(child, f"{key}.{place}")


def _innermost(step: Step) -> Step:
    """Return the behaviour itself inside its modifiers: where a person looks for it."""
    while "value" in step.arguments and step.leaf is None and len(step.children) == 1:
        step = step.children[0]
    return step


# From a checked mission to a report on it.

BOUND = 10_000
"""States after which an exploration gives up; the shipped missions have a few hundred at most."""

LIMIT = 60.0
"""Seconds after which it gives up."""


def verify(
    plan: Plan,
    clock: Clock,
    *,
    bound: int = BOUND,
    limit: float = LIMIT,
    sensor_timeout: float = SENSOR_TIMEOUT,
) -> Report:
    """Explore a mission and return what that proves and refutes.

    It goes on to ``bound`` states and for ``limit`` seconds at most, by ``clock``. The robot waits for its sensors for
    ``sensor_timeout`` seconds.
    """
    began = clock.now()
    space = Space(Model(plan, sensor_timeout), bound, lambda: clock.now() - began >= limit)
    space.explore()
    verdicts = tuple(Judge(space, plan).verdicts())
    seconds = clock.now() - began
    figures = len(space.places), space.transitions, space.depth
    return Report(plan.source.name, plan.mission, verdicts, *figures, seconds, _left_out(space, limit))


def _left_out(space: Space, limit: float) -> str:
    """Say what was not explored, and what to do about it."""
    if space.open:
        more = f"--limit '{written(10 * limit, 'duration')}'" if space.out_of_time else f"--bound {10 * space.bound}"
        when = f"after {written(limit, 'duration')} " if space.out_of_time else ""
        return f"{when}{len(space.open)} of {len(space.places)} states were not followed to the end; try {more}"
    return "" if space.whole else "not every order of a random composite with many children was tried"
