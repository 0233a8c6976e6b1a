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

from missions.records.recording.faults import InvalidRecordError
from missions.records.recording.read import open_record
from missions.studio.holders import holder_of
from missions.studio.sockets import connect, path_of, socket_folder
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

AT_ONCE = 4
"""Runs that are started at once, and killed one after the other."""

LATEST = 4.0
"""Seconds after their start by which the first of them is killed: some have not opened their base, some drive."""

MARK = "MISSION_KILLED"
"""What the environment of a run has, and of all that it starts."""


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


def test_a_process_killed_at_any_moment_since_its_start_leaves_nothing_behind_but_its_record(
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


def readable(record: Path, *, moved: bool) -> bool:
    """Read a record as far as it goes; one of a run that has moved something must be there."""
    try:
        list(open_record(record).moments)
    except (FileNotFoundError, InvalidRecordError):
        assert not moved
        return False
    return True


def nobody_left(mark: str) -> bool:
    return not marked(mark)


def marked(mark: str) -> dict[int, str]:
    """Return what all processes do that were started by the run of this mark, but for those that have ended."""
    found = {}
    for folder in Path("/proc").iterdir():
        with suppress(OSError):
            if folder.name.isdecimal() and f"{MARK}={mark}\0".encode() in (folder / "environ").read_bytes() + b"\0":
                found[int(folder.name)] = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode()
    return found


def writer_of(mark: str, record: Path) -> int | None:
    """Return the process that writes a record, once there is one."""
    files = {number: files_of(number) for number in marked(mark)}
    return next((number for number, names in files.items() if str(record) in names), None)


def files_of(process: int) -> set[str]:
    """Return the files that a process has open."""
    found = set[str]()
    with suppress(OSError):
        for link in Path(f"/proc/{process}/fd").iterdir():
            with suppress(OSError):
                found.add(str(link.readlink()))
    return found


def left_of(process: Forked) -> list[str]:
    """Return what is left of a run in the folder of all runs, once somebody has looked for it."""
    name = str(process.pid)
    assert holder_of(process.pid) is None
    with suppress(OSError), connect(path_of(name)):
        return [f"somebody answers for {name}"]
    return [path.name for path in socket_folder().glob(f"{name}.*")]


def run(mission: Path, base: LoneBase, *words: str) -> Forked:
    robot = ("--robot", "turtlebot2", "--port", f"base={base.port}")
    return Forked("missions", "run", str(mission), *robot, *words, stdin=DEVNULL, stdout=DEVNULL)


def moving(base: LoneBase) -> bool:
    return base.seen().moving


def time_to_rest(base: LoneBase) -> float:
    """Return the seconds from the last that a base heard to its rest, which follows by itself."""
    wait_until(lambda: not moving(base))
    seen = base.seen()
    assert seen.rest_at > seen.heard_at, "it was told to stop: nobody was killed while it drove"
    return seen.rest_at - seen.heard_at
