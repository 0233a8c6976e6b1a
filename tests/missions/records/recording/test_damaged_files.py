import fcntl
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.opcode import Opcode
from mcap.reader import make_reader

from missions.plugins.records.recording.container import McapContainer, McapMessage, RecordSpan
from missions.plugins.records.recording.mcap_scan import FIRST_PRIVATE_OPCODE, scan_file
from missions.plugins.records.recording.repair import RepairError, repair_record
from missions.plugins.records.recording.run_record import RunRecord, open_record
from missions.plugins.records.recording.validation import InvalidRecordError
from tests.missions.records.recording.small_record import END, items, write

Damage = tuple[float, list[tuple[float, int]]]
"""Where a file is cut off (a share of it; 1 for not at all), and which bits of which bytes are turned over."""

DAMAGES = st.tuples(
    st.one_of(st.just(1.0), st.floats(0.0, 1.0)),
    st.lists(st.tuples(st.floats(0.0, 1.0, exclude_max=True), st.integers(0, 7)), max_size=4),
)


@dataclass(frozen=True, repr=False)
class Samples:
    """The same record, closed and not, and the messages that are in it."""

    closed: bytes
    unclosed: bytes
    written: list[McapMessage]

    def __repr__(self) -> str:
        return "samples"  # hypothesis prints it


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("records")


@pytest.fixture(scope="module")
def samples(folder: Path) -> Samples:
    closed, unclosed = write(folder / "closed.mcap", items()), write(folder / "unclosed.mcap", items(), close=False)
    return Samples(closed.read_bytes(), unclosed.read_bytes(), by_the_plain_reader(closed))


@pytest.fixture(scope="module")
def path(folder: Path) -> Path:
    """A file that examples write over."""
    return folder / "record.mcap"


def surveyed(path: Path) -> McapContainer:
    container = scan_file(path)
    assert container is not None
    return container


def readable(path: Path) -> list[McapMessage]:
    return list(surveyed(path).messages())


def by_the_plain_reader(path: Path) -> list[McapMessage]:
    with path.open("rb") as file:
        found = make_reader(file, validate_crcs=True).iter_messages(log_time_order=False)
        return [McapMessage(channel.topic, message.log_time, message.data) for _, channel, message in found]


def chunks_of(path: Path) -> list[RecordSpan]:
    return list(surveyed(path).chunk_spans)


def damaged(data: bytes, damage: Damage) -> bytes:
    share, flips = damage
    found = bytearray(data[: round(share * len(data))])
    for place, bit in flips:
        if found:
            found[int(place * len(found))] ^= 1 << bit
    return bytes(found)


def ask_everything(record: RunRecord) -> None:
    assert [event.t for event in record.events] == sorted(event.t for event in record.events)
    assert len(record.tick_records) <= 80
    assert len(list(record.views())) <= 4
    assert all(jpeg for _, jpeg in record.frames())
    assert len(record.series("base.x")[0]) <= 40
    assert set(record.statuses(2.0)) <= {"1", "1.1"}
    assert len(record.failures()) <= len(record.search("nobody")) + 1
    assert set(record.lost_counts()) <= {"/camera"}
    assert 0 <= record.end_time <= END


@given(DAMAGES)
def test_damaged_record_is_read_partly_or_refused(samples: Samples, path: Path, damage: Damage) -> None:
    path.write_bytes(damaged(samples.closed, damage))
    with suppress(InvalidRecordError):
        ask_everything(open_record(path))


@given(st.binary(max_size=200), st.booleans())
def test_anything_else_is_refused_in_words(path: Path, data: bytes, begins_well: bool) -> None:
    path.write_bytes(b"\x89MCAP0\r\n" * begins_well + data)
    with pytest.raises(InvalidRecordError, match=r"record\.mcap"):
        open_record(path)


@given(DAMAGES, st.booleans())
def test_repair_keeps_all_readable_messages(samples: Samples, path: Path, damage: Damage, was_closed: bool) -> None:
    path.write_bytes(damaged(samples.closed if was_closed else samples.unclosed, damage))
    container = scan_file(path)
    before = [] if container is None else list(container.messages())
    assert set(before) <= set(samples.written)
    if not before:
        return
    mended = repair_record(path)
    assert surveyed(path).is_complete
    assert readable(path) == before
    if not mended.already_closed:
        assert by_the_plain_reader(path) == before
    assert repair_record(path).already_closed


