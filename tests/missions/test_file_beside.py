"""One rule for the names of missions: the file beside goes before the library, whoever names it."""

from pathlib import Path

import pytest

import missions
from missions.library.shipped import find_mission, shipped_missions
from missions.plugins.studio.library import files_by_name
from missions.plugins.testing.suite import find_tests, load_suite
from tests.missions.command import command

OWN = "mission: wander\ntree: {log: mine}\n"
TESTS = "tests: wander\ncases:\n  - case: it is mine\n    expect: {result: success, within: 1 s}\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a mission that has the name of one that ships, which is the working directory."""
    (tmp_path / "wander.yaml").write_text(OWN, encoding="utf-8")
    (tmp_path / "wander.test.yaml").write_text(TESTS, encoding="utf-8")
    (tmp_path / "other.yaml").write_text("mission: other\ntree: {mission: wander}\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", ["wander", "wander.yaml", "other", "other.yaml"])
def test_mission_run_check_and_show_take_the_file_beside(
    folder: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert folder.is_dir()
    done = command(capsys, "run", name, "--simulate", "fast")
    assert (done.code, "mine" in done.out) == (0, True), done
    assert "1 node" in command(capsys, "check", "wander").out
    assert "mine" in command(capsys, "show", name).out


def test_tests_and_python_api_prefer_the_file_beside(folder: Path) -> None:
    (path,) = find_tests("wander")
    (case,) = load_suite(path)
    assert (path, case.mission) == (Path("wander.test.yaml"), "wander.yaml")
    assert missions.load("wander").root.kind == "log"
    assert folder == Path.cwd()


def test_studio_omits_shadowed_library_names(folder: Path) -> None:
    names = files_by_name("missions")
    assert "wander" not in names
    assert names["wander.yaml"].resolve() == folder / "wander.yaml"
    assert names["greet"] == shipped_missions()["greet"]


@pytest.mark.parametrize("suffix", [".yaml", ".yml"])
def test_file_beside_takes_precedence_over_the_library(tmp_path: Path, suffix: str) -> None:
    own = tmp_path / f"greet{suffix}"
    own.write_text("mission: greet\ntree: stop\n", encoding="utf-8")
    assert find_mission("greet", tmp_path) == own
    assert find_mission("greet", tmp_path / "elsewhere") == shipped_missions()["greet"]


@pytest.mark.parametrize("text", ["world: greet\n", "tests: greet\ncases: []\n", "gesture: greet\n"])
def test_file_of_another_kind_does_not_shadow_a_mission(tmp_path: Path, text: str) -> None:
    (tmp_path / "greet.yaml").write_text(text, encoding="utf-8")
    (tmp_path / "motions").mkdir()
    assert find_mission("greet", tmp_path) == shipped_missions()["greet"]


def test_folder_or_program_does_not_shadow_a_mission(tmp_path: Path) -> None:
    (tmp_path / "greet").write_bytes(b"\x7fELF")
    (tmp_path / "wander.yaml").mkdir()
    assert find_mission("greet", tmp_path) == shipped_missions()["greet"]
    assert find_mission("wander", tmp_path) == shipped_missions()["wander"]
