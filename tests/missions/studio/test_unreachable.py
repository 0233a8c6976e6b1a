"""A run whose control socket cannot be made goes on, and says that it cannot be reached."""

from pathlib import Path

import pytest

from tests.missions.command import command


def test_a_run_without_a_folder_for_its_socket_says_so_and_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "missiontree").write_text("no folder", encoding="utf-8")
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    mission = tmp_path / "brief.yaml"
    mission.write_text("mission: brief\ntree:\n  wait: 10 ms\n", encoding="utf-8")
    ran = command(capsys, "run", str(mission), "--simulate", "fast")
    assert ran.code == 0
    assert "`mission stop` cannot reach this run" in ran.err


def test_a_path_that_is_too_long_for_a_socket_does_as_well(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / ("x" * 150)
    folder.mkdir()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))
    mission = tmp_path / "brief.yaml"
    mission.write_text("mission: brief\ntree:\n  wait: 10 ms\n", encoding="utf-8")
    ran = command(capsys, "run", str(mission), "--simulate", "fast")
    assert (ran.code, ran.err) == (0, "")
    assert list((folder / "missiontree" / "runs").iterdir()) == []
