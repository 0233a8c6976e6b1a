import os
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from mcap.writer import Writer

from missions.executive.events import CommandSent, Ended, NodeChanged, Ticked
from missions.plugins.records.recording.info import record_lines
from missions.plugins.records.recording.record_header import FORMAT_VERSION
from missions.plugins.records.recording.run_record import SERIES, InvalidRecordError, RunRecord, open_record
from perception.api import View
from tests.missions.records.recording.small_record import (
    END,
    FILES,
    HEAD,
    JPEG,
    TICKS,
    TREE,
    face,
    items,
    moments,
    write,
)


@pytest.fixture
def record(tmp_path: Path) -> RunRecord:
    return open_record(write(tmp_path / "greet.mcap", items()))


def test_record_has_header_files_and_tree(record: RunRecord) -> None:
    assert record.header == HEAD
    assert {name: record.files[name] for name in FILES} == FILES
    assert record.drawing() == TREE
    assert (record.is_complete, record.end_time, record.cut_start) == (True, END, None)


def test_tick_records_are_read_back_with_all_answers(record: RunRecord) -> None:
    assert [repr(moment) for moment in record.tick_records] == [repr(moment) for moment in moments()]


def test_events_are_read_back_in_order_with_ticks(record: RunRecord) -> None:
    told = [event for event in record.events if not isinstance(event, Ticked)]
    assert told == [event for event in items() if isinstance(event, tuple(map(type, told)))]
    ticks = [event for event in record.events if isinstance(event, Ticked)]
    assert [tick.tick for tick in ticks] == list(range(1, TICKS + 1))
    assert [tick.status for tick in ticks[-2:]] == ["running", "success"]
    assert [(tick.tick, tick.late) for tick in ticks if tick.late is not None] == [(20, 0.06)]
    assert isinstance(record.events[-1], Ended)
    assert record.run_end() == record.events[-1]


def test_tick_in_real_time_comes_after_its_node_changes(tmp_path: Path) -> None:
    late = [replace(event, t=event.t + 5e-5) if isinstance(event, NodeChanged) else event for event in items()]
    record = open_record(write(tmp_path / "wire.mcap", late, head=replace(HEAD, simulate="wire")))
    assert [event.status for event in record.events if isinstance(event, Ticked)][-2:] == ["running", "success"]


def test_views_and_pictures_come_back_with_their_times(record: RunRecord) -> None:
    assert list(record.views()) == [(time + 0.01, View(float(time), (face(float(time)),))) for time in range(4)]
    assert list(record.frames()) == [(float(time), JPEG) for time in range(4)]


def test_series_are_in_si_units_over_the_seconds_of_the_run(record: RunRecord) -> None:
    times, values = record.series("head.pan")
    assert values == pytest.approx([0.05 * time for time in times])
    assert max(times) > 0.9 * END
    assert set(record.series("battery.percent")[1]) == {80.0}
    assert all(len(times) == len(values) for times, values in map(record.series, SERIES))
    with pytest.raises(KeyError):
        record.series("head.roll")


def test_node_status_is_that_of_the_latest_change(record: RunRecord) -> None:
    assert {key: change.status for key, change in record.statuses(2.49).items()} == {"1": "running", "1.1": "running"}
    assert {key: change.status for key, change in record.statuses(2.5).items()} == {"1": "running", "1.1": "failure"}
    assert record.statuses(0.0) == {}


def test_record_ends_with_its_last_event_despite_rounded_stamps(tmp_path: Path) -> None:
    last = END + 6.4e-14  # times of messages are in whole nanoseconds
    told = [
        replace(item, t=last) if isinstance(item, Ended | NodeChanged) and item.t == END else item for item in items()
    ]
    record = open_record(write(tmp_path / "sums.mcap", told))
    assert record.end_time == last
    for time in (record.end_time, END):
        assert {change.status for change in record.statuses(time).values()} == {"success"}


def test_suggested_time_is_not_before_the_failure(tmp_path: Path) -> None:
    told = [replace(item, t=2.50049) if isinstance(item, NodeChanged) and item.t == 2.5 else item for item in items()]
    record = open_record(write(tmp_path / "wire.mcap", told))
    assert any("--at 2.501s    the first failure" in line for line in record_lines(record))


def test_failures_and_words_are_found(record: RunRecord) -> None:
    (failure,) = record.failures()
    assert (failure.t, failure.reason) == (2.5, "Nobody came")
    assert [type(event) for event in record.search("NOBODY")] == [NodeChanged, NodeChanged]
    assert [type(event) for event in record.search("pan")] == [CommandSent]
    assert record.search("no such thing") == []


def test_losses_are_counted_by_topic(record: RunRecord) -> None:
    assert record.lost_counts() == {"/camera": 3}


def test_record_can_be_read_repeatedly(record: RunRecord) -> None:
    first = next(iter(record.frames()))
    assert next(iter(record.frames())) == first
    assert record.events is record.events


def test_unclosed_record_is_marked_incomplete_and_readable(tmp_path: Path) -> None:
    record = open_record(write(tmp_path / "killed.mcap", items(), close=False))
    assert not record.is_complete
    assert record.end_time == END
    assert len(record.tick_records) == TICKS


def foreign(path: Path) -> Path:
    with path.open("wb") as file:
        writer: Any = Writer(file)
        writer.start(profile="ros2", library="rosbag2")
        channel = writer.register_channel("/mission", "cdr", writer.register_schema("std_msgs/String", "ros2msg", b""))
        writer.add_message(channel, 0, b"\x00\x01", 0)
        writer.finish()
    return path


def newer(path: Path) -> Path:
    return write(path, items(), head=replace(HEAD, format=FORMAT_VERSION + 1))


def older(path: Path) -> Path:
    return write(path, items(), head=replace(HEAD, format=FORMAT_VERSION - 1))


def empty(path: Path) -> Path:
    path.write_bytes(b"")
    return path


def mission(path: Path) -> Path:
    path = path.with_suffix(".yaml")
    path.write_text("mission: greet\n")
    return path


def folder(path: Path) -> Path:
    path.mkdir()
    return path


def pipe(path: Path) -> Path:
    os.mkfifo(path)
    return path


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (empty, "empty file: its run ended before anything was written"),
        (mission, "a mission, not a record\n  try: mission run "),
        (foreign, "an MCAP file, but not a record of MissionTree (written by ros2 and "),
        (
            newer,
            "record format 4; this version reads only format 3\n  try: pip install --upgrade ",
        ),
        (older, "record format 2; this version reads only format 3\n  try: record the mission again"),
        (folder, "cannot be read: Is a directory"),
        (pipe, "no such record file"),
        (lambda path: path, "cannot be read: No such file or directory"),
    ],
)
def test_other_files_are_refused_with_their_kind(tmp_path: Path, make: Any, words: str) -> None:
    path = make(tmp_path / "thing.mcap")
    with pytest.raises(InvalidRecordError) as caught:
        open_record(path)
    assert str(caught.value).startswith(f"{path}: {words}")


def test_missing_records_extra_gives_the_install_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "missions.plugins.records.recording.mcap_scan", None)
    with pytest.raises(InvalidRecordError, match=r"try: pip install 'missiontree\[records\]'"):
        open_record(tmp_path / "greet.mcap")
