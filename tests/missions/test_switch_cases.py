"""The cases of a switch: which are one and the same, and which value chooses them."""

import json

import pytest
from py_trees.common import Status

from behaviours.catalogue import LEAVES
from config.diagnostics import InvalidFileError, SourceText
from missions.language.document import check_plan
from missions.language.plan import Plan
from tests.conformance.harness import Play

ONE = [
    ("1", "1.0"),
    ("1", "01"),
    ("01", "001"),
    ("1", "+1"),
    ("1", "1e0"),
    ("1", '"1.0"'),
    (".5", "0.5"),
    ("0", "-0"),
    ("20 %", "0.2"),
    ("1 m", "100 cm"),
    ("0.7 m", "70 cm"),
    ("360 deg", "360.0 deg"),
    ("null", "~"),
]
TWO = [
    ("1", "10"),
    ("10001", "10002"),
    ("1", "1 m"),
    ("1 m", "1 s"),
    ("true", "yes"),
    ("true", "True"),
    ("true", "1"),
    ("null", "nothing"),
    ("a", "A"),
    ("no", "false"),
]


def plan(cases: list[str], value: str) -> Plan:
    """Check a mission that switches on a variable with this value, which the checker does not know."""
    lines = "".join(f"          {case}: {{log: {json.dumps(case)}}}\n" for case in cases)
    text = f"""\
mission: m
tree:
  sequence:
    - set: {{n: null}}
    - set: {{n: [1]}}
    - set: {{n: {value}}}
    - switch:
        on: n
        cases:
{lines}        default: {{log: none}}
"""
    return check_plan(SourceText("m.yaml", text), LEAVES, {})


@pytest.mark.parametrize(("first", "second"), ONE)
def test_one_case_written_twice_is_a_mistake(first: str, second: str) -> None:
    with pytest.raises(InvalidFileError) as caught:
        plan([first, second], "1")
    (fault,) = caught.value.diagnostics
    again, before = (each.strip('"') for each in (second, first))
    assert fault.message == f"the case '{again}' repeats the case '{before}' (first at line 10)"
    assert fault.mark.line == 11


@pytest.mark.parametrize(("first", "second"), TWO)
def test_switch_distinguishes_similar_cases(first: str, second: str) -> None:
    for value in (first, second):
        play = Play(plan([first, second], value), {})
        play.line("", 0.0)
        done = [
            node for node in play.root.iterate() if node.status is Status.SUCCESS and isinstance(node, LEAVES["log"])
        ]
        assert [vars(node)["text"] for node in done] == [value]
