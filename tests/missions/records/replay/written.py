"""Records in files, of runs in simulated time."""

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

from config.file_io import collect_read_files
from config.library import DEFAULT_ROBOT, find_file
from missions.executive.tick_record import TickRecord
from missions.library.drivers import load_robot
from missions.plugins.records.recording.record_contents import contents_of
from missions.plugins.records.recording.recorder import Recorder
from missions.plugins.records.recording.run_record import RunRecord, open_record
from missions.plugins.testing.case_runner import IN_PROCESS_LIMITS
from missions.request import RunRequest
from missions.runner import Runner
from perception.api import Frame
from perception.eyes import Vision


def record_of(order: RunRequest, path: Path, *, act: Callable[[Runner, TickRecord], None] | None = None) -> RunRecord:
    """Run an order, write the record of it, and open that. After each moment, ``act`` may do something to the run."""
    recorder = Recorder(path, frame_rate=100.0, lossless=True)

    def remember(moment: TickRecord) -> None:
        recorder.on_tick(moment)
        if act is not None:
            act(runner, moment)

    with collect_read_files() as read:
        runner = Runner(order, limits=IN_PROCESS_LIMITS, listeners=[recorder])
        runner.observe(remember)
    recorder.watch_tree(runner.root)
    config = load_robot(find_file("robots", order.robot or DEFAULT_ROBOT))
    contents = contents_of(order, runner.plan, config, read, started=datetime(2026, 11, 21, 14, 3, tzinfo=UTC))
    with recorder:
        recorder.open(contents, runner.executive.run.clock)
        _watch(runner, recorder)
        runner.run()
    assert runner.stream.failed_listeners == []
    assert not recorder.loss
    return open_record(path)


def _watch(runner: Runner, recorder: Recorder) -> None:
    """Have every picture that is searched recorded, with what was found in it."""
    vision = runner._robot.robot.sight_part
    if isinstance(vision, Vision):
        search = vision._search

        def searched(frame: Frame) -> None:
            search(frame)
            recorder.on_view(vision._view)
            recorder.on_frame(frame)

        vision._search = searched  # type: ignore[method-assign] # the one door of all pictures
