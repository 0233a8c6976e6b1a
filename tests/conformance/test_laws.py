"""What holds in every tree at every tick, whatever its leaves do: tried on trees that nobody has thought of."""

import json
from collections.abc import Iterator
from itertools import count
from typing import Any

from hypothesis import HealthCheck, given, reject, settings
from hypothesis import strategies as st
from py_trees.common import Status

from behaviours.node import Node
from config.diagnostics import InvalidFileError
from missions.executive.composites import COMPOSITES
from missions.executive.events import status_word
from missions.language.nodes import FINALLY, FOR_EACH, HALT_LIMIT, RECOVER, RETRY, SWITCHES, WAIT_FOR
from missions.language.plan import Plan
from tests.conformance.harness import Case, Play
from tests.conformance.probes import Probe

PERCENT = st.integers(0, 3)
CONDITIONS = PERCENT.map(lambda low: f"battery.percent > {low}")
DURATIONS = st.sampled_from(["50 ms", "150 ms", "350 ms"])
COUNTS = st.sampled_from([1, 2, "forever"])

MODIFIERS: dict[str, st.SearchStrategy[Any]] = {
    **dict.fromkeys(("if", "while", "until"), CONDITIONS),
    **dict.fromkeys(("for", "timeout", "hold", "delay", "cooldown"), DURATIONS),
    **dict.fromkeys(("retry", "repeat"), COUNTS),
    "invert": st.just(True),
    "once": st.just(True) | st.just("battery.percent"),
    "on_failure": st.just("succeed"),
    "on_success": st.just("fail"),
    "on_running": st.sampled_from(["succeed", "fail"]),
}
OUTCOMES = st.sampled_from(
    [
        "running",
        "running",
        "success",
        "success",
        "failure",
        "failure",
        "crashes",
        "is offline",
        "is silent",
        "is silent",
    ]
)
CHECKS = st.tuples(st.sampled_from(["check", "wait_until"]), CONDITIONS)
LEAVES = st.fixed_dictionaries(
    {"outcomes": st.lists(OUTCOMES, min_size=1, max_size=4), "halts_in": st.sampled_from([0, 0, 0, 1, 3, 99])},
    optional={"stopping": st.just("crashes")},
)
WORDS = st.sampled_from(["probe", "probe", "base_probe", "arm_probe"])
CLEANUPS = st.dictionaries(st.sampled_from(["probe", "voice_probe"]), LEAVES, min_size=1, max_size=1)


@st.composite
def modified(draw: st.DrawFn, behaviour: dict[str, Any]) -> dict[str, Any]:
    """Draw what stands beside a behaviour: up to three modifiers, in any order."""
    words = draw(st.lists(st.sampled_from([*sorted(MODIFIERS), FINALLY, FINALLY, RETRY]), max_size=3, unique=True))
    node = behaviour | {word: draw(MODIFIERS.get(word, CLEANUPS)) for word in words}
    if FINALLY in words and draw(st.booleans()):
        node[HALT_LIMIT] = "250 ms"
    if node.get(RETRY, 1) != 1 and draw(st.booleans()):
        node[RECOVER] = {draw(WORDS): draw(LEAVES)}
    return node


