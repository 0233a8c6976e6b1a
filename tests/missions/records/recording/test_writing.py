"""A record as the independent library reads it: every message by its schema, counted, whole chunk for whole chunk."""

import errno
import hashlib
import json
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from mcap.reader import make_reader

from drivers.api import BaseState, Health, JointState, Pose2D, Quality, RangeScan, Reading, Velocity
from missions.executive import events
from missions.plugins.records.recording.info import record_lines
from missions.plugins.records.recording.items import (
    EVENT_TOPICS,
    FeedbackItem,
    HealthItem,
    LossItem,
    PictureItem,
    ViewItem,
    pack_items,
    unpack_items,
)
from missions.plugins.records.recording.record_header import RecordContents, RecordHeader
from missions.plugins.records.recording.repair import repair_record
from missions.plugins.records.recording.run_record import open_record
from missions.plugins.records.recording.schemas import schema
from missions.plugins.records.recording.schemas.definitions import FOXGLOVE_SCHEMAS, MISSIONTREE_SCHEMAS
from missions.plugins.records.recording.writer import TOPIC_SCHEMAS, ChunkSink, RecordWriter, WriteResult
from perception.api import Gaze, Marker, Scene, Thing, View
from tests.missions.records.recording.small_record import FILES, HEAD, face, items, moments, write


def everything() -> list[object]:
    """Return items of every kind that there is."""
    joint = JointState(0.1, 0.0, None, 0.2, 12.0, float("nan"), False, True)
    scan = RangeScan(np.array([1.0, np.nan, 2.5], np.float32), 0.0, 0.1, 1.0, 3, 0.1, 6.0)
    moment = replace(moments()[0], t=0.2)
    moment.answers = [
        ("base", "state", (), Reading(BaseState(Pose2D(0, 0, 0), Velocity(float("inf"), 0)), 0.2, Quality.STALE)),
        ("base", "drive", (Velocity(1.0, 0.0),), Velocity(0.5, 0.0)),
        ("arm", "states", (), {"elbow": Reading(joint, 0.2, Quality.GOOD), "wrist": Reading(None, 0.0, Quality.NONE)}),
        ("range", "scan", (), Reading(scan, 1.0, Quality.GOOD)),
    ]
    seen = face(0.5)
    box = seen.box
    rest = (0.1, 0.2, 0.3, 0.4, 0.0, 0.0)
    thing = Thing(2, 0.5, box, *rest, float("nan"), "ball", "red", "ball")
    marker = Marker(3, 0.5, box, *rest, 2.0, 7, "R2", 0.5)
    view = View(0.5, (seen,), (thing,), (marker,), Scene(0.5, 100.0, 20.0))
    return [
        *items(),
        moment,
        ViewItem(0.6, view),
        PictureItem(0.5, b"jpeg", Gaze(0.1, float("nan"))),
        HealthItem(0.7, {"base": Health(True, counters={"frames": 7})}),
        FeedbackItem(0.75, 15, "1.1", "nobody yet"),
        events.Notified(0.8, 16, "Ana has the message"),
    ]


def read(path: Path) -> tuple[Mapping[str, int], list[tuple[str, str, Any]]]:
    """Return the counts that the file's index has, and every message: topic, schema, what it says."""
    with path.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        counts = {
            summary.channels[number].topic: count for number, count in summary.statistics.channel_message_counts.items()
        }
        found = [
            (channel.topic, "" if kind is None else kind.name, json.loads(message.data))
            for kind, channel, message in reader.iter_messages()
        ]
    return counts, found


def record(path: Path, what: Sequence[object], *, limit: float = float("inf")) -> tuple[WriteResult, Path]:
    with path.open("wb", buffering=0) as file:
        writer = RecordWriter(ChunkSink(file.fileno()), RecordContents(HEAD, FILES), limit=limit)
        writer.begin()
        for item in unpack_items(pack_items(what)):
            writer.add(item)
        return writer.close(), path


def test_every_message_matches_its_schema_and_every_topic_occurs(tmp_path: Path) -> None:
    written, path = record(tmp_path / "a.mcap", everything())
    counts, found = read(path)
    assert counts == written.counts == Counter(topic for topic, _, _ in found)
    assert set(counts) == set(TOPIC_SCHEMAS)
    for topic, name, message in found:
        assert name == TOPIC_SCHEMAS[topic]
        Draft202012Validator(json.loads(schema(name))).validate(message)


