"""Variables that are not set on every way to their readers: found, with the way; and what is left in peace."""

from pathlib import Path

import pytest

from config.diagnostics import InvalidFileError
from missions.language import document
from missions.plugins.verify.explore import REFUTED
from tests.missions.testing.verify.exploring import explored, outcomes, plan_of

SHORT = {
    "TRIED": "FOUND, on_failure: succeed",
    "FOUND": "find_face: {scans: 2}, as: guest",
    "GREETED": "say: 'Hello ${guest.id}'",
    "FLAGGED": "set: {ok: false}}, {sequence: [{FOUND}, {set: {ok: true}}], on_failure: succeed",
}
"""What stands for these words in the trees below; the first may hold the second."""

TOO_SOON = {
    "sequence: [{selector: [{FOUND}, {say: Nobody}]}, {GREETED}]": "not set where 'find_face' (line 4) fails",
    "sequence: [{TRIED}, {GREETED}]": "not set where 'find_face' (line 4) fails",
    "sequence: [{race: [{FOUND}, {wait: 5 s}]}, {GREETED}]": "not set where 'wait' (line 4) ends first",
    "sequence: [{FOUND, if: battery.low}, {GREETED}]": "not set where 'if' (line 4) is false",
    "sequence: [{FOUND, until: battery.low}, {GREETED}]": "not set where 'until' (line 4) is true",
    "selector: [{FOUND, timeout: 5 s}, {GREETED}]": "not set where 'find_face' (line 4) fails",
    "sequence: [{switch: {on: face.count, cases: {0: {say: a}}, default: {set: {n: 1}}}}, {log: '${n}'}]": (
        "not set where 'switch' (line 4) takes the case '0'"
    ),
    "sequence: [{log: '${n}'}, {set: {n: 1}}]\nrepeat: 3": "set only after this",
    "set: {n: '${n + 1}'}\nuntil: n > 3\nrepeat: forever": "set only after this",
    "sequence: [{mission: find_person, on_failure: succeed}, {log: '${person.id}'}]": (
        "not set where 'find_person' (line 4) fails"
    ),
    "sequence: [{sequence: [{drive: 1 m}, {set: {n: 1}}], on_failure: succeed}, {log: a, if: n > 1}]": (
        "not set where 'drive' (line 4) fails"
    ),
    "sequence: [{set: {l: [1, 2]}}, {for_each: {in: l, as: k, do: {set: {n: '${k}'}}}}, {log: '${n}'}]": (
        "not set where 'for_each' (line 4) has no member"
    ),
    "sequence: [{parallel: [{wait: 9 s}, {sequence: [find_face, {set: {n: 1}}]}], success_count: 1}, {log: '${n}'}]": (
        "not set where 'parallel' (line 4) succeeds without it"
    ),
    "sequence: [{parallel: [{FOUND}, {say: a}, {wait: 5 s}], success_count: 2}, {GREETED}]": (
        "not set where 'parallel' (line 4) succeeds without it"
    ),
    "sequence: [{parallel: [{FOUND}, stop], success_count: 1, failure_count: 2, wait_for_all: true}, {GREETED}]": (
        "not set where 'parallel' (line 4) succeeds without it"
    ),
    "sequence: [{parallel: [{FOUND}, {say: a}], wait_for_all: true, on_failure: succeed}, {GREETED}]": (
        "not set where 'find_face' (line 4) fails"
    ),
    "sequence: [{set: {n: '${face.count}'}}, {set: {m: '${1 / n}'}, on_failure: succeed}, {log: '${m}'}]": (
        "not set where 'set' (line 4) fails"
    ),
}

