"""Runs whose control socket cannot be where it usually is: another place does, and without any no robot is moved."""

import errno
import os
from pathlib import Path

import pytest

from missions.control import abstract_sockets
from missions.runner import Runner
from tests.missions.command import Process, command
from tests.missions.lone_base import LONE_ROBOT, lone_base
from tests.missions.studio.running import found_of, nowhere
from tests.waiting import wait_until

BRIEF = "mission: brief\ntree:\n  wait: 10 ms\n"


def mission_in(folder: Path, text: str = BRIEF) -> str:
    path = folder / "brief.yaml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_run_without_a_runtime_folder_uses_the_state_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "missiontree").write_text("no folder", encoding="utf-8")
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    ran = command(capsys, "run", mission_in(tmp_path), "--simulate", "fast")
    assert (ran.code, ran.err) == (0, "")


def test_simulated_run_without_any_folder_warns_and_continues(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    nowhere(tmp_path, monkeypatch)
    ran = command(capsys, "run", mission_in(tmp_path), "--simulate", "fast")
    assert ran.code == 0
    assert "`mission stop` cannot reach this run" in ran.err


def test_a_run_without_any_socket_is_still_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    found: list[bool] = []
    run = Runner.run

    def look(runner: Runner) -> object:
        found.extend(each.is_command for each in found_of(os.getpid()))
        return run(runner)

    def refuse(*_: object) -> None:
        raise OSError(errno.EPERM, "a system that has no abstract sockets")

    nowhere(tmp_path, monkeypatch)
    monkeypatch.setattr(abstract_sockets, "listen", refuse)
    monkeypatch.setattr(abstract_sockets, "bind_marker", refuse)
    monkeypatch.setattr(Runner, "run", look)
    ran = command(capsys, "run", mission_in(tmp_path), "--simulate", "fast")
    assert (ran.code, found) == (0, [False])
    assert found_of(os.getpid()) == []


def test_robot_that_no_stop_can_reach_is_moved_only_with_permission(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    nowhere(tmp_path, monkeypatch)
    with lone_base() as base:
        words = ["run", mission_in(tmp_path, "mission: brief\ntree:\n  drive: 2 cm\n"), "--robot", LONE_ROBOT]
        words += ["--port", f"base={base.port}"]
        refused = command(capsys, *words)
        assert refused.code == 3
        assert "no note of the run" in refused.err
        assert "`mission stop` could not stop this, so no robot is moved" in refused.err
        assert "mission run --without-stop" in refused.err
        assert base.seen().top == 0.0
        process = Process(*words, "--without-stop")
        wait_until(lambda: process.process.poll() is not None)
        assert process.end() == 0, process.errors
        assert base.seen().top > 0.0


def test_overlong_socket_path_is_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / ("x" * 150)
    folder.mkdir()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))
    ran = command(capsys, "run", mission_in(tmp_path), "--simulate", "fast")
    assert (ran.code, ran.err) == (0, "")
    assert list((folder / "missiontree" / "runs").iterdir()) == []
