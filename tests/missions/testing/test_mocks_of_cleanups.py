"""Mocks beside ``recover`` and ``finally``: every combination of scripts for the node, its recovery and its cleanup."""

from itertools import product
from pathlib import Path

import pytest

from config.diagnostics import InvalidFileError
from tests.missions.testing.playing import cases, played, seen

MISSION = """mission: m
tree:
  sequence:
    - drive: 20 cm
      retry: 2
      recover: {drive: -20 cm, name: back off}
      finally: {sequence: [{say: "The end: ${failure}", name: farewell}, {log: over}]}
      halt_limit: 3 s
    - say: done
      name: last
"""
NODE = ("succeeds", 'fails because "stuck"', "runs", "")
RECOVERY = CLEANUP = ("succeeds", "fails", "runs", "")


@pytest.mark.parametrize(("node", "recovery", "cleanup"), list(product(NODE, RECOVERY, CLEANUP)))
def test_mocked_node_runs_its_recovery_and_cleanup(node: str, recovery: str, cleanup: str, tmp_path: Path) -> None:
    """An empty script means no mock: the behaviour itself runs."""
    scripts = {"drive": node, "back off": recovery, "farewell": cleanup}
    given = ", ".join(f"{{{name}: '{script}'}}" for name, script in scripts.items() if script)
    if not recovery and node:  # the word of the node is also that of the recovery
        recovery = node.partition(" ")[0]
    ran, never = ["drive", "farewell"], list[str]()
    if node in ("succeeds", ""):
        expect = "result: success"
    elif node == "runs" or recovery == "runs":
        expect = "result: running"
    else:
        expect = "result: failure, reason: stuck"
    (ran if node.startswith("fails") else never).append("back off")
    (ran if expect == "result: success" else never).append("last")
    (ran if cleanup in ("succeeds", "") else never).append("log")
    lists = f"ran: [{', '.join(ran)}], never_ran: [{', '.join(never)}]"
    body = f"timeout: 9 s, given: [{given}], expect: {{{expect}, {lists}, base: stopped}}"
    assert seen(played(tmp_path, MISSION, body)) == []


def test_mock_of_a_composite_leaves_the_cleanup_beside_it(tmp_path: Path) -> None:
    mission = """mission: m
tree:
  sequence: [{drive: 20 cm}, {say: inside}]
  name: work
  retry: 2
  recover: {sequence: [{turn: 10 deg}], name: repair}
  finally: {sequence: [{say: bye}], name: tidy}
"""
    body = (
        "given: [{work: 'fails, then succeeds'}, {repair: fails}, {tidy: runs}], timeout: 6 s, "
        "expect: {result: success, order: [work fails, repair fails, work succeeds, tidy halts], said: []}"
    )
    assert seen(played(tmp_path, mission, body)) == []


@pytest.mark.parametrize("word", ["recover", "finally"])
def test_mock_of_a_modifier_is_an_error_that_names_the_behaviours(word: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidFileError) as error:
        cases(tmp_path, MISSION, f"given: [{{{word}: fails}}], expect: {{result: failure}}")
    assert f"name the behaviour of '{word}' instead; these can be mocked: back off, drive, farewell" in str(error.value)
