"""Mocks: stand-ins for leaves, missions and composites that follow a script, independent of robot and world."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from enum import IntEnum
from fnmatch import fnmatchcase
from operator import itemgetter
from typing import Any

from py_trees.common import Status

from behaviours.leaf import FAILURE, RUNNING, SUCCESS, Leaf
from config.diagnostics import Mark
from missions.language.kinds import RecordKind, kind_of_type
from missions.language.nodes import MISSION, MODIFIERS
from missions.language.plan import Step
from missions.language.variables import return_kinds
from missions.plugins.testing.mock_results import make_result
from missions.plugins.testing.phrases import Phrase
from perception.api import Percept

# Script of a mock in a test file: ``fails twice, then succeeds``, ``runs for 2 s, then fails``.
#
# A script is a list of turns. Each start of a mock takes one, whether the mock ends or is halted
# before; the last turn is repeated. After counted failures (``fails twice``) the mock succeeds.

DEFAULT_REASON = "failed as requested"
"""Reason of a mock's failure if the script gives none."""

VERBS = ("succeeds", "fails", "runs")
EXAMPLE = "such as 'fails twice, then succeeds'"


@dataclass(frozen=True, slots=True)
class MockTurn:
    """Result of a mock for one of its starts: it runs for ``seconds`` and ``ticks``, then returns ``end``.

    ``end`` is success or failure, or running if the mock never ends (then both times are infinite). ``times`` is the
    number of consecutive starts to which this turn applies; ``is_counted`` is true if the script names it.
    """

    end: str
    times: int = 1
    seconds: float = 0.0
    ticks: float = 0.0
    reason: str = ""
    result: object = None
    is_counted: bool = field(default=False, compare=False)


Script = tuple[MockTurn, ...]


def read_script(phrase: Phrase, *, is_last: bool = True) -> Script:
    """Return the turns in the script of a mock; an error is reported, and the turns before it are returned.

    With ``is_last``, nothing follows the script: a mock that fails twice then succeeds, and the count of another last
    turn is an error.
    """
    turns: list[MockTurn] = []
    waited: MockTurn | None = None  # "runs for 2 s": the beginning of the next turn
    while True:
        turn = _read_turn(phrase, waited)
        waited = turn if turn.end == "running" and turn.seconds + turn.ticks < math.inf else None
        if waited is None:
            turns.append(turn)
        if phrase.word != ",":
            break
        phrase.take()
        if not phrase.take_if("then"):
            phrase.reject("the word after a comma", ("then",))
    if waited is not None:
        phrase.add_fault("the end after 'runs for' is missing", "write 'runs for 2 s, then succeeds', or 'runs' alone")
    if phrase.word == "then":
        phrase.add_fault("a comma is missing before 'then'", EXAMPLE)
    phrase.expect_end()
    if is_last and turns and turns[-1].is_counted:
        if turns[-1].end != "failure":
            phrase.add_fault("the starts after these are missing", _next_turn_hint(turns[-1].end))
        turns.append(MockTurn("success"))
    return tuple(turns)


def _next_turn_hint(end: str) -> str:
    verb = {"success": "succeeds", "running": "runs"}[end]
    return f"write '{verb} twice, then fails', or '{verb}' alone for all starts"


def _read_turn(phrase: Phrase, waited: MockTurn | None) -> MockTurn:
    verb = phrase.take_if(*VERBS)
    if not verb:
        phrase.reject(f"the script of a mock ({EXAMPLE})", VERBS)
    if verb == "runs":
        return _read_running(phrase, waited)
    turn = MockTurn("success") if verb == "succeeds" else MockTurn("failure", reason=DEFAULT_REASON)
    if waited is not None:
        turn = replace(turn, seconds=waited.seconds, ticks=waited.ticks)
    turn = _read_times(phrase, turn)
    if waited is None and phrase.take_if("after"):
        turn = _read_duration(phrase, turn)
    if verb == "fails" and phrase.take_if("because"):
        turn = replace(turn, reason=phrase.take_quoted("'because'"))
    return turn


