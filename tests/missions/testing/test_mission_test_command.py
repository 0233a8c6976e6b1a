"""``mission test``: which files it plays, what it prints and writes, and its exit codes."""

import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from missions.cli.root import FAILURE, INTERRUPTED, SUCCESS, USAGE
from missions.library.shipped import shipped_missions
from missions.plugins.testing.case_verdict import CaseVerdict
from missions.plugins.testing.report import junit
from missions.plugins.testing.suite import all_tests, find_tests, load_suite
from missions.plugins.testing.worker_pool import PROCESS_ENDED, play_all
from tests.missions.command import command
from tests.missions.testing.playing import WAITS, cases, seen, write

TWO = """tests: nap
cases:
  - case: it sleeps for a second
    expect: {result: success, after: 1 s}
  - case: it sleeps for ever & a <day>
    expect: {after: 1 h}
"""
NAP = {"nap.yaml": "mission: nap\ntree: {wait: 1 s}\n", "nap.test.yaml": TWO}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a mission and its tests, one of which fails, which is the working directory."""
    write(tmp_path, NAP)
    monkeypatch.chdir(tmp_path)
    return tmp_path


FETCH = {
    "look.yaml": "mission: look\ntree: {sequence: [{find_face: }, {say: There!}]}\n",
    "fetch.yaml": """mission: fetch
tree:
  sequence:
    - mission: look.yaml
      returns: {found: 1 + 1}
    - sequence: [{drive: 1 m}, {turn: 90 deg}]
      name: bring it
    - say: ${found}
""",
    "fetch.test.yaml": """tests: fetch
with: {eyes: truth}
cases:
  - case: nothing of it moves
    given:
      - look: {does: succeeds, result: {found: 7}}
      - bring it: runs for 1 s, then succeeds
    expect: {result: success, said: '7', after: 1 s, never_ran: drive}
  - case: it cannot be brought
    given:
      - 'l??k': succeeds
      - bring it: fails because "too heavy"
    expect: {result: failure, reason: too heavy, ran: [look, bring it]}
