"""The explorer against an enumeration that shares nothing with it but the nodes: all short runs, from their start."""

import itertools
from collections.abc import Callable, Iterator
from dataclasses import replace

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from py_trees.common import Status

from behaviours.leaf import FAILURE, RUNNING, SUCCESS
from behaviours.robot import Robot
from behaviours.run import RunState
from drivers.clock import ManualClock
from missions.executive.build import build
from missions.language.plan import Plan
from missions.plugins.verify.explore import GOING, HALTING, RESTED, StateSpace
from missions.plugins.verify.model import MissionModel
from missions.plugins.verify.verdicts import MAX_STATES
from tests.missions.testing.verify.exploring import plan_of
from tests.missions.testing.verify.taped_runs import Tape, taped, taped_runs

TICKS = 3
RUNS = 6_000
"""Runs of one tree that are enumerated at most; a tree with more is passed over."""


def enumerated(plan: Plan, seconds: tuple[float, ...]) -> Iterator[tuple[int, Status]]:
    """Yield after how many ticks each run ended, and how. ``seconds`` pass before the ticks."""
    return ((run.tick, status) for run, status in taped_runs(plan, seconds))


LEAF = st.sampled_from(("look: 0 deg", "scene_uniform: 1 s"))
CONDITION = "face.seen"
CONDITION_LEAF = st.sampled_from(("look: 0 deg", f"check: {CONDITION}", f"wait_until: {CONDITION}"))
CONDITIONS = (f"if: {CONDITION}", f"while: {CONDITION}", f"until: {CONDITION}")
MODIFIERS = (
    "invert: true",
    "on_failure: succeed",
    "on_success: fail",
    "once: true",
    "retry: 2",
    "repeat: 2",
    "retry: forever",
    "on_running: succeed",
    "on_running: fail",
)
TIMES = ("timeout: 1 s", "for: 1 s", "delay: 1 s", "hold: 2 s", "cooldown: 2 s")
COMPOSITES = ("sequence", "selector", "reactive_sequence", "reactive_selector", "parallel", "race")
COUNTS = ("success_count: 1", "success_count: 1, failure_count: all", "wait_for_all: true")


def waiting(children: st.SearchStrategy[str]) -> list[st.SearchStrategy[str]]:
    return [st.builds("wait_for: {{{}}}".format, children)]


def listing(children: st.SearchStrategy[str]) -> list[st.SearchStrategy[str]]:
    """Loops over mappings, and lists that grow to three members: longer ones are not kept exactly."""
    members = "[{{a: 1, b: true}}, {{a: 2, b: false}}]"
    loop = f"for_each: {{{{in: {members}, as: p, do: {{{{sequence: [{{{{check: p.{{}}}}}}, {{{{{{}}}}}}]}}}}}}}}"
    longer = "${{found + [1] if len(found) < 3 else found}}"
    grow = f"sequence: [{{{{set: {{{{found: '{longer}'}}}}}}}}, {{{{{{}}}}}}, {{{{check: len(found) {{}}}}}}]"
    return [
        st.builds(loop.format, st.sampled_from(("b", "a < 2", "a > 0")), children),
        st.builds(grow.format, children, st.sampled_from(("> 0", "> 1", "< 2", "== 3"))),
    ]


def cleaning(children: st.SearchStrategy[str]) -> list[st.SearchStrategy[str]]:
    """Nodes with ``recover`` and ``finally``."""
    cleanups = children.map(lambda node: node.replace("look: 0 deg", "listen: {for: [yes]}"))
    return [
        st.builds("{}, retry: 2, recover: {{{}}}".format, LEAF, children),
        st.builds("{}, finally: {{{}}}".format, LEAF, cleanups),
        st.builds("sequence: [{{{}}}, {{{}}}], finally: {{{}}}".format, children, LEAF, cleanups),
    ]