def test_the_files_of_the_run_are_in_the_record(tmp_path: Path) -> None:
    _, path = record(tmp_path / "a.mcap", items())
    with path.open("rb") as file:
        assert {each.name: each.data for each in make_reader(file).iter_attachments()} == FILES


def test_log_times_are_wall_clock_times(tmp_path: Path) -> None:
    _, path = record(tmp_path / "a.mcap", items())
    with path.open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages(topics=["/nodes", "/log", "/camera"]):
            t = json.loads(message.data)["t"]
            assert message.log_time == 1_795_269_780_000_000_000 + round(t * 1e9)
            if channel.topic == "/log":
                stamp = json.loads(message.data)["timestamp"]
                assert stamp["sec"] * 1_000_000_000 + stamp["nsec"] == message.log_time


BYTES = {
    "foxglove.CompressedImage": "6233f8fb7e55a744",
    "foxglove.FrameTransform": "5e8510c1afeff52b",
    "foxglove.ImageAnnotations": "c7f315e9ed30f3b9",
    "foxglove.LaserScan": "ff6a24178d0c37a9",
    "foxglove.Log": "21c8b8273df114f1",
    "foxglove.PoseInFrame": "d82826249cd36d0a",
    "missiontree.ArmState": "16e900167d89691c",
    "missiontree.BaseState": "5c4ea884a9da2e9d",
    "missiontree.CommandSent": "bfcad541e70b5862",
    "missiontree.DeviceStates": "854e92ab337e78c7",
    "missiontree.Ended": "6650796735c65e29",
    "missiontree.FaultRaised": "65031d8e16eb1eb0",
    "missiontree.Feedback": "d021b5c755896bc5",
    "missiontree.HeadState": "c9c0fb68531d442f",
    "missiontree.Lost": "c7a72e226d97131f",
    "missiontree.Mission": "799ed6aa2d9cf79b",
    "missiontree.Moment": "e7c19d3deaf3ea07",
    "missiontree.NodeChanged": "3fd8537f5bc38c10",
    "missiontree.Notified": "95aea8105336e59f",
    "missiontree.ReflexFired": "72510a59f37352d8",
    "missiontree.VariableSet": "6af26b682581de33",
    "missiontree.View": "fabf6043e9694d2b",
}
"""The beginnings of the SHA-256 of the schemas in records of format 3."""


@pytest.mark.parametrize("name", BYTES)
def test_schemas_are_valid_and_unchanged(name: str) -> None:
    described = json.loads(schema(name))
    Draft202012Validator.check_schema(described)
    assert described["title"] == name
    assert hashlib.sha256(schema(name)).hexdigest()[:16] == BYTES[name]


def test_every_schema_is_used_by_a_topic() -> None:
    assert set(TOPIC_SCHEMAS.values()) == {*BYTES} == {*MISSIONTREE_SCHEMAS, *FOXGLOVE_SCHEMAS}


def test_schemas_have_the_fields_of_their_types() -> None:
    kinds = {TOPIC_SCHEMAS[topic]: getattr(events, name) for name, topic in EVENT_TOPICS.items() if name != "Logged"}
    for name, kind in {**kinds, "missiontree.Mission": RecordHeader, "missiontree.Moment": type(moments()[0])}.items():
        assert set(json.loads(schema(name))["properties"]) == {field.name for field in fields(kind)}, name


ASKED = {
    "Log": {"timestamp", "level", "message", "name", "file", "line"},
    "CompressedImage": {"timestamp", "frame_id", "data", "format"},
    "ImageAnnotations": {"circles", "points", "texts"},
    "FrameTransform": {"timestamp", "parent_frame_id", "child_frame_id", "translation", "rotation"},
    "PoseInFrame": {"timestamp", "frame_id", "pose"},
    "LaserScan": {"timestamp", "frame_id", "pose", "start_angle", "end_angle", "ranges", "intensities"},
}
"""As Foxglove documents them."""


@pytest.mark.parametrize("name", ASKED)
def test_foxglove_schemas_require_the_mandatory_fields(name: str) -> None:
    assert set(json.loads(schema(f"foxglove.{name}"))["required"]) >= ASKED[name]


