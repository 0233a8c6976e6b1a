"""Files that somebody made to be read for ever, or into all memory: told in words, soon, and with few bytes read.

They are written by the library of the format, as anybody may.
"""

import csv
import json
import struct
import tracemalloc
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.records import Chunk
from mcap.writer import CompressionType, Writer

from missions.plugins.records.recording import container, mcap_scan, run_record
from missions.plugins.records.recording.container import RECORD_HEADER as RECORD_HEAD
from missions.plugins.records.recording.export import to_csv
from missions.plugins.records.recording.run_record import InvalidRecordError, open_record
from missions.plugins.records.recording.tagged_values import to_json
from missions.trees.drawing import to_json as drawing_to_json
from tests.missions.records.recording.small_record import HEAD, TREE
from tests.missions.records.recording.small_record import items as small_items
from tests.missions.records.recording.small_record import write as write_small

Told = tuple[str, Mapping[str, Any]]
"""The topic of a message, and what it says."""


def about(**other: object) -> Told:
    """Return the first message of a record, with something else in it."""
    written = to_json(HEAD)
    assert isinstance(written, dict)
    return "/mission", {**written, **other}


def write(
    path: Path,
    messages: Iterable[Told],
    files: Mapping[str, bytes] | None = None,
    *,
    packed: CompressionType = CompressionType.ZSTD,
) -> Path:
    """Write a file as another program would; return its path."""
    with path.open("wb") as file:
        writer: Any = Writer(file, compression=packed)
        writer.start(profile="missiontree", library="somebody")
        for name, data in (files or {}).items():
            writer.add_attachment(0, 0, name, "", data)
        channels: dict[str, int] = {}
        for topic, said in messages:
            if topic not in channels:
                schema = writer.register_schema(f"of {topic}", "jsonschema", b"{}")
                channels[topic] = writer.register_channel(topic, "json", schema)
            writer.add_message(channels[topic], 0, json.dumps(said).encode(), 0)
        writer.finish()
    return path


@pytest.mark.parametrize(
    "said",
    [
        {"started": "0001-01-01T00:00:00+00:00"},
        {"started": "9999-12-31T23:59:59-23:59"},
        {"started": "2026-13-45"},
        {"started": 7},
        {"rate": "nan"},
        {"rate": 0.0},
        {"rate": -1e308},
        {"rate": 10**400},
        {"lag": "inf"},
        {"eye": [0.0, 1e308, 0.0]},
    ],
)
def test_header_with_invalid_values_is_refused(tmp_path: Path, said: Mapping[str, object]) -> None:
    path = write(tmp_path / "a.mcap", [about(**said)])
    with pytest.raises(InvalidRecordError, match="damaged record"):
        open_record(path)


def test_decompression_bomb_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(container, "EXPANSION_ALLOWANCE", 1_000_000)
    path = write(
        tmp_path / "a.mcap", [about(), *(("/log", {"t": 1.0, "kind": "voice", "message": "x" * 60_000}),) * 200]
    )
    assert path.stat().st_size < 100_000
    with pytest.raises(
        InvalidRecordError, match="would decompress to more than 100 times that: not written by MissionTree"
    ):
        _ = open_record(path).events


def test_normal_record_stays_far_below_the_expansion_limit(tmp_path: Path) -> None:
    written = open_record(write_small(tmp_path / "a.mcap", small_items(), every=1000))
    unpacked = sum(chunk.uncompressed_size for _, chunk, _ in written.container.chunks())
    assert unpacked < 0.2 * container.MAX_EXPANSION_RATIO * written.path.stat().st_size


