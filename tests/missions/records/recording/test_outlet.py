"""The states of a process that writes a record, by the lines that it prints."""

from pathlib import Path
from random import Random

import pytest

from missions.plugins.records.recording.writer_client import RecordWriterClient, WriterEvent, WriterState
from tests.machines import walk

NAME = "missions.plugins.records.recording.writer_client.TRANSITIONS"


def new_outlet() -> RecordWriterClient:
    return RecordWriterClient(Path("none.mcap"), limit=1e6, overwrite=False, start_timeout=1.0)


def test_random_lines_take_every_transition(monkeypatch: pytest.MonkeyPatch) -> None:
    def start(outlet: RecordWriterClient, _: Random) -> None:
        outlet._advance(WriterEvent.START)

    def print_line(outlet: RecordWriterClient, chance: Random) -> None:
        was_recording = outlet.state is WriterState.RECORDING
        closed = b'{"closed": {"counts": {}, "ended": null}}'
        outlet._handle_line(
            chance.choice((b'{"ready": true}', b'{"failed": "disk full"}', closed, b"Traceback", b"{}"))
        )
        assert (
            not outlet.accepts_items or was_recording or outlet.state in {WriterState.STARTING, WriterState.RECORDING}
        )

    def end(outlet: RecordWriterClient, _: Random) -> None:
        outlet._stop("its process has ended")
        assert not outlet.accepts_items

    table = walk(monkeypatch, NAME, new_outlet, [start, print_line, print_line, end], steps=10)
    assert table.visited == set(table)


def test_process_that_was_ready_and_fails_at_once_has_begun_its_record() -> None:
    outlet = new_outlet()
    outlet._advance(WriterEvent.START)
    outlet._handle_line(b'{"ready": true}')
    outlet._handle_line(b'{"failed": "disk full"}')
    assert outlet.state is WriterState.STOPPED
    assert list(outlet.problems) == ["disk full: recording stopped"]


def test_line_after_the_end_revives_no_process() -> None:
    outlet = new_outlet()
    outlet._advance(WriterEvent.START)
    outlet._stop("its process has ended")
    outlet._handle_line(b'{"ready": true}')
    assert outlet.state is WriterState.ABORTED


def test_replaced_picture_is_no_fault_and_a_later_loss_is_one() -> None:
    outlet = new_outlet()
    outlet._handle_line(b'{"lost": {"/camera": 1}, "why": "replaced by a newer picture"}')
    assert not outlet.problems
    assert outlet.lost == {"/camera": 1}
    outlet._handle_line(b'{"lost": {"/camera": 2}, "why": "replaced by a newer picture; the disk is too slow"}')
    assert list(outlet.problems) == ["replaced by a newer picture; the disk is too slow: messages are being lost"]
