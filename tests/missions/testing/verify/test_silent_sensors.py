"""Silent sensors: each short run of the executive, in which sensors go silent, is one that ``verify`` explores."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from py_trees.common import Status

from behaviours.basics import Check, Pretend, Set, Wait, WaitUntil
from behaviours.leaf import FAILURE, IDLE, RUNNING, SUCCESS, Leaf
from behaviours.node import Node
from behaviours.robot import Robot
from behaviours.run import RunState
from drivers.clock import ManualClock
from drivers.errors import SensorSilent
from missions.executive.build import build
from missions.language.plan import Plan, Step
from missions.plugins.verify.explore import PROVED, REFUTED, StateSpace
from missions.plugins.verify.model import MissionModel
from missions.plugins.verify.stand_ins import sensor_of
from tests.missions.testing.verify import test_against_brute_force as brute
from tests.missions.testing.verify.exploring import explored, outcome, outcomes, plan_of

TICKS = 3
BOUND = 1_500
RUNS = 800
"""Runs of one tree that are enumerated at most."""

SECONDS = (0.1, 1.2, 6.0)
"""Times that may pass before a tick; the last is longer than the sensor timeout."""

Picture = tuple[Status, ...]
"""Statuses of all nodes after a tick."""


class Decisions:
    """The answers of the world in one run, as digits that count up: times, reports of sensors, values and leaves."""

    def __init__(self) -> None:
        self._digits: list[tuple[int, int]] = []
        self._place = 0
        self._known: dict[object, Any] = {}

    def decide(self, options: Sequence[Any]) -> Any:
        if self._place == len(self._digits):
            self._digits.append((0, len(options)))
        self._place += 1
        return options[self._digits[self._place - 1][0]]

    def once(self, question: object, options: Sequence[Any]) -> Any:
        """Return the answer to a question, which is the same for the rest of the tick."""
        if question not in self._known:
            self._known[question] = self.decide(options)
        return self._known[question]

    def begin_tick(self) -> float:
        self._known = {}
        seconds: float = self.decide(SECONDS)
        return seconds

    def rewind(self) -> bool:
        """Go on to the next number; False after the last."""
        del self._digits[self._place :]
        self._place, self._known = 0, {}
        while self._digits and self._digits[-1][0] + 1 == self._digits[-1][1]:
            self._digits.pop()
        if self._digits:
            digit, count = self._digits.pop()
            self._digits.append((digit + 1, count))
        return bool(self._digits)


class Part:
    """Part of the robot's state: one value for each name in a tick; ``sensor`` may be silent for the whole tick."""

    def __init__(self, world: Decisions, sensor: str, values: Mapping[str, Sequence[object]]) -> None:
        self._world, self._sensor, self._values = world, sensor, values

    def __getattr__(self, name: str) -> object:
        if not self._world.once(self._sensor, (True, False)):
            raise SensorSilent(f"the {self._sensor} does not report")
        return self._world.once((self._sensor, name), self._values[name])


def parts(world: Decisions) -> Mapping[str, Part]:
    return {
        "base": Part(world, "base", {"bumper": (False, True)}),
        "battery": Part(world, "base", {"percent": (10, 90)}),
        "face": Part(world, "camera", {"seen": (True, False), "count": (0, 2)}),
        "range": Part(world, "range finder", {"ahead": (0.1, 9.0)}),
    }


REPORTS = {"bumped": "base", "battery_below": "base", "obstacle_within": "range finder"}
"""Reports that conditions read, and expressions too; others have a report of their own."""


def acting(step: Step, world: Decisions) -> Step:
    """Return the step with leaves whose results are answers of ``world``."""
    real = step.leaf
    if real in (Check, WaitUntil, Wait, Set, Pretend):
        return step

    class Actor(Leaf):
        drives = frozenset() if real is None else real.drives
        instant = real is not None and real.instant

        def update(self) -> Status:
            if not self.instant:
                return self._any_of(SUCCESS, FAILURE, RUNNING)
            report = REPORTS.get(step.kind, f"{step.kind} {step.text}")
            if not world.once(report, (True, False)):
                return self.suspend(report)
            return self._any_of(SUCCESS, FAILURE)

        def _any_of(self, *statuses: Status) -> Status:
            found: Status = world.decide(statuses)
            return found

    children = tuple(acting(child, world) for child in step.children)
    return replace(step, children=children) if real is None else replace(step, leaf=Actor, arguments={})


