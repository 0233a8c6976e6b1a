"""The states of a process that writes a record, by the lines that it prints."""

from pathlib import Path
from random import Random

import pytest

from missions.plugins.records.recording.outlet import Outlet, WriterEvent, WriterState
from tests.machines import walk

NAME = "missions.plugins.records.recording.outlet.TRANSITIONS"


def new_outlet() -> Outlet:
    return Outlet(Path("none.mcap"), limit=1e6, overwrite=False, start_time=1.0)


def test_random_lines_take_every_transition(monkeypatch: pytest.MonkeyPatch) -> None:
    def start(outlet: Outlet, _: Random) -> None:
        outlet._advance(WriterEvent.START)

    def print_line(outlet: Outlet, chance: Random) -> None:
        was_recording = outlet.state is WriterState.RECORDING
        closed = b'{"closed": {"counts": {}, "ended": null}}'
        outlet._take(chance.choice((b'{"ready": true}', b'{"failed": "disk full"}', closed, b"Traceback", b"{}")))
        assert not outlet.takes or was_recording or outlet.state in {WriterState.STARTING, WriterState.RECORDING}

    def end(outlet: Outlet, _: Random) -> None:
        outlet._stop("its process has ended")
        assert not outlet.takes

    table = walk(monkeypatch, NAME, new_outlet, [start, print_line, print_line, end], steps=10)
    assert table.visited == set(table)


def test_process_that_was_ready_and_fails_at_once_has_begun_its_record() -> None:
    outlet = new_outlet()
    outlet._advance(WriterEvent.START)
    outlet._take(b'{"ready": true}')
    outlet._take(b'{"failed": "disk full"}')
    assert outlet.state is WriterState.STOPPED
    assert list(outlet.troubles) == ["disk full: nothing more is recorded"]


def test_line_after_the_end_revives_no_process() -> None:
    outlet = new_outlet()
    outlet._advance(WriterEvent.START)
    outlet._stop("its process has ended")
    outlet._take(b'{"ready": true}')
    assert outlet.state is WriterState.ABORTED
