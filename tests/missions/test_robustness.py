"""What must not hurt a run: listeners that break or hang, terminals that go away, stale readings, a pause."""

import json
import os
import resource
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from behaviours.robot import Robot
from drivers.clock import ManualClock
from drivers.errors import NotConnected
from missions.assembly.assembled_robot import AssembledRobot
from missions.cli.leash import OUTPUT_CLOSED, watch_outputs
from missions.executive.events import Event, Logged
from missions.executive.state import state_of
from missions.executive.stream import EventStream
from missions.language.expressions import parse
from missions.library.shipped import load_mission
from missions.plugins.testing.recorders import HOLD, RELAX, STOP, LeafTestBench, good, stale
from missions.request import RunRequest
from missions.runner import Runner
from tests.missions.command import Process, command
from tests.waiting import wait_until


def event(text: str = "x") -> Event:
    return Logged(0.0, "info", text)


def test_raising_listener_is_removed_and_named() -> None:
    heard: list[Event] = []

    def leaver(event: Event) -> None:
        raise SystemExit(f"no terminal for {event.t}")

    stream = EventStream([leaver, heard.append])
    stream.emit(event())
    stream.emit(event())
    assert len(heard) == 2
    assert stream.failed_listeners == ["function: no terminal for 0.0"]


def test_hanging_listener_does_not_block_the_stream() -> None:
    stuck, ready = threading.Event(), threading.Event()

    def hang(_: Event) -> None:
        ready.set()
        stuck.wait(10.0)

    stream = EventStream([hang])
    stream.open()
    stream.emit(event())
    assert ready.wait(5.0)
    for _ in range(1000):
        stream.emit(event())  # returns at once, or this test would take for ever
    stuck.set()
    stream.close()
    assert stream.failed_listeners == []


def test_events_come_in_order_and_whole_before_the_stream_has_closed() -> None:
    heard: list[Event] = []
    stream = EventStream([heard.append])
    stream.open()
    for number in range(500):
        stream.emit(event(str(number)))
    stream.close()
    assert [each.as_dict()["text"] for each in heard] == [str(number) for number in range(500)]


@pytest.mark.parametrize("options", [[], ["--json"]], ids=["for people", "for programs"])
def test_closed_output_ends_the_run_with_the_base_stopped(options: list[str], tmp_path: Path) -> None:
    (tmp_path / "far.yaml").write_text("mission: far\ntree:\n  drive: 20 m\n")
    reader, writer = os.pipe()
    process = subprocess.Popen(
        [sys.executable, "-m", "missions", "run", "far.yaml", "--events", "e.jsonl", *options],
        stdout=writer,
        stderr=subprocess.PIPE,
        cwd=tmp_path,
    )
    os.close(writer)
    with process:
        wait_until(lambda: (tmp_path / "e.jsonl").exists() and '"to": "base"' in (tmp_path / "e.jsonl").read_text())
        os.close(reader)
        assert process.wait(20.0) == 130
        assert process.stderr is not None
        told = process.stderr.read()
        assert b"Traceback" not in told
        assert b"not all events" not in told
    *_, last = map(json.loads, (tmp_path / "e.jsonl").read_text().splitlines())
    assert (last["result"], last["reason"]) == ("interrupted", OUTPUT_CLOSED)


def test_closed_events_pipe_ends_the_run(tmp_path: Path) -> None:
    (tmp_path / "far.yaml").write_text("mission: far\ntree:\n  drive: 20 m\n")
    os.mkfifo(tmp_path / "events")
    process = Process("run", "far.yaml", "--events", "events", folder=tmp_path)
    with (tmp_path / "events").open() as events:
        events.readline()
    assert process.end() == 130


def test_only_pipes_are_ever_left(tmp_path: Path) -> None:
    told: list[str] = []
    reader, writer = os.pipe()
    with (tmp_path / "file").open("w") as file, Path(os.devnull).open("w") as null, os.fdopen(writer, "w") as pipe:
        with watch_outputs((file, null, pipe), told.append):
            pass
        assert told == [], "it ended before anybody went"
        with watch_outputs((file, null, pipe), told.append):
            os.close(reader)
            wait_until(lambda: told == [OUTPUT_CLOSED])


def test_full_disk_loses_events_and_is_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    if not Path("/dev/full").exists():
        pytest.skip("no /dev/full here")
    monkeypatch.chdir(tmp_path)
    Path("ok.yaml").write_text("mission: ok\ntree: succeed\n")
    outcome = command(capsys, "run", "ok.yaml", "--events", "/dev/full")
    assert outcome.code == 0
    assert "No space left" in outcome.err
    assert "Traceback" not in outcome.err


