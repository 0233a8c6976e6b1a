"""Records as the studio reads them: piece by piece."""

import io
import json
import math
import os
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.api import ZERO_VELOCITY, BaseState, Health, JointState, Pose2D, Quality, RangeScan, Reading
from missions.executive.events import Ended, Logged, NodeChanged, VariableSet
from missions.executive.tick_record import Answer, TickRecord
from missions.plugins.records.recording import record_list
from missions.plugins.records.recording.items import FeedbackItem, HealthItem, pack_items, unpack_items
from missions.plugins.records.recording.record_header import RecordContents
from missions.plugins.records.recording.writer import ChunkSink, RecordWriter
from missions.plugins.records.retention import records_folder
from missions.plugins.studio import moment_query, record_queries
from missions.plugins.studio.studio_commands import MomentQuery, RecordsQuery
from missions.plugins.studio.studio_commands import RecordQuery as Asked
from missions.trees.drawing import to_json
from tests.missions.records.report.told_record import DRAWING, FILES, WHERE, write


@pytest.fixture
def folder() -> Path:
    folder = records_folder()
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def long(path: Path, chunks: int) -> Path:
    """Write a record of so many chunks, each of a second, in which a leaf runs, and fails in every tenth."""
    with path.open("wb", buffering=0) as file:
        writer = RecordWriter(
            ChunkSink(file.fileno()), RecordContents(WHERE, FILES, json.dumps(to_json(DRAWING)).encode())
        )
        writer.begin()
        for second in range(1, chunks):
            status = "running" if second % 10 else "failure"
            change = NodeChanged(float(second), 20 * second, "1.1", "track_face", "track_face", 1, status, "")
            heavy = VariableSet(second + 0.1, 20 * second, "", "person", "x" * 2000)
            last = Ended(second + 0.5, "m", "failure", "the end", second + 0.5, 20 * second)
            for item in unpack_items(
                pack_items([change, heavy, FeedbackItem(second + 0.2, 20 * second, "1.1", f"of {second}")])
            ):
                writer.add(item)
            if second == chunks - 1:
                writer.add(unpack_items(pack_items([last]))[0])
            writer.flush()
        assert writer.close().whole
    return path


def piece_of(name: str, start: float = -1e9) -> dict[str, Any]:
    return record_queries.answer_record(Asked(name=name, start=start))


def test_record_name_with_invalid_bytes_is_listed_with_a_hint(folder: Path) -> None:
    write(folder / os.fsdecode(b"\xff<b>.mcap"), [])
    listed = json.dumps(record_queries.answer_records(RecordsQuery())["records"], ensure_ascii=False)
    assert '"name": "\ufffd<b>.mcap"' in listed
    assert "rename the file" in listed


@pytest.fixture
def read(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, int]]:
    """What is read of files: from which byte on, and how many."""
    found: list[tuple[int, int]] = []
    opened = Path.open

    class Counted(io.BufferedReader):
        def read(self, size: int | None = -1, /) -> bytes:
            at = self.tell()
            data = super().read(size)
            found.append((at, len(data)))
            return data

    def counting(path: Path, mode: str = "r", *more: Any, **named: Any) -> Any:
        return Counted(io.FileIO(path)) if mode == "rb" else opened(path, mode, *more, **named)

    monkeypatch.setattr(Path, "open", counting)
    return found


def test_first_view_of_a_record_reads_few_chunks(
    folder: Path, read: list[tuple[int, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(record_queries, "PIECE_TIME_BUDGET", 0.0)
    counts = []
    for chunks in (50, 400):
        long(folder / "long.mcap", chunks)
        read.clear()
        record = piece_of("long.mcap")
        assert (record["result"], record["until"], record["more"]) == ("failure", chunks - 0.5, 1.0)
        counts.append(len(read))
    assert counts[1] <= counts[0]


def test_record_pieces_add_up_to_the_whole(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    long(folder / "long.mcap", 31)
    monkeypatch.setattr(record_queries, "PIECE_TIME_BUDGET", inf)
    whole = piece_of("long.mcap")
    assert whole["failures"] == [10.0, 20.0, 30.0]
    assert "more" not in whole
    monkeypatch.setattr(record_queries, "PIECE_TIME_BUDGET", 0.0)
    piece = piece_of("long.mcap")
    lane, log = list[Any](), list[Any]()
    while True:
        lane += piece["lanes"].get("1.1", [])
        log += piece["log"]
        if "more" not in piece:
            break
        piece = piece_of("long.mcap", piece["more"])
        assert "drawing" not in piece
    assert whole["lanes"] == {"1.1": lane}
    assert whole["log"] == log
    assert [9.2, "running", "of 9"] in lane
    assert [10.2, "running", "of 10"] not in lane  # it had failed before


def test_moment_reads_only_the_preceding_part_of_the_record(
    folder: Path, read: list[tuple[int, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = long(folder / "long.mcap", 400)
    monkeypatch.setattr(record_list, "MAX_SEARCH_BYTES", path.stat().st_size / 20)
    read.clear()
    moment = moment_query.answer_moment(MomentQuery(name="long.mcap", t=200.3))
    assert moment["changed"] == {"1.1": ["failure", "", 200.0]}
    assert sum(size for _, size in read) < path.stat().st_size / 2  # the index too: of so short chunks it is long


def test_moment_includes_parts_joints_and_range_scan(folder: Path) -> None:
    scan = RangeScan(np.array([1.0, math.nan, 2.0, 3.0], np.float32), 0.0, math.pi / 2, 2.0, 1, 0.1, 9.0)
    joint = JointState(0.5, 0.0, None, -0.25, 12.0, 40.0, moving=False, torque=True)
    answers: list[Answer] = [
        (
            "base",
            "state",
            (),
            Reading(BaseState(Pose2D(1.0, 2.0, 0.5), ZERO_VELOCITY, battery_percent=77.0), 2.0, Quality.GOOD),
        ),
        ("arm", "states", (), {"elbow": Reading(joint, 2.0, Quality.GOOD)}),
        ("range", "scan", (), Reading(scan, 2.0, Quality.GOOD)),
    ]
    devices = {"base": Health(online=True), "arm": Health(online=False, detail="no such device", hint="plug it in")}
    items: list[Any] = [
        TickRecord("tick", 40, 2.0, 0.0, 1e-4, answers),
        HealthItem(2.1, devices),
        Logged(9.0, "info", ""),
    ]
    write(folder / "told.mcap", items)
    before, after = (moment_query.answer_moment(MomentQuery(name="told.mcap", t=t)) for t in (1.9, 2.2))
    assert (before["parts"], before["joints"], before["scan"]) == ([], {}, [])
    assert after["joints"] == {"elbow": [0.5, -0.25, 40.0]}
    assert after["scan"] == [[1.0, 0.0], [-2.0, 0.0], [0.0, -3.0]]
    parts: Any = after["parts"]
    base, arm = parts
    assert (base["level"], base["values"]["battery"], base["values"]["x"]) == ("OK", 77.0, 1.0)
    assert (arm["level"], arm["detail"], arm["hint"]) == ("ERROR", "no such device", "plug it in")
