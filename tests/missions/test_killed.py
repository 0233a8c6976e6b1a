"""Whatever becomes of the program that drives it, a base comes to rest: here it is killed, and can do nothing about it.

The base lives in a process of its own, behind its pseudo-terminal, and times itself. What brings it to rest is the
silence: its firmware waits for 0.4 s (which we assume) and brakes.
"""

import random
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from subprocess import DEVNULL
from threading import Event

import pytest

from tests.forked import Forked
from tests.missions.lone_base import LoneBase, lone_base
from tests.tries import tries
from tests.waiting import wait_until

pytestmark = pytest.mark.real_time

MOTIONS = {
    "straight": "drive: {distance: 100 m, speed: 0.5 m/s}",
    "wide": "arc: {radius: 1 m, angle: 9000 deg, speed: 0.5 m/s}",
    "narrow": "arc: {radius: 20 cm, angle: -9000 deg, speed: 0.5 m/s}",
    "spin": "turn: {angle: 9000 deg, speed: 110 deg/s}",
}
"""What four robots do at once, as fast as each may, without ever coming to rest in between."""

ROUNDS = tries(20) // len(MOTIONS)
"""How often each of them is killed: 20 times in all, unless more is asked for."""

WITHIN = 0.7
"""Seconds from the last that a base hears to its rest."""


def test_a_process_killed_at_any_moment_of_driving_leaves_a_base_that_comes_to_rest(
    tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    for name, step in MOTIONS.items():
        (tmp_path / f"{name}.yaml").write_text(f"mission: {name}\ntree:\n  {step}\n", encoding="utf-8")
    chance, pause = random.Random(7), Event()  # noqa: S311 - chance, not a secret
    took: list[float] = []
    with ExitStack() as lives:
        bases = {name: lives.enter_context(lone_base()) for name in MOTIONS}
        for _ in range(ROUNDS):
            running = {name: run(tmp_path / f"{name}.yaml", base) for name, base in bases.items()}
            for base in bases.values():
                wait_until(partial(moving, base))
            for process in running.values():
                pause.wait(chance.uniform(0.0, 0.4))
                process.kill()
            took += [time_to_rest(base) for base in bases.values()]
    assert len(took) == ROUNDS * len(MOTIONS)
    record_property("figure", f"{len(took)} kills, at rest after {max(took):.2f} s at most")
    assert max(took) <= WITHIN


def run(mission: Path, base: LoneBase) -> Forked:
    robot = ("--robot", "turtlebot2", "--port", f"base={base.port}")
    return Forked("missions", "run", str(mission), *robot, stdin=DEVNULL, stdout=DEVNULL)


def moving(base: LoneBase) -> bool:
    return base.seen().moving


def time_to_rest(base: LoneBase) -> float:
    """Return the seconds from the last that a base heard to its rest, which follows by itself."""
    wait_until(lambda: not moving(base))
    seen = base.seen()
    assert seen.rest_at > seen.heard_at, "it was told to stop: nobody was killed while it drove"
    return seen.rest_at - seen.heard_at
