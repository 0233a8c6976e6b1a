"""The process that writes a record, within one program and on a clock cranked by hand: when what is on the disk."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from drivers.clock import ManualClock
from missions.executive.events import CommandSent, NodeChanged
from missions.plugins.records.recording.items import pack_items
from missions.plugins.records.recording.record_header import RecordContents
from missions.plugins.records.recording.writer import RecordWriter
from missions.plugins.records.recording.writer_process import (
    FLUSH_INTERVAL,
    URGENT_FLUSH_INTERVAL,
    BatchReader,
    WriterProcess,
)
from tests.missions.records.recording.small_record import HEAD, Item, moments

CAME = 1.25
"""When it comes: just after what came before was written."""

COMMAND = CommandSent(0.4, 8, "base", "drive (1.1)", {"linear": 0.2})
CHANGE = NodeChanged(0.4, 8, "1.1", "drive", "drive", 4, "success", "")


class Script(BatchReader):
    """Lets an item come, and end some time later."""

    def __init__(self, clock: ManualClock, item: Item) -> None:
        self.is_open = True
        self._clock = clock
        self._coming = [(0.0, pack_items([RecordContents(HEAD, {}, b"")])), (CAME, pack_items([item])), (3.0, b"")]

    def batches(self, timeout: float) -> Iterator[bytes]:
        """Let time pass, up to ``timeout`` or to what comes next."""
        due, batch = self._coming[0]
        if due > self._clock.now() + timeout:
            self._clock.advance(timeout)
            return
        self._clock.advance(due - self._clock.now())
        self._coming.pop(0)
        self.is_open = bool(batch)
        if batch:
            yield batch


@pytest.mark.parametrize(
    ("item", "within"), [(moments()[0], FLUSH_INTERVAL), (COMMAND, FLUSH_INTERVAL), (CHANGE, URGENT_FLUSH_INTERVAL)]
)
def test_rare_messages_are_synced_sooner_than_frequent_ones(
    item: Item, within: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock, synced = ManualClock(), list[float]()
    monkeypatch.setattr(RecordWriter, "sync", lambda _: synced.append(clock.now()))
    WriterProcess(tmp_path / "it.mcap", Script(clock, item), clock, limit=1e9, overwrite=False).run()
    after = min(time for time in synced if time > CAME) - CAME
    assert within - 0.1 < after <= within + 1e-9
