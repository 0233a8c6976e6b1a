"""Runs that nobody can tell apart: what is left out, and that it changes no verdict."""

import pytest

from missions.plugins.verify import model
from missions.plugins.verify.explore import PROVED, REFUTED
from tests.missions.testing.verify.exploring import explored, outcomes

OPTIONAL = ", ".join("{scene_uniform: 1 s, on_failure: succeed}" for _ in range(16))


@pytest.mark.parametrize("kind", ["parallel", "sequence"])
def test_sixteen_optional_steps_have_few_states(kind: str) -> None:
    found = explored(f"{kind}: [{OPTIONAL}]")
    assert found.outcome == PROVED
    assert found.states < 40
    assert found.transitions < 200


def test_leaf_named_in_a_property_is_distinguished() -> None:
    tree = "parallel: [{say: Hi}, {drive: 1 m}, {gesture: hello}]"
    found = outcomes(explored(tree, "never: say without drive", "never: drive without say"))
    assert found["never: say without drive"] == REFUTED
    assert found["never: drive without say"] == REFUTED


TREES = (
    "parallel: [{say: Hi}, {drive: 1 m, on_failure: succeed}, {gesture: hello, invert: true}]",
    "parallel: [{say: Hi}, {sequence: [{drive: 1 m}, {gesture: hello}], timeout: 5 s}]\nretry: 3",
    "race: [{parallel: [{say: Hi}, {drive: 1 m}]}, {parallel: [{gesture: hello}, {face_seen: 1 s}]}]\nrepeat: forever",
    "selector: [{parallel: [{say: Hi}, {drive: 1 m}, {pretend: running}]}, {look: 0 deg}]",
    "sequence: [{parallel: [{say: Hi}, {drive: 1 m}], invert: true}, {pretend: running}]",
    "reactive_selector: [{sequence: [face_seen, {drive: 1 m}]}, {parallel: [{drive: 2 m}, {say: Hi}]}]",
    "parallel: [{say: Hi}, {drive: 1 m}, {gesture: hello}]\nwhile: battery.percent > 20\nonce: true\nretry: 2",
)
"""Missions with leaves that end in any order."""


@pytest.mark.parametrize("tree", TREES)
def test_partial_order_reduction_changes_no_verdict(tree: str, monkeypatch: pytest.MonkeyPatch) -> None:
    promises = ("can: succeed", "can: fail", *(["always eventually: look"] if "look" in tree else []))
    fewer = explored(tree, *promises)
    monkeypatch.setattr(model, "reduce_equivalent_runs", lambda *_: None)
    whole = explored(tree, *promises)
    assert fewer.states <= whole.states
    assert outcomes(fewer) == outcomes(whole)
    shown = [
        [finding.run and len(finding.run) for each in report.verdicts for finding in each.findings]
        for report in (fewer, whole)
    ]
    assert shown[0] == shown[1]
