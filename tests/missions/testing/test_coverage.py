"""Coverage: what of a mission its tests have never tried."""

from html.parser import HTMLParser
from pathlib import Path

import pytest

from missions.library.shipped import shipped_missions
from missions.plugins.testing.case_runner import IN_PROCESS_LIMITS
from missions.plugins.testing.case_verdict import play
from missions.plugins.testing.report import FileCoverage, coverage, coverage_lines, coverage_page
from missions.plugins.testing.suite import load_suite
from tests.missions.command import command

MISSION = """\
mission: door
params: {side: left}
tree:
  sequence:
    - switch:
        on: side
        cases:
          left: {say: To the left}
          right: {say: To the right}
    - selector:
        - turn: 90 deg
        - fail: the door is shut
"""

TESTS = """\
tests: door
cases:
  - case: left
    given: [{turn: succeeds}]
    expect: {result: success}
"""

MORE = """\
  - case: it cannot turn
    given: [{turn: fails because "it is <stuck>"}]
    expect: {result: failure, reason: the door is shut}
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "door.yaml").write_text(MISSION)
    (tmp_path / "door.test.yaml").write_text(TESTS)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def tried(folder: Path) -> FileCoverage:
    """The coverage of the one mission, by its tests as they stand."""
    (found,) = coverage(play(case, limits=IN_PROCESS_LIMITS) for case in load_suite(folder / "door.test.yaml"))
    return found


def lacks(found: FileCoverage) -> dict[int, str]:
    return {node.line: node.describe_gaps() for node in found.nodes if node.describe_gaps()}


def test_unreached_branches_and_outcomes_are_reported(folder: Path) -> None:
    found = tried(folder)
    assert (found.file, found.ticked_count, len(found.nodes)) == ("door.yaml", 5, 7)
    assert lacks(found)[9] == "never reached"
    assert lacks(found)[11] == "never failed"
    assert lacks(found)[12] == "never reached"


def test_more_cases_leave_less_untried_and_keep_their_reasons(folder: Path) -> None:
    (folder / "door.test.yaml").write_text(TESTS + MORE)
    found = tried(folder)
    assert 11 not in lacks(found)
    assert 12 not in lacks(found)  # `fail` cannot succeed: nothing is missing
    assert [list(node.reasons) for node in found.nodes if node.kind == "turn"] == [["it is <stuck>"]]
    assert next(coverage_lines([found])).startswith("door.yaml: 6 of 7 nodes ticked, ")


class Reader(HTMLParser):
    """Keeps how lines are marked, and what is said when one points at them."""

    def __init__(self) -> None:
        super().__init__()
        self.marked: list[tuple[str | None, str | None]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "span":
            self.marked.append((dict(attrs).get("class"), dict(attrs).get("title")))


def test_coverage_page_marks_each_line(folder: Path) -> None:
    (folder / "door.test.yaml").write_text(TESTS + MORE)
    text = coverage_page([tried(folder)])
    reader = Reader()
    reader.feed(text)
    key, lines = reader.marked[:3], reader.marked[3:]
    assert [kind for kind, _ in key] == ["all", "part", "nothing"]
    assert len(lines) == len(MISSION.splitlines())
    assert lines[8] == ("nothing", None)
    assert lines[10] == ("all", "it is <stuck>")
    assert lines[0] == (None, None)
    assert "http" not in text


def test_deleted_mission_file_is_noted_on_the_coverage_page(folder: Path) -> None:
    found = tried(folder)
    (folder / "door.yaml").unlink()
    assert "can no longer be read" in coverage_page([found])


def test_coverage_page_has_no_absolute_paths_and_a_dark_mode(folder: Path) -> None:
    (folder / "own").mkdir()
    here = [FileCoverage(str(folder / name), []) for name in ("door.yaml", "own/step.yaml")]
    text = coverage_page([*here, FileCoverage(str(shipped_missions()["motions/square"]), [])])
    titles = [">door.yaml<", ">own/step.yaml<", ">missions/motions/square.yaml<"]
    assert [text.count(title) for title in titles] == [2, 2, 2]
    assert str(folder) not in text
    assert "prefers-color-scheme: dark" in text


@pytest.mark.usefixtures("here")
def test_coverage_is_printed_and_written_as_a_page(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    outcome = command(capsys, "test", "door", "--coverage", "--coverage-page", "tried.html")
    assert outcome.code == 0
    assert "door.yaml:9: say: never reached" in outcome.out
    assert (folder / "tried.html").read_text().startswith("<!doctype html>")
    assert command(capsys, "test", "door", "--coverage-page", "no/where.html").code == 2
