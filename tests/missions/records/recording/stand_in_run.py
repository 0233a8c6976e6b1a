"""A run that never was, in real time and in a process of its own: its recorder gets a moment every 10 ms, until killed.

It says the process of its writer first, then the time of each moment that it has handed over.
"""

import sys
from pathlib import Path
from threading import Event

from drivers.api import HeadPose, Quality, Reading
from drivers.clock import SystemClock
from missions.executive.tick_record import TickRecord
from missions.plugins.records.recording.record_header import RecordContents
from missions.plugins.records.recording.recorder import Recorder
from tests.missions.records.recording.small_record import FILES, HEAD


def moment(tick: int, t: float) -> TickRecord:
    """Return a moment in which a head turns."""
    pose = Reading(HeadPose(0.1 * t, 0.0), t, Quality.GOOD)
    return TickRecord("tick", tick, t, 0.0, 1e-4, [("head", "pose", (), pose)])


def main() -> None:
    """Record until killed."""
    recorder, clock, pause = Recorder(Path(sys.argv[1])), SystemClock(), Event()
    recorder.open(RecordContents(HEAD, FILES), clock)
    process = recorder._writer._process
    print(0 if process is None else process.pid, flush=True)  # noqa: T201 - for the test
    tick = 0
    while not pause.wait(0.01):
        tick += 1
        t = clock.now()
        recorder.on_tick(moment(tick, t))
        print(t, flush=True)  # noqa: T201 - for the test


if __name__ == "__main__":
    main()
