"""Texts of counterexamples: each is in words of the mission, with the places of its nodes."""

import re
from pathlib import Path

import pytest

from missions.language.plan import Plan
from missions.plugins.verify.explore import PROVED, REFUTED, StateSpace, trace_to
from missions.plugins.verify.model import MissionModel
from tests.missions.testing.verify.exploring import explored, plan_of


def shown_steps(plan: Plan) -> set[str]:
    """Return all steps of the shortest runs to the states of a mission, as a report shows them."""
    space = StateSpace(MissionModel(plan), 200)
    space.explore()
    return {str(step) for number in range(len(space.places)) for step in trace_to(space, number)}


@pytest.mark.parametrize(
    ("tree", "words"),
    [
        ("{log: a, delay: '${time}'}", "the time of 'delay' (line 4) is over"),
        ("{drive: 1 m, repeat: '${number}'}", "'repeat' (line 4) has no more rounds"),
        ("{drive: 1 m, repeat: 8}", "'repeat' (line 4) has no more rounds"),
        ("{for_each: {in: many, as: x, do: {drive: 1 m}}}", "'for_each' (line 4) has no more rounds"),
        ("{log: a, once: '${number}', repeat: 2}", "the value of 'once' (line 4) is the same"),
        ("{say: Hi, if: number > 3}", "'number > 3' is true"),
        ("{switch: {on: word, cases: {Hello: {log: a}}, default: {log: b}}}", "'word' is Hello"),
        ("{random_sequence: [{log: a}, {log: b}]}", "the order is log (line 4), log (line 4)"),
        ("{random_selector: [{nod: 1}, {log: b}], weights: [1, 2]}", "nod (line 4) is drawn next"),
        ("{random_selector: [{nod: 1}, {log: b}], weights: '${[number, 2]}'}", "is above 0 for nod, log"),
        ("{wait_until: base.button == 2}", "base.button is 2"),
        ("{log: a, if: base.driver == ''}", "base.driver is "),
    ],
)
def test_trace_shows_each_choice_in_words_of_the_mission(tree: str, words: str) -> None:
    params = "{time: {type: duration}, number: {type: count}, many: {type: list, of: text}, word: {type: text}}"
    shown = shown_steps(plan_of(f"sequence: [{tree}, {{say: Bye}}]", params=params))
    assert any(words in step for step in shown), shown


INTERNALS = re.compile(r"\b[A-Z][a-z]+[A-Z]\w*|\bobject at\b|[\w.]+\(\w+=|\b1\.0\b|\bNone\b|\bTrue\b|\bFalse\b")


@pytest.mark.parametrize(
    "node",
    [
        "{for_each: {in: many, as: x, do: {drive: 1 m}}}",
        "{for_each: {in: seen, as: x, do: {drive: 1 m}}, on_failure: succeed}",
        "{drive: 1 m, timeout: '${random(low, 2 * low)}', on_failure: succeed}",
        "{wait: '${random(low, time)}', on_failure: succeed}",
        "{drive: 1 m, repeat: '${number}'}",
        "{log: a, once: '${seen}'}",
        "{set: {t: '${random(low, 2 * low)}'}}, {drive: 1 m, timeout: '${t}', on_failure: succeed}",
        "{random_selector: [{nod: 1}, {log: b}], weights: '${[number, number]}'}",
        "{parallel: [{nod: 1}, {log: b}], success_count: '${number}', on_failure: succeed}",
        "{drive: 1 m, if: base.button == 1, on_failure: succeed}",
    ],
)
def test_no_counterexample_shows_an_internal_value(node: str) -> None:
    params = "{low: 3 s, time: {type: duration}, number: {type: count}, many: {type: list, of: text}}"
    tree = f"sequence: [{{face_seen: 1 s, as: seen}}, {node}, {{say: Bye}}, {{check: number == 1}}]"
    assert {step for step in shown_steps(plan_of(tree, params=params)) if INTERNALS.search(step)} == set()


def test_lines_of_a_sub_mission_are_shown_with_its_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    inner = "mission: inner\ntree:\n  sequence:\n    - look: 0 deg\n    - say: Hi\n      delay: ${random(1 s, 2 s)}\n"
    Path("inner.yaml").write_text(inner + "    - fail: no\n    - nod: 1\n")
    report = str(explored("sequence: [{drive: 1 m}, {mission: inner.yaml}]", "never: say after drive"))
    assert "say (inner.yaml:5) starts, and drive has succeeded before" in report
    assert "the time of 'delay' (inner.yaml:6) is over; say (inner.yaml:5) succeeds -> delay (inner.yaml:6)" in report
    assert "'sequence' (line 3): the child before it never succeeds" in report  # the error is in its file


def test_node_of_a_shared_sub_mission_is_unreached_only_if_no_call_reaches_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    cases = "{a: {wait: 3 s, timeout: '${limit}'}, b: {say: B}, c: {say: C}}"
    params = "{place: {type: choice, choices: [a, b, c]}, limit: {type: duration}}"
    Path("inner.yaml").write_text(
        f"mission: inner\nparams: {params}\ntree:\n  switch:\n    {{on: place, cases: {cases}}}\n"
    )
    call = "{{mission: inner.yaml, with: {{place: {}, limit: {}}}}}".format
    alone = explored(call("b", "2 s"))
    assert [verdict.outcome for verdict in alone.verdicts[1:2]] == [REFUTED]
    twice = explored(f"sequence: [{call('b', '2 s')}, {call('c', '2 s')}, {call('c', '2 s')}]")
    assert [each.fault.message for each in twice.verdicts[1].findings] == ["'wait' is never reached"]
    thrice = explored(f"sequence: [{call('a', '9 s')}, {call('b', '2 s')}, {call('c', '2 s')}, {call('a', '9 s')}]")
    assert thrice.verdicts[1].outcome == PROVED
    (timeouts,) = (each for each in thrice.verdicts if each.rule.endswith("can be over"))
    assert [each.fault.message for each in timeouts.findings] == []
