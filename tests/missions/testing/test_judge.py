"""Each expectation, held against a run in which it came true and one in which it did not."""

from collections.abc import Sequence

import pytest

from config.diagnostics import Mark
from drivers.api import Pose2D
from missions.executive.events import CommandSent, Event, FaultRaised, Logged, NodeChanged, Notified, ReflexFired
from missions.executive.executive import Result
from missions.plugins.testing.case_history import CaseHistory
from missions.plugins.testing.case_verdict import CHECKS, check_expectations
from missions.plugins.testing.event_specs import EventSpec
from missions.plugins.testing.expectations import Expectation, ExpectedItem, PoseTarget


def node(time: float, name: str, status: str, reason: str = "", *, key: str = "1.1", kind: str = "leaf") -> Event:
    return NodeChanged(time, 1, key, name, kind, 1, status, reason)


EVENTS: Sequence[Event] = (
    node(0.0, "look", "running", key="1.1"),
    node(0.0, "tree", "running", key="1", kind="sequence"),
    node(1.0, "look", "failure", "too far", key="1.1"),
    node(1.0, "look", "running", key="1.1"),
    node(2.0, "look", "success", key="1.1"),
    node(2.0, "ask", "success", key="1.2"),
    CommandSent(2.0, 1, "voice", "say (1.3)", {"say": "Hello, you"}),
    Logged(2.0, "voice", "Hello, you"),
    CommandSent(2.0, 1, "screen", "face (1.4)", {"mood": "happy"}),
    CommandSent(2.1, 1, "screen", "show (1.5)", {"show": "Hello there"}),
    CommandSent(2.2, 1, "screen", "show (1.5)", {"show": ""}),
    node(2.0, "say", "running", key="1.3", kind="say"),
    Notified(2.2, 1, "Anna was found"),
    Notified(2.3, 1, "Anna was told"),
    FaultRaised(2.5, "arm", "offline", "the cable is out"),
    ReflexFired(2.6, 1, "bumper", "left", on=True),
    ReflexFired(2.7, 1, "bumper", "left", on=False),
    node(3.0, "say", "idle", key="1.3", kind="say"),
    node(3.0, "tree", "success", key="1", kind="sequence"),
)


@pytest.fixture
def history() -> CaseHistory:
    found = CaseHistory()
    for event in EVENTS:
        found(event)
    found.result = Result("m", "failure", "nobody found", 3.0, 60)
    found.pose = Pose2D(1.0, 2.0, 3.1)
    found.joints = {"elbow": 0.5}
    found.heard_by = {"Anna": ["Hello, you", "Bye"], "Ben": []}
    found.returns = {
        "count": 2,
        "name": "Anna",
        "ready": True,
        "share": 0.1 + 0.2,
        "ways": [{"x": 0.1 + 0.2}, {"x": 2}],
    }
    return found


def misses(history: CaseHistory, key: str, *values: object) -> list[str]:
    items = tuple(ExpectedItem(Mark(5, column), value) for column, value in enumerate(values, start=1))
    return [text for _, text in check_expectations([Expectation(key, Mark(5), items)], history)]


CAME_TRUE: list[tuple[str, list[object]]] = [
    ("result", ["failure"]),
    ("reason", ["nobody"]),
    ("within", [3.0]),
    ("after", [3.0]),
    ("said", ["Hello"]),
    ("never_said", ["Bye", "hello"]),
    ("heard_by", [("Anna", ("Hello", "Bye")), ("Anna", ("Bye",)), ("Ben", ())]),
    ("showed", ["there"]),
    ("showed", ["there", ""]),
    ("moods", ["happy"]),
    ("notified", ["found", "told"]),
    ("ran", [("look", 2), ("leaf", None), ("sequence", 1), ("ask", 1), ("nod", 0)]),
    ("never_ran", ["nod"]),
    ("succeeded", ["look", "tree"]),
    ("failed", ["look"]),
    (
        "order",
        [
            EventSpec("look", "starts"),
            EventSpec("look", "fails"),
            EventSpec("look", "starts"),
            EventSpec("say", "halts"),
        ],
    ),
    ("order", [EventSpec("tree", "starts"), EventSpec("look", "starts")]),
    (
        "order",
        [EventSpec("say", "starts"), EventSpec("robot", "says", "Hello"), EventSpec("arm", "disconnects")],
    ),
    ("faults", ["the cable"]),
    ("order", [EventSpec("bumper", "fires"), EventSpec("bumper", "clears"), EventSpec("say", "halts")]),
    ("reflexes", ["bumper", "bumper left"]),
    ("base", ["stopped"]),
    ("pose", [PoseTarget(1.05, 2.0), PoseTarget(1.0, 2.0, heading=-3.1)]),
    ("joints", [("elbow", 0.5, 0.0), ("elbow", 0.6, 0.11)]),
    ("returns", [("count", 2), ("name", "Anna"), ("ready", True), ("share", 0.3), ("ways", [{"x": 0.3}, {"x": 2}])]),
]

