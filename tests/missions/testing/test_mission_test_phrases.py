"""The small grammars of test files: mocks' scripts, mishaps and moments; each mistake at its word."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.diagnostics import Diagnostic, Mark, SourceText
from config.yaml_nodes import Scalar
from missions.plugins.testing.event_specs import EventSpec, read_event
from missions.plugins.testing.fault_specs import FaultSpec, read_fault
from missions.plugins.testing.mocks import DEFAULT_REASON, MockTurn, Script, read_script
from missions.plugins.testing.phrases import Phrase

RUNS = MockTurn("running", seconds=math.inf, ticks=math.inf)


def phrase(text: str) -> tuple[Phrase, list[Diagnostic]]:
    faults: list[Diagnostic] = []
    return Phrase(SourceText("a.test.yaml", text), Scalar(Mark(1, 1, len(text)), text, text), faults), faults


def script(text: str) -> Script:
    words, faults = phrase(text)
    read = read_script(words)
    assert not faults, faults[0]
    return read


def known(name: str) -> str:
    return "" if name in {"gesture", "greet the person", "say"} else f"no '{name}'"


def mishap(text: str) -> FaultSpec:
    words, faults = phrase(text)
    read = read_fault(words, known)
    assert not faults, faults[0]
    return read


def moment(text: str) -> EventSpec:
    words, faults = phrase(text)
    read = read_event(words, known)
    words.expect_end()
    assert not faults, faults[0]
    return read


@pytest.mark.parametrize(
    ("text", "turns"),
    [
        ("succeeds", [MockTurn("success")]),
        ("fails", [MockTurn("failure", reason=DEFAULT_REASON)]),
        ("runs", [RUNS]),
        ("fails twice, then succeeds", [MockTurn("failure", 2, reason=DEFAULT_REASON), MockTurn("success")]),
        ("succeeds 3 times, then runs", [MockTurn("success", 3), RUNS]),
        ('fails because "out of reach, alas"', [MockTurn("failure", reason="out of reach, alas")]),
        ("succeeds after 2 s", [MockTurn("success", seconds=2.0)]),
        ("succeeds after 500ms", [MockTurn("success", seconds=0.5)]),
        ('fails after 3 ticks because "x"', [MockTurn("failure", ticks=3, reason="x")]),
        ('fails once after 3 ticks because "x"', [MockTurn("failure", ticks=3, reason="x"), MockTurn("success")]),
        ("fails twice", [MockTurn("failure", 2, reason=DEFAULT_REASON), MockTurn("success")]),
        (
            "succeeds, then fails 3 times",
            [MockTurn("success"), MockTurn("failure", 3, reason=DEFAULT_REASON), MockTurn("success")],
        ),
        ("runs for 2 s, then fails", [MockTurn("failure", seconds=2.0, reason=DEFAULT_REASON)]),
        (
            "runs for 1 tick, then succeeds twice, then fails",
            [MockTurn("success", 2, ticks=1), MockTurn("failure", reason=DEFAULT_REASON)],
        ),
        ("runs once, then succeeds", [RUNS, MockTurn("success")]),
    ],
)
def test_mock_script_is_parsed(text: str, turns: list[MockTurn]) -> None:
    assert script(text) == tuple(turns)


def written(turn: MockTurn) -> str:
    if turn.end == "running":
        return f"runs {turn.times} times"
    text = f"{'succeeds' if turn.end == 'success' else 'fails'} {turn.times} times"
    if turn.ticks:
        text += f" after {turn.ticks:.0f} ticks"
    elif turn.seconds:
        text += f" after {turn.seconds:g} s"
    return text + (f' because "{turn.reason}"' if turn.end == "failure" else "")


TIMES = st.integers(1, 99)
WAITS = st.one_of(
    st.just((0.0, 0.0)),
    st.tuples(st.just(0.0), st.integers(1, 50).map(float)),
    st.tuples(st.integers(1, 500).map(lambda tenths: tenths / 10), st.just(0.0)),
)
REASONS = st.text(st.characters(codec="utf-8", exclude_characters='"')).map(lambda text: " ".join(text.split()))
TURNS = st.one_of(
    TIMES.map(lambda times: MockTurn("running", times, math.inf, math.inf)),
    st.builds(lambda times, wait: MockTurn("success", times, wait[0], wait[1]), TIMES, WAITS),
    st.builds(lambda times, wait, reason: MockTurn("failure", times, wait[0], wait[1], reason), TIMES, WAITS, REASONS),
)


@given(st.lists(TURNS, min_size=1, max_size=5))
def test_every_script_can_be_written_and_read_back(turns: list[MockTurn]) -> None:
    assert script(", then ".join([*map(written, turns), "succeeds"])) == (*turns, MockTurn("success"))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("camera frozen from 5 s to 8 s", FaultSpec("camera", "frozen", start=5.0, seconds=3.0)),
        ("arm unplugged at 3 s", FaultSpec("arm", "unplugged", start=3.0)),
        ("head unplugged for 2 s", FaultSpec("head", "unplugged", seconds=2.0)),
        ("voice unplugged", FaultSpec("voice", "unplugged")),
        ("base bumped", FaultSpec("base", "bumped", "centre")),
        ("base cliff left at 1 s for 500 ms", FaultSpec("base", "cliff", "left", start=1.0, seconds=0.5)),
        ("base lifted from 1 min", FaultSpec("base", "lifted", start=60.0)),
        ("base battery at 10 % at 3 s", FaultSpec("base", "battery", amount=0.1, start=3.0)),
        ("arm overloaded elbow at 3 s", FaultSpec("arm", "overloaded", "elbow", start=3.0)),
        ("arm turned elbow to 0.5 rad at 3 s", FaultSpec("arm", "turned", "elbow", 0.5, start=3.0)),
        ("arm turned elbow to -1 rad", FaultSpec("arm", "turned", "elbow", -1.0)),
        (
            "base bumped right when greet the person starts for 1 s",
            FaultSpec("base", "bumped", "right", seconds=1.0, trigger=EventSpec("greet the person", "starts")),
        ),
        (
            'camera covered when says "Hello"',
            FaultSpec("camera", "covered", trigger=EventSpec("robot", "says", "Hello")),
        ),
    ],
)
def test_fault_phrase_is_parsed(text: str, expected: FaultSpec) -> None:
    assert mishap(text) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("gesture starts", EventSpec("gesture", "starts")),
        ('"greet the person" halts', EventSpec("greet the person", "halts")),
        ("say succeeds", EventSpec("say", "succeeds")),
        ('say "Hello, you"', EventSpec("robot", "says", "Hello, you")),
        ("base stops", EventSpec("base", "stops")),
        ("base disconnects", EventSpec("base", "disconnects")),
        ("arm complains", EventSpec("arm", "complains")),
    ],
)
def test_event_phrase_is_parsed(text: str, expected: EventSpec) -> None:
    assert moment(text) == expected


@pytest.mark.parametrize(
    ("text", "column", "message"),
    [
        ("", 1, "the script of a mock (such as 'fails twice, then succeeds') is missing here"),
        ("fials", 1, "cannot be 'fials'"),
        ("fails twice then succeeds", 13, "a comma is missing before 'then'"),
        ("fails twice, succeeds", 14, "the word after a comma cannot be 'succeeds'"),
        ("fails because stuck", 15, "'because' needs a text in double quotes"),
        ('succeeds because "x"', 10, "'because' is not expected here"),
        ("succeeds after 2", 16, "'2' has no unit"),
        ("succeeds after -2 s", 16, "must be at least 0 s"),
        ("fails 0 times", 7, "needs a whole number, got '0'"),
        ("runs for 2 s", 13, "the end after 'runs for' is missing"),
        ("runs for 2 s, then runs", 24, "it is already running"),
        ("succeeds, then", 15, "is missing here"),
        ("succeeds twice", 15, "the starts after these are missing"),
        ("fails, then runs 2 times", 25, "the starts after these are missing"),
    ],
)
def test_fault_in_a_mock_script_is_marked_at_its_word(text: str, column: int, message: str) -> None:
    words, faults = phrase(text)
    read_script(words)
    (fault,) = faults
    assert fault.mark.column == column
    assert message in fault.message


@pytest.mark.parametrize(
    ("text", "column", "message"),
    [
        ("wheel off", 1, "the part with the fault cannot be 'wheel'"),
        ("camera frozn", 8, "the fault of the camera cannot be 'frozn'"),
        ("camera frozen from 5 to 8 s", 20, "'5' has no unit"),
        ("camera frozen from 8 s to 5 s", 30, "it ends before it begins"),
        ("camera frozen during lunch", 15, "'during' is not expected here"),
        ("base battery 10 %", 14, "the word after 'battery' cannot be '10'"),
        ("base battery at 110 %", 17, "must be at most 100 %"),
        ("base battery at 10 % for 2 s", 29, "'battery' does not end by itself"),
        ("arm overloaded at 3 s", 16, "which joint is overloaded is missing here"),
        ("arm turned to 3 deg", 12, "which joint is turned is missing here"),
        ("arm turned elbow at 3 s", 18, "the word after 'elbow' cannot be 'at'"),
        ("arm turned elbow to 3 s", 21, "'turned' needs an angle"),
        ("arm turned elbow to 300 deg", 21, "'turned' must be at most 180 deg"),
        ("base lifted when nod starts", 18, "no 'nod'"),
        ("base lifted when gesture begins", 26, "the event of 'gesture' cannot be 'begins'"),
        ("base lifted when arm moves", 22, "the event of 'arm' cannot be 'moves'"),
    ],
)
def test_fault_in_a_fault_phrase_is_marked_at_its_word(text: str, column: int, message: str) -> None:
    words, faults = phrase(text)
    read_fault(words, known)
    (fault,) = faults
    assert fault.mark.column == column
    assert message in fault.message


@given(st.text(st.characters(codec="utf-8"), max_size=60))
def test_phrase_parsers_accept_any_text_without_crashing(text: str) -> None:
    for read in (read_script, lambda words: read_fault(words, known), lambda words: read_event(words, known)):
        words, faults = phrase(text)
        read(words)
        assert len(faults) <= 1, "what follows from a mistake is not told"
        for fault in faults:
            assert str(fault)


def test_escaped_text_is_marked_as_a_whole() -> None:
    faults: list[Diagnostic] = []
    node = Scalar(Mark(1, 1, 20), "camera frozn", "camera frozn", quoted=True)
    read_fault(Phrase(SourceText("a.yaml", '"camera \\x66rozn"'), node, faults), known)
    assert faults[0].mark == Mark(1, 1, 20)
