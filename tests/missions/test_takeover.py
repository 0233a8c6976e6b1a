"""Instant leaves at the start of a branch that takes over: the running child of the composite is halted before them."""

from collections.abc import Callable
from dataclasses import replace
from random import Random

import pytest
from py_trees.common import Status

from behaviours.catalogue import LEAVES
from behaviours.leaf import FAILURE, RUNNING, SUCCESS, Leaf
from behaviours.node import Node
from behaviours.robot import Robot
from behaviours.run import RunState
from config.diagnostics import SourceText
from drivers.clock import ManualClock
from missions.executive.build import build
from missions.language.document import check_plan
from missions.language.draws import repeated_draw_hints
from missions.language.outcomes import ends_at_once
from missions.language.plan import Plan, Step
from missions.language.takeover import TakeoverAnalysis, early_action_hints, find_takeovers
from missions.library.shipped import load_mission, shipped_missions
from tests.tries import tries

TREES = tries(300, most=3_000)
FIRST_SEED = 640_000
TICKS = 12


def plan_of(tree: str) -> Plan:
    return check_plan(SourceText("m.yaml", f"mission: m\ntree: {{{tree}}}\n"), LEAVES, {})


def scripted(step: Step, answer: Callable[[str], Status], log: list[str]) -> Step:
    """Return the step with leaves that return ``answer(name)`` and log each start and each halt."""
    if step.leaf is None:
        return replace(step, children=tuple(scripted(child, answer, log) for child in step.children))
    real, at_once = step.leaf, ends_at_once(step)

    class Scripted(Leaf):
        """Return the next answer."""

        drives, acts, instant, needs = real.drives, real.acts, real.instant, real.needs

        def initialise(self) -> None:
            log.append(self.name)

        def update(self) -> Status:
            if self.acts and not at_once and self.elapsed == 0.0:
                return RUNNING
            return SUCCESS if self.acts else answer(self.name)

        def terminate(self, new_status: Status) -> None:
            if new_status is Status.INVALID:
                log.append(f"{self.name} halted")

        def halting(self) -> bool:
            return answer(f"halt of {self.name}") is RUNNING

    return replace(step, leaf=Scripted, arguments={})


class Stage:
    """A mission with scripted leaves."""

    def __init__(self, tree: str, answer: Callable[[str], Status]) -> None:
        self.log: list[str] = []
        self.plan = plan_of(tree)
        self.run = RunState(ManualClock())
        scripted_tree = scripted(self.plan.tree, answer, self.log)
        self.root = build(replace(self.plan, tree=scripted_tree), self.run, lambda _: Robot())

    def tick(self) -> list[str]:
        """Tick once; return the new lines of the log."""
        self.log.clear()
        self.run.tick += 1
        self.run.clock.advance(0.1)  # type: ignore[attr-defined]
        self.root.execute_tick()
        return list(self.log)


def takeover_log(branch: str, *, composite: str = "reactive_selector", halts_slowly: bool = False) -> list[str]:
    """Return the log of the ticks in which a branch takes over from a running ``drive`` with a ``finally``."""
    answers = {"bumped": FAILURE if composite == "reactive_selector" else SUCCESS}
    still_halting = 1 if halts_slowly else 0

    def answer(name: str) -> Status:
        nonlocal still_halting
        if name.startswith("halt of"):
            still_halting -= 1
            return RUNNING if still_halting >= 0 else SUCCESS
        return answers.get(name, RUNNING)

    stage = Stage(f"{composite}: [{{{branch}}}, {{drive: 1 m, finally: {{log: over, name: cleanup}}}}]", answer)
    assert "drive" in stage.tick()
    answers["bumped"] = SUCCESS if composite == "reactive_selector" else FAILURE
    log = stage.tick()
    for _ in range(3):
        log += stage.tick() if stage.root.status is RUNNING else []
    return [line for line in log if line not in ("bumped", "cliff")]


HALT = ["drive halted", "cleanup"]


@pytest.mark.parametrize("word", ["log: a", "led: red", "notify: a", "set: {a: 1}", "publish: /a", "sound: 'on'"])
@pytest.mark.parametrize("halts_slowly", [False, True])
def test_acting_leaf_starts_after_the_cleanup_of_the_preempted_branch(word: str, halts_slowly: bool) -> None:
    log = takeover_log(f"sequence: [bumped, {{{word}}}, {{turn: 30 deg}}]", halts_slowly=halts_slowly)
    assert log == [*HALT, word.partition(":")[0], "turn"]