def _read_running(phrase: Phrase, waited: MockTurn | None) -> MockTurn:
    if waited is not None:
        phrase.add_fault("it is already running", "write how that ends: 'succeeds' or 'fails'")
    if phrase.take_if("for"):
        return _read_duration(phrase, MockTurn("running"))
    return _read_times(phrase, MockTurn("running", seconds=math.inf, ticks=math.inf))


def _read_duration(phrase: Phrase, turn: MockTurn) -> MockTurn:
    """Return ``turn`` with the duration that the phrase names, such as ``3 ticks`` or ``2 s``."""
    if phrase.following_word in ("tick", "ticks"):
        turn = replace(turn, ticks=phrase.take_count("how many ticks"))
        phrase.take()
        return turn
    return replace(turn, seconds=phrase.take_quantity("how long", "duration"))


def _read_times(phrase: Phrase, turn: MockTurn) -> MockTurn:
    """Return ``turn`` with the number of starts that the phrase names, if it names one."""
    if phrase.following_word == "times":
        times = phrase.take_count("how often")
        phrase.take()
        return replace(turn, times=times, is_counted=True)
    word = phrase.take_if("once", "twice")
    return replace(turn, times=2 if word == "twice" else 1, is_counted=True) if word else turn


WILDCARDS = frozenset("*?")
"""Wildcard characters in the target of a mock."""


STUBS = "stubs"
"""Target of a mock for all stub leaves, which cannot run without a mock."""


@dataclass(frozen=True, slots=True)
class MockSpec:
    """A mock in a test file: its target (see ``matches_step``), its script, and its place in the file."""

    target: str
    script: Script
    mark: Mark = field(default_factory=Mark, compare=False)


class TurnSequence:
    """Turns of one script, shared by all mocks that follow it.

    If a mock is halted, the next mock goes on with the next turn; the script does not start again.
    """

    def __init__(self, script: Script) -> None:
        self._left = [turn for turn in script for _ in range(turn.times)]

    def take(self) -> MockTurn:
        """Return the next turn of the script; after the end of the script, return its last turn each time."""
        return self._left.pop(0) if len(self._left) > 1 else self._left[0]


class Mock(Leaf):
    """Replaces another leaf: makes the same claims, takes the same arguments, and follows a script.

    ``mission`` is the name of the mission that it replaces, empty if it replaces another node.
    """

    mission = ""

    _turns: TurnSequence
    _turn: MockTurn
    _output: Callable[[object], object]
    _keeps_failed = False
    _ticks = 0

    def set_script(
        self, turns: TurnSequence, output: Callable[[object], object], *, keeps_failed: bool = False
    ) -> None:
        """Set the turns of the mock, and ``output``, a function that makes the mock's output from the result in a turn.

        The function is called when the mock succeeds; with ``keeps_failed``, also when it fails.
        """
        self._turns, self._output, self._keeps_failed = turns, output, keeps_failed

    def initialise(self) -> None:
        self._turn, self._ticks = self._turns.take(), 0

    def update(self) -> Status:
        """Run until the turn is over, then return its end status."""
        turn = self._turn
        # A duration of a whole number of ticks ends with the last of them, despite rounding.
        if self._ticks < turn.ticks or self.elapsed < turn.seconds - 1e-6:
            self._ticks += 1
            return RUNNING
        if turn.end == "failure":
            self.feedback_message = turn.reason
            if self._keeps_failed:
                self._output(turn.result)
            return FAILURE
        self.result = self._output(turn.result)
        return SUCCESS


class TargetMatch(IntEnum):
    """How the target of a mock matches a step; of several mocks, the closest match replaces the step."""

    NAME = 0
    WORD = 1
    WILDCARD = 2


def match_step(target: str, step: Step) -> TargetMatch | None:
    """Return how a mock for ``target`` matches this step; None if it does not.

    A leaf matches by its word or name, a sub-mission by its own name or the name given to the step, a composite by the
    name given to it; ``*`` and ``?`` are wildcards, for leaves and sub-missions, and ``stubs`` is any stub leaf.
    """
    if step.kind in MODIFIERS:
        return None
    word = step.word
    if target == step.name and step.name != word:
        return TargetMatch.NAME
    if step.leaf is None and step.kind != MISSION:
        return None
    if target == word:
        return TargetMatch.WORD
    is_match = WILDCARDS.intersection(target) and any(fnmatchcase(name, target) for name in (step.name, word))
    is_stub = target == STUBS and step.leaf is not None and bool(step.leaf.stub)
    return TargetMatch.WILDCARD if is_match or is_stub else None


