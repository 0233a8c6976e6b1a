"""The record of a run of the storm, by the recorder that users have; and what becomes of who writes it meanwhile."""

import os
import resource
import signal
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path

from config.robot import RobotConfig
from drivers.api import ignore
from drivers.clock import time_of_day
from missions.executive.event_reporter import capture_log
from missions.executive.events import Event
from missions.executive.tick_record import TickRecord
from missions.language.plan import Plan
from missions.plugins.records.recording.record_contents import contents_of
from missions.plugins.records.recording.recorder import Recorder
from missions.plugins.records.recording.run_record import open_record
from missions.plugins.records.recording.validation import InvalidRecordError
from missions.plugins.records.replay.rerun import rerun
from missions.request import RunRequest
from missions.runner import Runner

ROOM = 4096
"""Bytes that still go onto a disk that is as good as full."""


class StormRecord:
    """Records a run at ``path``. It is a listener of the run's events; ``moment`` wants its moments."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.struck = ""
        self._recorder = Recorder(path, lossless=True, frame_rate=0.0)

    def __call__(self, event: Event) -> None:
        """Keep an event."""
        self._recorder(event)

    def moment(self, moment: TickRecord) -> None:
        """Keep a moment."""
        self._recorder.on_tick(moment)

    def begin(self, order: RunRequest, runner: Runner, files: Mapping[Path, bytes]) -> None:
        """Begin it. Raises CannotRecordError."""
        self._recorder.watch_tree(runner.root)
        head = contents_of(order, runner.plan, runner.config, files, started=time_of_day())
        self._recorder.open(head, runner.clock)

    def kill(self) -> None:
        """End who writes it with ``kill -9``."""
        self.struck = "record killed"
        with suppress(ProcessLookupError):
            os.kill(self._process, signal.SIGKILL)

    def fill(self) -> None:
        """Let the disk be full: no byte goes beyond what there is now, but for a few."""
        self.struck = "record full"
        most = self.path.stat().st_size + ROOM
        with suppress(ProcessLookupError):
            resource.prlimit(self._process, resource.RLIMIT_FSIZE, (most, most))

    def end(self) -> None:
        """End it."""
        self._recorder.close()

    @property
    def _process(self) -> int:
        process = self._recorder.process_id
        if process is None:
            raise ProcessLookupError
        return process

    def wrong(self, moments: list[TickRecord], plan: Plan, config: RobotConfig, seed: int) -> Iterator[str]:
        """Yield what is wrong with it, once it has ended: it must be read, and be the beginning of what was."""
        try:
            record = open_record(self.path)
            kept = list(record.tick_records)
        except (InvalidRecordError, OSError) as error:
            yield f"it cannot be read: {error}"
            return
        times = [moment.t for moment in kept]
        of_run = [moment.t for moment in moments]
        if times != of_run[: len(times)]:
            # On a full disk a small piece may find room after a large one did not: then the record says what it lacks.
            if not record.lost_counts() or not set(times) <= set(of_run):
                yield f"its {len(times)} moments are not those of the run"
        elif not self.struck and not (record.is_complete and len(times) == len(moments)):
            yield f"it has {len(times)} of {len(moments)} moments, and is {'' if record.is_complete else 'not '}whole"
        else:
            with capture_log(ignore):
                found = rerun(record, plan, config, seed=seed)
            if not found.is_identical:
                yield f"it is decided otherwise: {found.difference or found.command or found.unanswered}"
