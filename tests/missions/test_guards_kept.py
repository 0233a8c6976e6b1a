"""The hint of `mission check` about a ``once`` that remembers the answer of a guard."""

import pytest

from behaviours.catalogue import LEAVES
from config.diagnostics import SourceText
from missions.language.document import check_plan
from missions.language.outcomes import find_once_guards
from missions.library.shipped import load_mission, shipped_missions

KEPT = {
    "{turn: 30 deg, while: base.x > 30 cm, once: true}": ("while", "write 'once' above 'while'"),
    "{drive: 1 m, until: face.seen, once: true}": ("until", "write 'once' above 'until'"),
    "{turn: 30 deg, while: face.seen, retry: 2, once: true}": ("while", "write 'once' above 'while'"),
    "{bumped: , once: true}": ("bumped", "begin a sequence with 'bumped', and put 'once' beside what follows it"),
    "{sequence: [bumped, {say: Ouch}], once: true}": (
        "bumped",
        "put 'once' beside what follows 'bumped', not around both",
    ),
    "{sequence: [{log: a}, face_seen, {say: Hi}], once: true}": (
        "face_seen",
        "put 'once' beside what follows 'face_seen', not around both",
    ),
    "{reactive_sequence: [{face_seen: , invert: true}, {drive: 1 m}], once: true}": (
        "face_seen",
        "put 'once' beside what follows 'face_seen', not around both",
    ),
    "{selector: [bumped, face_seen], once: true}": (
        "bumped",
        "put 'once' beside what follows 'bumped', not around both",
    ),
    "{switch: {on: face.seen, cases: {true: {say: Hi}}}, once: true}": (
        "switch",
        "put 'once' beside the behaviour of each case",
    ),
}

DONE = [
    "{turn: 30 deg, once: true, while: base.x > 30 cm}",
    "{say: Hi, once: true, if: face.seen}",
    "{say: Hi, if: face.seen, once: true}",  # a skipped node is not remembered
    "{say: Hi, if: face.seen, timeout: 3 s, once: true}",
    "{say: Hi, if: face.seen, once: face.id}",
    "{drive: 1 m, once: true}",
    "{drive: 1 m, timeout: 9 s, once: true}",
    "{sequence: [bumped, {say: Ouch, once: true}]}",
    "{sequence: [{say: Hi}, face_seen], once: true}",
    "{selector: [face_seen, {say: Nobody}], once: true}",
    "{switch: {on: face.seen, cases: {true: {say: Hi}}, default: {say: Bye}}, once: true}",
]


def hints(node: str) -> list[tuple[str, str]]:
    """Return what is told of a node that is asked at every tick: message and suggestion."""
    text = f"mission: m\ntree: {{sequence: [{node}, {{wait: 1 s}}], on_failure: succeed, repeat: 9}}\n"
    return [
        (hint.message, hint.suggestion)
        for hint in find_once_guards(check_plan(SourceText("m.yaml", text), LEAVES, {}).tree)
    ]


@pytest.mark.parametrize("node", KEPT)
def test_once_around_a_guard_gets_a_hint(node: str) -> None:
    guard, suggestion = KEPT[node]
    message = f"'once' also remembers that '{guard}' (line 2) prevented the start, and does not evaluate it again"
    assert hints(node) == [(message, suggestion)]


@pytest.mark.parametrize("node", DONE)
def test_once_around_an_action_gets_no_hint(node: str) -> None:
    assert hints(node) == []


def test_shipped_missions_have_no_once_around_a_guard() -> None:
    assert not [name for name in shipped_missions() if find_once_guards(load_mission(name).tree)]
