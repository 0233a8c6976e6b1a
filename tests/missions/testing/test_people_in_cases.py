"""What people say and hear, and what is on the screen, in the tests of missions."""

from pathlib import Path

import pytest

from config.diagnostics import InvalidFileError
from tests.missions.testing.playing import cases, played, seen, write

ASKS = """mission: m
tree:
  sequence:
    - face: happy
    - say: Would you like some coffee?
    - show: "??"
    - listen: {for: [yes please, "no", say it again], timeout: 6 s}
      as: answer
    - {face: surprised, if: answer == "say it again"}
    - say: You said ${answer}.
returns: {answer: answer}
"""

ROOM = """world: room
walls: [{from: [0.4 m, 1 m], to: [3 m, 1 m]}]
people:
  - {name: Anna, at: [1.5 m, 0 m], acts: [{hears: coffee, after: 1 s, say: "Yes please!", times: 1}]}
  - {name: Ben, look: ben, at: [1.5 m, 2 m]}
  - {name: Dora, look: dora, at: [4.6 m, 0 m]}
  - {name: Emil, look: emil, at: [4.5 m, -1 m], hears_within: 6 m}
"""


@pytest.fixture
def room(tmp_path: Path) -> Path:
    write(tmp_path, {"room.yaml": ROOM})
    return tmp_path


@pytest.mark.parametrize(
    "body",
    [
        "expect: {returns: {answer: yes please}, said: [coffee, You said yes please.]}",
        "expect: {heard_by: {Anna: [coffee, You said], Ben: [], Dora: [], Emil: [coffee]}}",
        "expect: {showed: ['??'], moods: [happy]}",
        "given: [microphone deaf], expect: {result: failure, reason: nothing heard, heard_by: {Anna: [coffee]}}",
        "given: [microphone unplugged at 100 ms], expect: {reason: no sound from the microphone, faults: [microphone]}",
        "given: [microphone deaf for 800 ms], expect: {returns: {answer: yes please}}",
        "given: [{listen: {does: succeeds, result: say it again}}], expect: {moods: [happy, surprised]}",
        "given: [{listen: {does: succeeds, result: say it again}}], expect: {said: [coffee, You said say it again.]}",
        "given: [screen unplugged], expect: {result: error, reason: unplugged}",
        "given: [screen unplugged at 100 ms], expect: {result: success, faults: [screen]}",
    ],
)
def test_fulfilled_people_expectations_pass(room: Path, body: str) -> None:
    verdict = played(room, ASKS, f"world: room.yaml, {body}")
    assert verdict.passed, [*seen(verdict), verdict.error, *verdict.last_events]


@pytest.mark.parametrize(
    ("expect", "said"),
    [
        ("heard_by: {Ben: [coffee]}", "Ben heard nothing"),
        ("heard_by: {Anna: []}", 'Anna heard "Would you like some coffee?", "You said yes please."'),
        ("heard_by: {Anna: [You said, coffee]}", 'Anna heard "Would you like'),
        ("showed: [coffee]", 'it showed "??"'),
        ("moods: [happy, sad]", 'it looked "happy"'),
        ("showed: []", 'it showed "??"'),
        ("showed: ['??', '']", 'it showed "??"'),
    ],
)
def test_unfulfilled_people_expectation_shows_the_actual_result(room: Path, expect: str, said: str) -> None:
    verdict = played(room, ASKS, f"world: room.yaml, expect: {{{expect}}}")
    assert said in " ".join(seen(verdict))


def test_removed_text_is_expected_as_an_empty_text(room: Path) -> None:
    shows = "mission: m\ntree: {sequence: [show: {text: Coffee?, for: 1 s}, wait: 1 s]}\n"
    verdict = played(room, shows, "world: room.yaml, expect: {showed: [Coffee, '']}")
    assert verdict.passed, seen(verdict)
    assert not played(room, shows, "world: room.yaml, expect: {showed: ['', Coffee]}").passed


def test_clearing_an_empty_screen_shows_nothing(room: Path) -> None:
    wipes = "mission: m\ntree: {show: ''}\n"
    assert played(room, wipes, "world: room.yaml, expect: {showed: []}").passed
    assert played(room, wipes, "world: room.yaml, expect: {showed: ''}").passed


@pytest.mark.parametrize(
    ("mock", "said"),
    [
        ("succeeds with no", "write listen: {result: no}"),
        ("{does: succeeds, result: nope}", "'listen' cannot hear 'nope'"),
        ("{does: succeeds, result: No}", "did you mean 'no'?"),
    ],
)
def test_mock_of_listen_accepts_only_listed_words(tmp_path: Path, mock: str, said: str) -> None:
    mission = "mission: m\ntree: {listen: [yes, no], as: answer}\n"
    with pytest.raises(InvalidFileError) as caught:
        cases(tmp_path, mission, f"given: [{{listen: {mock}}}], expect: {{result: success}}")
    assert said in str(caught.value)
    assert played(
        tmp_path, mission, "given: [{listen: {does: succeeds, result: no}}], expect: {result: success}"
    ).passed