@settings(max_examples=30)
@given(st.floats(0.0, 1.0))
def test_interrupted_repair_is_finished_by_the_next(samples: Samples, path: Path, share: float) -> None:
    path.write_bytes(samples.unclosed[:-10])
    before = readable(path)
    repair_record(path)
    mended = path.read_bytes()
    appended = len(mended) - surveyed(path).end
    path.write_bytes(mended[: len(mended) - round(share * appended)])  # cut off first, then appended up to there
    assert readable(path) == before
    repair_record(path)
    assert by_the_plain_reader(path) == before


def test_unclosed_record_is_readable_up_to_its_last_chunk(samples: Samples, path: Path) -> None:
    path.write_bytes(samples.unclosed)
    assert readable(path) == samples.written
    path.write_bytes(samples.unclosed[: chunks_of(path)[-1].end - 1])
    left = readable(path)
    assert left == samples.written[: len(left)]
    assert len(left) < len(samples.written)
    assert not open_record(path).is_complete
    assert 3.0 < open_record(path).end_time <= END


def test_only_the_chunk_with_a_bad_checksum_is_skipped(samples: Samples, path: Path) -> None:
    path.write_bytes(samples.unclosed)
    chunk = chunks_of(path)[3]
    path.write_bytes(
        samples.unclosed[: chunk.end - 20]
        + bytes([samples.unclosed[chunk.end - 20] ^ 1])
        + samples.unclosed[chunk.end - 19 :]
    )
    told: list[RecordSpan] = []
    left = list(surveyed(path).messages(on_damage=told.append))
    assert told == [chunk]
    assert len(left) > 0.8 * len(samples.written)
    assert repair_record(path).skipped_spans == 1
    assert by_the_plain_reader(path) == left
    assert path.read_bytes()[chunk.start] == FIRST_PRIVATE_OPCODE


def test_reading_continues_at_the_next_chunk_after_a_damaged_range(samples: Samples, path: Path) -> None:
    path.write_bytes(samples.unclosed)
    chunk = chunks_of(path)[3]
    path.write_bytes(samples.unclosed[: chunk.start] + bytes(500) + samples.unclosed[chunk.start + 500 :])
    left = readable(path)
    assert left[0] == samples.written[0]
    assert left[-1] == samples.written[-1]
    assert repair_record(path).skipped_spans == 1
    assert by_the_plain_reader(path) == left


def test_repair_cuts_trailing_zeros(samples: Samples, path: Path) -> None:
    path.write_bytes(samples.unclosed + bytes(4096))
    assert repair_record(path).bytes_cut >= 4096
    assert repair_record(path).already_closed


def test_huge_length_fields_use_little_memory(samples: Samples, path: Path) -> None:
    path.write_bytes(samples.unclosed)
    chunk = chunks_of(path)[3]
    for at, least in ((chunk.start + 1, 8), (chunk.start + 9 + 16, 8)):  # of the record; of what it unpacks to
        path.write_bytes(samples.unclosed[:at] + b"\xff" * (least - 1) + b"\x7f" + samples.unclosed[at + least :])
        told: list[RecordSpan] = []
        container = surveyed(path)
        assert list(container.messages(on_damage=told.append))
        assert len(told) + len(container.damaged_spans) == 1


def test_repair_refuses_a_record_that_is_being_written(samples: Samples, path: Path) -> None:
    path.write_bytes(samples.unclosed)
    with path.open("rb") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        with pytest.raises(RepairError, match="is being written"):
            repair_record(path)
    assert path.read_bytes() == samples.unclosed


def test_repair_leaves_a_record_without_beginning_unchanged(samples: Samples, path: Path) -> None:
    path.write_bytes(samples.unclosed)
    chunk = chunks_of(path)[0]
    data = samples.unclosed[: chunk.start + 60] + bytes(9) + samples.unclosed[chunk.start + 69 :]
    path.write_bytes(data)
    with pytest.raises(RepairError, match="no readable data"):
        repair_record(path)
    assert path.read_bytes() == data
    with pytest.raises(InvalidRecordError, match="its beginning is missing or damaged"):
        open_record(path)


def test_repair_leaves_other_files_unchanged(path: Path) -> None:
    path.write_text("mission: greet\n")
    with pytest.raises(RepairError, match="not an MCAP file"):
        repair_record(path)
    assert path.read_text() == "mission: greet\n"


def test_spans_without_an_index_equal_the_indexed_spans(samples: Samples, path: Path) -> None:
    path.write_bytes(samples.closed)
    indexed = surveyed(path)
    path.write_bytes(samples.unclosed)
    walked = surveyed(path)
    assert (indexed.is_complete, walked.is_complete) == (True, False)
    for opcode in (Opcode.CHUNK, Opcode.ATTACHMENT, Opcode.METADATA):
        places = [[span for span in found.spans if span.opcode == opcode] for found in (indexed, walked)]
        assert places[0] == places[1]
