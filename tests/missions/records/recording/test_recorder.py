"""What a run records, with the process that writes it: nothing is lost, or it is told; and nobody ever waits."""

import json
import os
import random
import resource
import signal
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import replace
from itertools import islice
from pathlib import Path
from threading import Event as Flag
from threading import Lock, Thread

import numpy as np
import pytest
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Message
from mcap.stream_reader import StreamReader

from drivers.api import CameraFrame, DeviceStatus, Health
from drivers.clock import ManualClock, SystemClock
from missions.executive.events import Event, FaultRaised, Logged, Started, VariableSet
from missions.plugins.records.recording.budget import DEFAULT_FRAME_RATE, DEFAULT_MAX_BYTES
from missions.plugins.records.recording.record_header import RecordContents
from missions.plugins.records.recording.recorder import Recorder
from missions.plugins.records.recording.run_record import open_record
from missions.plugins.records.recording.writer_client import CannotRecordError, RecordLoss
from perception.api import Gaze, View
from tests.missions.records.recording.small_record import FILES, HEAD, face, items, moments
from tests.missions.records.recording.stand_in_run import moment
from tests.tries import tries
from tests.waiting import wait_until

PICTURE = np.full((48, 64, 3), 100, np.uint8)


def counts_of(path: Path) -> dict[str, int]:
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    found = summary.statistics.channel_message_counts
    return {summary.channels[number].topic: count for number, count in found.items()}


def times_of(path: Path) -> list[float]:
    """Return the times of the moments as far as the file can be read, which may end anywhere."""
    times = []
    with path.open("rb") as file:
        try:
            for each in StreamReader(file).records:
                times += [json.loads(each.data)["t"]] if isinstance(each, Message) and b'"answers"' in each.data else []
        except (McapError, struct.error):  # the end of what was written
            return times
    return times


@contextmanager
def recording(
    path: Path,
    *,
    limit: float = DEFAULT_MAX_BYTES,
    frames: float = DEFAULT_FRAME_RATE,
    patient: bool = False,
    overwrite: bool = False,
) -> Iterator[tuple[Recorder, list[DeviceStatus]]]:
    told: list[DeviceStatus] = []
    with Recorder(path, limit=limit, frame_rate=frames, lossless=patient, overwrite=overwrite) as recorder:
        recorder.open(RecordContents(HEAD, FILES), SystemClock(), report=told.append)
        yield recorder, told


def writer_of(recorder: Recorder) -> int:
    process = recorder._writer._process
    assert process is not None
    return process.pid


def test_record_contains_versions(tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.mcap") as recorder:
        recorder.open(RecordContents(replace(HEAD, versions={}), FILES), SystemClock())
    found = open_record(tmp_path / "a.mcap").header.versions
    assert {"python", "py-trees", "numpy"} <= found.keys()


def test_recorder_writes_all_given_items(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with recording(path) as (recorder, told):
        for each in items():
            if isinstance(each, Event):
                recorder(each)
        recorder(Started(0.0, "greet", "greet.yaml", "r", {}))
        for past in moments():
            recorder.on_tick(past)
        for number in range(3):
            stamp = float(number)
            recorder.on_view(View(stamp, (face(stamp),)))
            recorder.on_frame(CameraFrame(PICTURE, stamp, number), Gaze(0.1, 0.0))
            wait_until(lambda: recorder._pictures._newest is None)
        loss = recorder.close()
    assert not loss
    assert not told
    counts = counts_of(path)
    assert counts == recorder.counts
    assert counts["/moments"] == len(moments())
    assert counts["/percepts"] == 3
    assert counts["/camera"] == counts["/camera/marks"] == 3


def test_closing_twice_or_without_opening_is_safe(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.mcap")
    recorder.on_tick(moment(1, 0.05))
    assert not recorder.close()
    with recording(tmp_path / "b.mcap") as (opened, _):
        assert not opened.close()
        assert not opened.close()


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda path: path / "no" / "a.mcap", "no folder"),
        (lambda path: path, "not a regular file"),
        (lambda path: _piped(path / "a.mcap"), "not a regular file"),
        (lambda path: _written(path / "a.mcap"), "already exists"),
    ],
)
def test_failed_start_is_reported_and_leaves_no_process(
    tmp_path: Path, make: Callable[[Path], Path], words: str
) -> None:
    recorder = Recorder(make(tmp_path))
    with closing(recorder), pytest.raises(CannotRecordError, match=words):
        recorder.open(RecordContents(HEAD, FILES), ManualClock())
    assert recorder._writer._process is None