def composed(children: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    """Draw a composite of such children."""
    words = st.sampled_from(sorted(COMPOSITES))
    lists = st.dictionaries(words, st.lists(children, min_size=1, max_size=3), min_size=1, max_size=1)
    counts = st.sampled_from([1, 2, "all"])
    counted = st.fixed_dictionaries(
        {"parallel": st.lists(children, min_size=1, max_size=3)},
        optional={"success_count": counts, "failure_count": counts, "wait_for_all": st.just(True)},
    )
    each = st.fixed_dictionaries({"in": st.just([1, 2]), "as": st.just("m"), "do": children})
    loops = st.dictionaries(st.just(FOR_EACH), each, min_size=1, max_size=1)
    waits = st.dictionaries(st.just(WAIT_FOR), children, min_size=1, max_size=1)
    return (lists | counted | ordered(children) | chosen(children) | loops | waits).flatmap(modified)


def ordered(children: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    """Draw a selector with another order of its children."""
    pairs = st.lists(children, min_size=2, max_size=2)
    in_turn = st.fixed_dictionaries({"selector": pairs, "in_turn": st.just(True)})
    weights = st.sampled_from([[1, 2], [0, 1], [0.2, 0.8]])
    return in_turn | st.fixed_dictionaries({"random_selector": pairs, "weights": weights})


def chosen(children: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    """Draw a switch between such children, by the one thing that changes here."""
    cases = st.dictionaries(st.sampled_from(["0", "1", "2"]), children, min_size=1, max_size=2)
    switch = st.fixed_dictionaries({"on": st.just("battery.percent"), "cases": cases}, optional={"default": children})
    return st.dictionaries(st.sampled_from(sorted(SWITCHES)), switch, min_size=1, max_size=1)


TREES = st.recursive(
    (st.tuples(WORDS, LEAVES) | CHECKS).flatmap(lambda leaf: modified({leaf[0]: leaf[1]})), composed, max_leaves=8
)
TICKS = st.lists(
    st.tuples(st.sampled_from(["", "", "", "", "told to halt, ", "battery silent, ", "battery reports, "]), PERCENT),
    min_size=1,
    max_size=12,
)


def named(tree: dict[str, Any], number: Iterator[int]) -> dict[str, Any]:
    """Give every behaviour a name of its own."""

    def below(key: str, value: Any) -> Any:
        if key in COMPOSITES:
            return [named(child, number) for child in value]
        if key == FOR_EACH:
            place = next(number)
            return value | {"as": f"m{place}", "do": named(value["do"], number)}
        if key in (WAIT_FOR, RECOVER, FINALLY):
            return named(value, number)
        if key in SWITCHES:
            cases = {case: named(child, number) for case, child in value["cases"].items()}
            return value | {"cases": cases} | {k: named(v, number) for k, v in value.items() if k == "default"}
        return value

    return {**{key: below(key, value) for key, value in tree.items()}, "name": f"n{next(number)}"}


class Witness:
    """Reads what happens in a play, and raises AssertionError where a law is broken."""

    def __init__(self, play: Play) -> None:
        self.play = play
        self.leaves = {name: node for name, node in play.nodes.items() if isinstance(node, Probe)}
        self.shown = dict.fromkeys(play.nodes, "idle")
        self.state = dict.fromkeys(self.leaves, "at rest")

    def read(self, line: str) -> None:
        """Read what happened in one tick, and look at the tree that it left."""
        entries = [
            entry
            for entry in line.split(", ")
            if not entry.startswith(("with ", "told ", "battery ")) and entry != "nothing"
        ]
        for entry in entries:
            name, what = entry.split(" ", 1)
            if what.startswith("is ") and name in self.shown:
                self.shown[name] = what.removeprefix("is ")
            if name in self.leaves:
                self.take(name, what)
        self.look()

    def take(self, name: str, what: str) -> None:
        """Follow a leaf: it starts, then ends or is halted, once; its actuators are its own until it is at rest."""
        before = self.state[name]
        assert what != "is ticked though it has not started", name
        if what == "starts":
            assert before != "working", f"{name} starts twice"
            busy = [other for other in self.leaves if other != name and self.state[other] != "at rest"]
            rivals = [other for other in busy if self.leaves[other].drives & self.leaves[name].drives]
            assert not rivals, f"{name} starts while {rivals} still drive"
            self.state[name] = "working"
        elif what == "halts" or what.startswith("ends "):
            assert before == "working", f"{name} {what}, but was {before}"
            self.state[name] = "halting" if what == "halts" else "at rest"
        elif what == "is idle":
            assert before != "working", f"{name} was forgotten while it worked"
            self.state[name] = "at rest"

    def look(self) -> None:
        """Check the tree between two ticks."""
        for name, node in self.play.nodes.items():
            assert self.shown[name] == status_word(node), f"the observer takes {name} for {self.shown[name]}"
            if node.status is Status.FAILURE:
                assert node.reason, f"{name} fails without a reason"
            if node.status is Status.RUNNING and isinstance(node.parent, Node):
                assert node.parent.status is Status.RUNNING, f"{name} runs on after what is around it"
        for name, state in self.state.items():
            running = self.leaves[name].status is Status.RUNNING
            assert running or state == "at rest", f"{name} is {state}, but shows {self.shown[name]}"


def _checked(case: Case) -> Plan | None:
    """Return the plan, None for the errors of these cases: rivals for an actuator, modifiers without effect."""
    try:
        return case.plan()
    except InvalidFileError as error:
        known = (
            "at the same time",
            "never reached",
            "never over",
            "no effect",
            "not an 'else'",
            "must be at most",
            "never does",
        )
        if not all(any(words in fault.message for words in known) for fault in error.diagnostics):
            raise
        return None


@settings(suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much])
@given(TREES, TICKS)
def test_every_tree_keeps_the_laws(tree: dict[str, Any], ticks: list[tuple[str, int]]) -> None:
    case = Case("any tree", "laws", f"mission: any\ntree: {json.dumps(named(tree, count()))}\n")
    plan = _checked(case)
    if plan is None:
        reject()
    play = Play(plan, {"battery": {"percent": 1}})
    witness = Witness(play)
    for told, percent in ticks:
        witness.read(play.line(f"{told}with battery.percent = {percent}", 0.1))
    for _ in range(40):  # a leaf has a second for its halt, and so has a cleanup, whatever the leaves do
        witness.read(play.line("told to halt", 0.1))
    assert set(witness.state.values()) <= {"at rest"}
    assert play.root.status is not Status.RUNNING
