"""Hints for words of other systems: who follows one to the letter gets what the word means there.

Each word is answered by the checker. Its hint is made into a tree as it says, with scripted leaves in the places that
it leaves open, and played beside the tree that the word belongs to: in BehaviorTree.CPP, in py_trees, or as its own
page says in a few lines of Python.
"""

import json
import re
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from random import Random
from typing import Any

import pytest
import yaml
from py_trees import composites, decorators
from py_trees.behaviour import Behaviour
from py_trees.common import OneShotPolicy, ParallelPolicy, Status

from behaviours.catalogue import LEAVES
from behaviours.leaf import Leaf, argument
from config.diagnostics import InvalidFileError, SourceText, to_snake_case
from missions.executive.events import STATUS_WORDS
from missions.language.document import check_plan
from missions.language.nodes import BRANCHES, MODIFIERS
from missions.language.steps import BESIDE_KEYS, LIST_HINT
from missions.language.synonyms import PHRASE_SYNONYMS, SYNONYMS, UNMATCHED_HINT, UNMATCHED_WORDS, unknown_word_hint
from tests.behaviortree_cpp import ask_behaviortree_cpp, needs_behaviortree_cpp
from tests.conformance.harness import Play
from tests.conformance.probes import Bench, Probe

SEEDS = range(40)
TICKS = 10
STATUSES = {"R": Status.RUNNING, "S": Status.SUCCESS, "F": Status.FAILURE}
TRUE, FALSE = "battery.percent > 50", "battery.percent < 5"
LEVEL = {"S": 80, "F": 20}
"""What is in the battery while CONDITION is true, and while it is not."""

CONDITION = TRUE


class Scripted(Leaf):
    """Give the outcomes of its name in turn, one letter a tick, over and over; leaves of one name share them."""

    tag = "scripted"
    outcomes: str = argument("text", "the letters R, S and F", principal=True)
    run: Bench
    given: dict[Bench, dict[str, int]] = {}  # noqa: RUF012 - shared on purpose

    def update(self) -> Status:
        given = self.given.setdefault(self.run, {})
        given[self.name] = given.get(self.name, -1) + 1
        outcome = self.outcomes[given[self.name] % len(self.outcomes)]
        self.run.log.append(f"{self.name} {outcome}")
        return STATUSES[outcome]


Tree = dict[str, Any]
Line = tuple[str, list[str]]
"""What a tick came to: the status of the root, and the leaves that were ticked, each with its outcome."""


def hint_for(word: str) -> str:
    """Return what the checker says to a word where a behaviour should be."""
    with pytest.raises(InvalidFileError) as caught:
        check_plan(SourceText("m.yaml", f"mission: m\ntree:\n  sequence:\n    - {word}: [stop]\n"), LEAVES, {})
    return caught.value.diagnostics[0].suggestion


def follow(word: str, fill: Sequence[Any], value: object = None) -> Tree:
    """Return the tree that a hint says, its open places filled in turn; ``value`` is that of the word itself."""
    hint = hint_for(word)
    if found := re.search(r"(switch: )?(\{.*\})", re.sub(r"'[^']*'", "", hint)):  # quoted words explain the form
        return _filled(f"{{{found[0]}}}" if found[1] else found[2], fill)
    if found := re.match(r"write '([^']*)',? (?:beside a|in place of)", hint):
        ours = found[1] if ":" in found[1] else f"{found[1]}: {json.dumps(value)}"
        return {**fill[0], **yaml.safe_load(re.sub(r"\.\.\.|CONDITION", CONDITION, ours))}
    found = re.fullmatch(r"write '(\w+)'(?:, w.*)?|did you mean '(\w+)'\?", hint)
    assert found is not None, hint
    ours = found[1] or found[2]
    return {**fill[0], ours: value} if ours in MODIFIERS else {ours: list(fill)}


def _filled(form: str, fill: Sequence[object]) -> Tree:
    left = iter(fill)
    form = re.sub(r"\bon:", '"on":', form)  # which PyYAML takes for true
    form = re.sub(r"\b(CONDITION|EXPRESSION|UTILITY|VALUE|N)\b", lambda _: str(next(left)), form)
    tree: Tree = yaml.safe_load(re.sub(r"\b[A-Z]{4,}\b|\.\.\.", lambda _: json.dumps(next(left)), form))
    return tree


def leaf(name: str, outcomes: str) -> Tree:
    return {"scripted": outcomes, "name": name}


def flow(value: object) -> str:
    """Write a tree as YAML; in JSON the cases of a switch would be texts."""
    if isinstance(value, dict):
        pairs = (f"{key if isinstance(key, str) else json.dumps(key)}: {flow(each)}" for key, each in value.items())
        return f"{{{', '.join(pairs)}}}"
    if isinstance(value, list):
        return f"[{', '.join(map(flow, value))}]"
    return json.dumps(value)


def played(tree: Tree, condition: str = "S", ticks: int = TICKS) -> list[Line]:
    """Play our tree while the condition goes as its letters say, one a tick."""
    text = f"mission: pair\ntree: {flow(tree)}\n"
    play = Play(
        check_plan(SourceText("pair", text), {**LEAVES, "scripted": Scripted}, {}), {"battery": {"percent": 80}}
    )
    told = []
    for tick in range(ticks):
        level = LEVEL[condition[tick % len(condition)]]
        happened = play.line(f"with battery.percent = {level}", 0.1 if tick else 0.0).split(", ")
        told.append((STATUS_WORDS[play.root.status].upper(), [e for e in happened if re.fullmatch(r"\w+ [RSF]", e)]))
    return told


