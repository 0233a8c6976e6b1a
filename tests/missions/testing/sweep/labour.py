"""What workers do in these tests, and a small sweep for them. In a module of its own, so that they can import it."""

import os
from collections.abc import Sequence
from pathlib import Path

from missions.plugins.testing.sweep.sweep import SweepPlan
from missions.plugins.testing.sweep.variation import SweepRow, ValueList, ValueRange, Variation

GLANCE = """\
mission: glance
params:
  patience: 3 s
  greeting: {type: text, default: Hello}
  rounds: {type: count, default: 1, low: 1, high: 5}
tree:
  sequence:
    - find_face: {pan: [-60 deg, 60 deg]}
      timeout: ${patience}
    - say: ${greeting}
"""
"""A mission that is over in a moment."""

PERSON = {"name": "Anna", "at": ["1.7 m", "0 m"]}

VARIED = (
    Variation("person.bearing", "deg", ValueRange(-90.0, 90.0)),
    Variation("light", "%", ValueList((100.0, 5.0))),
    Variation("param.patience", "s", ValueList((2.0, 3.0))),
)


def glance(folder: Path, variations: tuple[Variation, ...] = VARIED) -> SweepPlan:
    """A sweep of that mission, written into ``folder``."""
    mission = folder / "glance.yaml"
    mission.write_text(GLANCE, encoding="utf-8")
    return SweepPlan(str(mission), {"world": "hall", "people": [PERSON]}, "hall.yaml", variations=variations)


def at_once(sweep: SweepPlan, seeds: Sequence[int]) -> list[SweepRow]:
    """Make rows without running anything."""
    return [SweepRow(seed, sweep.draw(seed), "success", "", float(seed), 1) for seed in seeds]


def deadly(sweep: SweepPlan, seeds: Sequence[int]) -> list[SweepRow]:
    """The same, but seed 5 kills whoever runs it."""
    if 5 in seeds:
        os._exit(3)
    return at_once(sweep, seeds)


def deadly_once(sweep: SweepPlan, seeds: Sequence[int]) -> list[SweepRow]:
    """The same, but the first worker that runs seed 5 dies, as one that was killed for want of memory."""
    died = Path(sweep.file)
    if 5 in seeds and not died.exists():
        died.touch()
        os._exit(3)
    return at_once(sweep, seeds)