def preempting(children: st.SearchStrategy[str]) -> list[st.SearchStrategy[str]]:
    """Reactive composites whose first child acts before it takes over from a child with a ``finally``."""
    act, cleanup, reactive = "{set: {n: 1}}", "{set: {n: 2}}", st.sampled_from(COMPOSITES[2:4])
    guard = st.sampled_from(("scene_uniform: 1 s", "check: n < 1", "check: n > 1", "look: 0 deg"))
    branch = st.builds(
        "{}: [{{{}}}, {}, {{{}}}]".format, st.sampled_from(("sequence", "selector")), guard, st.just(act), children
    )
    running = children.map(lambda node: f"sequence: [{{{node}}}, {{look: 0 deg}}], finally: {cleanup}")
    whole = st.builds("{}: [{{{}}}, {{{}}}]".format, reactive, branch, running)
    return [st.builds("sequence: [{{{}}}, {{check: n {}}}]".format, whole, st.sampled_from(("== 2", "== 0", "== 1")))]


PREEMPTION = (
    "sequence: [{{reactive_selector: [{{sequence: [{{scene_uniform: 1 s}}, {{set: {{n: 1}}}}, {{{}}}]}}, "
    "{{look: 0 deg, finally: {{set: {{n: 2}}}}}}]}}, {{check: n == {}}}]"
)
"""A ``set`` after a condition and before a leaf: the variable tells whether it runs before or after a ``finally``."""


def ordering(children: st.SearchStrategy[str]) -> list[st.SearchStrategy[str]]:
    """Selectors with another order of their children."""
    weights = st.sampled_from(("[1, 2]", "[0, 1]", "[1, 0]"))
    return [
        st.builds("selector: [{{{}}}, {{{}}}], in_turn: true".format, children, children),
        st.builds("random_selector: [{{{}}}, {{{}}}], weights: {}".format, children, children, weights),
    ]


def drawing(children: st.SearchStrategy[str]) -> list[st.SearchStrategy[str]]:
    """Conditions with random numbers: some that may be true or false, and some that cannot."""
    conditions = ("random(0, 1) < 0.3", "random(2, 3) > 1", "1 + random(0, 1) < 1", "not random(0, 1) > 0.7", "n < 5")
    chance = st.sampled_from(conditions)
    return [
        st.builds("sequence: [{{check: '{}'}}, {{{}}}]".format, chance, children),
        st.builds("sequence: [{{{}}}], if: '{}'".format, children, chance),
    ]