@pytest.mark.parametrize(
    ("branch", "log"),
    [
        ("sequence: [bumped, {log: a}]", [*HALT, "log"]),
        ("sequence: [bumped, {log: a, retry: 2}, {log: b, name: second}]", [*HALT, "log", "second"]),
        ("sequence: [bumped, {call_service: /a}]", [*HALT, "call_service"]),
        ("sequence: [bumped, {log: a}, {turn: 30 deg, if: 'base.x > 1 m'}, {log: b, name: second}]", None),
        ("sequence: [bumped, {parallel: [{log: a}, {turn: 30 deg}]}]", [*HALT, "log", "turn"]),
        ("sequence: [bumped, {selector: [{log: a}, {turn: 30 deg}]}]", [*HALT, "log"]),
        (
            "sequence: [bumped, {reactive_sequence: [{log: a}, {turn: 30 deg}]}]",
            [*HALT, "log", "turn", "log", "log", "log"],
        ),
        ("sequence: [bumped, {log: a}, cliff, {turn: 30 deg}]", ["log", *HALT]),
        ("sequence: [bumped, {log: a, on_success: fail}]", ["log", "log", "log", "log"]),
    ],
)
def test_acting_leaf_halts_first_unless_a_condition_follows(branch: str, log: list[str] | None) -> None:
    if log is None:  # `if` skips one step, and the branch goes on
        takeovers = find_takeovers(plan_of(f"reactive_selector: [{{{branch}}}, {{drive: 1 m}}]").tree)
        assert len(takeovers) == 2
        return
    assert takeover_log(branch) == log


def test_failing_guard_of_a_reactive_sequence_halts_before_it_acts() -> None:
    branch = "selector: [bumped, {sequence: [{log: a}, {fail: blocked}]}]"

    def run(name: str) -> list[str]:
        return takeover_log(branch.replace("fail: blocked", name), composite="reactive_sequence")

    assert run("turn: 30 deg") == [*HALT, "log", "turn"]
    assert run("fail: blocked")[:3] == [*HALT, "log"]


def test_branch_that_declines_after_it_acted_leaves_the_running_child_alone() -> None:
    answers = {"bumped": SUCCESS, "cliff": FAILURE}
    stage = Stage(
        "reactive_selector: [{sequence: [bumped, {set: {n: 1}}, cliff, {turn: 30 deg}]}, {drive: 1 m}]",
        lambda name: answers.get(name, RUNNING),
    )
    assert stage.tick() == ["bumped", "set", "cliff", "drive"]
    assert stage.tick() == ["bumped", "set", "cliff"]


# --- random trees -----------------------------------------------------------------------------------------------------

LEAF_WORDS = ["bumped", "cliff", "{log: a}", "{set: {n: 1}}", "{turn: 30 deg}", "{wait: 1 s}", "{call_service: /a}"]
COMPOSITES = ["sequence", "selector", "reactive_sequence", "reactive_selector", "parallel", "race", "random_selector"]
MODIFIERS = ["invert: true", "on_failure: succeed", "on_success: fail", "retry: 2", "repeat: 2", "once: true",
             "on_running: fail", "on_running: succeed", "hold: 1 s", "timeout: 1 s", "delay: 100 ms",
             "finally: {log: over}", "cooldown: 1 s"]  # fmt: skip


def random_node(random: Random, depth: int) -> str:
    if depth == 0 or random.random() < 0.25:
        node = random.choice(LEAF_WORDS)
    else:
        kind = random.choice(COMPOSITES)
        children = ", ".join(random_node(random, depth - 1) for _ in range(random.randint(2, 3)))
        node = f"{{{kind}: [{children}]}}"
    if random.random() < 0.25:
        inner = node if node.startswith("{") else f"{{{node}: }}"
        node = f"{inner[:-1]}, {random.choice(MODIFIERS)}}}"
    return node


def random_tree(random: Random) -> str:
    kind = random.choice(["reactive_selector", "reactive_sequence"])
    children = ", ".join(random_node(random, 3) for _ in range(random.randint(1, 2)))
    return f"{kind}: [{children}, {{drive: 1 m}}]"


