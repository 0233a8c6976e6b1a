"""What a record costs a tick: ten minutes of a mission in simulated time, twice at once, one of the two recorded.

Both runs are the same, tick for tick, and make their ticks in turn, so that whatever else the machine does befalls
both. Between two ticks of a robot there is time, of which a little is left here too. The record is read back by the
library's own reader, and counted.
"""

import statistics
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from mcap.reader import make_reader

from config.file_io import collect_read_files
from missions.executive.events import Event
from missions.plugins.records.recording.record_contents import contents_of
from missions.plugins.records.recording.recorder import Recorder
from missions.request import RunRequest
from missions.runner import Runner
from tests.benchmarks.table import Row

MISSION = "patrol"
TICKS = 12_000
"""Ten minutes."""

PAUSE = 0.002
"""Seconds between two ticks; a robot has 50 ms or so."""


@dataclass
class Costs:
    """What each tick took: seconds of the ticking thread's own work, and seconds by the clock on the wall."""

    work: list[float] = field(default_factory=list)
    wall: list[float] = field(default_factory=list)


@dataclass
class Outcome:
    """What ticks cost with and without a record, and how many messages were told of, and read back, by topic."""

    recorded: Costs
    bare: Costs
    told: Mapping[str, int]
    read: Mapping[str, int]


def rows() -> Iterator[Row]:
    """Yield what the median tick takes, and by how many milliseconds the 99th percentile is longer."""
    with TemporaryDirectory() as folder:
        outcome = run(Path(folder) / "patrol.mcap")
    if outcome.told != outcome.read:
        raise ValueError(f"told of {outcome.told}, but the reader finds {outcome.read}")
    for what in ("work", "wall"):
        ours, theirs = getattr(outcome.recorded, what), getattr(outcome.bare, what)
        median, other = statistics.median(ours), statistics.median(theirs)
        yield Row(f"recorded tick, median ({what})", median, other, median / other, 1.1)
        late, bare = (float(np.quantile(each, 0.99)) for each in (ours, theirs))
        yield Row(f"recorded tick, 99 %, more ms ({what})", late, bare, (late - bare) * 1000, 1.0)


def run(path: Path, *, ticks: int = TICKS) -> Outcome:
    """Make so many ticks of the mission with and without a record at ``path``."""
    order = RunRequest(MISSION, {"rounds": "1000"}, simulate="fast", eyes="truth")
    recorder = Recorder(path)
    with collect_read_files() as files:
        recorded = Runner(order, listeners=[recorder])
        recorded.observe(recorder.on_tick, recorder.on_view)
    recorder.watch_tree(recorded.root)
    bare = Runner(order, listeners=[_unheard])
    contents = contents_of(order, recorded.plan, recorded.config, files, started=datetime(2026, 11, 21, tzinfo=UTC))
    outcome = Outcome(Costs(), Costs(), {}, {})
    with ExitStack() as closing:
        closing.enter_context(recorder)
        recorder.open(contents, recorded.clock)
        for runner in (recorded, bare):
            runner.executive.emit_start(file="", robot="", params={})
            closing.enter_context(runner.ready())
        pair = ((recorded, outcome.recorded), (bare, outcome.bare))
        for number in range(ticks):
            for runner, costs in pair if number % 2 else reversed(pair):
                _tick(runner, costs)
    loss = recorder.close()
    if loss:
        raise ValueError(f"the record is not whole: {loss}")
    outcome.told, outcome.read = dict(recorder.counts), counted(path)
    return outcome


def counted(path: Path) -> Mapping[str, int]:
    """Return how many messages the library's reader finds, by topic."""
    with path.open("rb") as file:
        return Counter(channel.topic for _, channel, _ in make_reader(file).iter_messages())


def _tick(runner: Runner, costs: Costs) -> None:
    """Make a tick, and let time pass until the next."""
    executive = runner.executive
    wall, work = time.perf_counter(), time.thread_time()
    executive.tick()
    costs.work.append(time.thread_time() - work)
    costs.wall.append(time.perf_counter() - wall)
    executive.wait_period()
    time.sleep(PAUSE)


def _unheard(event: Event) -> None:
    """Hear an event, as whoever shows a run does."""
    del event
