"""Whatever becomes of the program that drives it, a base comes to rest: here it is killed, and can do nothing about it.

The base lives in a process of its own, behind its pseudo-terminal, and times itself. What brings it to rest is the
silence: its firmware waits for 0.4 s (which we assume) and brakes.
"""

import os
import random
import signal
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from subprocess import DEVNULL
from threading import Event

import pytest

from tests.forked import Forked
from tests.missions.left import MARK, left_of, nobody_left, readable, writer_of
from tests.missions.lone_base import LONE_ROBOT, LoneBase, lone_base
from tests.tries import tries
from tests.waiting import wait_until

pytestmark = [pytest.mark.real_time, pytest.mark.long]

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

AT_ONCE = 4
"""Runs that are started at once, and killed one after the other."""

LATEST = 4.0
"""Seconds after their start by which the first of them is killed: some have not opened their base, some drive."""


def test_base_stops_after_the_driving_process_is_killed(
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


def test_killed_process_leaves_only_its_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, record_property: Callable[[str, object], None]
) -> None:
    mission = tmp_path / "straight.yaml"
    mission.write_text(f"mission: straight\ntree:\n  {MOTIONS['straight']}\n", encoding="utf-8")
    chance, pause = random.Random(8), Event()  # noqa: S311 - chance, not a secret
    took, told = list[float](), Counter[str]()
    with ExitStack() as lives:
        bases = [lives.enter_context(lone_base()) for _ in range(AT_ONCE)]
        for number in range(tries(8) // AT_ONCE):
            mark = f"{tmp_path}-{number}"
            monkeypatch.setenv(MARK, mark)
            records = [tmp_path / f"{number}-{place}.mcap" for place in range(AT_ONCE)]
            before = [base.seen().rest_at for base in bases]
            running = [run(mission, base, "--record", str(record)) for base, record in zip(bases, records, strict=True)]
            pause.wait(chance.uniform(0.0, LATEST))
            for process, record in zip(running, records, strict=True):
                pause.wait(chance.uniform(0.0, 0.4))
                writer = writer_of(mark, record) if chance.random() < 0.5 else None
                process.kill()
                if writer is not None:
                    told["writers"] += 1
                    with suppress(ProcessLookupError):
                        os.kill(writer, signal.SIGKILL)
            wait_until(lambda: not any(map(moving, bases)))
            for base, then, record in zip(bases, before, records, strict=True):
                now = base.seen()
                took += [now.rest_at - now.heard_at] * (now.rest_at > then)
                told["records"] += readable(record, moved=now.rest_at > then)
            wait_until(partial(nobody_left, mark))
            assert [name for process in running if process.wait() for name in left_of(process)] == []
            told["runs"] += len(running)
    figures = f"{told['runs']} runs killed ({len(took)} while they drove), {told['writers']} with who records"
    record_property("figure", f"{figures}; {told['records']} records read, nothing left behind")
    assert max(took, default=0.0) <= WITHIN


def run(mission: Path, base: LoneBase, *words: str) -> Forked:
    robot = ("--robot", LONE_ROBOT, "--port", f"base={base.port}")
    return Forked("missions", "run", str(mission), *robot, *words, stdin=DEVNULL, stdout=DEVNULL)


def moving(base: LoneBase) -> bool:
    return base.seen().moving


def time_to_rest(base: LoneBase) -> float:
    """Return the seconds from the last that a base heard to its rest, which follows by itself."""
    wait_until(lambda: not moving(base))
    seen = base.seen()
    assert seen.rest_at > seen.heard_at, "it was told to stop: nobody was killed while it drove"
    return seen.rest_at - seen.heard_at