IN_PEACE = (
    "sequence: [{FOUND}, {GREETED}]",
    "sequence: [{selector: [{FOUND}, {fail: nobody}]}, {GREETED}]",
    "sequence: [{FOUND, retry: forever, timeout: 5 s}, {GREETED}]",
    "selector: [{GREETED}, {FOUND}]\nrepeat: 2",  # where it reads too soon, another takes its turn
    "sequence: [{TRIED}, {selector: [{GREETED}, {say: Hello}]}]",
    "sequence: [{TRIED}, {GREETED, on_failure: succeed}]",
    "sequence: [{set: {guest: null}}, {TRIED}, {GREETED, if: guest != null}]",
    "sequence: [{FLAGGED}, {GREETED, if: ok}]",
    "sequence: [{FLAGGED}, {fail: nobody, if: not ok}, {GREETED}]",
    "sequence: [{set: {ok: false}}, {TRIED}, {say: Hi, if: ok and guest.id == 1}]",
    "parallel: [{FOUND}, {sequence: [{wait: 5 s}, {GREETED}]}]",
    "sequence: [{parallel: [{FOUND}, {say: Where are you}]}, {GREETED}]",
    "sequence: [{parallel: [{FOUND}, {say: a, timeout: 1 s}], wait_for_all: true}, {GREETED}]",
    "sequence: [{parallel: [{FOUND}, {say: a}], success_count: 2}, {GREETED}]",
    "sequence: [{parallel: [{FOUND}, {say: a}], success_count: all}, {GREETED}]",
    "sequence: [{parallel: [{FOUND}, {say: a, if: battery.low}, {wait: 5 s}], success_count: all}, {GREETED}]",
    "sequence: [{parallel: [{FOUND}, {say: a}], success_count: 1, wait_for_all: true}, {GREETED}]",
    "sequence: [{parallel: [{FOUND}, {listen: yes, as: guest}, {wait: 5 s}], success_count: 2}, {log: '${guest}'}]",
    "sequence: [{parallel: [{FOUND}, {GREETED}], success_count: 1, failure_count: all}]",
    "selector: [{parallel: [{set: {n: 1}, on_success: fail}, cliff], success_count: 1}, {log: '${n}'}]",
    "sequence: [{race: [{sequence: [{set: {n: 1}}, {drive: 1 m}]}, {wait: 5 s}]}, {log: '${n}'}]",
    "sequence: [{sequence: [{set: {n: 1}}, {drive: 1 m}], for: 5 s}, {log: '${n}'}]",
    "selector: [{random_selector: [{sequence: [{set: {n: 1}}, fail]}, {find_face: {}}]}, {log: '${n}'}]",
    "sequence: [{switch: {on: face.count, cases: {0: {set: {n: 0}}}, default: {set: {n: 1}}}}, {log: '${n}'}]",
    "sequence: [{switch: {on: face.count, cases: {0: {set: {n: 0}}}}}, {log: '${n}'}]",
    "sequence: [{for_each: {in: [1, 2], as: k, do: {set: {n: '${k}'}}}}, {log: '${n + k}'}]",
    "for_each: {in: [1, 2], as: k, number: i, do: {log: '${k + i}'}}",
    "sequence: [{mission: find_person}, {log: '${person.id}'}]",
)


def written(tree: str) -> str:
    """The tree, in full."""
    for word, meant in SHORT.items():
        tree = tree.replace(word, meant)
    return tree.replace("FOUND", SHORT["FOUND"])


def said(tree: str) -> str:
    """What the checker says of a tree, all of it; nothing where it is good."""
    try:
        plan_of(written(tree))
    except InvalidFileError as error:
        return str(error)
    return ""


def test_variable_not_set_on_every_path_is_a_mistake() -> None:
    wrong = {
        tree: found for tree, why in TOO_SOON.items() if f"is read here, but it is {why}\n" not in (found := said(tree))
    }
    assert wrong == {}


def test_possibly_set_or_tested_variable_is_accepted() -> None:
    assert {tree: found for tree in IN_PEACE if (found := said(tree))} == {}


def test_submission_returns_variables_set_before_its_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    tree = "{sequence: [{set: {gone: '${way / 2}'}}, {drive: '${gone}'}, {set: {late: 1}}]}"
    Path("try.yaml").write_text(f"mission: try\nparams: {{way: 1 m}}\ntree: {tree}\nreturns: {{gone: gone, to: way}}\n")
    kept = "{mission: try.yaml, as: it, on_failure: succeed}"
    assert said(f"sequence: [{kept}, {{log: '${{it.gone}} ${{it.to}}'}}]") == ""
    assert said("sequence: [{mission: try.yaml, on_failure: succeed}, {log: '${gone} ${to}'}]") == ""
    lost = said("sequence: [{mission: try.yaml, returns: {late: late}, on_failure: succeed}, {log: '${late}'}]")
    assert "not set where 'try' (line 4) fails" in lost


def test_unset_variable_gives_a_hint() -> None:
    hint = "set it before, such as set: {guest: null}, and test it here with if: guest != null"
    assert hint in said("sequence: [{TRIED}, {GREETED}]")


def test_verify_refutes_each_unset_variable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(document, "check_assignments", lambda *_: None)
    # It knows that the list of a for_each has members, and takes calculations to succeed.
    trees = [tree for tree in TOO_SOON if "for_each" not in tree and "1 / n" not in tree]
    found = {tree: outcomes(explored(written(tree)))["every variable is set when it is read"] for tree in trees}
    assert set(found.values()) == {REFUTED}, found
