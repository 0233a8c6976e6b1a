"""An answer that ``listen`` has kept, compared with a text that it can never be."""

from pathlib import Path

import pytest

from config.diagnostics import InvalidFileError
from missions.library.shipped import load_mission

LISTEN = "    - listen: [yes, No thanks]\n      as: answer\n"


def said(folder: Path, steps: str, *, head: str = "", name: str = "m") -> list[str]:
    """Return what is wrong with a mission of these steps."""
    file = folder / f"{name}.yaml"
    file.write_text(f"mission: {name}\n{head}tree:\n  sequence:\n{steps}", encoding="utf-8")
    try:
        load_mission(str(file))
    except InvalidFileError as error:
        return [f"{fault.mark.line}: {fault.message}; {fault.suggestion}" for fault in error.diagnostics]
    return []


@pytest.mark.parametrize(
    ("expression", "hint"),
    [
        ("answer == 'yess'", "'answer' is never 'yess'; did you mean 'yes'?"),
        ("'no thanks' == answer", "'answer' is never 'no thanks'; did you mean 'No thanks'?"),
        ("answer != ''", "'answer' is never ''; it can be: No thanks, yes"),
        ("not (answer in ['yes', 'maybe'])", "'answer' is never 'maybe'; it can be: No thanks, yes"),
    ],
)
def test_comparison_of_an_answer_with_an_impossible_text_is_a_mistake(
    tmp_path: Path, expression: str, hint: str
) -> None:
    assert said(tmp_path, f'{LISTEN}    - say: x\n      if: "{expression}"\n') == [f"7: 'if': {hint}"]


def test_switch_case_that_is_no_phrase_is_a_mistake(tmp_path: Path) -> None:
    steps = f"{LISTEN}    - switch: {{on: answer, cases: {{yes: succeed, 'no': stop}}, default: succeed}}\n"
    assert said(tmp_path, steps) == ["6: 'switch': 'answer' is never 'no'; it can be: No thanks, yes"]


@pytest.mark.parametrize(
    "more",
    [
        "    - say: ${answer + '!'}\n      if: answer == 'yes' or answer == 'No thanks'\n",
        "    - listen: maybe\n      as: answer\n    - say: x\n      if: answer == 'maybe'\n",
        "    - set: {answer: none of it}\n    - say: x\n      if: answer == 'none of it'\n",
        "    - find_face:\n      as: answer\n    - say: x\n      if: answer == 'none of it'\n",
        "    - say: x\n      if: answer < 'b'\n",
    ],
)
def test_comparison_of_an_answer_with_a_phrase_is_accepted(tmp_path: Path, more: str) -> None:
    assert said(tmp_path, LISTEN + more) == []


def test_a_phrase_with_a_param_may_be_anything(tmp_path: Path) -> None:
    head = "params: {word: {type: text}}\n"
    steps = "    - listen: [yes, '${word}']\n      as: answer\n    - say: x\n      if: answer == 'tea'\n"
    assert said(tmp_path, steps, head=head) == []


def test_submission_has_its_own_answers(tmp_path: Path) -> None:
    inner = "    - listen: [tea, milk]\n      as: answer\n    - say: x\n      if: answer == 'tee'\n"
    assert said(tmp_path, inner, name="inner") == ["7: 'if': 'answer' is never 'tee'; did you mean 'tea'?"]
    outer = f"{LISTEN}    - mission: inner.yaml\n    - say: x\n      if: answer == 'yes'\n"
    assert said(tmp_path, outer) == ["7: 'if': 'answer' is never 'tee'; did you mean 'tea'?"]
    (tmp_path / "inner.yaml").write_text(
        "mission: inner\nparams: {answer: tea}\ntree: {say: x, if: \"answer == 'milk'\"}\n", encoding="utf-8"
    )
    assert said(tmp_path, LISTEN + "    - mission: inner.yaml\n      with: {answer: '${answer}'}\n") == []
