"""What became of nodes, told from a record, against what they did."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from typing import TypeVar

import pytest
from hypothesis import HealthCheck, given, reject, settings
from hypothesis import strategies as st
from py_trees.common import Status

from behaviours.catalogue import LEAVES
from behaviours.leaf import FAILURE, RUNNING, SUCCESS, Leaf, argument
from behaviours.node import Node
from behaviours.robot import Robot
from behaviours.run import RunState
from config.diagnostics import InvalidFileError, SourceText
from drivers.clock import ManualClock
from missions.executive.build import build
from missions.executive.events import Event, NodeChanged
from missions.executive.executive import Executive
from missions.executive.parent import Parent
from missions.executive.stream import EventStream
from missions.executive.tick_record import TickRecord
from missions.language.document import check_plan
from missions.language.plan import Plan
from missions.plugins.records.statistics.figures import NodeFigures
from missions.plugins.records.statistics.nodes import node_figures
from missions.request import RunRequest
from missions.runner import Runner
from missions.trees.drawing_builder import drawing_of
from tests.missions.records.replay.past import past_of

TICKS = 12
PERIOD = 0.05
OUTCOMES = {"r": RUNNING, "s": SUCCESS, "f": FAILURE}


class Scripted(Leaf):
    """Gives these outcomes in turn, for ever."""

    tag = "scripted"
    outcomes: str = argument("text", "what it gives", principal=True)
    _given = 0

    def update(self) -> Status:
        self._given += 1
        return OUTCOMES[self.outcomes[(self._given - 1) % len(self.outcomes)]]


N = TypeVar("N", bound=Node)


@pytest.fixture
def worked(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """How often each node was ticked, counted where it works."""
    counts: Counter[str] = Counter()

    def counting(work: Callable[[N], Status]) -> Callable[[N], Status]:
        def counted(node: N) -> Status:
            counts[node.key] += 1
            return work(node)

        return counted

    monkeypatch.setattr(Leaf, "on_tick", counting(Leaf.on_tick))
    monkeypatch.setattr(Parent, "on_tick", counting(Parent.on_tick))
    return counts


def play(plan: Plan, ticks: int) -> Mapping[str, NodeFigures]:
    """Tick a mission, and return what became of its nodes by what it has told."""
    clock, events, moments = ManualClock(), list[Event](), list[TickRecord]()
    run = RunState(clock)
    root = build(plan, run, lambda _: Robot())
    executive = Executive(root, run, EventStream([events.append]), rate=1 / PERIOD)
    executive.observe(moments.append)
    for _ in range(ticks):
        if executive.tick() is not RUNNING:
            break
        clock.advance(PERIOD)
    else:
        executive.halt()
    changes = [event for event in events if isinstance(event, NodeChanged)]
    found = node_figures(drawing_of(plan), changes, moments, start=0.0, until=clock.now())
    return {place.key: node for place, node in found.items()}


def plan_of(tree: str) -> Plan:
    return check_plan(SourceText("some.yaml", f"mission: some\ntree:\n{tree}\n"), {**LEAVES, "scripted": Scripted}, {})


def ticks_of(found: Mapping[str, NodeFigures]) -> dict[str, int]:
    return {key: node.ticks for key, node in found.items() if node.ticks}


# --- against the nodes themselves


MODIFIERS = [
    *("invert: true", "on_failure: succeed", "on_success: fail", "hold: 0.1 s", "once: true"),
    *("retry: 2", "repeat: 2", "timeout: 0.22 s", "delay: 0.1 s", "on_running: succeed", "on_running: fail"),
    *("if: false", "for: 0.22 s"),
]
COMPOSITES = ["sequence", "selector", "parallel", "race", "reactive_sequence", "reactive_selector", "random_sequence"]
COUNTS = [["success_count: 1"], ["wait_for_all: true"], ["success_count: 1", "failure_count: all"]]


def trees() -> st.SearchStrategy[list[str]]:
    """Return trees as lines of YAML."""
    scripts = st.text(alphabet="rsf", min_size=1, max_size=4)

    def composite(kind: str, children: list[list[str]]) -> list[str]:
        return [f"{kind}:", *(line for child in children for line in _item(child))]

    def counted(children: list[list[str]], counts: list[str]) -> list[str]:
        return [*composite("parallel", children), *counts]

    def looped(child: list[str]) -> list[str]:
        return ["for_each:", "  in: [1, 2]", "  as: m", "  do:", *(f"    {line}" for line in child)]

    def awaited(child: list[str]) -> list[str]:
        return ["wait_for:", *(f"  {line}" for line in child)]

    def recovered(node: list[str], child: list[str]) -> list[str]:
        return [*modified(node, "retry: 3"), "recover:", *(f"  {line}" for line in child)]

    def cleaned(node: list[str], outcome: str) -> list[str]:
        return modified(node, f"finally: {{scripted: {outcome}}}")

    def modified(node: list[str], modifier: str) -> list[str]:
        name = modifier.partition(":")[0]
        return node if any(line.startswith(f"{name}:") for line in node) else [*node, modifier]

    return st.recursive(
        st.builds(lambda script: [f"scripted: {script}"], scripts),
        lambda inner: (
            st.builds(composite, st.sampled_from(COMPOSITES), st.lists(inner, min_size=1, max_size=3))
            | st.builds(counted, st.lists(inner, min_size=2, max_size=3), st.sampled_from(COUNTS))
            | st.builds(looped, inner)
            | st.builds(awaited, inner)
            | st.builds(
                recovered, inner.filter(lambda node: not any(line.startswith("retry:") for line in node)), inner
            )
            | st.builds(cleaned, inner, st.sampled_from("sf"))
            | st.builds(modified, inner, st.sampled_from(MODIFIERS))
        ),
        max_leaves=8,
    )


def _item(node: list[str]) -> Iterator[str]:
    first, *rest = node
    yield f"  - {first}"
    yield from (f"    {line}" for line in rest)


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(tree=trees())
def test_node_tick_counts_match_the_ticks_of_any_tree(tree: list[str], worked: Counter[str]) -> None:
    worked.clear()
    try:
        plan = plan_of("\n".join(f"  {line}" for line in tree))
    except InvalidFileError:  # such as a child that is never reached
        reject()
    found = play(plan, TICKS)
    assert ticks_of(found) == dict(worked)


@pytest.mark.parametrize("mission", ["wander", "follow_me"])
def test_node_tick_counts_match_interrupted_shipped_missions(mission: str, worked: Counter[str]) -> None:
    def stop(runner: Runner, moment: TickRecord) -> None:
        if moment.t > 8.0:
            runner.executive.stop("enough")

    past = past_of(RunRequest(mission, simulate="fast", eyes="truth"), act=stop)
    changes = [event for event in past.events if isinstance(event, NodeChanged)]
    found = node_figures(past.drawing(), changes, past.tick_records, start=0.0, until=past.tick_records[-1].t)
    assert ticks_of({place.key: node for place, node in found.items()}) == dict(worked)


# --- by example


def lasted(node: NodeFigures) -> list[float]:
    return [round(seconds, 3) for seconds in node.durations]


def test_node_figures_have_ticks_results_and_run_times() -> None:
    found = play(plan_of("  scripted: rrs\n  repeat: 3"), TICKS)
    assert (found["1.1"].ticks, found["1.1"].runs, found["1.1"].success) == (9, 3, 3)
    assert lasted(found["1.1"]) == [0.1, 0.1, 0.1]
    assert (found["1"].ticks, found["1"].runs, lasted(found["1"])) == (9, 1, [0.4])


def test_guards_that_give_the_same_result_again_are_counted() -> None:
    found = play(plan_of("  reactive_sequence:\n    - scripted: s\n    - scripted: rrf"), TICKS)
    assert (found["1.1"].ticks, found["1.1"].success) == (3, 3)
    assert (found["1.2"].ticks, found["1.2"].failure) == (3, 1)


def test_halted_node_counts_the_tick_only_if_ticked_before_the_halt() -> None:
    found = play(plan_of("  race:\n    - scripted: r\n    - scripted: rs\n    - scripted: r"), TICKS)
    assert [(found[key].ticks, found[key].halted) for key in ("1.1", "1.2", "1.3")] == [(2, 1), (2, 0), (1, 1)]


def test_running_node_counts_to_the_end_of_the_record() -> None:
    change = NodeChanged(1.0, 1, "1", "scripted", "scripted", 3, "running", "")
    moments = [TickRecord("tick", tick, tick / 1.0, 0.0, 0.0, []) for tick in (1, 2, 3)]
    (node,) = node_figures(drawing_of(plan_of("  scripted: r")), [change], moments, start=0.0, until=3.5).values()
    assert (node.ticks, node.runs, node.unended, lasted(node)) == (3, 1, 1, [2.5])


def test_figures_of_a_cut_record_count_from_its_start() -> None:
    change = NodeChanged(1.0, 20, "1", "scripted", "scripted", 3, "running", "")
    moments = [TickRecord("tick", tick, tick / 20, 0.0, 0.0, []) for tick in (100, 101)]
    (node,) = node_figures(drawing_of(plan_of("  scripted: r")), [change], moments, start=5.0, until=5.05).values()
    assert (node.ticks, lasted(node)) == (2, [0.05])