def _piped(path: Path) -> Path:
    os.mkfifo(path)
    return path


def _written(path: Path) -> Path:
    path.write_text("mine", encoding="utf-8")
    return path


def test_start_timeout_applies_in_real_time_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("missions.plugins.records.recording.recorder.START_TIMEOUT", 0.0)
    with pytest.raises(CannotRecordError, match="did not start within 0 s"):
        Recorder(tmp_path / "real.mcap").open(RecordContents(HEAD, FILES), ManualClock())
    with Recorder(tmp_path / "simulated.mcap", lossless=True) as recorder:
        recorder.open(RecordContents(HEAD, FILES), ManualClock())


def test_existing_record_is_overwritten_only_on_request(tmp_path: Path) -> None:
    path = _written(tmp_path / "a.mcap")
    with recording(path, overwrite=True) as (recorder, _):
        assert not recorder.close()
    assert counts_of(path) == {"/mission": 1}


@pytest.mark.parametrize("room", [100, 100_000], ids=["not begun", "not written to its end"])
def test_full_disk_keeps_the_record_to_be_overwritten(tmp_path: Path, room: int) -> None:
    path = _written(tmp_path / "a.mcap")
    before = path.read_bytes()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    recorder = Recorder(path, overwrite=True)
    told: list[DeviceStatus] = []
    draws = random.Random(1)  # noqa: S311 - text for tests
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, hard))
    try:
        with closing(recorder), suppress(CannotRecordError):
            recorder.open(RecordContents(HEAD, FILES), ManualClock(), report=told.append)
            for number in range(1000):
                recorder(Logged(number / 100, "info", draws.randbytes(300).hex()))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert path.read_bytes() == before
    others = [each for each in tmp_path.iterdir() if each != path]
    if room == 100:
        assert others == []
    else:
        assert others == [recorder.path] == [tmp_path / "a-incomplete.mcap"]
        assert any("a.mcap is the earlier record, a-incomplete.mcap" in each.message for each in told)


def test_record_being_written_is_not_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with recording(path) as (recorder, _):
        recorder.on_tick(moment(1, 0.01))
        other = Recorder(path, overwrite=True)
        with closing(other), pytest.raises(CannotRecordError, match="another run is writing it"):
            other.open(RecordContents(HEAD, FILES), ManualClock())
        assert not recorder.close()
    assert counts_of(path)["/moments"] == 1


def test_failed_start_leaves_no_file(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    recorder = Recorder(path)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, hard))
    try:
        with closing(recorder), pytest.raises(CannotRecordError, match="File too large"):
            recorder.open(RecordContents(HEAD, FILES), ManualClock())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert not path.exists()


def test_item_that_cannot_be_pickled_is_the_only_loss(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with recording(path) as (recorder, _):
        for value in (1, Lock(), 2):
            recorder(VariableSet(0.1, 1, "", "x", value))
        loss = recorder.close()
    assert counts_of(path)["/variables"] == 2
    assert loss.counts == {"/variables": 1}


def test_in_simulated_time_nothing_is_lost_however_far_the_writer_is_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("missions.plugins.records.recording.recorder.MAX_QUEUED_ITEMS", 500)
    path = tmp_path / "a.mcap"
    with recording(path, patient=True) as (recorder, _):
        small = replace(moments()[0], answers=[])
        for tick in range(1, 3001):
            recorder.on_tick(replace(small, tick=tick, t=tick / 1000))
        assert not recorder.close()
    assert counts_of(path)["/moments"] == 3000


def test_full_disk_is_reported_and_does_not_block_ticks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "missions.plugins.records.recording.recorder.CLOSE_TIMEOUT", 60.0
    )  # it is not about a writer that is slow
    path = tmp_path / "a.mcap"
    with recording(path, frames=1000.0) as (recorder, told):
        soft, hard = resource.prlimit(writer_of(recorder), resource.RLIMIT_FSIZE)
        resource.prlimit(writer_of(recorder), resource.RLIMIT_FSIZE, (100_000, hard))
        frames = noise()
        number = 0

        def go_on() -> bool:
            nonlocal number
            number += 1
            recorder.on_tick(moment(number, number / 100))
            recorder.on_frame(next(frames))
            return bool(told)

        wait_until(go_on, pause=0.005)
        assert (told[0].device, told[0].kind) == ("record", "fault")
        assert "File too large" in told[0].message
        resource.prlimit(writer_of(recorder), resource.RLIMIT_FSIZE, (soft, hard))
        written = path.stat().st_size

        def grows() -> bool:
            go_on()
            return path.stat().st_size > written + 10_000

        wait_until(grows, pause=0.005)
        loss = recorder.close()
    assert loss.counts["/camera"] > 0
    assert "File too large" in str(loss)
    counts = counts_of(path)
    assert counts == recorder.counts
    assert counts["/moments"] + loss.counts["/moments"] == number
    assert counts["/lost"] >= 1