def story(lines: Sequence[Line]) -> tuple[str, list[str]]:
    """Return the first end, and all that was ticked up to then: for words that differ in when a round begins."""
    done: list[str] = []
    for status, ticked in lines:
        done += ticked
        if status != "RUNNING":
            return status, done
    return "RUNNING", done[: len(lines) // 2]


# --- BehaviorTree.CPP -------------------------------------------------------------------------------------------------


@dataclass
class Case:
    """A word, the XML of what it means, with leaves a, b and c, and a condition that is asked as leaf q.

    ``children`` are those of the word; without them it has the leaves that ``fill`` names. ``story`` says that rounds
    begin at other ticks there. ``quick`` leaves never run.
    """

    word: str
    xml: str
    fill: Sequence[object] = ("a", "b", "c")
    value: object = None
    story: bool = False
    quick: str = ""
    condition: str = ""

    def pair(self, random: Random) -> tuple[Tree, dict[str, Any], str]:
        """Draw outcomes; return our tree, the request for theirs, and the letters of the condition."""
        outcomes = {
            name: "".join(random.choices("SF" if name in self.quick else "RSF", k=random.randint(1, 4)))
            for name in "abc"
        }
        condition = self.condition or "".join(random.choices("SF", k=random.randint(1, 5)))
        fill = [leaf(each, outcomes[each]) if each in ("a", "b", "c") else each for each in self.fill]
        xml = re.sub(r"<([abcq])/>", r'<Probe name="\1"/>', self.xml)
        xml = f'<root BTCPP_format="4"><BehaviorTree ID="Main">{xml}</BehaviorTree></root>'
        ticks = 6 * TICKS if self.story else TICKS
        request = {"xml": xml, "outcomes": {**outcomes, "q": condition}, "clocked": ["q"], "ticks": ticks}
        return follow(self.word, fill, self.value), request, condition


ABC = "<a/><b/><c/>"
SET = '<Sequence><Script code="n:={}"/>{}</Sequence>'
CASES = [
    Case("Sequence", f"<Sequence>{ABC}</Sequence>"),
    Case("Fallback", f"<Fallback>{ABC}</Fallback>"),
    Case("AsyncSequence", f"<AsyncSequence>{ABC}</AsyncSequence>", story=True),
    Case("AsyncFallback", f"<AsyncFallback>{ABC}</AsyncFallback>", story=True),
    Case("ReactiveSequence", f"<ReactiveSequence>{ABC}</ReactiveSequence>", quick="ab"),
    Case("ReactiveFallback", f"<ReactiveFallback>{ABC}</ReactiveFallback>", quick="ab"),
    Case("Parallel", f"<Parallel>{ABC}</Parallel>"),
    Case("ParallelAll", "<ParallelAll><a/><b/></ParallelAll>", ("a", "b")),
    Case("Inverter", "<Inverter><a/></Inverter>", ("a",)),
    Case("ForceSuccess", "<ForceSuccess><a/></ForceSuccess>", ("a",)),
    Case("ForceFailure", "<ForceFailure><a/></ForceFailure>", ("a",)),
    Case("KeepRunningUntilFailure", "<KeepRunningUntilFailure><a/></KeepRunningUntilFailure>", ("a",)),
    Case(
        "RetryUntilSuccessful",
        '<RetryUntilSuccessful num_attempts="3"><a/></RetryUntilSuccessful>',
        ("a",),
        value=3,
        story=True,
    ),
    Case("num_attempts", '<RetryUntilSuccessful num_attempts="2"><a/></RetryUntilSuccessful>', ("a",), 2, story=True),
    Case("Repeat", '<Repeat num_cycles="3"><a/></Repeat>', ("a",), value=3, story=True),
    Case("num_cycles", '<Repeat num_cycles="2"><a/></Repeat>', ("a",), value=2, story=True),
    Case("IfThenElse", "<IfThenElse><q/><a/><b/></IfThenElse>", (CONDITION, "a", "b")),
    Case("ScriptCondition", "<q/>", (CONDITION,)),
    Case(
        "Precondition",
        SET.format(1, '<Precondition if="n==1" else="FAILURE"><a/></Precondition>'),
        (TRUE, "a"),
        condition="S",
    ),
    Case(
        "Precondition",
        SET.format(0, '<Precondition if="n==1" else="FAILURE"><a/></Precondition>'),
        (TRUE, "a"),
        condition="F",
    ),
    *(
        Case(
            "Switch2",
            SET.format(n, '<Switch2 variable="{n}" case_1="80" case_2="99"><a/><b/><c/></Switch2>'),
            ("battery.percent", "80", "a", "c"),
            condition=letter,
        )
        for n, letter in ((80, "S"), (20, "F"))
    ),
    Case("TryCatch", "<Fallback><a/><ForceFailure><b/></ForceFailure></Fallback>", ("a", "b")),
]


def theirs(requests: Sequence[dict[str, Any]]) -> list[list[Line]]:
    """Have BehaviorTree.CPP tick the trees, in a process of its own."""
    return [[(status, ticked) for status, ticked, _ in tree] for tree in ask_behaviortree_cpp(requests)]


@needs_behaviortree_cpp
def test_hint_for_a_behaviortree_cpp_word_gives_the_same_behaviour() -> None:
    pairs = [(case, *case.pair(Random(seed))) for case in CASES for seed in SEEDS]  # noqa: S311 - as a test draws
    for (case, tree, request, condition), expected in zip(pairs, theirs([each[2] for each in pairs]), strict=True):
        ours = played(tree, condition, request["ticks"])
        same = story(ours) == story(expected) if case.story else ours == expected
        assert same, f"{case.word}: {json.dumps(tree)}\n{request['xml']}\n{condition}\n{ours}\n{expected}"


MEMORY = [
    {"set": {"step": 1}},
    {
        "sequence": [
            {**leaf("a", ""), "if": "step == 1"},
            {"set": {"step": 2}, "if": "step == 1"},
            {**leaf("b", ""), "if": "step == 2"},
            {"set": {"step": 3}, "if": "step == 2"},
            leaf("c", ""),
            {"set": {"step": 1}},
        ],
        "retry": "forever",
    },
]
ONCE = [
    {"set": {"done": False}},
    {
        "selector": [
            {
                "sequence": [
                    {
                        "selector": [
                            {"sequence": [leaf("a", ""), {"set": {"done": True}}]},
                            {"sequence": [{"set": {"done": True}}, "fail"]},
                        ],
                        "if": "not done",
                    },
                    leaf("b", ""),
                ]
            },
            "succeed",
        ],
        "repeat": 4,
    },
]
RECIPES = {
    "SequenceWithMemory": (
        MEMORY,
        f'<RetryUntilSuccessful num_attempts="-1"><{{0}}>{ABC}</{{0}}></RetryUntilSuccessful>',
    ),
    "RunOnce": (
        ONCE,
        '<Repeat num_cycles="4"><ForceSuccess><Sequence><{0}><a/></{0}><b/></Sequence></ForceSuccess></Repeat>',
    ),
}
"""What the page says to write for a word that nothing here means, with what that is in BehaviorTree.CPP."""


def _scripted(tree: Any, outcomes: dict[str, str]) -> Any:
    if isinstance(tree, list):
        return [_scripted(each, outcomes) for each in tree]
    if isinstance(tree, dict):
        return {
            key: outcomes[tree["name"]] if key == "scripted" else _scripted(each, outcomes)
            for key, each in tree.items()
        }
    return tree


@needs_behaviortree_cpp
@pytest.mark.parametrize("word", RECIPES)
def test_documented_recipe_replaces_a_word_without_equivalent(word: str) -> None:
    recipe, xml = RECIPES[word]
    cases = [Case(word, xml.format(word), ()) for _ in SEEDS]
    requests, ours = [], []
    for seed, case in zip(SEEDS, cases, strict=True):
        random = Random(seed)  # noqa: S311 - as a test draws
        outcomes = {name: "".join(random.choices("RSF", k=random.randint(1, 4))) for name in "abc"}
        body = re.sub(r"<([abc])/>", r'<Probe name="\1"/>', case.xml)
        body = f'<root BTCPP_format="4"><BehaviorTree ID="Main">{body}</BehaviorTree></root>'
        requests.append({"xml": body, "outcomes": outcomes, "ticks": 6 * TICKS})
        ours.append(played({"sequence": _scripted(recipe, outcomes)}, ticks=6 * TICKS))
    for request, mine, expected in zip(requests, ours, theirs(requests), strict=True):
        assert story(mine) == story(expected), f"{request}\n{mine}\n{expected}"


# --- py_trees ---------------------------------------------------------------------------------------------------------


class Told(Behaviour):
    """Gives the outcomes of its name in turn, over and over, and writes them down."""

    def __init__(self, name: str, outcomes: str, log: list[str]) -> None:
        super().__init__(name)
        self._outcomes, self._log, self._given = outcomes, log, 0

    def update(self) -> Status:
        outcome = self._outcomes[self._given % len(self._outcomes)]
        self._given += 1
        self._log.append(f"{self.name} {outcome}")
        return STATUSES[outcome]


class Level:
    """The condition of a tick."""

    def __init__(self) -> None:
        self.true = True

    def __call__(self) -> bool:
        return self.true


class Asks(Behaviour):
    """Asks whether the condition is true, once, or until it is."""

    def __init__(self, level: Level, otherwise: Status) -> None:
        super().__init__("asks")
        self._level, self._otherwise = level, otherwise

    def update(self) -> Status:
        return Status.SUCCESS if self._level() else self._otherwise


Build = Callable[[list[Behaviour], Level], Behaviour]
PY_TREES: dict[str, tuple[Build, Sequence[str], object]] = {
    "EternalGuard": (lambda kids, level: decorators.EternalGuard("x", kids[0], level), "a", CONDITION),
    "FailureIsRunning": (lambda kids, _: decorators.FailureIsRunning("x", kids[0]), "a", None),
    "FailureIsSuccess": (lambda kids, _: decorators.FailureIsSuccess("x", kids[0]), "a", None),
    "Inverter": (lambda kids, _: decorators.Inverter("x", kids[0]), "a", None),
    "OneShot": (lambda kids, _: decorators.OneShot("x", kids[0], OneShotPolicy.ON_COMPLETION), "a", None),
    "Repeat": (lambda kids, _: decorators.Repeat("x", kids[0], num_success=2), "a", 2),
    "num_success": (lambda kids, _: decorators.Repeat("x", kids[0], num_success=3), "a", 3),
    "num_failures": (lambda kids, _: decorators.Retry("x", kids[0], num_failures=3), "a", 3),
    "RunningIsFailure": (lambda kids, _: decorators.RunningIsFailure("x", kids[0]), "a", None),
    "RunningIsSuccess": (lambda kids, _: decorators.RunningIsSuccess("x", kids[0]), "a", None),
    "SuccessIsFailure": (lambda kids, _: decorators.SuccessIsFailure("x", kids[0]), "a", None),
    "SuccessIsRunning": (lambda kids, _: decorators.SuccessIsRunning("x", kids[0]), "a", None),
    "Sequence": (lambda kids, _: composites.Sequence("x", memory=True, children=kids), "abc", None),
    "Selector": (lambda kids, _: composites.Selector("x", memory=True, children=kids), "abc", None),
    "CheckBlackboardVariableValue": (lambda _, level: Asks(level, Status.FAILURE), "", CONDITION),
    "WaitForBlackboardVariable": (lambda _, level: Asks(level, Status.RUNNING), "", CONDITION),
}


@pytest.mark.parametrize("word", PY_TREES)
def test_hint_for_a_py_trees_word_gives_the_same_behaviour(word: str) -> None:
    build, names, value = PY_TREES[word]
    for seed in SEEDS:
        random = Random(seed)  # noqa: S311 - as a test draws
        outcomes = {name: "".join(random.choices("RSF", k=random.randint(1, 4))) for name in names}
        condition = "".join(random.choices("SF", k=random.randint(1, 5)))
        log: list[str] = []
        level = Level()
        root = build([Told(name, each, log) for name, each in outcomes.items()], level)
        expected = []
        for tick in range(TICKS):
            level.true = condition[tick % len(condition)] == "S"
            log.clear()
            root.tick_once()
            expected.append((STATUS_WORDS[root.status].upper(), list(log)))
        kids: list[object] = [leaf(name, each) for name, each in outcomes.items()]
        tree = follow(word, kids or [value], value)
        assert played(tree, condition) == expected, f"{word}: {flow(tree)} with {condition}"


# --- side by side, as the page says -----------------------------------------------------------------------------------

SIDE_BY_SIDE: dict[str, tuple[Tree, str, Callable[[list[Behaviour]], Behaviour]]] = {
    "parallel": (
        {"parallel": "abc"},
        f"<Parallel>{ABC}</Parallel>",
        lambda kids: composites.Parallel("x", ParallelPolicy.SuccessOnAll(synchronise=True), kids),
    ),
    "race": (
        {"race": "abc"},
        f'<Parallel success_count="1" failure_count="1">{ABC}</Parallel>',
        lambda kids: composites.Parallel("x", ParallelPolicy.SuccessOnOne(), kids),
    ),
    "repeat": (
        {"a": None, "repeat": 2},
        '<Repeat num_cycles="2"><a/></Repeat>',
        lambda kids: decorators.Repeat("x", kids[0], num_success=2),
    ),
    "retry": (
        {"a": None, "retry": 2},
        '<RetryUntilSuccessful num_attempts="2"><a/></RetryUntilSuccessful>',
        lambda kids: decorators.Retry("x", kids[0], num_failures=2),
    ),
}
"""Rows of the page's table: ours, BehaviorTree.CPP's and py_trees' word for one thing, with the leaves a, b and c."""


def draw_row(word: str, seed: int) -> tuple[Tree, dict[str, str]]:
    """Return our tree of a row with drawn outcomes, and the outcomes."""
    ours, random = SIDE_BY_SIDE[word][0], Random(seed)  # noqa: S311 - as a test draws
    outcomes = {name: "".join(random.choices("RSF", k=random.randint(1, 4))) for name in "abc"}
    kids = [leaf(name, outcomes[name]) for name in "abc"]
    return ({**kids[0], word: ours[word]} if "a" in ours else {word: kids}), outcomes


def first_end(statuses: Sequence[str]) -> list[str]:
    """Return the statuses of the ticks up to the first end."""
    ended = next((place for place, status in enumerate(statuses) if status != "RUNNING"), len(statuses))
    return list(statuses[: ended + 1])


@needs_behaviortree_cpp
@pytest.mark.parametrize("word", SIDE_BY_SIDE)
def test_row_of_the_page_ends_as_in_behaviortree_cpp(word: str) -> None:
    rows = [draw_row(word, seed) for seed in SEEDS]
    body = re.sub(r"<([abc])/>", r'<Probe name="\1"/>', SIDE_BY_SIDE[word][1])
    xml = f'<root BTCPP_format="4"><BehaviorTree ID="Main">{body}</BehaviorTree></root>'
    requests = [{"xml": xml, "outcomes": outcomes, "ticks": 6 * TICKS} for _, outcomes in rows]
    for (tree, _), expected in zip(rows, theirs(requests), strict=True):
        assert story(played(tree, ticks=6 * TICKS)) == story(expected), flow(tree)


@pytest.mark.parametrize("word", SIDE_BY_SIDE)
def test_row_of_the_page_ends_as_in_py_trees(word: str) -> None:
    mixed = 0
    for seed in SEEDS:
        tree, outcomes = draw_row(word, seed)
        log: list[str] = []
        root = SIDE_BY_SIDE[word][2]([Told(name, outcomes[name], log) for name in "abc"])
        expected = []
        for _ in range(TICKS):
            log.clear()
            root.tick_once()
            expected.append(STATUS_WORDS[root.status].upper())
            if root.status is not Status.RUNNING:
                break
        ends = {step[-1] for step in log} - {"R"}
        if word == "race" and ends == {"S", "F"}:  # both in one tick: the page says what counts where
            mixed += 1
            assert expected[-1] == "FAILURE"
            first = next(step[-1] for step in log if step[-1] != "R")
            expected[-1] = "SUCCESS" if first == "S" else "FAILURE"
        assert first_end([status for status, _ in played(tree)]) == first_end(expected), flow(tree)
    assert (mixed > 0) == (word == "race")


# --- as their pages say -----------------------------------------------------------------------------------------------


def recovering(a: str, b: str) -> Iterator[tuple[str, str]]:
    """Tick Nav2's RecoveryNode with one retry: a, where it fails b, then a once more."""
    first, second = iter(a * TICKS), iter(b * TICKS)
    for name, script, passes in (("a", first, "F"), ("b", second, "S"), ("a", first, "")):
        for outcome in script:
            yield f"{name} {outcome}", outcome
            if outcome != "R":
                break
        if outcome not in passes:
            return


def test_hint_for_recovery_node_behaves_as_in_nav2() -> None:
    for seed in SEEDS:
        random = Random(seed)  # noqa: S311 - as a test draws
        a, b = ("".join(random.choices("RSF", k=random.randint(1, 4))) + "S" for _ in "ab")
        tree = follow("RecoveryNode", [leaf("a", a), leaf("b", b), leaf("a", a)])
        steps = list(recovering(a, b))
        status = "SUCCESS" if steps[-1][1] == "S" else "FAILURE"
        assert story(played(tree, ticks=30)) == (status, [step for step, _ in steps]), (a, b)


IN_A_ROW = {
    "condition": ("S", "a"),
    "check_condition": ("S", "a"),
    "assert": ("S", "a"),
    "require": ("S", "a"),
    "wait_template": ("R", "a"),
    "wait_for_condition": ("R", "a"),
}
"""Words that stand before a step, and how that goes on while their condition is false: not at all, or not yet."""


@pytest.mark.parametrize("word", IN_A_ROW)
def test_condition_before_a_step_prevents_its_start(word: str) -> None:
    tree = {"sequence": [follow(word, [CONDITION]), leaf("a", "S")]}
    waits = IN_A_ROW[word][0] == "R"
    assert played(tree, "F", 3) == [("RUNNING" if waits else "FAILURE", [])] * 3
    assert played(tree, "S", 1) == [("SUCCESS", ["a S"])]
    assert played(tree, "FS", 2)[1] == ("SUCCESS", ["a S"])


@pytest.mark.parametrize(
    ("word", "runs"), [("unless", "F"), ("if_not", "F"), ("while_not", "F"), ("when", "S"), ("only_if", "S")]
)
def test_condition_beside_a_step_is_evaluated(word: str, runs: str) -> None:
    tree = follow(word, [leaf("a", "S")], CONDITION)
    assert played(tree, runs, 1)[0] == ("SUCCESS", ["a S"])
    assert played(tree, "F" if runs == "S" else "S", 1)[0][1] == []


# --- all of them ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("word", ["Cleanup", "on_exit", "teardown", "ensure", "Finally", "always"])
def test_hint_for_a_cleanup_runs_it_after_every_end(word: str) -> None:
    for outcome, status in (("S", "SUCCESS"), ("F", "FAILURE"), ("R", "FAILURE")):
        tree = {"sequence": [{**leaf("a", outcome), "timeout": "50 ms"}], **follow(word, [{}], leaf("b", "F"))}
        lines = played(tree, ticks=3)
        ended = next(line for line in lines if line[0] != "RUNNING")
        assert (ended[0], ended[1][-1:]) == (status, ["b F"])


@pytest.mark.parametrize("word", ["recover_with", "on_retry", "RecoveryAction"])
def test_hint_for_a_recovery_runs_it_between_attempts(word: str) -> None:
    tree = {**follow(word, [leaf("a", "FFS")], leaf("b", "RF")), "retry": 3}
    assert story(played(tree, ticks=12)) == ("SUCCESS", ["a F", "b R", "b F", "a F", "b R", "b F", "a S"])


@pytest.mark.parametrize("word", [*UNMATCHED_WORDS.split(), "SequenceStar", "RateController", "PipelineSequence"])
def test_word_without_equivalent_gets_no_form(word: str) -> None:
    assert hint_for(word) == UNMATCHED_HINT


@pytest.mark.parametrize("word", ["Timeout", "TimeLimit", "MaxTime"])
def test_hint_for_a_time_limit_fails_a_running_node(word: str) -> None:
    assert [status for status, _ in played(follow(word, [leaf("a", "R")], "250 ms"), ticks=4)] == [
        "RUNNING",
        "RUNNING",
        "RUNNING",
        "FAILURE",
    ]


def test_a_delay_waits_before_each_start() -> None:
    lines = played(follow("start_after", [leaf("a", "S")], "150 ms"), ticks=5)
    assert lines == [("RUNNING", []), ("RUNNING", []), ("SUCCESS", ["a S"]), ("RUNNING", []), ("RUNNING", [])]


@pytest.mark.parametrize("word", ["while", "until"])
def test_a_loop_of_other_languages_is_no_guard(word: str) -> None:
    with pytest.raises(InvalidFileError) as caught:
        check_plan(SourceText("m.yaml", f"mission: m\ntree:\n  {word}: face.seen\n  do: [stop]\n"), LEAVES, {})
    assert caught.value.diagnostics[0].suggestion == UNMATCHED_HINT


NOTHING = (
    "undocked not_bumped face_not_seen no_face_seen joint_unloaded until_not_seen reactive_race any_success "
    "all_success tag_cooldown simple_race random_parallel guard_selector monitor abort rate hz "
    "emergency_stop every memory policy Count SkipUnlessUpdated"
)


@pytest.mark.parametrize("word", NOTHING.split())
def test_similar_spelling_does_not_suggest_a_composite(word: str) -> None:
    assert hint_for(word) == LIST_HINT


@pytest.mark.parametrize(
    ("slip", "meant"),
    [
        ("sequnce", "sequence"),
        ("parralel", "parallel"),
        ("sequense", "sequence"),
        ("reactive_seqence", "reactive_sequence"),
        ("selecter", "selector"),
        ("timout", "timeout"),
        ("untill", "until"),
        ("docekd", "docked"),
        ("faces_seen", "face_seen"),
        ("parallel_", "parallel"),
    ],
)
def test_typing_mistake_suggests_a_composite(slip: str, meant: str) -> None:
    assert (
        unknown_word_hint(slip, LEAVES, BRANCHES, (*MODIFIERS, *BESIDE_KEYS), alone=False) == f"did you mean '{meant}'?"
    )


def test_synonym_tables_do_not_overlap() -> None:
    tables = [
        set(UNMATCHED_WORDS.split()),
        *({word for words in t.values() for word in words.split()} for t in (PHRASE_SYNONYMS, SYNONYMS)),
    ]
    assert [a & b for a, b in zip(tables, tables[1:] + tables[:1], strict=True)] == [set(), set(), set()]
    words = set().union(*tables)
    assert {word for word in words if to_snake_case(word) != word} == set()
    assert not words & {*LEAVES, *BRANCHES, *MODIFIERS}


@pytest.mark.parametrize("ours", [ours for ours in SYNONYMS if ":" in ours])
def test_suggested_word_with_a_value_is_valid(ours: str) -> None:
    node = ours.replace("...", CONDITION).replace("NAME", "name")
    head = node.partition(":")[0]
    node = f"{{drive: 1 m, {node}}}" if head in MODIFIERS else f"{{{node}}}"
    check_plan(SourceText("m.yaml", f"mission: m\ntree: {node}\n"), LEAVES, {})


SIGNS = {"back|reverse": "drive: -", "right|[^r]clockwise": "(turn|look): -", "left|anti|counter": r"(turn|look): \d"}


@pytest.mark.parametrize("names", SIGNS)
def test_synonym_with_a_direction_keeps_the_direction(names: str) -> None:
    led = [(ours, w) for ours, words in SYNONYMS.items() for w in words.split() if re.search(rf"(^|_)({names})", w)]
    led = [(ours, word) for ours, word in led if re.match("drive|turn|look", ours) and "turn_back" not in word]
    assert led
    assert [each for each in led if not re.match(SIGNS[names], each[0])] == []


def test_hint_for_round_robin_starts_with_the_next_child_each_time() -> None:
    lines = played(follow("RoundRobin", [leaf("a", "S"), leaf("b", "RFS")]), ticks=5)
    assert lines == [
        ("SUCCESS", ["a S"]),
        ("RUNNING", ["b R"]),
        ("SUCCESS", ["b F", "a S"]),
        ("SUCCESS", ["b S"]),
        ("SUCCESS", ["a S"]),
    ]


@pytest.mark.parametrize("word", ["ProbabilitySelector", "weighted_choice"])
def test_hint_for_chances_draws_by_weight_and_tries_the_others(word: str) -> None:
    tree = follow(word, [leaf("a", "S"), leaf("b", "S")])
    assert tree["weights"] == [2, 1]
    firsts = [ticked[0] for _, ticked in played(tree, ticks=300)]
    assert 170 < firsts.count("a S") < 230
    failing = played({**tree, "random_selector": [leaf("a", "F"), leaf("b", "S")], "weights": [1_000_000, 1]}, ticks=1)
    assert failing == [("SUCCESS", ["a F", "b S"])]


def test_hint_for_appending_makes_a_longer_list() -> None:
    step = hint_for("append").removeprefix("write ").replace("LIST", "found").replace("ITEM", "3")
    text = f"mission: m\ntree:\n  sequence:\n    - set: {{found: [1, 2]}}\n    - {step}\n"
    play = Play(check_plan(SourceText("m.yaml", text), LEAVES, {}), {})
    play.line("", 0.0)
    assert play.bench.variables["found"] == [1, 2, 3]


def test_hint_for_a_random_wait_waits_between_its_bounds() -> None:
    step = hint_for("random_wait").removeprefix("write ")
    play = Play(check_plan(SourceText("m.yaml", f"mission: m\ntree: {{{step}}}\n"), LEAVES, {}), {})
    lines = [play.line("", 0.1) for _ in range(31)]
    ended = next(place for place, line in enumerate(lines) if "success" in line)
    assert 10 <= ended <= 30


def test_hint_for_a_probability_runs_the_node_in_half_of_the_cases() -> None:
    lines = played(follow("Probability", [leaf("a", "S")]), ticks=300)
    assert {status for status, _ in lines} == {"SUCCESS", "FAILURE"}
    assert 120 < sum(ticked == ["a S"] for _, ticked in lines) < 180


# --- other systems, as their pages say --------------------------------------------------------------------------------

Coroutine = Generator[None, None, str]
"""A behaviour of another system: yields at each tick in which it runs, and returns S or F."""


class Stage:
    """Scripted leaves and a condition, for a coroutine that says what a word does in its own system."""

    def __init__(self, outcomes: dict[str, str]) -> None:
        self._outcomes = {name: cycle(letters) for name, letters in outcomes.items()}
        self.true = True
        self.log: list[str] = []

    def run(self, name: str) -> Coroutine:
        """Run a leaf to its end."""
        while True:
            outcome = next(self._outcomes[name])
            self.log.append(f"{name} {outcome}")
            if outcome != "R":
                return outcome
            yield

    def play(self, root: Coroutine, condition: str) -> list[Line]:
        """Run a coroutine up to its end, or for so many ticks as one of our trees is played."""
        lines = []
        for tick in range(TICKS):
            self.true = condition[tick % len(condition)] == "S"
            self.log = []
            ended = step(root)
            lines.append((f"{STATUS_WORDS[STATUSES[ended or 'R']]}".upper(), self.log))
            if ended:
                break
        return lines


def step(coroutine: Coroutine) -> str:
    """Run a coroutine for a tick; return its result, or an empty text while it runs."""
    try:
        next(coroutine)
    except StopIteration as end:
        return str(end.value)
    return ""


def first_success(stage: Stage, names: str) -> Coroutine:
    for name in names:
        if (yield from stage.run(name)) == "S":
            return "S"
    return "F"


def both(stage: Stage, names: str) -> Coroutine:
    for name in names:
        if (yield from stage.run(name)) == "F":
            return "F"
    return "S"


def failed_when(stage: Stage) -> Coroutine:
    result = yield from stage.run("a")
    return "F" if stage.true else result


def failure_if(stage: Stage) -> Coroutine:
    return "F" if stage.true else (yield from stage.run("a"))


def success_if(stage: Stage) -> Coroutine:
    return "S" if stage.true else (yield from stage.run("a"))


def guarded(stage: Stage) -> Coroutine:
    return (yield from stage.run("a")) if stage.true else "F"


def chosen(stage: Stage) -> Coroutine:
    return (yield from stage.run("a" if stage.true else "b"))


def handled(stage: Stage) -> Coroutine:
    """Run b after a failure of a; the failure remains."""
    if (yield from stage.run("a")) == "S":
        return "S"
    yield from stage.run("b")
    return "F"


def repeated_until(stage: Stage) -> Coroutine:
    while not stage.true and (yield from stage.run("a")) == "S":
        yield
    return "S"


def done_while(stage: Stage) -> Coroutine:
    while (yield from stage.run("a")) == "S" and stage.true:
        yield
    return "S"


def done_until(stage: Stage) -> Coroutine:
    while (yield from stage.run("a")) == "S" and not stage.true:
        yield
    return "S"


def looped_on_condition(stage: Stage) -> Coroutine:
    while True:
        yield from stage.run("a")
        if not stage.true:
            return "S"
        yield


def steady(stage: Stage, *, value: bool) -> Coroutine:
    """Wait while the condition has a value."""
    while stage.true is value:
        yield
    return "S"


def triggered(stage: Stage) -> Coroutine:
    """Wait for a change: a condition that is true already does not count."""
    yield from steady(stage, value=True)
    yield from steady(stage, value=False)
    return "S"


def endless(_: Stage) -> Coroutine:
    while True:
        yield


def beside_main(stage: Stage) -> Coroutine:
    """Run a; start b again whenever it has ended meanwhile."""
    main, background = stage.run("a"), stage.run("b")
    while not (ended := step(main)):
        if step(background):
            background = stage.run("b")
        yield
    return ended


def first_of_all(stage: Stage) -> Coroutine:
    running = {name: stage.run(name) for name in "ab"}
    while running:
        for name in list(running):
            if ended := step(running[name]):
                del running[name]
            if ended == "S":
                return "S"
        if running:
            yield
    return "F"


def most_useful(stage: Stage) -> Coroutine:
    """Prefer a while the condition holds, else b; the other one is tried after a failure."""
    preferred, current = stage.true, first_success(stage, "ab" if stage.true else "ba")
    while not (ended := step(current)):
        yield
        if stage.true != preferred:
            preferred, current = stage.true, first_success(stage, "ab" if stage.true else "ba")
    return ended


def all_ended(stage: Stage) -> Coroutine:
    running, ends = {name: stage.run(name) for name in "ab"}, []
    while True:
        for name in list(running):
            if ended := step(running[name]):
                del running[name]
                ends.append(ended)
        if not running:
            return "F" if "F" in ends else "S"
        yield


def first_end_of(stage: Stage) -> Coroutine:
    running = [stage.run(name) for name in "ab"]
    while True:
        for each in running:
            if ended := step(each):
                return ended
        yield


def ignoring(stage: Stage) -> Coroutine:
    yield from stage.run("a")
    return "S"


def failing(stage: Stage) -> Coroutine:
    yield from stage.run("a")
    return "F"


def until_success(stage: Stage) -> Coroutine:
    while (yield from stage.run("a")) == "F":
        yield
    return "S"


def until_failure(stage: Stage) -> Coroutine:
    while (yield from stage.run("a")) == "S":
        yield
    return "F"


def skipped_once_false(stage: Stage) -> Coroutine:
    """Run a while the condition holds, then b."""
    child = stage.run("a")
    while stage.true:
        if ended := step(child):
            return ended if ended == "F" else (yield from stage.run("b"))
        yield
    return (yield from stage.run("b"))


def while_true(stage: Stage) -> Coroutine:
    child = stage.run("a")
    while stage.true:
        if ended := step(child):
            return ended
        yield
    return "F"


A, AB, IF_A, IF_AB = ("a",), ("a", "b"), (CONDITION, "a"), (CONDITION, "a", "b")
PAGES: dict[str, tuple[Sequence[object], Callable[[Stage], Coroutine]]] = {
    # LimboAI
    "RepeatUntilSuccess": (A, until_success),
    "AlwaysSucceed": (A, ignoring),
    "AlwaysFail": (A, failing),
    # Unreal
    "Simple Parallel": (AB, beside_main),
    "BlackboardCondition": (IF_A, guarded),
    "ConditionalLoop": (IF_A, looped_on_condition),
    "ConditionalAbort": (A, while_true),
    # Unity Behavior Designer
    "ParallelSelector": (AB, first_of_all),
    "ParallelComplete": (AB, first_end_of),
    "PrioritySelector": (AB, lambda stage: first_success(stage, "ab")),
    "UtilitySelector": (("battery.percent", "50", "a", "b", "b", "a"), most_useful),
    "ConditionalEvaluator": (IF_A, guarded),
    "ReturnSuccess": (A, ignoring),
    "ReturnFailure": (A, failing),
    "UntilSuccess": (A, until_success),
    # Behavior3
    "Runner": ((), endless),
    "MemPriority": (AB, lambda stage: first_success(stage, "ab")),
    # SkiROS2
    "SerialStar": (AB, lambda stage: both(stage, "ab")),
    "SelectorStar": (AB, lambda stage: first_success(stage, "ab")),
    "NoFail": (A, ignoring),
    # BehaviorTree.CPP
    "_failureIf": (IF_A, failure_if),
    "_successIf": (IF_A, success_if),
    # SMACH, FlexBE
    "Concurrence": (AB, all_ended),
    "DecisionState": (IF_AB, chosen),
    # scenario_execution
    "one_of": (AB, first_end_of),
    # Home Assistant
    "choose": (IF_AB, chosen),
    "wait_for_trigger": ((CONDITION, CONDITION), triggered),
    "do_until": (IF_A, done_until),
    "do_while": (IF_A, done_while),
    # GitHub Actions
    "continue-on-error": (A, ignoring),
    "needs": (AB, lambda stage: both(stage, "ab")),
    # Ansible
    "ignore_errors": (A, ignoring),
    "rescue": (AB, lambda stage: first_success(stage, "ab")),
    "failed_when": (IF_A, failed_when),
    # Scratch
    "forever": (A, until_failure),
    "repeat until": (IF_A, repeated_until),
}
"""Words, each with what fills the open places of its hint, and what it does in its own system."""


@pytest.mark.parametrize("word", PAGES)
def test_hint_gives_what_the_page_of_the_word_says(word: str) -> None:
    fill, meaning = PAGES[word]
    for seed in SEEDS:
        random = Random(seed)  # noqa: S311 - as a test draws
        outcomes = {name: "".join(random.choices("RSF", k=random.randint(1, 4))) for name in "ab"}
        condition = "".join(random.choices("SF", k=random.randint(1, 5)))
        stage = Stage(outcomes)
        expected = stage.play(meaning(stage), condition)
        tree = follow(word, [leaf(each, outcomes[each]) if each in AB else each for each in fill], value=True)
        assert played(tree, condition, len(expected)) == expected, f"{word}: {flow(tree)} with {condition}"


@pytest.mark.parametrize("word", ["DynamicSelector", "SelectorEvaluator", "DynamicSequence"])
def test_hint_for_a_dynamic_composite_starts_with_the_first_child_at_every_tick(word: str) -> None:
    composite = composites.Sequence if word == "DynamicSequence" else composites.Selector
    for seed in SEEDS:
        random = Random(seed)  # noqa: S311 - as a test draws
        outcomes = {name: "".join(random.choices("SF" if name != "c" else "RSF", k=4)) for name in "abc"}
        log: list[str] = []
        root = composite("x", memory=False, children=[Told(*each, log) for each in outcomes.items()])
        lines = []
        for _ in range(TICKS):
            log.clear()
            root.tick_once()
            lines.append((STATUS_WORDS[root.status].upper(), list(log)))
        assert played(follow(word, [leaf(*each) for each in outcomes.items()])) == lines


def test_hint_for_while_of_behaviortree_cpp_goes_on_behind_the_node() -> None:
    beside = [each.replace("CONDITION", CONDITION) for each in re.findall(r"'([^']*)'", hint_for("_while"))]
    for seed in SEEDS:
        random = Random(seed)  # noqa: S311 - as a test draws
        outcomes = {name: "".join(random.choices("RSF", k=random.randint(1, 4))) for name in "ab"}
        condition = "".join(random.choices("SF", k=random.randint(1, 5)))
        stage = Stage(outcomes)
        expected = stage.play(skipped_once_false(stage), condition)
        node = leaf("a", outcomes["a"])
        for each in beside:
            node |= yaml.safe_load(each)
        tree = {"sequence": [node, leaf("b", outcomes["b"])]}
        assert played(tree, condition, len(expected)) == expected, f"{flow(tree)} with {condition}"


def limited(stage: Stage, *, runs: int, counted: str) -> Coroutine:
    """Run a until that many of its ends are counted, then c instead of each failure."""
    done = 0
    while True:
        ended = yield from (stage.run("a") if done < runs else both(stage, "c"))
        if done < runs:
            done += ended in counted
            if ended == "F":
                yield from stage.run("c")
        yield


@pytest.mark.parametrize(
    ("word", "runs", "counted"), [("RunLimit", 2, "S"), ("Limiter", 2, "SF"), ("SingleTrigger", 1, "SF")]
)
def test_hint_for_a_number_of_runs_fails_after_them(word: str, runs: int, counted: str) -> None:
    start = re.search(r"'(set: [^']*)'", hint_for(word))
    assert start is not None
    for seed in SEEDS:
        random = Random(seed)  # noqa: S311 - as a test draws
        outcomes = {"a": "".join(random.choices("RSF", k=random.randint(1, 4))), "c": "S"}
        form = follow(word, [*([runs] if word != "SingleTrigger" else []), leaf("a", outcomes["a"])])
        tree = {"sequence": [yaml.safe_load(start[1]), {"selector": [form, leaf("c", "S")], "repeat": "forever"}]}
        stage = Stage(outcomes)
        assert played(tree) == stage.play(limited(stage, runs=runs, counted=counted), "S"), flow(tree)


@pytest.mark.parametrize("word", ["retries", "do_jump"])
def test_hint_for_further_rounds_counts_the_first_one_too(word: str) -> None:
    letter, status = ("F", "FAILURE") if word == "retries" else ("S", "SUCCESS")
    assert "plus 1" in hint_for(word)
    ours = re.search(r"'(\w+): N'", hint_for(word))
    assert ours is not None
    assert story(played({**leaf("a", letter), ours[1]: 3 + 1})) == (status, [f"a {letter}"] * 4)


@pytest.mark.parametrize("word", ["Succeeder", "Failer"])
def test_hint_for_a_constant_result_holds_as_a_step_and_around_a_behaviour(word: str) -> None:
    alone, around = re.findall(r"'([^']*)'", hint_for(word))
    status = "SUCCESS" if word == "Succeeder" else "FAILURE"
    assert played({alone: None}, ticks=1) == [(status, [])]
    for outcome in "SF":
        assert played(leaf("a", outcome) | yaml.safe_load(around), ticks=1) == [(status, [f"a {outcome}"])]


@pytest.mark.parametrize("word", ["timeout-minutes", "continue_on_timeout"])
def test_hint_for_a_limit_ends_a_running_node_with_the_result_of_the_word(word: str) -> None:
    form = re.search(r"write '([^']*)'", hint_for(word))
    assert form is not None
    limit, status = ("1 min", "FAILURE") if word == "timeout-minutes" else ("950 ms", "SUCCESS")
    beside = form[1].replace("N min", limit).replace("TIME", limit)
    lines = played({**leaf("a", "R"), **yaml.safe_load(beside)}, ticks=605)
    ended = next(tick for tick, (status, _) in enumerate(lines) if status != "RUNNING")
    assert (lines[ended][0], ended) == (status, 600 if limit == "1 min" else 10)


@pytest.mark.parametrize("word", ["WaitState", "WaitForDuration", "NAV_LOITER_TIME", "CONDITION_DELAY", "elapsed"])
def test_hint_for_a_waiting_state_waits(word: str) -> None:
    tree = dict.fromkeys(re.findall(r"write '(\w+)'", hint_for(word)), "250 ms")
    assert [status for status, _ in played(tree, ticks=4)] == ["RUNNING", "RUNNING", "RUNNING", "SUCCESS"]


def test_hint_for_a_service_runs_it_every_half_second_beside_the_behaviour() -> None:
    tree = follow("Service", [leaf("a", "RRRRRRRRRRRS"), leaf("b", "F")])
    lines = played(tree, ticks=12)
    assert lines[-1] == ("SUCCESS", ["a S"])
    assert {status for status, _ in lines[:-1]} == {"RUNNING"}
    succeeding = follow("Service", [leaf("a", "RRRRRRRRRRRS"), leaf("b", "S")])
    assert [tick for tick, (_, ticked) in enumerate(played(succeeding, ticks=12)) if "b S" in ticked] == [0, 6]


def stored(*steps: str, ticks: int = 1) -> dict[str, Any]:
    """Play steps one after another; return the variables of the mission."""
    text = "mission: m\ntree:\n  sequence:\n" + "".join(f"    - {each}\n" for each in steps)
    play = Play(check_plan(SourceText("m.yaml", text), {**LEAVES, "probe": Probe}, {}), {})
    for _ in range(ticks):
        play.line("", 0.1)
    return dict(play.bench.variables)


def written(word: str, **names: str) -> str:
    """Return the step that a hint says, with its capitals replaced."""
    form = hint_for(word).removeprefix("write ").strip("'")
    for name, value in names.items():
        form = re.sub(rf"\b{name}\b", value, form)
    return form


@pytest.mark.parametrize(
    ("word", "names", "value"),
    [
        ("SetBlackboard", {"NAME": "x", "VALUE": "3"}, 3),
        ("SetBlackboardVariable", {"NAME": "x", "VALUE": "yes"}, "yes"),
        ("set_fact", {"NAME": "x", "VALUE": "3"}, 3),
        ("CalculationState", {"NAME": "x", "EXPRESSION": "2 * old"}, 10),
        ("change_variable_by", {"NAME": "old"}, 6),
        ("increment", {"NAME": "old"}, 6),
        ("decrement", {"NAME": "old"}, 4),
        ("AddToVector", {"LIST": "list", "ITEM": "9"}, [7, 8, 9]),
        ("GetElementOfVector", {"NAME": "x", "LIST": "list"}, 7),
        ("GetSizeOfVector", {"NAME": "x", "LIST": "list"}, 2),
        ("ResetVector", {"NAME": "list"}, []),
    ],
)
def test_hint_for_a_calculation_stores_its_value(word: str, names: dict[str, str], value: object) -> None:
    found = stored("set: {old: 5}", "set: {list: [7, 8]}", written(word, **names))
    assert found[next(iter(names.values()))] == value


@pytest.mark.parametrize("word", ["Iterator", "foreach", "with_items", "with_dict", "matrix", "LoopInt"])
def test_hint_for_an_iteration_runs_the_behaviour_for_each_member(word: str) -> None:
    add = {"set": {"seen": "${seen + [item]}"}}
    tree = follow(word, [["red", "blue"], "item", add])
    assert stored("set: {seen: []}", flow(tree), ticks=2)["seen"] == ["red", "blue"]


@pytest.mark.parametrize("word", ["emit", "broadcast", "SendEvent", "fire_event"])
def test_hint_for_an_event_lets_the_waiting_go_on(word: str) -> None:
    sends, resets, waits, _ = (each.replace("NAME", "done") for each in re.findall(r"'([^']*)'", hint_for(word)))
    tree = (
        f"{{parallel: [{{sequence: [{{wait: 250 ms}}, {{{sends}}}]}}, {{sequence: [{{{waits}}}, {leaf('a', 'S')}]}}]}}"
    )
    lines = played({"sequence": [yaml.safe_load(resets), yaml.safe_load(tree)]}, ticks=4)
    assert lines == [("RUNNING", []), ("RUNNING", []), ("RUNNING", []), ("SUCCESS", ["a S"])]


def test_hint_for_a_received_message_runs_the_script_each_time() -> None:
    tree = follow("when_i_receive", ["done", "done", leaf("a", "S")])
    sender = {"sequence": [{"set": {"done": True}}, {"wait": "250 ms"}], "repeat": 3}
    lines = played({"sequence": [{"set": {"done": False}}, {"race": [sender, tree]}]}, ticks=14)
    assert story(lines) == ("SUCCESS", ["a S"] * 3)


@pytest.mark.parametrize("word", ["register", "response_variable"])
def test_hint_for_a_result_stores_it(word: str) -> None:
    node = follow(word, [{"probe": {"outcomes": "success", "finds": 7}}], "answer")
    assert stored(flow(node))["answer"] == 7


@pytest.mark.parametrize("word", ["SubTree", "RunBehavior", "include_tasks", "BehaviorTreeReference", "link_call"])
def test_hint_for_a_tree_in_a_tree_runs_that_mission(word: str, tmp_path: Path) -> None:
    inner = tmp_path / "inner.yaml"
    inner.write_text("mission: inner\ntree: {set: {n: 3}}\nreturns: {n: n}\n")
    tree = {"sequence": [follow(word, []) | {"mission": "inner"}, {"check": "n == 3"}]}
    text = f"mission: m\ntree: {flow(tree)}\n"
    play = Play(check_plan(SourceText("m.yaml", text), LEAVES, {}, find_mission=lambda *_: inner), {})
    assert "success" in play.line("", 0.0)


def file_hints(text: str) -> list[str]:
    with pytest.raises(InvalidFileError) as caught:
        check_plan(SourceText("m.yaml", text), LEAVES, {})
    return [f"{each.message} > {each.suggestion}" for each in caught.value.diagnostics]


@pytest.mark.parametrize(
    ("key", "value", "ours"),
    [("inputs", "{who: {default: Anna, description: whom}}", "params"), ("vars", "{who: Anna}", "params")]
    + [(word, "{sequence: [{set: {n: 3}}]}", "tree") for word in ("steps", "tasks")],
)
def test_key_of_another_system_at_the_top_is_answered_with_ours(key: str, value: str, ours: str) -> None:
    if ours == "params":
        text = f'mission: m\nKEY: {value}\ntree: {{set: {{n: "${{who}}"}}}}\n'
    else:
        text = f"mission: m\nKEY: {value}\n"
    assert f"a mission has no key '{key}' > write '{ours}'" in file_hints(text.replace("KEY", key))
    text = text.replace("KEY", ours)
    if "description" in text:
        assert file_hints(text) == ["param 'who' has no key 'description' > write 'help'"]
        text = text.replace("description", "help")
    play = Play(check_plan(SourceText("m.yaml", text), LEAVES, {}), {})
    play.line("", 0.0)
    assert play.bench.variables["n"] == ("Anna" if ours == "params" else 3)


def function_answer(call: str) -> str:
    """Return what the checker says to a function of another system in a condition."""
    return file_hints(f"mission: m\ntree: {{stop: , if: '{call}'}}\n")[0]


@pytest.mark.parametrize("call", ["always()", "${{ always() }}"])
def test_answer_to_always_runs_the_step_after_every_end(call: str) -> None:
    assert function_answer(call).startswith(
        "'if': 'always' cannot be called; put the step under 'finally:' beside the steps before it"
    )
    for outcome, status in (("S", "SUCCESS"), ("F", "FAILURE")):
        assert played({"sequence": [leaf("a", outcome)], "finally": leaf("b", "S")}, ticks=1) == [
            (status, [f"a {outcome}", "b S"])
        ]


def test_answer_to_failure_runs_the_step_after_a_failure_only() -> None:
    form = re.search(r"write (\{.*\})", function_answer("failure()"))
    assert form is not None
    for seed in SEEDS:
        random = Random(seed)  # noqa: S311 - as a test draws
        outcomes = {name: "".join(random.choices("RSF", k=random.randint(1, 4))) for name in "ab"}
        stage = Stage(outcomes)
        expected = stage.play(handled(stage), "S")
        tree = _filled(form[1], [leaf(name, outcomes[name]) for name in "ab"])
        assert played(tree, ticks=len(expected)) == expected


def test_answer_to_pick_random_draws_whole_numbers_between_both() -> None:
    form = re.search(r"write (.*) for a whole number", function_answer("pick_random(1, 6) == 1"))
    assert form is not None
    step = f"{{set: {{seen: '${{seen + [{form[1]}]}}'}}, repeat: 600}}"
    drawn = stored("set: {seen: []}", step, ticks=600)["seen"]
    assert set(drawn) == {1, 2, 3, 4, 5, 6}
    assert all(70 < drawn.count(number) < 130 for number in set(drawn))  # each in a sixth of the cases