def test_index_with_repeated_chunks_is_ignored(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", [about(), ("/log", {"t": 1.0, "kind": "voice", "message": "once"})])
    data = path.read_bytes()
    footer = len(data) - 8 - 29
    opcode, length, start, _, _ = struct.unpack("<BQQQI", data[footer:-8])
    index = data[start:footer]
    at = next(
        at
        for at in range(len(index))
        if index[at] == Opcode.CHUNK_INDEX and struct.unpack_from("<Q", index, at + 1)[0] < 200
    )
    size = RECORD_HEAD.size + struct.unpack_from("<Q", index, at + 1)[0]
    many = index + index[at : at + size] * 1000
    path.write_bytes(data[:start] + many + struct.pack("<BQQQI", opcode, length, start, 0, 0) + data[-8:])
    record = open_record(path)
    assert len(record.container.chunk_spans) == 1
    assert [event.event for event in record.events] == ["log"]


def test_false_chunk_starts_do_not_slow_the_scan(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mcap_scan, "MAX_SEARCHED_BYTES", 10_000_000)
    whole = write_small(tmp_path / "whole.mcap", small_items(), close=False).read_bytes()
    false = struct.pack("<BQ", Opcode.CHUNK, 900_000) + bytes(28) + b"\x04\0\0\0zstd" + bytes(20)
    path = tmp_path / "a.mcap"
    path.write_bytes(whole + b"\xff" * 50 + false * 30_000)
    read_bytes, real = [0], container.read_body

    def counted(*arguments: Any) -> bytes:
        found = real(*arguments)
        read_bytes[0] += len(found)
        return found

    monkeypatch.setattr(mcap_scan, "read_body", counted)
    assert open_record(path).end_time >= 4.0
    assert read_bytes[0] < 12_000_000


def test_millions_of_empty_records_use_little_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mcap_scan, "MAX_SPANS", 1000)
    whole = write_small(tmp_path / "whole.mcap", small_items(), close=False).read_bytes()
    path = tmp_path / "a.mcap"
    path.write_bytes(whole + struct.pack("<BQB", 0xFF, 1, 0) * 300_000)
    tracemalloc.start()
    try:
        assert open_record(path).end_time >= 4.0
        assert tracemalloc.get_traced_memory()[1] < 20_000_000
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("most", ["MAX_MESSAGES", "MAX_MESSAGE_BYTES"])
def test_record_too_large_for_memory_is_refused_with_a_hint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, most: str
) -> None:
    monkeypatch.setattr(run_record, most, 50)
    record = open_record(write_small(tmp_path / "a.mcap", small_items()))
    with pytest.raises(InvalidRecordError, match=r"too large to read at once(.|\n)*try: mission record cut"):
        _ = record.events
    assert len(list(record.frames())) == 4  # one by one


def test_oversized_attached_files_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_record, "MAX_FILE_BYTES", 1_000_000)
    path = write(tmp_path / "a.mcap", [about()], {f"world/{number}": bytes(600_000) for number in range(2)})
    with pytest.raises(InvalidRecordError, match="has attached files of more than 1 MB"):
        open_record(path)


def test_a_tree_of_too_many_nodes_is_not_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tree = drawing_to_json(replace(TREE, root=replace(TREE.root, children=TREE.root.children * 300)))
    path = write(tmp_path / "a.mcap", [about()], {"tree.json": json.dumps(tree).encode()})
    assert len(open_record(path).drawing().root.children) == 300
    monkeypatch.setattr(run_record, "MAX_NODES", 300)
    with pytest.raises(InvalidRecordError, match="a tree of more than 300 nodes"):
        open_record(path).drawing()


def test_chunk_with_a_wrong_size_is_damaged() -> None:
    bomb = zstandard.ZstdCompressor().compress(bytes(50_000_000))
    for size in (1000, container.MAX_RECORD_SIZE + 1, 2**63):
        with pytest.raises(container.DamagedError):
            container.decompress_chunk(Chunk("zstd", bomb, 0, 0, 0, size))


def test_no_text_of_a_record_is_a_formula_of_a_spreadsheet(tmp_path: Path) -> None:
    texts = ("=cmd|' /C calc'!A0", "+1+1", "-2+3", "@SUM(A1)", "\t=1", "fine - really", "-inf", "-")
    path = write(tmp_path / "a.mcap", [about(), *(("/log", {"t": 1.0, "message": text}) for text in texts)])
    to_csv(open_record(path), tmp_path / "tables")
    with (tmp_path / "tables" / "log.csv").open(encoding="utf-8", newline="") as file:
        found = [row["message"] for row in csv.DictReader(file)]
    assert found == [f"'{text}" for text in texts[:5]] + list(texts[5:])


def test_csv_file_names_are_safe_for_any_topic(tmp_path: Path) -> None:
    topics = ("/\0", "/../../evil", "/" + "x" * 300, "/a\nb", "..", "/c\\d")
    path = write(tmp_path / "a.mcap", [about(), *((topic, {"t": 1.0, "n": 1}) for topic in topics)])
    folder = tmp_path / "tables"
    made = to_csv(open_record(path), folder)
    assert sorted(each.name for each in folder.iterdir()) == sorted(each.name for each in made)
    assert len(made) == len(topics) + 1
    assert [each.name for each in tmp_path.iterdir() if each.is_dir()] == ["tables"]


def test_a_table_of_thousands_of_columns_is_refused(tmp_path: Path) -> None:
    wide = [("/log", {f"{number}.{name}": 1 for name in range(300)}) for number in range(10)]
    path = write(tmp_path / "a.mcap", [about(), *wide])
    with pytest.raises(InvalidRecordError, match="a table of /log has more than 2000 columns"):
        to_csv(open_record(path), tmp_path / "tables")
    many = [(f"/{number}", {"t": 1.0}) for number in range(250)]
    with pytest.raises(InvalidRecordError, match="has more than 200 topics"):
        to_csv(open_record(write(tmp_path / "b.mcap", [about(), *many])), tmp_path / "others")
