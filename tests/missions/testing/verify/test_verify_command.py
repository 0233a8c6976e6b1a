"""``mission verify`` as its users meet it: what it prints, its exit codes, and its JSON."""

import itertools
import json
import re
import time
from pathlib import Path

import pytest

from tests.missions.command import Outcome, command

FOLDER = Path(__file__).parent / "faulty"
GOOD = "mission: good\ntree:\n  sequence:\n    - drive: 1 m\n    - say: Hi\nproperties:\n  - never: say before drive\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "good.yaml").write_text(GOOD, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


HURRY = """mission: hurry
tree:
  # both at once
  parallel:
    - drive: 1 m
    - gesture: hello
properties:
  - never: gesture while drive
"""


def verify(capsys: pytest.CaptureFixture[str], *arguments: str) -> Outcome:
    return command(capsys, "verify", *arguments)


def test_proved_properties_are_listed_with_figures(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    del folder
    outcome = verify(capsys, "good.yaml")
    assert outcome.code == 0
    first, *rest = outcome.out.splitlines()
    assert first.startswith("good.yaml: proved (8 states, 16 transitions, 2 ticks deep, ")
    assert rest == [
        "  proved       it can end from every state",
        "  proved       each of its 3 nodes can be reached",
        "  proved       no two behaviours drive one actuator at the same time",
        "  proved       after every halt and every end all is at rest",
        "  proved       never: say before drive",
    ]


def test_refuted_property_is_shown_with_its_line_and_a_run(capsys: pytest.CaptureFixture[str]) -> None:
    outcome = verify(capsys, str(FOLDER / "left_rolling.yaml"), "--behaviours", str(FOLDER / "rolling.py"))
    assert outcome.code == 1
    shown = outcome.out.partition("\n\n")[2].splitlines()
    assert shown[0].endswith("left_rolling.yaml:6:7: the base still moves: roll_away (line 6) leaves it to itself")
    assert shown[1:] == [
        "     6 |     - roll_away",
        "       |       ^^^^^^^^^",
        "  a shortest run to it, of 2 ticks:",
        "     1. say (line 5) runs; roll_away (line 6) runs -> race (line 4) running",
        "     2. say (line 5) succeeds -> roll_away (line 6) halted, race (line 4) success",
    ]


def test_json_output_has_the_same_content(capsys: pytest.CaptureFixture[str]) -> None:
    outcome = verify(capsys, "--json", str(FOLDER / "drives_after_goodbye.yaml"), "patrol", "--bound", "20")
    assert outcome.code == 1
    goodbye, patrol = json.loads(outcome.out)
    assert (goodbye["mission"], goodbye["outcome"], goodbye["left_out"]) == ("drives_after_goodbye", "refuted", "")
    (finding,) = goodbye["verdicts"][-1]["findings"]
    assert (finding["line"], finding["column"], finding["length"]) == (9, 5, 5)
    assert [turn["given"][0] for turn in finding["run"]] == ["drive (line 5) succeeds"] * 2
    assert finding["run"][0]["changed"] == {"sequence (line 4)": "success", "repeat (line 7)": "running"}
    assert patrol["outcome"] == "not decided"
    assert "--bound 200" in patrol["left_out"]


def test_too_small_a_bound_is_no_proof(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    del folder
    outcome = verify(capsys, "good.yaml", "--bound", "1")
    assert outcome.code == 1
    assert "good.yaml: not decided" in outcome.out
    assert "  not fully explored: 1 of 2 states were not fully explored; try --bound 10" in outcome.out


def test_a_limit_of_time_is_no_proof_either(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    del folder
    outcome = verify(capsys, "good.yaml", "--limit", "0 s")
    assert outcome.code == 1
    assert "after 0 s of CPU time 1 of 1 states were not fully explored; try --limit" in outcome.out


def test_only_the_time_of_this_process_counts(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    del folder
    real = time.monotonic
    monkeypatch.setattr(time, "monotonic", lambda: 1000.0 * real())  # another program takes the processor
    assert verify(capsys, "good.yaml", "--limit", "10 s").code == 0
    ticks = itertools.count(0.0, 1.0)
    monkeypatch.setattr(time, "process_time", lambda: next(ticks))
    assert "after 1 s of CPU time" in verify(capsys, "good.yaml", "--limit", "1 s").out


def test_a_folder_is_verified_file_by_file(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "other.yaml").write_text(GOOD.replace("good", "other"), encoding="utf-8")
    outcome = verify(capsys, ".")
    assert outcome.code == 0
    assert [line.split(":")[0] for line in outcome.out.splitlines() if not line.startswith(" ")] == [
        "good.yaml",
        "other.yaml",
    ]


def test_invalid_mission_is_an_error_and_others_are_verified(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "bad.yaml").write_text("mission: bad\ntree: drvie\n", encoding="utf-8")
    outcome = verify(capsys, "bad.yaml", "good.yaml", "nowhere")
    assert outcome.code == 2
    assert "bad.yaml:2:7" in outcome.err
    assert "unknown mission 'nowhere'" in outcome.err
    assert outcome.out.startswith("good.yaml: proved")


def test_param_decides_the_reachable_nodes(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = "mission: m\nparams: {loud: false}\ntree:\n  sequence: [{drive: 1 m}, {say: Hi, if: loud}]\n"
    (folder / "m.yaml").write_text(text, encoding="utf-8")
    assert verify(capsys, "m.yaml").code == 1
    assert verify(capsys, "m.yaml", "--param", "loud=true").code == 0


def test_unset_param_may_have_any_value(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = "mission: m\nparams: {n: {type: count}}\ntree:\n  drive: 1 m\n  if: n > 3\n  repeat: ${n}\n"
    (folder / "m.yaml").write_text(text, encoding="utf-8")
    assert verify(capsys, "m.yaml").code == 0


def test_verify_output_matches_the_docs(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = (Path(__file__).parents[4] / "docs" / "verify.md").read_text(encoding="utf-8")
    (mission,) = re.findall(r"^```yaml\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)
    (folder / "escort.yaml").write_text(mission, encoding="utf-8")
    assert verify(capsys, "escort.yaml").code == 0
    (folder / "hurry.yaml").write_text(HURRY, encoding="utf-8")
    shown = page.partition("$ mission verify hurry.yaml\n")[2].partition("```")[0]
    printed = re.sub(r"\d+\.\d s", "0.0 s", verify(capsys, "hurry.yaml").out)
    first, _, run = shown.partition("...\n")
    assert printed.startswith(first)
    assert printed.endswith(run)


ARMLESS = "robot: box\nbase: {driver: kobuki, port: /dev/kobuki}\n"


def test_verify_uses_the_default_robot_like_check(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "reach.yaml").write_text(
        "mission: reach\ntree:\n  move_joints: {to: {third_knee: 5 deg}}\n", encoding="utf-8"
    )
    checked, verified = command(capsys, "check", "reach.yaml"), verify(capsys, "reach.yaml")
    assert (checked.code, verified.code) == (2, 2)
    assert "third_knee" in verified.err
    assert checked.err.startswith(verified.err)
    (folder / "box.yaml").write_text(ARMLESS, encoding="utf-8")
    (folder / "hello.yaml").write_text("mission: hello\ntree:\n  gesture: hello\n", encoding="utf-8")
    assert verify(capsys, "hello.yaml").code == 0
    refused = verify(capsys, "hello.yaml", "--robot", "box.yaml")
    assert refused.code == 2
    assert "'gesture' needs an arm; robot 'box' has none" in refused.err


SHARED = """mission: shared
params: {whole: {type: number}, half: 2}
tree:
  sequence:
    - set: {n: NUMBER}
    - selector:
        - sequence:
            - set: {part: "${CALCULATED}"}
            - set: {after: 1}
        - succeed
    - log: ${after}
"""


@pytest.mark.parametrize(
    ("number", "calculated", "code"),
    [
        ("2", "1 / n", 0),
        ("0", "1 / n", 2),
        ("${half}", "1 / n", 0),
        ("${whole}", "1 / n", 2),
        ("${face.count}", "1 / n", 2),
        ("${whole}", "n + 1", 0),
        ("${whole}", "(n - 3) * half < 8", 0),
        ("${whole}", "n % 2", 0),
    ],
)
def test_check_and_verify_agree_on_whether_a_calculation_can_fail(
    folder: Path, capsys: pytest.CaptureFixture[str], number: str, calculated: str, code: int
) -> None:
    text = SHARED.replace("CALCULATED", calculated)
    (folder / "shared.yaml").write_text(
        text.replace("NUMBER", f'"{number}"' if "$" in number else number), encoding="utf-8"
    )
    told = [command(capsys, each, "shared.yaml") for each in ("check", "verify")]
    assert [outcome.code for outcome in told] == [code, 1 if code == 0 else code]
    if code:
        assert all("'after' is read here, but it is not set where 'set' (line 8) fails" in each.err for each in told)
    else:  # since the division never fails, what is tried after it is never reached
        assert "'succeed' is never reached" in told[1].out
