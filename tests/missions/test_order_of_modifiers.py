"""Two modifiers in an order in which one of them keeps the other, or the behaviour, from its turn."""

import pytest

from config.diagnostics import InvalidFileError
from missions.language.plan import Plan
from tests.missions.testing.verify.exploring import plan_of

CASES = {
    "drive: 1 m\ndelay: 10 s\ntimeout: 5 s": (
        "'drive' is never reached: the 'delay' of 10 s is longer than the 'timeout' of 5 s around it",
        "the order is the cause: write 'timeout' above 'delay' (line 5)",
    ),
    "drive: 1 m\ndelay: 10 s\nfor: 5 s": (
        "'drive' is never reached: the 'delay' of 10 s is longer than the 'for' of 5 s around it",
        "the order is the cause: write 'for' above 'delay' (line 5)",
    ),
    "drive: 1 m\nfor: 10 s\ntimeout: 2 s": (
        "'for' has no effect here: the 'timeout' of 2 s around it is over first",
        "",
    ),
    "drive: 1 m\ntimeout: 10 s\nretry: 2\nfor: 2 s": (
        "'timeout' has no effect here: the 'for' of 2 s around it is over first",
        "",
    ),
    "drive: 1 m\nfor: 2 s\ntimeout: 10 s": (
        "'timeout' has no effect here: the 'for' of 2 s inside it is over first",
        "",
    ),
    "drive: 1 m\ntimeout: 2 s\nfor: 10 s": (
        "'for' has no effect here: the 'timeout' of 2 s inside it is over first",
        "",
    ),
    "drive: 1 m\non_failure: succeed\nretry: 3": (
        "'retry' has no effect here: 'drive' never fails",
        "the order is the cause: write 'retry' above 'on_failure' (line 5)",
    ),
    "drive: 1 m\non_success: fail\nname: go\nrepeat: 3": (
        "'repeat' has no effect here: 'go' never succeeds",
        "the order is the cause: write 'repeat' above 'on_success' (line 5)",
    ),
    "wait: 1 s\nretry: 3": ("'retry' has no effect here: 'wait' never fails", ""),
}


def test_wrong_order_of_two_modifiers_is_reported() -> None:
    for tree, said in CASES.items():
        with pytest.raises(InvalidFileError) as caught:
            plan_of(tree)
        assert [(fault.message, fault.suggestion) for fault in caught.value.diagnostics] == [said], tree


def test_the_same_modifiers_in_the_other_order_are_good() -> None:
    for tree in ("drive: 1 m\ntimeout: 5 s\ndelay: 10 s", "drive: 1 m\nretry: 3\non_failure: succeed"):
        assert plan_of(tree).tree.children
    assert plan_of("drive: 1 m\ndelay: 4 s\ntimeout: 5 s").tree.kind == "timeout"


def test_two_time_limits_are_good_if_a_modifier_between_them_takes_longer_than_the_inner_one() -> None:
    for between in ("retry: 9", "repeat: 9", "delay: 1 s", "finally: succeed"):
        assert plan_of(f"drive: 1 m\nfor: 2 s\n{between}\ntimeout: 5 s").tree.kind == "timeout"
    assert plan_of("check: base.x > 1 m\ntimeout: 1 s\nhold: 2 s\nfor: 9 s").tree.kind == "for"


FAILS_BY_FAULT = (
    "wait: 1 h\nuntil: base.x > 1 m",
    "wait: 1 s\nif: base.bumper",
    "wait: ${1 s / n}",
    "wait: ${n * 1 s}",
    "wait: 1 s\nfor: ${1 s / n}",
    "wait: 1 s\nrepeat: ${n}",
    "wait: 1 s\nonce: 1 / n",
    "wait_for: bumped",
    "switch: {on: base.bumper, cases: {true: {wait: 1 s}}, default: {wait: 2 s}}",
    "reactive_switch: {on: base.bumper, cases: {true: {wait: 1 s}}, default: {wait: 2 s}}",
    "reactive_selector: [bumped, {wait: 1 h}]",
    "reactive_selector: [{sequence: [{check: base.bumper}, {led: red}]}, {wait: 1 h}]",
    "reactive_sequence: [{bumped: {}, on_failure: succeed}, {wait: 1 h}]",
)
"""Nodes that fail only if a sensor stays silent, or if a value cannot be calculated."""

NEVER_FAILS = (
    "wait: ${patience}",
    "wait: 1 s\nif: n == 1",
    "wait: 1 s\nuntil: n == 1",
    "reactive_selector: [{check: n == 1}, {wait: 1 h}]",
    "for_each: {in: [1, 2], as: k, do: {wait: 1 s}}",
)


def _beside(tree: str, modifier: str) -> Plan:
    indented = f"{tree}\n{modifier}".replace("\n", "\n    ")
    return plan_of(f"sequence:\n  - set: {{n: 1}}\n  - {indented}", params="{patience: 5 s}")


@pytest.mark.parametrize("tree", FAILS_BY_FAULT)
def test_a_failure_by_a_fault_can_be_caught(tree: str) -> None:
    for modifier in ("on_failure: succeed", "retry: 2"):
        assert _beside(tree, modifier).tree.children
    child = tree.replace("\n", "\n    ")
    assert plan_of(f"selector:\n  - {child}\n  - say: stuck", params="{n: {type: count}}").tree.children


@pytest.mark.parametrize("tree", NEVER_FAILS)
def test_a_failure_that_cannot_happen_is_not_caught(tree: str) -> None:
    for modifier in ("on_failure: succeed", "retry: 2"):
        with pytest.raises(InvalidFileError, match=r"has no effect here: '[a-z_]+' never fails"):
            _beside(tree, modifier)
