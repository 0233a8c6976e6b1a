"""A long run: what a robot that drives, looks and speaks for hours costs, from minute to minute, as plots.

    python -m tests.benchmarks.soak --hours 8 FILE.svg

Everything is simulated, and recorded without pictures, as fast as the machine allows. The plots are of the run's
process: memory, open files, threads, the record, and how long a tick takes; a leak is a line that rises.
"""

import argparse
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import active_count

import click

from config.file_io import collect_read_files
from drivers.clock import SystemClock, time_of_day
from missions.executive.tick_record import TickRecord
from missions.plugins.records.recording.record_contents import contents_of
from missions.plugins.records.recording.recorder import Recorder
from missions.request import RunRequest
from missions.runner import Runner

MISSION = """
mission: soak
params:
  time: 1 h
tree:
  race:
    - wander: {speed: 0.2 m/s}
    - sequence:
        - scan: {pan: [-60 deg, 60 deg], tilt: [-10 deg, 10 deg]}
        - say: still here
        - wait: 5 s
      repeat: forever
    - wait: ${time}
"""

EVERY = 60.0
"""Simulated seconds from one sample to the next."""

WIDTH, HEIGHT, EDGE = 760, 120, 60

LINES: Mapping[str, str] = {
    "memory": "MB",
    "open files": "",
    "threads": "",
    "record": "MB",
    "wall time of a tick, mean": "ms",
}


class Soak:
    """A run that is sampled. ``samples`` are the figures of ``LINES``, one row every ``EVERY`` seconds."""

    def __init__(self, folder: Path, hours: float) -> None:
        mission, self._path = folder / "soak.yaml", folder / "soak.mcap"
        mission.write_text(MISSION, "utf-8")
        order = RunRequest(
            str(mission), {"time": f"{hours} h"}, "turtlebot2_arm", "fast", "living_room", eyes="truth", seed=1
        )
        self._recorder = Recorder(self._path, lossless=True, frame_rate=0.0)
        with collect_read_files() as files:
            self._runner = Runner(order, listeners=[self._recorder])
            self._runner.observe(self._moment)
        self._recorder.watch_tree(self._runner.root)
        self._contents = contents_of(order, self._runner.plan, self._runner.config, files, started=time_of_day())
        self._clock, self._ticks, self._since = SystemClock(), 0, 0.0
        self.samples: list[Sequence[float]] = []
        self.result = ""

    def run(self) -> None:
        """Let it run to its end."""
        self._recorder.open(self._contents, self._runner.clock)
        self._since = self._clock.now()
        self._runner.twins.timeline.call_every(EVERY, self._sample)  # type: ignore[union-attr]  # it is simulated
        try:
            self.result = self._runner.run().result
        finally:
            self._recorder.close()

    def _moment(self, moment: TickRecord) -> None:
        self._ticks += 1
        self._recorder.on_tick(moment)

    def _sample(self) -> None:
        now = self._clock.now()
        pages = int(Path("/proc/self/statm").read_text("ascii").split()[1])
        memory = pages * os.sysconf("SC_PAGE_SIZE") / 1e6
        tick = 1000 * (now - self._since) / max(self._ticks, 1)
        files = len(list(Path("/proc/self/fd").iterdir()))
        if self._ticks:
            self.samples.append((memory, files, active_count(), self._path.stat().st_size / 1e6, tick))
        self._ticks, self._since = 0, now


def drawn(samples: Sequence[Sequence[float]]) -> str:
    """Return the plots, one below the other."""
    panels = [_panel(at, name, [row[at] for row in samples]) for at, name in enumerate(LINES)]
    high = HEIGHT * len(LINES) + 20
    size = f'width="{WIDTH}" height="{high}" viewBox="0 0 {WIDTH} {high}"'
    style = 'font-family="sans-serif" font-size="12"'
    ground = f'<rect width="{WIDTH}" height="{high}" fill="#ffffff"/>'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size} {style}>{ground}{"".join(panels)}</svg>\n'


def _panel(at: int, name: str, values: Sequence[float]) -> str:
    """Return the curve of one figure over the hours, from 0 to its greatest."""
    top, most, unit = at * HEIGHT + 30, max(values) or 1.0, LINES[name]
    wide, high = WIDTH - 2 * EDGE, HEIGHT - 40
    step = wide / max(len(values) - 1, 1)
    points = " ".join(f"{EDGE + n * step:.1f},{top + high * (1 - value / most):.1f}" for n, value in enumerate(values))
    told = f"{name}: {values[0]:.4g} at first, {values[-1]:.4g} at last, {most:.4g} at most {unit}".rstrip()
    hours = f"{len(values) * EVERY / 3600:.2g} h"
    return (
        f'<text x="{EDGE}" y="{top - 6}">{told}</text><text x="{WIDTH - EDGE + 6}" y="{top + high}">{hours}</text>'
        f'<path d="M{EDGE} {top}v{high}h{wide}" fill="none" stroke="#8a8f98"/>'
        f'<polyline points="{points}" fill="none" stroke="#2a78b5" stroke-width="1.5"/>'
    )


def main() -> None:
    """Soak, and draw."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--hours", type=float, default=8.0)
    options.add_argument("file", type=Path)
    given = options.parse_args()
    with TemporaryDirectory() as folder:
        soak = Soak(Path(folder), given.hours)
        soak.run()
    given.file.write_text(drawn(soak.samples), "utf-8")
    first, last = soak.samples[0], soak.samples[-1]
    for name, before, after in zip(LINES, first, last, strict=True):
        click.echo(f"{name}: {before:.4g} at first, {after:.4g} at last {LINES[name]}")
    click.echo(f"{len(soak.samples)} simulated minutes: {soak.result}")


if __name__ == "__main__":
    main()