def noise() -> Iterator[CameraFrame]:
    """Yield pictures that no disk can hold many of."""
    chance = np.random.default_rng(3)
    for number in range(1_000_000):
        yield CameraFrame(chance.integers(0, 255, (60, 80, 3), np.uint8), number / 100, number)


@pytest.mark.real_time
def test_stopped_writer_does_not_block_and_losses_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("missions.plugins.records.recording.recorder.MAX_QUEUED_ITEMS", 500)
    path = tmp_path / "a.mcap"
    with recording(path) as (recorder, _):
        os.kill(writer_of(recorder), signal.SIGSTOP)
        count = 0
        try:
            while not recorder.loss.counts:
                count += 1
                recorder.on_tick(moment(count, count / 1000))
        finally:
            os.kill(writer_of(recorder), signal.SIGCONT)
        wait_until(lambda: not recorder._queue)
        for _ in range(2):  # what comes once there is room again is kept
            count += 1
            recorder.on_tick(moment(count, count / 1000))
        loss = recorder.close()
    assert loss.reason == "the disk is too slow"
    assert counts_of(path)["/moments"] + loss.counts["/moments"] == count
    assert loss.counts["/moments"] < 10


@pytest.mark.real_time
def test_hung_writer_process_is_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("missions.plugins.records.recording.recorder.CLOSE_TIMEOUT", 0.2)
    with recording(tmp_path / "a.mcap") as (recorder, _):
        number = writer_of(recorder)
        os.kill(number, signal.SIGSTOP)
        recorder.on_tick(moment(1, 0.01))
        loss = recorder.close()
    assert "too slow" in loss.reason
    assert not Path(f"/proc/{number}").exists()


