"""What it costs to be watched: a run of 60 nodes at 20 Hz with its camera, alone and with clients of the studio.

    python -m tests.benchmarks.watching [--clients 8] [--seconds 30] [--no-camera] [--json]

Each client has two connections, as a page has: one that watches states and pictures (10 a second), and one for nothing
but STOP. One more reads nothing. The robot is in a process of its own, on virtual devices with a camera. Told are: the
tick alone and watched; from a state in the run to a client; from a client's stop to the latch of each driver; what
processor time run and studio took; and how much memory the studio holds at the beginning and in the end.
"""

import argparse
import asyncio
import json
import os
import statistics
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AsyncExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from subprocess import DEVNULL, PIPE, Popen
from tempfile import TemporaryDirectory
from typing import Any

from websockets.asyncio.client import ClientConnection, connect

from missions.control.run_folders import SYSTEM_ROOT
from tests.benchmarks.robot_beside import robot_beside

BRANCHES = 13
"""Each has four nodes; with those above them, and what tracks a face, the tree has 60."""

STOPS_EVERY = 0.4
"""Seconds from one stop to the next."""


def mission(*, camera: bool) -> str:
    """Return a mission in which much changes at each tick, for ever."""
    branch = (
        "    - sequence:\n        - wait: {} ms\n        - wait: {} ms\n        - wait: 100 ms\n      repeat: forever\n"
    )
    branches = "".join(branch.format(50 + 10 * (each % 5), 60 + 20 * (each % 3)) for each in range(BRANCHES))
    on = "      on_failure: succeed\n      repeat: forever\n"
    moves = "track_face:" if camera else "drive: {distance: 1 m, speed: 0.05 m/s}"
    return f"mission: busy\ntree:\n  parallel:\n    - gesture: hello\n{on}    - {moves}\n{on}{branches}"


@dataclass
class Measured:
    """Seconds from a state, or a stop, to where it was to come."""

    ways: list[float] = field(default_factory=list)
    pictures: int = 0
    stops: list[float] = field(default_factory=list)
    answers: list[float] = field(default_factory=list)
    late: list[float] = field(default_factory=list)


def share(values: Sequence[float], part: float) -> float:
    """Return the value below which a part of all is, in ms."""
    ordered = sorted(values)
    return 1000 * ordered[min(len(ordered) - 1, int(part * len(ordered)))] if ordered else float("nan")


def sleep_on(until: float, found: Measured) -> None:
    """Note how late this machine wakes who sleeps: no other figure is better than that."""
    while time.monotonic() < until:
        due = time.monotonic() + 0.005
        time.sleep(0.005)
        found.late.append(time.monotonic() - due)


async def page(host: str, token: str, run: str, zero: float, until: float, pictures: float, found: Measured) -> None:
    """Be one page until then: read all, and say of each picture that it was seen."""
    async with opened(host, token) as socket:
        await say(socket, do="watch", run=run, pictures=pictures)
        while time.monotonic() < until:
            told = json.loads(await socket.recv())
            if told["say"] == "state":
                found.ways.append(time.monotonic() - zero - told["t"])
            elif told["say"] == "picture":
                found.pictures += 1
                await say(socket, do="seen", run=run, t=told["t"])


async def stopper(host: str, token: str, run: str, until: float, found: Measured) -> None:
    """Stop now and then, and go on; in the second half of the time, as stops make ticks of their own."""
    await asyncio.sleep((until - time.monotonic()) / 2)
    async with opened(host, token) as own, opened(host, token) as main:
        number = 0
        while time.monotonic() < until:
            await asyncio.sleep(STOPS_EVERY)
            found.stops.append(time.monotonic())
            number += 1
            answer = await asked(own, number, do="stop", run=run)
            found.answers.append(time.monotonic() - found.stops[-1])
            await asked(main, 3 * number, do="release", run=run, stop=answer["result"]["stopped"][run]["stops"])
            await asked(main, 3 * number + 1, do="resume", run=run)


