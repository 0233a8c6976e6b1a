"""Records in files, of runs in simulated time."""

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

from config.library import DEFAULT_ROBOT, find
from config.reading import files_read
from missions.executive.tick_record import TickRecord
from missions.library.drivers import load_robot
from missions.plugins.records.recording.gather import contents_of
from missions.plugins.records.recording.read import Record, open_record
from missions.plugins.records.recording.recorder import Recorder
from missions.plugins.testing.stage import IN_PROCESS
from missions.request import RunRequest
from missions.runner import Runner
from perception.api import Frame
from perception.eyes import Vision


def record_of(order: RunRequest, path: Path, *, act: Callable[[Runner, TickRecord], None] | None = None) -> Record:
    """Run an order, write the record of it, and open that. After each moment, ``act`` may do something to the run."""
    recorder = Recorder(path, frames=100.0, patient=True)

    def remember(moment: TickRecord) -> None:
        recorder.moment(moment)
        if act is not None:
            act(runner, moment)

    with files_read() as read:
        runner = Runner(order, limits=IN_PROCESS, listeners=[recorder])
        runner.observe(remember)
    recorder.watch(runner.root)
    config = load_robot(find("robots", order.robot or DEFAULT_ROBOT))
    contents = contents_of(order, runner.plan, config, read, started=datetime(2026, 11, 21, 14, 3, tzinfo=UTC))
    with recorder:
        recorder.open(contents, runner.executive.run.clock)
        _watch(runner, recorder)
        runner.run()
    assert runner.stream.lost == []
    assert not recorder.loss
    return open_record(path)


def _watch(runner: Runner, recorder: Recorder) -> None:
    """Have every picture that is searched recorded, with what was found in it."""
    vision = runner._robot.robot.sight_part
    if isinstance(vision, Vision):
        search = vision._search

        def searched(frame: Frame) -> None:
            search(frame)
            recorder.view(vision._view)
            recorder.frame(frame)

        vision._search = searched  # type: ignore[method-assign] # the one door of all pictures
