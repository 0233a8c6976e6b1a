"""Output files of a sweep: runs as CSV, summary as JSON, worlds of the worst runs."""

import csv
import io
import json
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path

from config.file_io import save_file
from missions.plugins.testing.sweep.summary import Summary, cause_of
from missions.plugins.testing.sweep.sweep import SweepPlan
from missions.plugins.testing.sweep.variation import SweepRow, Variation

RUNS, SUMMARY, PICTURE, WORLDS = "runs.csv", "summary.json", "sweep.png", "worlds"
"""The files in the folder, and the folder of worlds in it."""


def runs_csv(rows: Iterable[SweepRow], variations: Sequence[Variation], *, heading: bool = True) -> str:
    """Return all runs as CSV; the text does not depend on the machine or the number of workers."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    if heading:
        titles = [variation.title for variation in variations]
        writer.writerow(["seed", *titles, "result", "cause", "reason", "seconds", "ticks"])
    for row in rows:
        writer.writerow([row.seed, *row.values, row.result, cause_of(row), row.reason, row.seconds, row.ticks])
    return out.getvalue()


def summary_json(summary: Summary, about: Mapping[str, object]) -> str:
    """Return the summary as JSON, with the sweep's settings ``about``."""
    low, high = summary.rate.interval
    found: dict[str, object] = {
        **about,
        "runs": summary.rate.runs,
        "successes": summary.rate.successes,
        "success": summary.rate.share,
        "interval_95": [low, high],
        "seconds": None if summary.times is None else asdict(summary.times),
        "causes": [asdict(each) for each in summary.causes],
        "varied": {
            title: [
                {
                    "values": each.label,
                    "runs": each.rate.runs,
                    "successes": each.rate.successes,
                    "interval_95": each.rate.interval,
                }
                for each in bins
            ]
            for title, bins in summary.bins.items()
        },
        "worst": [asdict(row) for row in summary.worst],
    }
    return json.dumps(found, indent=2, ensure_ascii=False) + "\n"


def write_world(sweep: SweepPlan, seed: int, path: Path) -> None:
    """Write the world of one run as a world file. Raises ValueError for an invalid world, OSError."""
    text = sweep.world_of(sweep.draw(seed), seed)
    save_file(path, f"# As it is for run {seed} of a sweep.\n{text}")


class SweepFolder:
    """Output folder of a sweep: table of runs, summary, picture, and worlds of the worst runs."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._worlds = path / WORLDS
        self._has_rows = False

    def prepare(self, *, force: bool) -> None:
        """Create the folder, so that errors show before the first run.

        Files of an earlier sweep stay until they are replaced. Raises FileExistsError for them unless ``force``;
        OSError.
        """
        for path in self._old_files():
            if not force:
                raise FileExistsError(f"{path} already exists")
        self._worlds.mkdir(parents=True, exist_ok=True)

    def _old_files(self) -> list[Path]:
        left = [*(self.path / name for name in (RUNS, SUMMARY, PICTURE)), *self._worlds.glob("*.yaml")]
        return [path for path in left if path.exists()]

    def append_row(self, sweep: SweepPlan, row: SweepRow) -> None:
        """Append a run to the CSV at once, so that an interrupted sweep keeps it. Raises OSError.

        The first run replaces the files of an earlier sweep.
        """
        if not self._has_rows:
            self._clear()
        with (self.path / RUNS).open("a", encoding="utf-8") as file:
            file.write(runs_csv([row], sweep.variations, heading=not self._has_rows))
        self._has_rows = True

    def _clear(self) -> None:
        for path in self._old_files():
            path.unlink()

    def write(self, sweep: SweepPlan, rows: Sequence[SweepRow], summary: Summary, about: Mapping[str, object]) -> None:
        """Write all files except the picture, replacing those of an earlier sweep. Raises OSError."""
        self._clear()
        for row in summary.worst:
            with suppress(ValueError):  # the row has the error of this world as its reason
                write_world(sweep, row.seed, self.world_file(row.seed))
        save_file(self.path / RUNS, runs_csv(rows, sweep.variations))
        save_file(self.path / SUMMARY, summary_json(summary, about))

    def world_file(self, seed: int) -> Path:
        """Return the path of the world of one of the worst runs."""
        return self._worlds / f"{seed}.yaml"