def nodes_of(root: Node) -> list[Node]:
    return [root, *(below for child in root.children if isinstance(child, Node) for below in nodes_of(child))]


def picture_of(nodes: Sequence[Node]) -> Picture:
    """Return the statuses of nodes; those below a node that does not run, or has not started, have no effect."""
    running = {node for node in nodes if node.status is RUNNING and not getattr(node, "unstarted", False)}
    return tuple(node.status if node.parent is None or node.parent in running else IDLE for node in nodes)


def real_runs(plan: Plan) -> Iterator[tuple[Picture, ...]]:
    """Yield the pictures of every run of TICKS ticks at most, as the executive's nodes are ticked."""
    world = Decisions()
    tree, more = acting(plan.tree, world), True
    while more:
        clock = ManualClock()
        run = RunState(clock)
        run.variables.update(parts(world))
        root = build(replace(plan, tree=tree), run, lambda _: Robot())
        nodes = nodes_of(root)
        pictures: list[Picture] = []
        while len(pictures) < TICKS and (not pictures or root.status is RUNNING):
            run.last_tick_at = clock.now() if pictures else None
            clock.advance(world.begin_tick())
            run.tick += 1
            root.execute_tick()
            pictures.append(picture_of(nodes))
        yield tuple(pictures)
        more = world.rewind()


def explored_runs(plan: Plan) -> set[tuple[Picture, ...]] | None:
    """Return the pictures of all runs of TICKS ticks at most that are explored; None if there are too many states."""
    space = StateSpace(MissionModel(plan), BOUND)
    space.explore()
    if not space.is_complete:
        return None
    nodes = space.model.nodes
    pictures: dict[int, Picture] = {}
    for number, place in enumerate(space.places):
        if place.state is None:  # an end: only the root has a status that counts
            pictures[number] = ({"success": SUCCESS, "failure": FAILURE}.get(place.kind, IDLE),)
        elif place.kind == "going":
            space.model.restore(place.state)
            pictures[number] = picture_of(nodes)
    found: set[tuple[Picture, ...]] = set()
    ways: dict[tuple[Picture, ...], set[int]] = {(): {0}}
    for _ in range(TICKS):
        longer: dict[tuple[Picture, ...], set[int]] = {}
        for way, numbers in ways.items():
            for after in itertools.chain.from_iterable(space.places[number].successors for number in numbers):
                if space.places[after].kind in ("going", "success", "failure"):
                    longer.setdefault((*way, pictures[after]), set()).add(after)
        found |= longer.keys()
        ways = longer
    return found


def shortened(run: tuple[Picture, ...]) -> tuple[Picture, ...]:
    """Return a run with the status of the root alone at its end."""
    return run if run[-1][0] is RUNNING else (*run[:-1], run[-1][:1])


LEAF = st.sampled_from(
    (
        "look: 0 deg",
        "drive: 1 m",
        "bumped",
        "battery_below: 20 %",
        "obstacle_within: 1 m",
        "topic: /a",
        "topic: /b",
        "face_seen: 1 s",
        "face_seen: 2 s",
        "check: base.bumper",
        "check: battery.percent < 30",
        "check: face.seen or range.ahead < 1 m",
        "check: battery.percent > 20 and face.count > 1",
        "wait_until: base.bumper and face.seen",
        "wait: 1 s",
    )
)
MODIFIERS = (
    *brute.MODIFIERS,
    *brute.TIMES,
    "if: base.bumper",
    "while: battery.percent > 20",
    "until: range.ahead < 1 m",
    "while: face.seen and base.bumper",
)