""",
}


@pytest.mark.usefixtures("here")
def test_missions_and_composites_are_mocked_as_a_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write(tmp_path, FETCH)
    outcome = command(capsys, "test", "fetch.test.yaml", "-j", "1", "--coverage")
    assert outcome.code == SUCCESS, outcome.out + outcome.err
    assert "fetch.yaml:6: drive: never reached" in outcome.out
    text = FETCH["fetch.test.yaml"].replace("found: 7", "fnd: 7").replace("bring it: fails", "sequence: fails")
    write(tmp_path, {"fetch.test.yaml": text})
    wrong = command(capsys, "test", "fetch.test.yaml").err
    assert "'result' has no 'fnd'" in wrong
    assert "'sequence' is not the name of one behaviour" in wrong
    assert "these can be mocked: bring it, drive, find_face, look, say, turn" in wrong


@pytest.mark.usefixtures("here")
def test_behaviours_are_taken_from_the_option_and_from_the_folder_beside_the_mission(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    blink = "from behaviours.basics import Succeed\n\n\nclass Blink(Succeed):\n    'Blink.'\n\n    tag = 'blink'\n"
    write(tmp_path, {"eyes.py": blink, "eye.yaml": "mission: eye\ntree: blink\n"})
    write(tmp_path, {"eye.test.yaml": "tests: eye\ncases: [{case: it blinks, expect: {result: success}}]\n"})
    outcome = command(capsys, "test", "eye.test.yaml")
    assert outcome.code == USAGE
    assert "put your own into behaviours/NAME.py beside the mission" in outcome.err
    assert command(capsys, "test", "eye.test.yaml", "-j", "1", "--behaviours", "eyes.py").code == SUCCESS
    Path("behaviours").mkdir()
    Path("eyes.py").rename("behaviours/eyes.py")
    write(tmp_path / "behaviours", {"_not_this.py": "1 / 0\n"})
    for words in (("test", "eye.test.yaml", "-j", "1"), ("check", "eye.yaml", "eye.test.yaml"), ("run", "eye.yaml")):
        outcome = command(capsys, *words)
        assert outcome.code == SUCCESS, outcome.err
        assert "behaviours of this folder: behaviours/eyes.py" in outcome.err, words
    for line in ("show eye.yaml", "verify eye.yaml", "show behaviour blink", "schema"):
        outcome = command(capsys, *line.split())
        assert outcome.code == SUCCESS, outcome.err
        assert "behaviours/eyes.py" in outcome.err, line
    Path("behaviours/__init__.py").touch()
    assert command(capsys, "check", "eye.yaml").code == USAGE, "a package of Python is no folder of behaviours"


def read(xml: bytes) -> ET.Element:
    """Read a report."""
    return ET.fromstring(xml)  # noqa: S314 - we have written it ourselves


@pytest.mark.usefixtures("here")
def test_failed_case_shows_its_line_and_the_actual_result(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    del folder
    outcome = command(capsys, "test", "--junit", "report.xml")
    assert outcome.code == FAILURE
    assert (
        outcome.out
        == (
            "passed  nap.test.yaml:3: it sleeps for a second\n"
            "\n"
            "FAILED  nap.test.yaml:5: it sleeps for ever & a <day>\n"
            "  nap.test.yaml:6:21: it took only 1.00 s\n"
            "       6 |     expect: {after: 1 h}\n"
            "         |                     ^^^\n"
            "  last events:\n"
            "      0.00 s  wait starts\n"
            "      1.00 s  wait succeeds\n"
            "      1.00 s  nap ends: success\n"
            "\n"
        )
        + outcome.out.splitlines(keepends=True)[-1]
    )
    assert outcome.out.splitlines()[-1].startswith("1 passed, 1 failed: 2 s of simulated time in ")
    report = read(Path("report.xml").read_bytes())
    assert [suite.get("name") for suite in report] == ["nap.test.yaml"]
    assert {name: report[0].get(name) for name in ("tests", "failures", "errors")} == {
        "tests": "2",
        "failures": "1",
        "errors": "0",
    }
    good, bad = report[0]
    assert (good.get("name"), good.get("classname"), len(good)) == ("it sleeps for a second", "nap.test.yaml", 0)
    assert bad.get("name") == "it sleeps for ever & a <day>"
    assert bad[0].tag == "failure"
    assert bad[0].get("message") == "it took only 1.00 s"


@pytest.mark.usefixtures("here")
def test_cases_are_selected_by_name_and_printed_as_json(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    del folder
    outcome = command(capsys, "test", "nap", "-k", "A SECOND", "--json")
    assert outcome.code == SUCCESS
    (told,) = json.loads(outcome.out)
    assert told["case"] == "it sleeps for a second"
    assert told["passed"] is True
    assert told["seconds"] == 1.0
    assert outcome.err.startswith("1 passed")
    assert command(capsys, "test", "-k", "banana").code == USAGE


@pytest.mark.usefixtures("here")
def test_after_the_first_failure_nothing_new_begins(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = "".join(f"  - {{case: number {number}, expect: {{result: failure}}}}\n" for number in range(20))
    write(tmp_path, {"nap.yaml": NAP["nap.yaml"], "nap.test.yaml": f"tests: nap\ncases:\n{lines}"})
    outcome = command(capsys, "test", str(tmp_path), "--fail-fast", "--jobs", "1")
    assert outcome.code == FAILURE
    assert outcome.out.count("FAILED") == 1
    assert "0 passed, 1 failed, 19 not run" in outcome.out


def test_faults_of_all_files_are_reported_and_no_case_runs(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(folder, {"a.test.yaml": "tests: nap\ncases: []\n", "b.test.yaml": "tests: nob\ncases: []\n"})
    outcome = command(capsys, "test")
    assert outcome.code == USAGE
    assert outcome.out == ""
    assert "a.test.yaml:1:1: the file has no cases" in outcome.err
    assert "b.test.yaml:1:8: unknown mission 'nob'" in outcome.err


def test_case_that_ends_its_process_fails_and_others_run(tmp_path: Path) -> None:
    write(
        tmp_path,
        {
            "own.py": "import os\nfrom behaviours.leaf import Leaf\n\n\nclass Quit(Leaf):\n    'Quit.'\n"
            "    tag = 'quit'\n\n    def update(self):\n        os._exit(3)\n",
            "m.yaml": "mission: m\ntree: {sequence: [{wait: 1 s}, quit]}\n",
            "m.test.yaml": "tests: m\nbehaviours: [own.py]\ncases:\n"
            "  - {case: ends the process, expect: {result: success}}\n"
            "  - {case: does not, given: [{quit: succeeds}], expect: {result: success}}\n",
        },
    )
    verdicts = {verdict.case.title: verdict for verdict in play_all(load_suite(tmp_path / "m.test.yaml"), jobs=2)}
    assert verdicts["ends the process"].error == PROCESS_ENDED
    assert verdicts["does not"].passed


@pytest.mark.real_time
def test_ctrl_c_ends_all_processes_at_once(tmp_path: Path) -> None:
    write(
        tmp_path,
        {
            "own.py": "from behaviours.leaf import RUNNING, Leaf\n\n\nclass Stay(Leaf):\n    'Stay.'\n"
            "    tag = 'stay'\n\n    def initialise(self):\n        print('begun', flush=True)\n\n"
            "    def update(self):\n        return RUNNING\n",
            "m.yaml": "mission: m\ntree: stay\n",
            "m.test.yaml": "tests: m\nbehaviours: [own.py]\nwith: {timeout: 5 h}\n"
            "cases: [{case: a, expect: {result: success}}, {case: b, expect: {result: success}}]\n",
        },
    )
    program = [sys.executable, "-m", "missions", "test", str(tmp_path), "--jobs", "2"]
    process = subprocess.Popen(
        program, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "begun\n"
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does
        _, errors = process.communicate(timeout=20.0)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
    assert process.returncode == INTERRUPTED
    assert errors.strip() == "mission: interrupted"


def test_verdicts_of_worker_processes_are_complete(tmp_path: Path) -> None:
    (case,) = cases(tmp_path, WAITS, "expect: {result: failure}")
    (verdict,) = play_all([case], jobs=4)
    assert seen(verdict) == ["the result was success"]
    assert verdict.nodes[0].statuses == {"running": 1, "success": 1}


def test_tests_are_found_by_file_folder_mission_and_name(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    inner = folder / "inner"
    for each in (inner, folder / ".hidden"):
        each.mkdir()
        write(each, NAP)
    here, below = Path("nap.test.yaml"), Path("inner/nap.test.yaml")
    assert all_tests() == [below, here]
    assert find_tests(".") == [below, here]
    assert find_tests("nap.yaml") == find_tests("nap.test.yaml") == [here]
    assert find_tests("greet")[0].name == "greet.test.yaml"
    (folder / "nap.test.yaml").unlink()
    (inner / "nap.test.yaml").unlink()
    assert {path.name for path in all_tests()} >= {"greet.test.yaml", "square.test.yaml"}
    for name in ("nap.yaml", "nap.test.yaml", "inner", "nobody"):
        outcome = command(capsys, "test", name)
        assert outcome.code == USAGE
        assert name in outcome.err


def test_check_reads_tests_too_and_no_mission_is_mistaken_for_one(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    outcome = command(capsys, "check", ".")
    assert outcome.code == SUCCESS
    assert outcome.out.splitlines() == ["nap.test.yaml: good (2 cases)", "nap.yaml: good (nap, 1 node)"]
    (folder / "nap.test.yaml").write_text("tests: nap\ncases: []\n", encoding="utf-8")
    assert "the file has no cases" in command(capsys, "check", "nap.test.yaml").err
    assert not [name for name in shipped_missions() if name.endswith(".test")]


def test_characters_invalid_in_xml_are_replaced(tmp_path: Path) -> None:
    (case,) = cases(tmp_path, WAITS, "expect: {result: success}")
    report = read(junit([CaseVerdict(case, error="bell \x07 and half \ud800\nValueError: \x00")]))
    (error,) = report.iter("error")
    assert error.get("message") == "ValueError: \ufffd"
    assert "bell \ufffd and half \ufffd" in (error.text or "")
    assert report.get("errors") == "1"


@pytest.mark.usefixtures("here")
def test_unwritable_junit_report_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    del folder
    outcome = command(capsys, "test", "-k", "second", "--junit", "nowhere/report.xml")
    assert outcome.code == USAGE
    assert "nowhere/report.xml: there is no folder" in outcome.err


KITCHEN = """# Test of the greeting in the kitchen.
tests: greet
with: {eyes: truth}

cases:
  - case: it says good-bye
    expect:
      result: success
      said: Good-bye!
"""


def test_examples_of_the_docs_give_the_printed_output(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    docs = (Path(__file__).parents[3] / "docs" / "testing.md").read_text(encoding="utf-8")
    file = docs.split("```yaml\n", 1)[1].split("```")[0]
    passed, failed = (block.split("```")[0] for block in docs.split("```text\n")[1:3])
    write(tmp_path, {"greet.test.yaml": file, "kitchen.test.yaml": KITCHEN})
    monkeypatch.chdir(tmp_path)
    assert passed in command(capsys, "test", "greet.test.yaml", "--jobs", "1").out
    assert failed in command(capsys, "test", "kitchen.test.yaml", "--jobs", "1").out