def declined_after_takeover(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Tick a stage; return the leaves that took over from a child to which their composite then went on.

    Children from which a leaf that drives would have taken over in the same tick are left out.
    """
    found = []
    driven: set[Node] = set()
    preempted: list[tuple[Node, str]] = []

    def preempt(composites: frozenset[str] | None = None) -> bool:
        running = [node for node in stage.run.preemptible if node.status is RUNNING]
        leaf = stage.run.active_leaf
        done = RunState.preempt(stage.run, composites)
        if composites is None:
            driven.update(stage.run.preemptible)
        elif leaf is not None:
            preempted.extend((node, leaf.key) for node in running if node.key.rpartition(".")[0] in composites)
        return done

    monkeypatch.setattr(stage.run, "preempt", preempt)
    for _ in range(TICKS):
        preempted.clear()
        driven.clear()
        stage.tick()
        found += [key for node, key in preempted if node.visited_tick == stage.run.tick and node not in driven]
    return found


@pytest.mark.parametrize("seed", range(FIRST_SEED, FIRST_SEED + TREES))
def test_no_branch_declines_after_a_leaf_has_taken_over(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The leaves act without failures, as the analysis assumes."""
    random = Random(seed)  # noqa: S311 - the same trees each time

    def answer(name: str) -> Status:
        if name in ("bumped", "cliff"):
            return random.choice((SUCCESS, FAILURE))
        return random.choice((SUCCESS, RUNNING, RUNNING))

    while True:
        try:
            stage = Stage(random_tree(random), answer)
            break
        except ValueError:
            continue
    assert declined_after_takeover(stage, monkeypatch) == []


# --- the hint ---------------------------------------------------------------------------------------------------------


def hints(branch: str, composite: str = "reactive_selector") -> list[str]:
    return [str(hint) for hint in early_action_hints(plan_of(f"{composite}: [{{{branch}}}, {{drive: 1 m}}]").tree)]


@pytest.mark.parametrize(
    "branch",
    [
        "sequence: [bumped, {log: a}, {turn: 30 deg}]",
        "sequence: [bumped, {set: {n: 1}}, {check: n == 1}, {turn: 30 deg}]",
        "sequence: [{log: a}, {turn: 30 deg}, cliff]",
        "sequence: [bumped, {log: a}, {cliff: , on_failure: succeed}]",
        "sequence: [{cliff: , finally: {log: a}}, bumped]",
    ],
)
def test_no_hint_without_an_action_before_a_condition(branch: str) -> None:
    assert hints(branch) == []


@pytest.mark.parametrize(
    ("branch", "condition"),
    [
        ("sequence: [bumped, {log: a}, cliff, {turn: 30 deg}]", "cliff"),
        ("sequence: [{sequence: [bumped, {log: a}]}, {log: b, if: false}, {check: base.x > 1 m}]", "check"),
        ("sequence: [{log: a}, {turn: 30 deg, while: base.x > 1 m}]", "turn"),
    ],
)
def test_action_before_a_condition_of_a_reactive_selector_gets_a_hint(branch: str, condition: str) -> None:
    found = hints(branch)
    assert found
    assert "'log' may act at every tick while a later child of the reactive_selector runs" in found[0]
    assert f"'{condition}' (line 2) follows it" in found[0]
    assert f"write 'log' after '{condition}' (line 2)" in found[0]


def test_shipped_missions_get_no_hint_about_actions_or_draws() -> None:
    trees = {name: load_mission(name).tree for name in shipped_missions()}
    assert not [name for name, tree in trees.items() if early_action_hints(tree) or repeated_draw_hints(tree)]


@pytest.mark.parametrize("kind", ["sequence", "selector", "random_sequence", "parallel"])
def test_takeovers_of_a_wide_branch_are_found_in_linear_work(kind: str) -> None:
    """Each step has its results computed once, and each child of a composite is looked at a few times."""
    leaves = ", ".join(["{log: a}", "bumped"] * 400)
    tree = plan_of(f"reactive_selector: [{{{kind}: [{leaves}]}}, {{drive: 1 m}}]").tree
    looked = 0

    class CountingAnalysis(TakeoverAnalysis):
        def results(self, step: Step) -> frozenset[str]:
            nonlocal looked
            looked += 1
            return super().results(step)

    list(CountingAnalysis().acting_leaves(tree, "1"))
    assert looked < 20 * 800