class Disk:
    """A disk that is full for a while: a piece of what is written comes into the file before that fails."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.full = False
        self._write = os.write
        monkeypatch.setattr("missions.plugins.records.recording.writer.os.write", self.write)

    def write(self, number: int, data: memoryview) -> int:
        if not self.full:
            return self._write(number, data)
        if len(data) <= 100:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return self._write(number, data[: len(data) - 100])


def test_full_disk_loses_whole_chunks_which_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, disk = tmp_path / "a.mcap", Disk(monkeypatch)
    with path.open("wb", buffering=0) as file:
        writer = RecordWriter(ChunkSink(file.fileno()), RecordContents(HEAD, FILES))
        writer.begin()
        expected: Counter[str] = Counter()
        given = [replace(moments()[0], tick=tick, t=tick / 20) for tick in range(1, 151)]
        for number, item in enumerate(given):
            writer.add(item)
            if number % 10 == 9:
                disk.full = 50 <= number < 100
                before = Counter(writer.lost)
                writer.flush()
                if disk.full:
                    assert (writer.lost - before)["/moments"] == 10
                    expected = Counter(writer.lost)
        written = writer.close()
    assert written.lost == expected
    assert written.lost["/moments"] == 50
    assert "No space left" in written.why
    assert not written.whole
    repair_record(path)
    counts, found = read(path)
    assert counts == written.counts
    assert counts["/moments"] == len(given) - 50
    told: Counter[str] = Counter()
    for topic, _, message in found:
        if topic == "/lost":
            told.update(message["counts"])
    assert told == expected


def test_loss_at_the_end_is_recorded_once_space_allows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, write = tmp_path / "a.mcap", os.write

    def nearly_full(number: int, data: memoryview) -> int:
        if len(data) > 1000:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(number, data)

    with path.open("wb", buffering=0) as file:
        writer = RecordWriter(ChunkSink(file.fileno()), RecordContents(HEAD, FILES))
        writer.begin()
        monkeypatch.setattr("missions.plugins.records.recording.writer.os.write", nearly_full)
        writer.add(PictureItem(1.0, os.urandom(5000), None))
        written = writer.close()
    assert written.lost == {"/camera": 1}
    repair_record(path)
    assert [message["counts"] for topic, _, message in read(path)[1] if topic == "/lost"] == [{"/camera": 1}]


def test_chunk_is_readable_without_the_previous_one(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", moments(), every=10)
    answers = [message["answers"] for topic, _, message in read(path)[1] if topic == "/moments"]
    for first in range(0, len(answers), 10):
        assert all(len(answer) == 4 for answer in answers[first])


def test_disk_full_at_the_start_raises_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Disk(monkeypatch).full = True
    with (tmp_path / "a.mcap").open("wb", buffering=0) as file, pytest.raises(OSError, match="No space left"):
        RecordWriter(ChunkSink(file.fileno()), RecordContents(HEAD, FILES)).begin()
    assert (tmp_path / "a.mcap").stat().st_size == 0


def test_record_stays_within_its_size_limit_and_is_complete(tmp_path: Path) -> None:
    picture = PictureItem(1.0, os.urandom(20_000), None)
    written, path = record(
        tmp_path / "a.mcap", [replace_stamp(picture, number / 5) for number in range(100)], limit=5e5
    )
    assert written.whole
    assert written.ended is not None
    assert 1.0 < written.ended < 15.0
    assert not written.lost
    assert 3e5 < path.stat().st_size < 5.4e5
    assert read(path)[0] == written.counts
    assert open_record(path).limit_reached
    assert any("not recorded: the size limit was reached" in line for line in record_lines(open_record(path)))


def replace_stamp(picture: PictureItem, t: float) -> PictureItem:
    return picture._replace(t=t)


def test_losses_before_the_writer_are_recorded(tmp_path: Path) -> None:
    written, path = record(tmp_path / "a.mcap", [*items(), LossItem({"/nodes": 2}, "too slow")])
    assert written.lost == {"/camera": 3, "/nodes": 2}
    assert written.whole
    (message,) = (message for topic, _, message in read(path)[1] if topic == "/lost")
    assert message["counts"] == {"/camera": 3, "/nodes": 2}