def trees(
    modifiers: tuple[str, ...],
    leaf: st.SearchStrategy[str] = LEAF,
    more: Callable[[st.SearchStrategy[str]], list[st.SearchStrategy[str]]] = lambda _: [],
) -> st.SearchStrategy[str]:
    """Small trees in the flow style of YAML."""

    def node(children: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
        lists = st.lists(children, min_size=1, max_size=2).map(
            lambda nodes: "[" + ", ".join(f"{{{n}}}" for n in nodes) + "]"
        )
        composites = st.builds(lambda word, nodes: f"{word}: {nodes}", st.sampled_from(COMPOSITES), lists)
        counted = st.builds("parallel: {}, {}".format, lists, st.sampled_from(COUNTS))
        each = st.builds("for_each: {{in: [1, 2], as: x, do: {{{}}}}}".format, children)
        nodes = st.one_of(children, composites, counted, each, *more(children))
        return st.builds(with_modifier, nodes, st.sampled_from(modifiers))

    return st.recursive(leaf, node, max_leaves=3)


def with_modifier(node: str, modifier: str) -> str:
    word = modifier.partition(":")[0]
    return node if f", {word}:" in node.rpartition("]")[2] else f"{node}, {modifier}"


def plan(tree: str) -> Plan | None:
    """The plan of a tree; None for one that the checker refuses."""
    try:
        return plan_of(f"{{{tree}}}")
    except ValueError:
        return None


def explored(plan: Plan) -> dict[str, int]:
    """How many ticks it takes at least to each end."""
    space = StateSpace(MissionModel(plan), MAX_STATES)
    space.explore()
    assert space.is_complete
    return {place.kind: place.depth for place in reversed(space.places)}


def shortest(runs: list[tuple[int, Status]], wanted: Status) -> int | None:
    return min((ticks for ticks, status in runs if status is wanted), default=None)


def compare_shortest_ways(found: Plan, seconds: float) -> None:
    """Compare the number of ticks to each end, with so many ``seconds`` before each tick."""
    runs = list(itertools.islice(enumerated(found, (seconds,) * TICKS), RUNS + 1))
    if len(runs) > RUNS:
        return
    depths = explored(found)
    for word, status in (("success", SUCCESS), ("failure", FAILURE)):
        depth = depths.get(word)
        assert shortest(runs, status) == (depth if depth is None or depth <= TICKS else None)


@settings(max_examples=40)
@example("reactive_sequence: [{scene_uniform: 1 s, on_failure: succeed}], once: true")
@given(trees(MODIFIERS))
def test_shortest_runs_match_brute_force(tree: str) -> None:
    found = plan(tree)
    if found is None:
        return
    compare_shortest_ways(found, 10.0)  # longer than the sensor timeout


@settings(max_examples=40)
@example(f"selector: [{{look: 0 deg, if: {CONDITION}}}, {{look: 0 deg}}]")
@example(f"parallel: [{{look: 0 deg, if: {CONDITION}}}, {{look: 0 deg}}], success_count: 2")
@example(f"race: [{{look: 0 deg, if: {CONDITION}}}, {{look: 0 deg}}]")
@given(trees((*CONDITIONS, *MODIFIERS[:7]), CONDITION_LEAF, waiting))
def test_shortest_runs_with_conditions_match_brute_force(tree: str) -> None:
    found = None if tree.count(CONDITION) > 1 else plan(tree)  # two reads in a tick share the silence of the camera
    if found is None:
        return
    compare_shortest_ways(found, 10.0)  # longer than the sensor timeout


@settings(max_examples=40)
@example("{wait_until: set_later}, {sequence: [{look: 0 deg}, {set: {set_later: true}}]}", "parallel")
@example("{sequence: [{look: 0 deg}, {set: {set_later: true}}]}, {wait_until: set_later}", "race")
@given(
    trees(MODIFIERS[:7], st.sampled_from(("look: 0 deg", "set: {set_later: true}", "wait_until: set_later"))).map(
        lambda tree: f"{{wait_until: set_later}}, {{{tree}}}"
    ),
    st.sampled_from(COMPOSITES),
)
def test_shortest_ways_past_unset_variables_match_brute_force(children: str, composite: str) -> None:
    found = plan(f"{composite}: [{children}]")
    if found is None:
        return
    compare_shortest_ways(found, 10.0)  # longer than the sensor timeout


@settings(max_examples=40)
@example("sequence: [{set: {found: '${found + [1]}'}}, {look: 0 deg}, {check: len(found) == 3}], retry: 2")
@given(trees(MODIFIERS, more=listing))
def test_shortest_runs_with_lists_match_brute_force(tree: str) -> None:
    found = plan(f"sequence: [{{set: {{found: []}}}}, {{{tree}}}]")
    if found is None:
        return
    compare_shortest_ways(found, 10.0)  # longer than the sensor timeout


@settings(max_examples=40)
@example("look: 0 deg, retry: 2, recover: {listen: {for: [yes]}}")
@example("selector: [{look: 0 deg, finally: {listen: {for: [yes]}}}, {look: 0 deg}]")
@given(trees(MODIFIERS[:7], LEAF, cleaning))
def test_shortest_ways_past_recoveries_and_cleanups_match_brute_force(tree: str) -> None:
    found = plan(tree)
    if found is None:
        return
    compare_shortest_ways(found, 10.0)  # longer than the sensor timeout


@settings(max_examples=40)
@example("selector: [{check: 'random(0, 1) < 0.3'}, {look: 0 deg, if: 'random(0, 1) > 2'}, {fail: no}]")
@given(trees(MODIFIERS, more=drawing))
def test_the_shortest_way_past_random_numbers_is_that_of_all_short_runs(tree: str) -> None:
    found = plan(f"sequence: [{{set: {{n: '${{random(0, 10)}}'}}}}, {{{tree}}}]")
    if found is None:
        return
    compare_shortest_ways(found, 10.0)  # longer than the sensor timeout


@settings(max_examples=40)
@example(PREEMPTION.format("look: 0 deg", 1))
@example(PREEMPTION.format("look: 0 deg", 2))
@example(PREEMPTION.format("scene_uniform: 1 s", 2))
@given(trees(MODIFIERS[:7], LEAF, preempting))
def test_shortest_ways_past_a_preemption_match_brute_force(tree: str) -> None:
    found = plan(f"sequence: [{{set: {{n: 0}}}}, {{{tree}}}]")
    if found is None:
        return
    compare_shortest_ways(found, 10.0)  # longer than the sensor timeout


@settings(max_examples=40)
@example("selector: [{look: 0 deg}, {look: 0 deg, invert: true}], in_turn: true, repeat: 2")
@example("random_selector: [{look: 0 deg, if: false}, {look: 0 deg}, {fail: no}], weights: [2, 1, 0]")
@given(trees(MODIFIERS, more=ordering))
def test_the_shortest_way_in_another_order_is_that_of_all_short_runs(tree: str) -> None:
    found = plan(tree)
    if found is None:
        return
    compare_shortest_ways(found, 10.0)  # longer than the sensor timeout


@settings(max_examples=60)
@example("selector: [{look: 0 deg, finally: {set: {n: 5}}}, {check: n < 5}], in_turn: true, repeat: 2")
@example("random_selector: [{look: 0 deg, once: true}, {check: n < 5, invert: true}], weights: [1, 2], retry: 2")
@given(
    trees(
        (*MODIFIERS, "if: n < 5", "if: n > 50"),
        more=lambda nodes: [*waiting(nodes), *listing(nodes), *cleaning(nodes), *ordering(nodes), *drawing(nodes)],
    )
)
def test_shortest_ways_past_nodes_of_all_kinds_match_brute_force(tree: str) -> None:
    found = plan(f"sequence: [{{set: {{n: 1, found: []}}}}, {{{tree}}}]")
    if found is None:
        return
    compare_shortest_ways(found, 10.0)  # longer than the sensor timeout


def halted(plan: Plan, ticks: int) -> Iterator[int]:
    """Every run that is halted after so many ticks: how many steps of the halt bring it to rest."""
    tape = Tape()
    tree = taped(plan.tree, tape)
    more = True
    while more:
        run = RunState(ManualClock())
        root = build(replace(plan, tree=tree), run, lambda _: Robot())
        for _ in range(ticks):
            run.tick += 1
            if root.execute_tick() is not RUNNING:
                break
        else:
            for step in range(1, TICKS + 1):
                run.tick += 1
                if root.halt():
                    yield step
                    break
            else:
                yield TICKS + 1
        more = tape.rewind()


@settings(max_examples=30)
@example("look: 0 deg, finally: {listen: {for: [yes]}}")
@example(
    "look: 0 deg, finally: {sequence: [{scene_uniform: 1 s}, {listen: {for: [yes]}}], finally: {scene_uniform: 1 s}}"
)
@example("look: 0 deg, finally: {listen: {for: [yes]}, finally: {listen: {for: [yes]}}, halt_limit: 5 s}")
@given(trees(MODIFIERS[:4], LEAF, cleaning))
def test_halts_with_cleanups_take_as_long_as_in_brute_force(tree: str) -> None:
    found = plan(tree)
    if found is None:
        return
    runs = list(itertools.islice(halted(found, 1), RUNS + 1))
    if len(runs) > RUNS or not runs:
        return
    space = StateSpace(MissionModel(found), MAX_STATES)
    space.explore()
    assert space.is_complete
    first = [number for number in space.places[0].successors if space.places[number].kind == GOING]
    steps, reached = 0, set(first)
    while not any(space.places[number].kind == RESTED for number in reached):
        steps += 1
        onward = set().union(*(space.places[number].successors for number in reached))
        reached = {number for number in onward if space.places[number].kind in (HALTING, RESTED)}
    assert steps == min(runs)


@settings(max_examples=15)
@example("look: 0 deg, finally: {listen: {for: [yes]}}, retry: 2")
@example("look: 0 deg, finally: {listen: {for: [yes]}, finally: {listen: {for: [yes]}}, halt_limit: 5 s}")
@given(trees((*MODIFIERS[:4], *TIMES), LEAF, cleaning))
def test_runs_with_cleanups_in_any_time_are_explored(tree: str) -> None:
    found = plan(tree)
    if found is None:
        return
    depths = explored(found)
    for seconds in itertools.product((0.1, 1.0, 2.5), repeat=TICKS):
        for ticks, status in itertools.islice(enumerated(found, seconds), 500):
            if status is not RUNNING:
                assert depths["success" if status is SUCCESS else "failure"] <= ticks


@settings(max_examples=15)
@example("sequence: [{look: 0 deg, cooldown: 2 s}, {scene_uniform: 1 s}], repeat: 2")
@example("look: 0 deg, delay: 1 s, cooldown: 2 s, repeat: 2")
@given(trees((*MODIFIERS[:4], *TIMES)))
def test_no_run_has_an_unexplored_end_for_any_timing(tree: str) -> None:
    found = plan(tree)
    if found is None:
        return
    depths = explored(found)
    for seconds in itertools.product((0.1, 1.0, 2.5), repeat=TICKS):
        for ticks, status in itertools.islice(enumerated(found, seconds), 500):
            if status is not RUNNING:
                assert depths["success" if status is SUCCESS else "failure"] <= ticks


@settings(max_examples=40)
@given(trees(MODIFIERS), st.integers(min_value=0))
def test_continuous_run_reaches_the_explored_state(tree: str, pick: int) -> None:
    found = plan(tree)
    if found is None:
        return
    space = StateSpace(MissionModel(found), MAX_STATES)
    space.explore()
    going = [number for number, place in enumerate(space.places) if place.kind == GOING]
    way = space.path_to(going[pick % len(going)])
    first, last = space.places[0].state, space.places[way[-1]].state
    assert first is not None
    assert last is not None
    space.model.restore(first)
    for number in way[1:]:
        script = space.places[number].script
        space.model.oracle.follow(script)
        space.model.tick()
        assert space.model.oracle.script == script
    assert space.model.state().rows == last.rows


THIRD_ROUND = "sequence: [{set: {k: '${k + 1}'}}, {check: k < 3}]"


@pytest.mark.parametrize("loop", ["repeat: 5", "repeat: '${n}'", "retry: 5, invert: true"])
def test_rounds_beyond_the_counted_ones_are_explored(loop: str) -> None:
    node = THIRD_ROUND if loop.startswith("repeat") else THIRD_ROUND.replace("<", ">=")
    found = plan_of(f"{{sequence: [{{set: {{k: 0}}}}, {{{node}, {loop}}}]}}", params="{n: {type: count}}")
    assert "failure" in explored(found)


def test_count_that_is_not_known_may_be_one() -> None:
    for loop in ("repeat: '${n}'", "retry: '${n}', invert: true"):
        depths = explored(plan_of(f"{{look: 0 deg, {loop}}}", params="{n: {type: count}}"))
        assert depths["success"] == 1
