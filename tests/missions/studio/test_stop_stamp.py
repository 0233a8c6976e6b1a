"""A stop that is typed before a command can be found: the command ends before it moves anything."""

import os
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import pytest

from missions.control import notes
from missions.control.command_broadcast import send_to_all
from missions.control.notes import STAMP_FILE, was_stopped_since, write_stamp
from missions.control.processes import identity_of
from missions.control.run_folders import run_folders
from tests.missions.command import PATIENCE, command

HELD_UP = "open({gate!r}).read()  # waits until somebody has written there\n"


@contextmanager
def loading(folder: Path, *words: str) -> Iterator[tuple[subprocess.Popen[str], Path]]:
    """A command whose Python has just started, and the gate that holds it up there."""
    gate = folder / "gate"
    os.mkfifo(gate)
    (folder / "sitecustomize.py").write_text(HELD_UP.format(gate=str(gate)), encoding="utf-8")
    environment = os.environ | {"PYTHONPATH": str(folder)}
    program = [sys.executable, "-m", "missions", *words]
    with subprocess.Popen(program, env=environment, stdout=-1, stderr=-1, text=True) as process:
        try:
            yield process, gate
        finally:
            process.kill()


def brief(folder: Path) -> str:
    path = folder / "brief.yaml"
    path.write_text("mission: brief\ntree:\n  wait: 10 ms\n", encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("stopped", [True, False])
def test_run_that_started_before_a_stop_ends_before_it_begins(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *, stopped: bool
) -> None:
    if not stopped:
        before = notes._uptime() - 1000
        with monkeypatch.context() as earlier:
            earlier.setattr(notes, "_uptime", lambda: before)
            write_stamp()
    with loading(tmp_path, "run", brief(tmp_path), "--simulate", "fast") as (process, gate):
        if stopped:
            assert command(capsys, "stop").out == "no mission is running\n"
        gate.write_text("go on")
        out, error = process.communicate(timeout=PATIENCE)
    assert process.returncode == (3 if stopped else 0), (out, error)
    assert ("`mission stop` was typed while this was loading" in error) is stopped


def test_command_that_started_before_a_stop_moves_no_part(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with loading(tmp_path, "head", "look", "--pan", "20", "--simulate") as (process, gate):
        command(capsys, "stop")
        gate.write_text("go on")
        _, error = process.communicate(timeout=PATIENCE)
    assert (process.returncode, "while this was loading" in error) == (3, True), error


def test_stop_of_one_run_leaves_no_stamp_for_others() -> None:
    for place in run_folders():
        (place.folder / STAMP_FILE).unlink(missing_ok=True)
    send_to_all([{"do": "stop"}], "a test", ["greet"])
    own = identity_of(os.getpid())
    assert own is not None
    assert not was_stopped_since(own)


@pytest.mark.parametrize(
    "damage",
    [
        "",
        "{",
        "[]",
        '{"boot": "", "ticks": 1e300}',
        '{"ticks": 9999999999}',
        '{"boot": "", "ticks": 1e999}',
        "[" * 50_000,
    ],
)
def test_a_damaged_stamp_stops_nothing(damage: str) -> None:
    write_stamp()
    for place in run_folders():
        if (place.folder / STAMP_FILE).exists():
            (place.folder / STAMP_FILE).write_text(damage, encoding="utf-8")
    own = identity_of(os.getpid())
    assert own is not None
    assert not was_stopped_since(own)


def test_stop_without_a_writable_stamp_is_uncertain(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(notes, "_write_stamp", fail)
    stopped = command(capsys, "stop")
    assert (stopped.code, "perhaps not stopped" in stopped.err) == (1, True)


def test_concurrent_stamps_do_not_collide() -> None:
    with ThreadPoolExecutor(8) as threads:
        written = [threads.submit(write_stamp) for _ in range(200)]
    assert [each.exception() for each in written] == [None] * 200
