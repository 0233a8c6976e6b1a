"""The language and its executive do what the specification says, case by case: see harness.py for how cases read."""

from collections import Counter

import pytest

from config.diagnostics import InvalidFileError
from missions.language.nodes import COMPOSITES, FOR_EACH, MODIFIERS, SWITCHES, WAIT_FOR
from tests.conformance.harness import Case, all_cases, play, read_cases

ALL = all_cases()


@pytest.mark.parametrize("case", [case for case in ALL if case.ticks], ids=str)
def test_tree_matches_its_table(case: Case) -> None:
    table, played = play(case)
    assert table == [line.strip() for line in case.ticks]
    assert {name: played.nodes[name].reason for name in case.reasons} == case.reasons
    assert {name: played.bench.variables[name] for name in case.variables} == case.variables


@pytest.mark.parametrize("case", [case for case in ALL if case.refused], ids=str)
def test_the_mission_is_refused(case: Case) -> None:
    with pytest.raises(InvalidFileError) as caught:
        case.plan()
    found = [f"{fault.mark.line}: {fault.message}" for fault in caught.value.diagnostics]
    assert [line[: len(told)] for line, told in zip(found, case.refused, strict=True)] == list(case.refused)


def test_case_titles_are_unique() -> None:
    assert [title for title, count in Counter(map(str, ALL)).items() if count > 1] == []


@pytest.mark.parametrize("word", [*COMPOSITES, *SWITCHES, FOR_EACH, WAIT_FOR, *MODIFIERS, "check"])
def test_every_composite_and_modifier_has_cases(word: str) -> None:
    assert sum(word in {step.kind for step in case.plan().tree.walk()} for case in ALL if case.ticks) >= 3


TABLE = """
- case: a node that runs
  tree:
    probe: [running, success]
    name: a
  ticks:
    - a starts, a is running
    - {second}
"""


@pytest.mark.parametrize("wrong", ["nothing", "a ends success", "a is success, a ends success", "a ends failure"])
def test_wrong_table_is_detected(wrong: str) -> None:
    (right,) = read_cases("right", TABLE.replace("{second}", "a ends success, a is success"))
    test_tree_matches_its_table(right)
    (case,) = read_cases("wrong", TABLE.replace("{second}", wrong))
    with pytest.raises(AssertionError):
        test_tree_matches_its_table(case)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (TABLE + "  reason: {a: none}\n", "unknown keys: reason"),
        ("- case: nothing to check\n  tree: succeed\n", "needs either ticks or what is refused"),
    ],
)
def test_malformed_case_is_detected(text: str, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        list(read_cases("cases", text))
