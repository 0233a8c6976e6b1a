"""Parallels with counts against BehaviorTree.CPP: random trees end alike, tick by tick and leaf by leaf."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import count
from random import Random
from typing import Any

from py_trees.common import Status

from behaviours.leaf import Leaf, argument
from config.diagnostics import SourceText
from missions.executive.events import STATUS_WORDS
from missions.executive.parallel import Parallel
from missions.language.document import check_plan
from missions.language.expressions import Value
from missions.language.parallel_counts import ALL_CHILDREN, FAILURE_COUNT, SUCCESS_COUNT, WAIT_FOR_ALL
from tests.behaviortree_cpp import ask_behaviortree_cpp, needs_behaviortree_cpp
from tests.conformance.harness import Play
from tests.conformance.probes import Bench
from tests.tries import tries

TREES = tries(200, most=2000)
FIRST_SEED = 700_000
TICKS = 8
STATUSES = {"R": Status.RUNNING, "S": Status.SUCCESS, "F": Status.FAILURE}


class Scripted(Leaf):
    """Give these outcomes in turn, one letter a tick, over and over, and write down each of them, and each halt."""

    tag = "scripted"
    outcomes: str = argument("text", "the letters R, S and F", principal=True)
    run: Bench
    _given = 0

    def update(self) -> Status:
        outcome = self.outcomes[self._given % len(self.outcomes)]
        self._given += 1
        self.run.log.append(f"{self.name} {outcome}")
        return STATUSES[outcome]

    def terminate(self, new_status: Status) -> None:
        if new_status is Status.INVALID:
            self.run.log.append(f"{self.name} halts")


WORDS = {Scripted.tag: Scripted}


@dataclass
class Pair:
    """One tree, written for both: ``ours`` is a node of a mission, ``xml`` its counterpart.

    ``counts`` are the settings of its parallels, by their names.
    """

    ours: dict[str, Any]
    xml: str
    outcomes: dict[str, str] = field(default_factory=dict)
    counts: dict[str, dict[str, object]] = field(default_factory=dict)

    def play(self) -> Play:
        """Build our tree. `mission check` would refuse some of the counts: they are set behind its back."""
        text = f"mission: pair\ntree: {json.dumps(self.ours)}\n"
        play = Play(check_plan(SourceText("pair", text), WORDS, {}), {})
        for name, settings in self.counts.items():
            parallel = play.nodes[name]
            assert isinstance(parallel, Parallel)
            parallel.counts = {word: Value(value) for word, value in settings.items()}
        return play

    def request(self) -> dict[str, Any]:
        """Return the tree as the other program reads it."""
        xml = f'<root BTCPP_format="4"><BehaviorTree ID="Main">{self.xml}</BehaviorTree></root>'
        return {"xml": xml, "outcomes": self.outcomes, "ticks": TICKS}


def tree(random: Random, number: Iterator[int], depth: int = 3) -> Pair:
    """Draw a tree: composites at the top, leaves at ``depth`` 0."""
    if depth == 0 or (depth < 3 and random.random() < 0.3):
        return _inverted(random, _leaf(random, f"n{next(number)}"))
    children = [tree(random, number, depth - 1) for _ in range(random.randint(1, 4))]
    draw = random.choice((_parallel, _parallel, _parallel_all, _in_order))
    made = draw(random, f"n{next(number)}", children)
    for child in children:
        made.outcomes |= child.outcomes
        made.counts |= child.counts
    return _inverted(random, made)


def _leaf(random: Random, name: str) -> Pair:
    outcomes = "".join(random.choices("RSF", weights=(2, 1, 1), k=random.randint(1, 4)))
    return Pair({"scripted": outcomes, "name": name}, f'<Probe name="{name}"/>', {name: outcomes})


def _inverted(random: Random, pair: Pair) -> Pair:
    if random.random() < 0.2:
        return replace(pair, ours=pair.ours | {"invert": True}, xml=f"<Inverter>{pair.xml}</Inverter>")
    return pair


def _in_order(random: Random, name: str, children: list[Pair]) -> Pair:
    ours, theirs = random.choice((("sequence", "Sequence"), ("selector", "Fallback")))
    return Pair({ours: [child.ours for child in children], "name": name}, _xml(theirs, name, children))


def _parallel(random: Random, name: str, children: list[Pair]) -> Pair:
    """Draw any counts, or none; where there is none, each side has its default."""
    chosen = {
        word: random.choice((None, ALL_CHILDREN, *range(1, len(children) + 1)))
        for word in (SUCCESS_COUNT, FAILURE_COUNT)
    }
    settings = {word: count for word, count in chosen.items() if count is not None}
    theirs = {word: -1 if count == ALL_CHILDREN else count for word, count in settings.items()}
    xml = _xml("Parallel", name, children, **theirs)
    return Pair({"parallel": [child.ours for child in children], "name": name}, xml, counts={name: settings})


def _parallel_all(random: Random, name: str, children: list[Pair]) -> Pair:
    """Draw any counts beside `wait_for_all`.

    BehaviorTree.CPP has one count there: as many failures as are too many, or as leave too few that could succeed.
    """
    failures, successes = random.randint(1, len(children)), random.randint(1, len(children))
    settings: dict[str, object] = {FAILURE_COUNT: failures, SUCCESS_COUNT: successes, WAIT_FOR_ALL: True}
    xml = _xml("ParallelAll", name, children, max_failures=min(failures, len(children) - successes + 1))
    return Pair({"parallel": [child.ours for child in children], "name": name}, xml, counts={name: settings})


def _xml(kind: str, name: str, children: list[Pair], **ports: object) -> str:
    beside = "".join(f' {port}="{value}"' for port, value in ports.items())
    return f'<{kind} name="{name}"{beside}>{"".join(child.xml for child in children)}</{kind}>'


def ours(pair: Pair) -> list[list[Any]]:
    """Play the tree here; return the same as the other program does."""
    play = pair.play()
    told = []
    for tick in range(TICKS):
        happened = play.line("", 0.1 if tick else 0.0).split(", ")
        ticked = [entry for entry in happened if entry[-2:] in (" R", " S", " F")]
        halted = sorted(entry.removesuffix(" halts") for entry in happened if entry.endswith(" halts"))
        told.append([STATUS_WORDS[play.root.status].upper(), ticked, halted])
    return told


def theirs(pairs: list[Pair]) -> list[list[list[Any]]]:
    """Have BehaviorTree.CPP tick the trees, in a process of its own."""
    return ask_behaviortree_cpp([pair.request() for pair in pairs])


@needs_behaviortree_cpp
def test_random_parallels_with_counts_end_as_in_behaviortree_cpp() -> None:
    seeds = range(FIRST_SEED, FIRST_SEED + TREES)
    pairs = [tree(Random(seed), count()) for seed in seeds]  # noqa: S311 - as a test draws
    for seed, pair, expected in zip(seeds, pairs, theirs(pairs), strict=True):
        assert ours(pair) == expected, f"seed {seed}: {json.dumps(pair.ours)}\n{pair.xml}"