def more(children: st.SearchStrategy[str]) -> list[st.SearchStrategy[str]]:
    pairs = st.lists(children, min_size=2, max_size=2).map(lambda nodes: ", ".join(f"{{{node}}}" for node in nodes))
    reactive = st.sampled_from(("reactive_sequence", "reactive_selector", "parallel", "race"))
    switch = "reactive_switch: {{on: base.bumper, cases: {{true: {{{}}}, false: {{{}}}}}}}"
    return [
        *brute.waiting(children),
        st.builds("{}: [{}]".format, reactive, pairs),
        st.builds(switch.format, children, children),
    ]


def check_runs(tree: str) -> int:
    """Check that each run of the executive is explored; return how many there were."""
    try:
        plan = plan_of(f"{{{tree}}}")
    except ValueError:
        return 0
    known = explored_runs(plan)
    if known is None:
        return 0
    count = 0
    for run in itertools.islice(real_runs(plan), RUNS):
        assert shortened(run) in known, (tree, run)
        count += 1
    return count


@settings(max_examples=25)
@example("reactive_selector: [{topic: /a}, {sequence: [{topic: /b}, {drive: 1 m}]}]")
@example("reactive_sequence: [{face_seen: 1 s}, {face_seen: 2 s}, {drive: 1 m}]")
@example("parallel: [{check: face.seen or range.ahead < 1 m}, {obstacle_within: 1 m}]")
@example("reactive_sequence: [{face_seen: 1 s, timeout: 1 s, on_failure: succeed}, {drive: 1 m}]")
@example("look: 0 deg, if: base.bumper")
@example("reactive_switch: {on: base.bumper, cases: {true: {look: 0 deg}, false: {drive: 1 m}}}")
@example("sequence: [{face_seen: 1 s, on_failure: succeed}, {drive: 1 m}], on_running: succeed")
@example("drive: 1 m, while: battery.percent > 20, hold: 2 s")
@example("wait_for: {reactive_sequence: [{bumped}, {drive: 1 m, timeout: 1 s}]}")
@given(brute.trees(MODIFIERS, LEAF, more))
def test_each_run_with_silent_sensors_is_explored(tree: str) -> None:
    check_runs(tree)


def test_a_setting_that_is_a_text_is_kept_while_a_sensor_is_silent() -> None:
    tree = "sequence: [{face_seen: 1 s, on_failure: succeed}, {pretend: running}]\non_running: succeed"
    assert outcome(tree, "can: fail") == REFUTED
    assert outcome(tree, "can: succeed") == PROVED


def test_a_sensor_behind_a_condition_that_is_false_is_not_read() -> None:
    tree = "sequence: [{set: {flag: false}}, {say: Hi, while: flag and face.seen}]"
    report = explored(tree, "can: succeed")
    assert "the camera does not report" not in str(report)
    assert outcome(tree, "can: succeed") == REFUTED
    assert outcome(tree.replace("false", "true"), "can: succeed") == PROVED


def test_a_variable_is_kept_while_a_node_waits_for_a_sensor_before_it_starts() -> None:
    tree = "sequence: [{set: {low: 20}}, {say: Hi, if: battery.percent < low}]"
    assert outcomes(explored(tree))["every variable is set when it is read"] == PROVED
    assert outcome(tree.replace("say: Hi", "succeed: {}"), "can: fail") == PROVED  # by the sensor timeout


def read_thermometer() -> float:
    raise SensorSilent("the thermometer does not report")


class Warm(Leaf):
    """Check the temperature, with a function that finds the sensor silent."""

    tag = "warm"
    ends = frozenset({"success"})

    def update(self) -> Status:
        return SUCCESS if self._temperature() > 20.0 else self.wait("cold")

    def _temperature(self) -> float:
        return read_thermometer()


class Cold(Leaf):
    """Check the temperature, without such a function."""

    tag = "cold"
    ends = frozenset({"success"})

    def update(self) -> Status:
        return SUCCESS


@pytest.mark.parametrize(("leaf", "can_be_silent"), [(Warm, True), (Cold, False)])
def test_a_leaf_from_elsewhere_can_be_suspended_if_its_code_says_so(leaf: type[Leaf], *, can_be_silent: bool) -> None:
    assert bool(sensor_of(leaf)) is can_be_silent
    assert outcome(leaf.tag, "can: fail", leaves=[leaf]) == (PROVED if can_be_silent else REFUTED)
