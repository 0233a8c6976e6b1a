"""All mistakes in one go: one hides no other, and none has a follower that is none."""

import re
from pathlib import Path
from random import Random
from typing import NamedTuple

import pytest

from behaviours.catalogue import LEAVES
from config.diagnostics import Diagnostic, InvalidFileError, SourceText
from missions.language.document import check_plan
from missions.library.lookups import LOOKUPS
from missions.library.shipped import find_mission, shipped_missions


class Several(NamedTuple):
    """A tree as somebody has written it, and how each mistake in it begins, in the order of the file."""

    tree: str
    mistakes: tuple[str, ...]


def several(tree: str, *mistakes: str) -> Several:
    return Several(tree, mistakes)


TOGETHER = [
    # A mistake of YAML, of a unit, of a word: each beside a variable that is not set, or a kind that does not fit
    several(
        "- stop:\n  timeout 5 s\n- say: ${who}\n- set: {who: Anna}",
        "'timeout' lacks a colon",
        "'who' is read here, but nothing before",
    ),
    several(
        "- drive: 1\n- say: ${who}\n- set: {who: Anna}",
        "'drive' needs a length such as '0.5 m': '1' has no unit",
        "'who' is read here, but nothing before",
    ),
    several(
        "- trak_face\n- if: face.seen\n  set: {who: Anna}\n- say: ${who}",
        "unknown behaviour 'trak_face'",
        "'who' is read here, but it is not set where 'if'",
    ),
    several("- sleep: 2 s\n- set: {gap: 2 m}\n- wait: ${gap}", "unknown behaviour 'sleep'", "'wait' needs a duration"),
    several(
        "- turn: 3\n- parallel:\n    - drive: 1 m\n    - drive: 2 m",
        "'turn' needs an angle",
        "'drive' and 'drive' (line 6) can both drive",
    ),
    several(
        "- nod_off\n- stop:\n  repeat: forever\n- say: Hello",
        "unknown behaviour 'nod_off'",
        "'say' is never reached: 'stop' (line 5) never succeeds",
    ),
    several(
        "- turn: {angel: 90 deg}\n- stop:\n  on_failure: succeed\n  retry: 3",
        "'turn' needs 'angle'",
        "'turn' has no argument 'angel'",
        "'retry' has no effect here: 'stop' never fails",
    ),
    several(
        "- listen: {for: [yes please, no thanks]}\n  as: answer\n  timeout: 5\n- say: Hello\n  if: answer == 'yes'",
        "'timeout' needs a duration",
        "'if': 'answer' is never 'yes'",
    ),
    several(
        "- for_each: {in: [1, 2], as: n, do: {set: {n: 3}}}\n- drve_on",
        "'set' sets 'n'",
        "unknown behaviour 'drve_on'",
    ),
    several(
        '- say: "Hello\n- say: ${nobody}',
        "unclosed quote",
        "'say': unknown name 'nobody'",
    ),
    # What hangs on a mistake is none itself
    several("- sett: {n: 3}\n- say: ${n}", "unknown behaviour 'sett'"),
    several("- find_fase:\n  as: who\n- say: ${who.name}", "unknown behaviour 'find_fase'"),
    several("- if_else: {then: {set: {n: 3}}}\n- say: ${n}", "unknown behaviour 'if_else'"),
    several(
        "- turn: {angle: 3 m}\n- stop:\n  retry: ${3 / 0}",
        "'turn': 'angle' needs an angle",
        "'retry': '3 / 0' divides by zero",
    ),
    several("- mission: gone\n- say: ${result}", "unknown mission 'gone'"),
    several("- swich: {on: n, cases: {1: {set: {a: 1}}}}\n- log: ${a}", "unknown behaviour 'swich'"),
    several("- selector:\n    - always_wrong\n    - set: {n: 1}\n- log: hi", "unknown behaviour 'always_wrong'"),
    several("- parallel:\n    - stopp\n    - say: Hi\n  success_count: 2", "unknown behaviour 'stopp'"),
    several("- race: []\n- say: Hi", "'race' needs a list"),
    several("- stop:\n  retry: 0\n- say: Hi", "'retry' needs a count of 1 or more"),
    several("- switch: {on: face.sen, cases: {true: stop}}", "'on': unknown name 'face.sen'"),
    several("- switch: {on: face.seen, cases: {true: stap, false: {say: Hi}}}", "unknown behaviour 'stap'"),
    several("- set:\n    n: ${m}\n- say: Hi\n  if: n > 3", "'n': unknown name 'm'"),
    several("- for_each:\n    in: ${rooms}\n    as: room\n    do: {log: hi}", "'in': unknown name 'rooms'"),
]