DID_NOT: list[tuple[str, list[object], str]] = [
    ("result", ["success"], "the result was failure: nobody found"),
    ("reason", ["somebody"], "the reason was 'nobody found'"),
    ("within", [2.9], "it took 3.00 s"),
    ("after", [3.1], "it took only 3.00 s"),
    ("said", ["Bye"], 'it never said "Bye"; it said "Hello, you"'),
    ("said", ["Hello", "Hello"], 'it never said "Hello" after "Hello"; it said "Hello, you"'),
    ("said", [], 'it said "Hello, you"'),
    ("never_said", ["Hello"], 'it said "Hello, you"'),
    ("heard_by", [("Anna", ("Bye", "Hello"))], 'Anna heard "Hello, you", "Bye"'),
    ("heard_by", [("Anna", ())], 'Anna heard "Hello, you", "Bye"'),
    ("heard_by", [("Ben", ("Hello",))], "Ben heard nothing"),
    ("showed", ["Bye"], 'it never showed "Bye"; it showed "Hello there", ""'),
    ("showed", [], 'it showed "Hello there"'),
    ("showed", ["", "there"], 'it never showed "there" after ""; it showed "Hello there", ""'),
    ("showed", ["there", "", ""], 'it never showed "" after ""; it showed "Hello there", ""'),
    ("moods", ["happy", "sad"], 'it never looked "sad" after "happy"; it looked "happy"'),
    (
        "notified",
        ["told", "found"],
        'it never notified "found" after "told"; it notified "Anna was found", "Anna was told"',
    ),
    ("notified", [], 'it notified "Anna was found", "Anna was told"'),
    ("ran", [("nod", None)], "'nod' never ran"),
    ("ran", [("look", 1)], "'look' started 2 times"),
    ("ran", [("look", 0)], "'look' started 2 times"),
    ("never_ran", ["look"], "'look' started 2 times, first at 0.00 s"),
    ("succeeded", ["say"], "'say' started once, was halted once"),
    ("failed", ["ask"], "'ask' started once, succeeded once"),
    ("failed", ["nod"], "'nod' never ran"),
    ("order", [EventSpec("nod", "starts")], "it never happened"),
    ("order", [EventSpec("look", "succeeds"), EventSpec("look", "fails")], "happened only before, at 1.00 s"),
    (
        "order",
        [EventSpec("ask", "succeeds"), EventSpec("nod", "starts")],
        "after 'ask succeeds' it never happened",
    ),
    ("faults", ["elbow"], "the notices were"),
    ("faults", [], 'unexpected notices: "arm disconnects: the cable is out"'),
    ("reflexes", ["bumper", "cliff"], 'the reflexes that fired were "bumper left"'),
    ("reflexes", [], 'these reflexes fired: "bumper left"'),
    ("pose", [PoseTarget(0.8, 2.0)], "the base was at [1.00 m, 2.00 m], heading 178 deg"),
    ("pose", [PoseTarget(1.0, 2.0, heading=1.0)], "the base was at"),
    ("joints", [("elbow", 0.6, 0.05)], "'elbow' was at 28.6 deg"),
    ("joints", [("wrist", 0.6, 0.05)], "the arm was offline"),
    ("returns", [("count", 3)], "'count' was 2"),
    ("returns", [("name", "Ben")], "'name' was Anna"),
    ("returns", [("ready", False)], "'ready' was yes"),
    ("returns", [("missing", 1)], "'missing' was nothing"),
    ("returns", [("ways", [{"x": 0.3}, {"x": 3}])], "'ways' was"),
    ("returns", [("ways", [{"x": 0.3}])], "'ways' was"),
    ("returns", [("ways", [{"x": 0.3}, {"y": 2}])], "'ways' was"),
]


@pytest.mark.parametrize(("key", "values"), CAME_TRUE)
def test_fulfilled_expectation_is_no_miss(key: str, values: list[object], history: CaseHistory) -> None:
    assert misses(history, key, *values) == []


@pytest.mark.parametrize(("key", "values", "seen"), DID_NOT)
def test_unfulfilled_expectation_shows_the_actual_result(
    key: str, values: list[object], seen: str, history: CaseHistory
) -> None:
    assert seen in misses(history, key, *values)[0]


def test_every_key_is_proved_to_come_true_and_to_fail() -> None:
    assert {key for key, _ in CAME_TRUE} == CHECKS.keys()
    assert {key for key, _, _ in DID_NOT} | {"base"} == CHECKS.keys(), "for the base, see below"


def test_base_must_be_sent_a_stop_before_the_end(history: CaseHistory) -> None:
    history.is_moving = True
    assert misses(history, "base", "stopped") == ["the base was still moving when the mission ended"]
    history(CommandSent(2.9, 1, "base", "drive (1.4)", {"linear": 0.2, "angular": 0.0}))
    assert misses(history, "base", "stopped")
    history(CommandSent(3.0, 1, "base", "drive (1.4)", {"linear": 0.0, "angular": 0.0}))
    assert misses(history, "base", "stopped") == []
    history(CommandSent(3.0, 1, "base", "safety", {"linear": -0.1, "angular": 0.0}))  # which is not the mission's doing
    assert misses(history, "base", "stopped") == []


def test_misses_come_in_the_order_of_the_file(history: CaseHistory) -> None:
    expectations = [
        Expectation("said", Mark(9), (ExpectedItem(Mark(9), "Bye"),)),
        Expectation("result", Mark(7), (ExpectedItem(Mark(7), "success"),)),
    ]
    assert [mark.line for mark, _ in check_expectations(expectations, history)] == [7, 9]


def test_run_without_an_end_is_an_error() -> None:
    assert misses(CaseHistory(), "result", "success") == ["the result was error: the run did not end"]
    assert misses(CaseHistory(), "within", 1.0)
    assert misses(CaseHistory(), "pose", PoseTarget(0.0, 0.0)) == ["the robot has no base"]
