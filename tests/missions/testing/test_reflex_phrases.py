"""Test files speak of reflexes: what befalls a base and its range finder, what fires, and what is expected of that."""

import math
from pathlib import Path

import pytest

from config.diagnostics import Diagnostic, InvalidFileError, Mark, SourceText
from config.yaml_nodes import Scalar
from missions.plugins.testing.event_specs import EventSpec, read_event
from missions.plugins.testing.fault_specs import FaultSpec, read_fault
from missions.plugins.testing.phrases import Phrase
from tests.missions.testing.playing import DRIVES, cases, played, seen


def phrase(text: str) -> tuple[Phrase, list[Diagnostic]]:
    faults: list[Diagnostic] = []
    return Phrase(SourceText("a.test.yaml", text), Scalar(Mark(1, 1, len(text)), text, text), faults), faults


def known(name: str) -> str:
    return "" if name in {"cliff", "drive"} else f"no '{name}'"


@pytest.mark.parametrize(
    ("text", "read"),
    [
        ("base button 0 pressed at 2 s", FaultSpec("base", "button", "0", start=2.0)),
        ("base button 2 pressed from 1 s to 2 s", FaultSpec("base", "button", "2", start=1.0, seconds=1.0)),
        ("base docked from 3 s", FaultSpec("base", "docked", start=3.0)),
        ("base battery at 8 % from 3 s", FaultSpec("base", "battery", amount=0.08, start=3.0)),
        ("base blocked from 2 s", FaultSpec("base", "blocked", start=2.0)),
        ("base drifting at 180 deg/s from 1 s", FaultSpec("base", "drifting", amount=math.pi, start=1.0)),
        ("base late by 0.5 s from 1 s", FaultSpec("base", "late", amount=0.5, start=1.0)),
        ("range unplugged at 3 s", FaultSpec("range", "unplugged", start=3.0)),
        (
            "range unplugged when bumper fires for 1 s",
            FaultSpec("range", "unplugged", seconds=1.0, trigger=EventSpec("bumper", "fires")),
        ),
    ],
)
def test_base_and_range_faults_are_parsed(text: str, read: FaultSpec) -> None:
    words, faults = phrase(text)
    assert read_fault(words, known) == read
    assert not faults


@pytest.mark.parametrize(
    ("text", "column", "message", "suggestion"),
    [
        ("base button", 12, "the number of a button is missing here", "known are: 0, 1, 2"),
        ("base button 3 pressed", 13, "the number of a button cannot be '3'", "known are: 0, 1, 2"),
        ("base button 0 presed", 15, "the state of button 0 cannot be 'presed'", "did you mean 'pressed'?"),
        ("range frozen", 7, "the fault of the range cannot be 'frozen'", "known are: unplugged"),
        ("rang unplugged", 1, "the part with the fault cannot be 'rang'", "did you mean 'range'?"),
    ],
)
def test_mistake_in_a_fault_phrase_is_marked_at_its_word(text: str, column: int, message: str, suggestion: str) -> None:
    words, faults = phrase(text)
    read_fault(words, known)
    (fault,) = faults
    assert (fault.mark.column, fault.message, fault.suggestion) == (column, message, suggestion)


@pytest.mark.parametrize(
    ("text", "read"),
    [
        ("bumper fires", EventSpec("bumper", "fires")),
        ("battery_low clears", EventSpec("battery_low", "clears")),
        ("cliff fires", EventSpec("cliff", "fires")),
        ("cliff fails", EventSpec("cliff", "fails")),  # the behaviour of that name
        ("range disconnects", EventSpec("range", "disconnects")),
    ],
)
def test_reflex_event_takes_precedence_over_a_behaviour_name(text: str, read: EventSpec) -> None:
    words, faults = phrase(text)
    assert read_event(words, known) == read
    words.expect_end()
    assert not faults


@pytest.mark.parametrize(
    ("text", "message", "suggestion"),
    [
        ("bumper fire", "the event of 'bumper' cannot be 'fire'", "did you mean 'fires'?"),
        ("bumper starts", "the event of 'bumper' cannot be 'starts'", "known are: clears, fires"),
        ("drive fires", "the event of 'drive' cannot be 'fires'", "known are: fails, halts, starts, succeeds"),
        ("bumpr fires", "no 'bumpr'", ""),
    ],
)
def test_mistake_in_an_event_phrase_lists_the_choices(text: str, message: str, suggestion: str) -> None:
    words, faults = phrase(text)
    read_event(words, known)
    (fault,) = faults
    assert (fault.message, fault.suggestion) == (message, suggestion)


@pytest.mark.parametrize(
    "body",
    [
        "given: [base bumped left at 1 s], expect: {reflexes: bumper, order: [base moves, bumper fires, drive fails]}",
        "given: [base bumped left at 1 s], expect: {reflexes: [bumper left]}",
        "given: [base docked from 1 s to 2 s], expect: {result: success, order: [docked fires, docked clears]}",
        "given: [base docked, base battery at 50 %], expect: {result: success, reflexes: [docked, charging]}",
        "given: [base button 1 pressed at 1 s for 500 ms], expect: {order: [button fires, button clears]}",
        "expect: {reflexes: []}",
    ],
)
def test_fired_reflexes_match_the_expectation(body: str, tmp_path: Path) -> None:
    verdict = played(tmp_path, DRIVES, body)
    assert verdict.passed, [*seen(verdict), verdict.error, *verdict.last_events]


def test_unfired_reflexes_are_reported(tmp_path: Path) -> None:
    bumped = "given: [base bumped left at 1 s]"
    assert seen(played(tmp_path, DRIVES, f"{bumped}, expect: {{reflexes: bumper right}}")) == [
        'the reflexes that fired were "bumper left"'
    ]
    assert seen(played(tmp_path, DRIVES, f"{bumped}, expect: {{reflexes: []}}")) == [
        'these reflexes fired: "bumper left"'
    ]
    assert seen(played(tmp_path, DRIVES, "expect: {reflexes: cliff}")) == ["the reflexes that fired were nothing"]


def test_unknown_reflex_is_refused_with_a_suggestion(tmp_path: Path) -> None:
    with pytest.raises(InvalidFileError, match=r"(?s)unknown reflex 'bumped'.*did you mean 'bumper'\?"):
        cases(tmp_path, DRIVES, "expect: {reflexes: bumped left}")