def matches_step(target: str, step: Step) -> bool:
    """Return whether a mock for ``target`` can replace this step."""
    return match_step(target, step) is not None


def closest_target(targets: Iterable[str], step: Step) -> str | None:
    """Return the target that matches ``step`` most closely, the first of equally close ones; None if none matches."""
    matches = [(match, target) for target in targets if (match := match_step(target, step)) is not None]
    return min(matches, key=itemgetter(0))[1] if matches else None


def find_left_out(tree: Step, targets: Iterable[str]) -> dict[str, str]:
    """Return the names and targets of which a run builds no node, since all their nodes are below mocked ones.

    The value is the reason of one of them, such as "'fetch' is mocked by '*'".
    """
    known, left_out, built = tuple(targets), dict[str, str](), set[str | None]()

    def visit(step: Step, reason: str) -> None:
        target = closest_target(known, step)
        names = () if step.kind in MODIFIERS else (step.kind, step.word, step.name, target)
        if reason:
            left_out.update({name: reason for name in names if name})
        else:
            built.update(names)
        if target is not None and step.leaf is None:
            reason = reason or f"'{step.name}' is mocked by '{target}'"
        for child in step.children:
            visit(child, reason)

    visit(tree, "")
    return {name: reason for name, reason in left_out.items() if name not in built}


class MockSubstitution:
    """Replaces leaves, missions and composites with mocks while a tree is built.

    If several mocks match a step, the closest match replaces it, and the first of equally close ones. All steps that
    one mock replaces share its script: ``gesture: fails twice`` covers the first two gestures.
    """

    def __init__(self, specs: Iterable[MockSpec]) -> None:
        self._turns = {spec.target: TurnSequence(spec.script) for spec in specs}

    def __call__(self, step: Step, leaf: Leaf | None) -> Leaf | None:
        """Return the mock that replaces a step; without one, return ``leaf`` (None if the step is not a leaf)."""
        target = closest_target(self._turns, step)
        if target is None:
            return leaf
        turns = self._turns[target]
        return _mock_step(step, turns) if leaf is None else _mock_leaf(leaf, turns)


def _mock_leaf(leaf: Leaf, turns: TurnSequence) -> Mock:
    # A class of its own, since the claims of a leaf are class attributes.
    own = {"tag": leaf.tag, "drives": leaf.drives, "acts": leaf.acts, "open_ended": leaf.open_ended,
           "output_doc": leaf.output_doc, "arguments": leaf.arguments}  # fmt: skip
    mock_class: Any = type(f"Mock{type(leaf).__name__}", (Mock,), own)
    mock: Mock = mock_class(leaf.name)
    kind = kind_of_type(leaf.output_type)
    is_percept = isinstance(leaf.output_type, type) and issubclass(leaf.output_type, Percept)
    without_result: object = {} if is_percept else None

    def output(result: object) -> object:
        return make_result(kind, without_result if result is None else result, mock.run.now())

    mock.set_script(turns, output)
    return mock


def _mock_step(step: Step, turns: TurnSequence) -> Mock:
    """Return a mock in place of a mission or a composite, and of all nodes below it."""
    mock_class: Any = type("MockTree", (Mock,), {"tag": step.kind, "drives": step.claims, "mission": step.text})
    mock: Mock = mock_class(step.name)
    kind = RecordKind("the results of a mission", members=return_kinds(step) if step.kind == MISSION else {})

    def output(result: object) -> object:
        made = make_result(kind, result, mock.run.now())
        given = made if isinstance(made, dict) else {}
        results = {name: value for name, value in given.items() if name in kind.members}
        mock.scope.update(results if step.output_variable is None else {step.output_variable: results})
        mock.run.variables_changed = True
        return results

    mock.set_script(turns, output, keeps_failed=step.kind == MISSION)
    return mock