def test_full_disk_keeps_the_earlier_events_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("ok.yaml").write_text("mission: ok\ntree: succeed\n")
    Path("e.jsonl").write_text("mine")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (300, hard))
    try:
        outcome = command(capsys, "run", "ok.yaml", "--simulate", "fast", "--events", "e.jsonl")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert outcome.code == 0
    assert Path("e.jsonl").read_text() == "mine"
    assert {each.name for each in tmp_path.iterdir()} == {"ok.yaml", "e.jsonl", "e-incomplete.jsonl"}
    assert "mission: e.jsonl is the earlier file, e-incomplete.jsonl the new one" in outcome.err
    assert "wrote e-incomplete.jsonl" in outcome.err


def test_events_take_the_place_of_earlier_ones(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("ok.yaml").write_text("mission: ok\ntree: succeed\n")
    Path("e.jsonl").write_text("mine")
    assert command(capsys, "run", "ok.yaml", "--simulate", "fast", "--events", "e.jsonl").code == 0
    assert '"success"' in Path("e.jsonl").read_text().splitlines()[-1]
    assert {each.name for each in tmp_path.iterdir()} == {"ok.yaml", "e.jsonl"}


def test_log_is_shown_and_recorded(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("note.yaml").write_text("mission: note\ntree:\n  log: the kettle is on\n")
    outcome = command(capsys, "run", "note.yaml", "--events", "e.jsonl")
    assert "the kettle is on" in outcome.out
    assert '"the kettle is on"' in Path("e.jsonl").read_text()


@pytest.mark.parametrize(("number", "word"), [(signal.SIGTSTP, "Ctrl-Z"), (signal.SIGQUIT, "Ctrl-\\")])
def test_ctrl_z_and_ctrl_backslash_stop_the_run(number: int, word: str, tmp_path: Path) -> None:
    (tmp_path / "far.yaml").write_text("mission: far\ntree:\n  drive: 20 m\n")
    process = Process("run", "far.yaml", "--json", "--events", "e.jsonl", folder=tmp_path)
    events = tmp_path / "e.jsonl"
    wait_until(lambda: events.exists() and '"linear": 0.2' in events.read_text())
    assert process.end(number) == 130
    assert json.loads(process.lines[-1])["reason"] == word


def test_safe_stop_holds_the_arm() -> None:
    bench = LeafTestBench()
    robot = Robot(bench.base, bench.head, bench.arm, bench.voice, bench.sight)
    assembled = AssembledRobot("r", robot, {"base": bench.base, "head": bench.head, "arm": bench.arm})
    assembled.safe_stop(frozenset({"base", "arm"}))
    assert bench.base.commands == [STOP]
    assert bench.arm.commands == [HOLD]
    assert RELAX not in bench.arm.commands
    assert bench.head.commands == []


def test_failing_part_does_not_prevent_the_safe_stop_of_others() -> None:
    bench = LeafTestBench()

    def broken() -> None:
        raise RuntimeError("no")

    bench.base.stop = broken  # type: ignore[method-assign,assignment]
    robot = Robot(bench.base, bench.head, bench.arm, bench.voice, bench.sight)
    AssembledRobot("r", robot, {}).safe_stop(frozenset({"base", "arm"}))
    assert bench.arm.commands == [HOLD]


def test_an_expression_trusts_no_stale_reading() -> None:
    bench = LeafTestBench()
    state = state_of(bench.robot, ManualClock())
    reading = bench.base.reading.value
    assert reading is not None
    bench.base.reading = good(reading)
    assert parse("battery.percent >= 0").evaluate(state) is True
    bench.base.reading = stale(reading)
    with pytest.raises(NotConnected, match="the base does not report"):
        parse("battery.percent >= 0").evaluate(state)
    with pytest.raises(NotConnected, match="the base does not report"):
        parse("base.bumper").evaluate(state)


def test_parts_read_in_expressions_are_needs_of_the_mission(tmp_path: Path) -> None:
    path = tmp_path / "watch.yaml"
    path.write_text("mission: watch\ntree:\n  wait: 1 s\n  until: face.seen\n  if: battery.percent > 1\n")
    assert load_mission(str(path)).tree.needs == {"camera", "base"}
    assert Runner(RunRequest(str(path))).run().result == "success"


def test_the_battery_of_the_robot_is_known_when_the_mission_starts(tmp_path: Path) -> None:
    path = tmp_path / "watch.yaml"
    path.write_text("mission: watch\ntree:\n  fail: empty\n  if: battery.percent < 1\n")
    assert Runner(RunRequest(str(path))).run().result == "success"
