"""How long arm and head move on after the program that moves them was ended, at 200 moments of chance.

    python -m tests.benchmarks.killing [MOMENTS]

The limbs live in processes of their own: see ``tests.missions.killing``. Exit code 1 where one took too long, or leapt
once its program went on.
"""

import statistics
import sys
import tempfile
from collections.abc import Sequence
from math import degrees
from pathlib import Path

from tests.missions.killing import KINDS, WAYS, WITHIN, Silence, campaign
from tests.missions.lone_limbs import SPEED

MOMENTS = 200

TOGETHER = 2
"""Kinds that are tried at once: the limbs of more starve each other on two cores."""

FASTEST = 1.05 * degrees(SPEED)
"""Degrees a second: a joint that turns faster has leapt."""


def main(moments: int) -> int:
    """Try so many moments, print what became of them by what was moved, and return the exit code."""
    found: list[Silence] = []
    for first in range(0, len(KINDS), TOGETHER):
        kinds = KINDS[first : first + TOGETHER]
        with tempfile.TemporaryDirectory() as folder, campaign(Path(folder), kinds) as trials:
            for number in range(-(-moments // len(KINDS))):
                for silence in trials.round(list(WAYS)[number % len(WAYS)]):
                    found.append(silence)
                    print(silence, file=sys.stderr, flush=True)
    print(f"{'':<12} {'moments':>8} {'moving':>7} {'median':>8} {'longest':>8}   once let go on, fastest and step")
    for kind in (*KINDS, "all"):
        print(_row(kind, [each for each in found if kind in (each.kind, "all")]))
    return int(any(each.took > WITHIN or each.fastest > FASTEST for each in found))


def _row(kind: str, silences: Sequence[Silence]) -> str:
    moving = [each.took for each in silences if each.moving]
    longest = max(each.took for each in silences)
    median = statistics.median(moving or [0.0])
    fastest, step = max(each.fastest for each in silences), max(each.step for each in silences)
    after = f"{fastest:8.0f} deg/s {step:4.0f} deg"
    return f"{kind:<12} {len(silences):>8} {len(moving):>7} {median:>6.3f} s {longest:>6.3f} s   {after}"


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else MOMENTS))