def opened(host: str, token: str) -> connect:
    """Return a connection that is to be opened."""
    return connect(
        f"ws://{host}/ws", additional_headers={"Authorization": f"Bearer {token}"}, max_size=None, compression=None
    )


async def say(socket: ClientConnection, **command: object) -> None:
    """Send a command; the first one of a connection is hello."""
    if not getattr(socket, "greeted", False):
        socket.greeted = True  # type: ignore[attr-defined]
        await socket.send('{"do": "hello", "version": "2"}')
    await socket.send(json.dumps(command))


async def asked(socket: ClientConnection, number: int, **command: object) -> Any:
    """Send a command, and return its answer."""
    await say(socket, id=number, **command)
    while True:
        told = json.loads(await socket.recv())
        if told["say"] == "answer" and told.get("id") == number:
            if not told["ok"]:
                raise RuntimeError(str(told))
            return told


def notes_of(path: Path) -> list[dict[str, Any]]:
    """Return what a run has noted so far."""
    return [
        json.loads(line) for line in path.read_text(encoding="utf-8").splitlines(keepends=True) if line.endswith("\n")
    ]


def used(process: int) -> tuple[float, float]:
    """Return the processor time in seconds that a process has taken, and its memory in MB."""
    fields = Path(f"/proc/{process}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    pages = int(Path(f"/proc/{process}/statm").read_text(encoding="ascii").split()[1])
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK"), pages * os.sysconf("SC_PAGE_SIZE") / 1e6


@dataclass
class Busy:
    """A run with much to do, which notes what it does in a file, and a studio beside it, with its operator's token."""

    run: Popen[bytes]
    studio: Popen[str]
    notes: Path
    host: str
    token: str

    @property
    def zero(self) -> float:
        """When the run's own time began, by the machine's clock."""
        return float(notes_of(self.notes)[0]["zero"])


@contextmanager
def busy(*, camera: bool) -> Iterator[Busy]:
    """Have them until the end of the block, from when the run is under way."""
    with TemporaryDirectory() as folder, robot_beside("living_room") as beside:
        file, notes = Path(folder) / "busy.yaml", Path(folder) / "notes"
        file.write_text(mission(camera=camera), encoding="utf-8")
        words = [*beside.options, str(file)]
        os.environ["XDG_RUNTIME_DIR"] = os.environ["XDG_STATE_HOME"] = os.environ[SYSTEM_ROOT] = folder
        run = Popen([sys.executable, "-m", "tests.benchmarks.watched_run", str(notes), *words], stdout=DEVNULL)
        studio = Popen([sys.executable, "-m", "missions", "studio", "--port=0"], stdout=PIPE, text=True)
        try:
            if studio.stdout is None:
                raise RuntimeError("a process without pipes")
            host, _, token = studio.stdout.readline().split()[1].partition("/?token=")
            while not notes.exists() or sum("tick" in each for each in notes_of(notes)) < 60:
                if run.poll() is not None:
                    raise RuntimeError("the run has ended")
                time.sleep(0.2)
            yield Busy(run, studio, notes, host.removeprefix("http://"), token)
        finally:
            for process in (run, studio):
                process.terminate()
                process.wait()
                if process.stdout is not None:
                    process.stdout.close()


async def watched(its: Busy, asks: argparse.Namespace, *, stops: bool = True) -> Measured:
    """Watch a run as so many pages, one of which may stop it now and then, and one that reads nothing."""
    found, until = Measured(), time.monotonic() + asks.seconds
    pictures, at, run, zero = 0.0 if asks.no_camera else 10.0, (its.host, its.token), str(its.run.pid), its.zero
    async with AsyncExitStack() as ends, asyncio.TaskGroup() as group:
        deaf = await ends.enter_async_context(opened(*at))
        await say(deaf, do="watch", run=run, pictures=pictures)
        for _ in range(asks.clients):
            group.create_task(page(*at, run, zero, until, pictures, found))
            await say(await ends.enter_async_context(opened(*at)), do="hello", version="2")
        if stops:
            group.create_task(asyncio.to_thread(sleep_on, until, found))
            group.create_task(stopper(*at, run, until, found))
    return found


def measure(asks: argparse.Namespace) -> dict[str, object]:
    """Run, look on for so long alone, then watch for as long."""
    with busy(camera=not asks.no_camera) as its:
        begin, start = time.monotonic(), (used(its.run.pid), used(its.studio.pid))
        time.sleep(asks.seconds)
        middle, before = time.monotonic(), (used(its.run.pid), used(its.studio.pid))
        found = asyncio.run(watched(its, asks))
        after, end = (used(its.run.pid), used(its.studio.pid)), time.monotonic()
        return told(notes_of(its.notes), found, (begin, middle, end), (start, before, after))


def told(
    notes: list[dict[str, Any]], found: Measured, times: tuple[float, float, float], used: Sequence[Any]
) -> dict[str, object]:
    """Return the figures."""
    (begin, middle, end), (start, before, after) = times, used
    ticks = [each["tick"] for each in notes if "tick" in each]
    alone = [tick for tick in ticks if begin <= tick[0] < middle]
    with_them = [tick for tick in ticks if middle <= tick[0] < (middle + end) / 2]
    stops: dict[str, list[float]] = {}
    for number, part, begun, done in (each["latched"] for each in notes if "latched" in each):
        if number <= len(found.stops):
            stops.setdefault(f"{part} told", []).append(begun - found.stops[number - 1])
            stops.setdefault(f"{part} done", []).append(done - found.stops[number - 1])
    seconds = end - middle
    medians = [statistics.median(each[2] for each in some) for some in (with_them, alone)]
    return {
        "a sleeper wakes late by, ms: median, p99": (share(found.late, 0.5), share(found.late, 0.99)),
        "tick alone, ms: median, p99": tuple(share([each[1] for each in alone], at) for at in (0.5, 0.99)),
        "tick watched, ms: median, p99": tuple(share([each[1] for each in with_them], at) for at in (0.5, 0.99)),
        "processor time of the median tick, ms": (1000 * medians[1], 1000 * medians[0]),
        "the same, watched to alone": medians[0] / medians[1],
        "state to client, ms: median, p95, p99": tuple(share(found.ways, part) for part in (0.5, 0.95, 0.99)),
        "states, pictures a second in all": (len(found.ways) / seconds, found.pictures / seconds),
        "stop to driver, ms: median, p99": {
            part: tuple(share(each, at) for at in (0.5, 0.99)) for part, each in stops.items()
        },
        "stop to answer, ms: median, p99": (share(found.answers, 0.5), share(found.answers, 0.99)),
        "stops": len(found.stops),
        "run alone, watched; studio: share of a core": (
            round((before[0][0] - start[0][0]) / (middle - begin), 3),
            *(round((after[at][0] - before[at][0]) / seconds, 3) for at in (0, 1)),
        ),
        "studio, MB: before, after": (before[1][1], after[1][1]),
    }


def main() -> None:
    """Measure, and print."""
    words = argparse.ArgumentParser()
    words.add_argument("--clients", type=int, default=8)
    words.add_argument("--seconds", type=float, default=30.0)
    words.add_argument("--no-camera", action="store_true")
    words.add_argument("--json", action="store_true")
    asks = words.parse_args()
    found = measure(asks)
    print(json.dumps(found, indent=2) if asks.json else shown(found))


def shown(found: Mapping[str, object]) -> str:
    """Return figures as lines."""
    return "\n".join(f"{name:<44} {_short(value)}" for name, value in found.items())


def _short(value: object) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{name} {_short(each)}" for name, each in value.items())
    if isinstance(value, tuple):
        return " / ".join(_short(each) for each in value)
    return f"{value:.3g}" if isinstance(value, float) else str(value)


if __name__ == "__main__":
    main()