def test_killed_writer_is_reported_and_the_run_continues(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with recording(path) as (recorder, told):
        recorder.on_tick(moment(1, 0.01))
        wait_until(lambda: times_of(path))
        os.kill(writer_of(recorder), signal.SIGKILL)
        count = 1

        def go_on() -> bool:
            nonlocal count
            count += 1
            recorder.on_tick(moment(count, count / 100))
            return bool(told)

        wait_until(go_on, pause=0.005)
        loss = recorder.close()
    assert "killed by signal 9: recording stopped" in told[0].message
    assert "mission record info" in told[0].hint
    assert 0 < loss.counts["/moments"] < count
    assert times_of(path)[0] == 0.01


def test_signal_of_a_writer_that_is_still_ending_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with recording(tmp_path / "a.mcap") as (recorder, told):
        monkeypatch.setattr(subprocess.Popen, "poll", lambda _: None)
        os.kill(writer_of(recorder), signal.SIGKILL)

        def go_on() -> bool:
            recorder.on_tick(moment(1, 0.01))
            return bool(told)

        wait_until(go_on, pause=0.005)
    assert "killed by signal 9: recording stopped" in told[0].message


def test_killed_writer_does_not_block_a_simulated_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("missions.plugins.records.recording.recorder.MAX_QUEUED_ITEMS", 500)
    with recording(tmp_path / "a.mcap", patient=True) as (recorder, told):

        def tick() -> None:
            for number in range(50_000):
                recorder.on_tick(moment(number, number / 100))

        os.kill(writer_of(recorder), signal.SIGSTOP)
        ticking = Thread(target=tick)
        ticking.start()
        wait_until(lambda: len(recorder._queue) >= 250)
        os.kill(writer_of(recorder), signal.SIGKILL)
        ticking.join(20)
        assert not ticking.is_alive()
        assert "killed by signal 9" in told[0].message


def test_dropped_pictures_use_no_queue_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("missions.plugins.records.recording.recorder.MAX_QUEUED_ITEMS", 1)
    with recording(tmp_path / "a.mcap", frames=1000.0, patient=True) as (recorder, _):
        for frame in islice(noise(), 50):
            recorder.on_frame(frame)
        wait_until(lambda: not recorder._queue)
        assert recorder._queued_picture_bytes == 0


def test_the_health_of_devices_is_sampled(tmp_path: Path) -> None:
    path, asked = tmp_path / "a.mcap", Flag()

    def check() -> dict[str, Health]:
        asked.set()
        return {"base": Health(True, counters={"frames": 3})}

    with Recorder(path) as recorder:
        recorder.open(RecordContents(HEAD, FILES), SystemClock(), health_check=check)
        assert asked.wait(10)
        assert not recorder.close()
    assert counts_of(path)["/state/devices"] >= 1


def test_size_limit_closes_the_record_and_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with recording(path, limit=200_000, frames=0.0) as (recorder, told):
        count = 0

        def go_on() -> bool:
            nonlocal count
            count += 1
            recorder(FaultRaised(count / 100, "base", "fault", os.urandom(500).hex()))
            recorder.on_tick(moment(count, count / 100))
            return bool(told)

        wait_until(go_on, pause=0.005)
        loss = recorder.close()
    assert "limit" in told[0].message
    assert loss.limit_reached_at is not None
    assert "size limit was reached" in str(loss)
    assert not loss.counts
    assert path.stat().st_size < 260_000
    assert counts_of(path) == recorder.counts


SOON, LATE = 0.2, 1.5


@pytest.mark.parametrize("seed", range(tries(3)))
@pytest.mark.real_time
def test_a_kill_at_any_moment_costs_a_second_at_most(
    tmp_path: Path, seed: int, record_property: Callable[[str, object], None]
) -> None:
    path = tmp_path / "a.mcap"
    chance = random.Random(seed)  # noqa: S311 - chance, not a secret
    with running(path) as (run, writer):
        begun, last = until(run, chance.uniform(SOON, LATE))
        for number in (run.pid, writer):
            os.kill(number, signal.SIGKILL)
        wait_until(lambda: not Path(f"/proc/{writer}").exists())
    lost = last - max(times_of(path), default=begun)
    record_property("most", f"{lost:.2f} s of a record lost")
    assert lost <= 1.0


@pytest.mark.real_time
def test_killed_run_leaves_a_closed_record(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with running(path) as (run, writer):
        _, last = until(run, 0.5)
        os.kill(run.pid, signal.SIGKILL)
        wait_until(lambda: not Path(f"/proc/{writer}").exists())
    assert counts_of(path)["/moments"] == len(times_of(path))
    assert times_of(path)[-1] >= last - 0.5


@contextmanager
def running(path: Path) -> Iterator[tuple["subprocess.Popen[str]", int]]:
    program = [sys.executable, "-m", "tests.missions.records.recording.stand_in_run", str(path)]
    with subprocess.Popen(program, stdout=subprocess.PIPE, text=True) as run:
        try:
            assert run.stdout is not None
            yield run, int(run.stdout.readline())
        finally:
            run.kill()


def until(run: "subprocess.Popen[str]", t: float) -> tuple[float, float]:
    """Follow a run for ``t`` seconds; return the times of its first and its newest moment."""
    assert run.stdout is not None
    begun = last = float(run.stdout.readline())
    while last < begun + t:
        last = float(run.stdout.readline())
    return begun, last


def test_record_loss_of_one_message_is_singular() -> None:
    assert str(RecordLoss({"/camera": 1}, "the disk is full")).startswith("1 message is missing (the disk is full)")
    assert str(RecordLoss({"/camera": 2}, "the disk is full")).startswith("2 messages are missing (the disk is full)")
