"""What checking and verifying cost: in proportion to the number of nodes, whatever these are.

Counted in lines that run, not in seconds: the figure is the same on each machine and under any load.
"""

import sys
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from types import FrameType
from typing import Any

import pytest

from behaviours.catalogue import LEAVES
from config.diagnostics import InvalidFileError, SourceText
from missions.language.document import check_plan
from missions.language.nodes import COMPOSITES, MODIFIERS
from missions.language.outcomes import actions_as_guards
from missions.language.plan import Plan
from missions.library.lookups import LOOKUPS
from missions.plugins.verify.explore import StateSpace
from missions.plugins.verify.model import MissionModel

FEW, MANY = 40, 160

SETTINGS = {
    "condition": "battery.low",
    "duration": "5 s",
    "count": "3",
    "expression": "true",
    "node": "succeed",
}
"""A value for each kind of modifier that takes no constant."""


def children(kind: str, child: str) -> Callable[[int], str]:
    """Return a mission with one composite of a kind and as many children as are asked for; ``#`` is their number."""
    return lambda count: _tree(f"{kind}:", [child.replace("#", str(number)) for number in range(count)])


def _tree(word: str, lines: list[str]) -> str:
    return "\n".join(["mission: cost", "tree:", f"  {word}", *(f"    - {line}" for line in lines)])


def chain(count: int) -> str:
    """Return variables each of which is calculated from the next one, which is set before it."""
    lines = [f'set: {{v{number}: "${{v{number + 1}}} m"}}' for number in reversed(range(count))]
    return _tree("sequence:", [f"set: {{v{count}: 1}}", *lines])


def reversed_chain(count: int) -> str:
    """Return variables each of which is calculated from the one before, in a composite that begins anew."""
    lines = [f'set: {{v{number}: "${{v{number + 1}}}"}}' for number in range(count)]
    return _tree("reactive_sequence:", [f"set: {{v{count}: 1}}", *lines])


def switch(count: int) -> str:
    """Return a switch of many cases."""
    cases = "\n".join(f"          {number}: {{set: {{w{number}: 1}}}}" for number in range(count))
    return _tree("sequence:", ["set: {v: 1}", f'switch:\n        on: "${{v}}"\n        cases:\n{cases}'])


def nested(count: int) -> str:
    """Return parallels within parallels, with the same number of children each."""
    names = iter(range(count))
    inner = f"[{', '.join(f'{{set: {{v{next(names)}: 1}}}}' for _ in range(count // 6))}]"
    for _ in range(5):
        inner = f"[{{parallel: {inner}}}, {', '.join(f'{{set: {{v{next(names)}: 1}}}}' for _ in range(count // 6))}]"
    return f"mission: cost\ntree:\n  parallel: {inner}\n"


def params(count: int) -> str:
    """Return as many params as are asked for, and a switch on each."""
    declared = [f"  p{number}: {{type: number, default: 1}}" for number in range(count)]
    lines = [f'    - switch: {{on: "${{p{number}}}", cases: {{1: {{wait: 1 s}}}}}}' for number in range(count)]
    return "\n".join(["mission: cost", "params:", *declared, "tree:", "  race:", *lines])


CASES: dict[str, Callable[[int], str]] = {
    "chain": chain,
    "reversed chain": reversed_chain,
    "switch": switch,
    "nested": nested,
    "params": params,
    "sequence of turns": children("sequence", "turn: 90 deg"),
    "parallel of waits": children("parallel", "wait: 1 s"),
    "too early": children("sequence", "{set: {v#: 1}, if: battery.low}"),
}
for _word in COMPOSITES:
    CASES |= {
        f"{_word} of set and read": children(_word, '{sequence: [{set: {v#: 1}}, {log: "${v#}"}]}'),
        f"{_word} of for_each": children(_word, 'for_each: {in: [1, 2], as: v#, do: {log: "${v#}"}}'),
    }
for _word, _kind in MODIFIERS.items():
    _value = str(_kind.constants[0]).lower() if _kind.constants else SETTINGS[_kind.value]
    CASES[f"parallel of {_word}"] = children("parallel", f"{{dark:, {_word}: {_value}}}")


@pytest.mark.parametrize("case", CASES)
def test_a_check_costs_in_proportion_to_the_nodes(case: str) -> None:
    few, many = (_lines(partial(_check, case, count)) for count in (FEW, MANY))
    assert many < 1.25 * few * MANY / FEW


VERIFIED = ("nested", "switch", "parallel of set and read", "sequence of turns", "race of for_each")


@pytest.mark.parametrize("case", VERIFIED)
def test_a_step_of_verify_costs_in_proportion_to_the_nodes(case: str) -> None:
    plans = [_plan(case, count) for count in (FEW, MANY)]
    few, many = (_lines(partial(_step, plan)) for plan in plans)
    assert many < 1.25 * few * MANY / FEW


def _plan(case: str, count: int) -> Plan:
    return check_plan(SourceText("cost.yaml", CASES[case](count)), LEAVES, LOOKUPS)


def _check(case: str, count: int) -> None:
    """Check a mission, whether it is good or not."""
    with suppress(InvalidFileError):
        actions_as_guards(_plan(case, count).tree)


def _step(plan: Plan) -> None:
    """Make the model of a mission and follow one step."""
    late = iter([False])
    StateSpace(MissionModel(plan), 1, lambda: next(late, True)).explore()


def _lines(work: Callable[[], None]) -> int:
    """Return how many lines a piece of work runs through, once caches are filled."""
    work()
    count, before = 0, sys.gettrace()

    def trace(frame: FrameType, event: str, _: Any) -> Any:
        nonlocal count
        del frame
        count += event == "line"
        return trace

    sys.settrace(trace)
    try:
        work()
    finally:
        sys.settrace(before)
    return count
