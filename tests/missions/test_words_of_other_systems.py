"""Hints for words of other systems: who follows one to the letter gets what the word means there.

Each word is answered by the checker. Its hint is made into a tree as it says, with scripted leaves in the places that
it leaves open, and played beside the tree that the word belongs to: in BehaviorTree.CPP, in py_trees, or as its own
page says in a few lines of Python.
"""

import json
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
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
from tests.conformance.probes import Bench

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
    if found := re.fullmatch(r"write (\{.*\})", hint):
        return _filled(found[1], fill)
    if found := re.fullmatch(r"write (switch: .*)", hint):
        return _filled(f"{{{found[1]}}}", fill)
    if found := re.fullmatch(r"write '([^']*)', beside a behaviour", hint):
        ours = found[1] if ":" in found[1] else f"{found[1]}: {json.dumps(value)}"
        return {**fill[0], **yaml.safe_load(ours.replace("...", CONDITION))}
    found = re.fullmatch(r"write '(\w+)'|did you mean '(\w+)'\?", hint)
    assert found is not None, hint
    ours = found[1] or found[2]
    return {**fill[0], ours: value} if ours in MODIFIERS else {ours: list(fill)}


def _filled(form: str, fill: Sequence[object]) -> Tree:
    left = iter(fill)
    form = re.sub(r"\bon:", '"on":', form)  # which PyYAML takes for true
    form = re.sub(r"\b(CONDITION|EXPRESSION|VALUE)\b", lambda _: str(next(left)), form)
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


@pytest.mark.parametrize("word", ["Cleanup", "on_exit", "teardown", "ensure", "Finally"])
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
    "emergency_stop every memory policy StateMachine Iterator Count PassThrough LoopInt SkipUnlessUpdated"
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