@pytest.mark.parametrize("written", TOGETHER, ids=lambda written: written.tree.splitlines()[0])
def test_one_mistake_hides_no_other_and_has_no_follower(written: Several) -> None:
    lines = [f"    {line}" for line in written.tree.splitlines()]
    told = faults("\n".join(["mission: m", "tree:", "  sequence:", *lines, ""]))
    messages = [fault.message for fault in told]
    assert len(messages) == len(written.mistakes), messages
    assert [m for m, begins in zip(messages, written.mistakes, strict=True) if not m.startswith(begins)] == []


def test_wrong_param_is_reported_once() -> None:
    text = "mission: m\nparams:\n  gap: {type: lenght}\ntree:\n  drive: ${gap}\nreturns: {gap: gap}\n"
    assert [fault.message for fault in faults(text)] == ["param 'gap': unknown type 'lenght'"]
    assert [fault.mark.line for fault in faults(text, gap="3 m")] == [3]


WRONG = {
    "a word that nobody knows": (re.compile(r"^( *(?:- )*)(\w+)\b(?=:|$)"), r"\1zzzz\2"),
    "a unit that is none": (re.compile(r"(\d) (deg/s|m/s|deg|ms|m|s)\b"), r"\1 furlong"),
    "a unit left out": (re.compile(r"(\d) (deg/s|m/s|deg|ms|m|s)\b"), r"\1"),
    "an expression that is none": (re.compile(r"\$\{([^}]*)\}"), r"${\1 +}"),
    "a name that nobody knows": (re.compile(r"\$\{(\w+)"), r"${zzzz\1"),
}
"""Ways of spoiling a line of a mission that is right."""


@pytest.mark.parametrize("what", WRONG)
def test_one_mistake_is_reported_only_at_its_line(what: str) -> None:
    random, (found, instead) = Random(15), WRONG[what]  # noqa: S311 - which lines are spoilt
    wrong, spoilt = [], 0
    for path in shipped_missions().values():
        lines = path.read_text(encoding="utf-8").splitlines()
        begin = next(at for at, line in enumerate(lines) if line.startswith("tree:")) + 1
        end = next((at for at, line in enumerate(lines) if at > begin and line[:1].isalpha()), len(lines))
        places = [at for at in range(begin, end) if found.search(lines[at]) and "set:" not in lines[at]]
        for at in random.sample(places, min(3, len(places))):
            changed = [*lines[:at], found.sub(instead, lines[at], count=1), *lines[at + 1 :]]
            elsewhere = [each for each in faults("\n".join(changed) + "\n", path) if each.mark.line != at + 1]
            spoilt += 1
            wrong += [f"{path.name}, {changed[at]!r}: {each}" for each in elsewhere]
    assert spoilt > 5
    assert not wrong, "\n".join(wrong)


def faults(text: str, path: Path = Path("m.yaml"), **params: str) -> list[Diagnostic]:
    try:
        check_plan(SourceText(str(path), text), LEAVES, LOOKUPS, find_mission=find_mission, params=params)
    except InvalidFileError as error:
        return list(error.diagnostics)
    return []
