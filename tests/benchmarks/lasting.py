"""What memory a studio holds while it is watched for long: a run in simulated time, quicker than the clock.

    python -m tests.benchmarks.lasting [--hours 1] [--speed 10] [--clients 8] [--json]

The mission is that of ``tests.benchmarks.watching``, on twins, with its camera; so many clients watch it with pictures,
and one reads nothing. The server's own clock is the machine's: an hour of the run is ``--speed`` times shorter for it.
Told is its memory at each twelfth of the time, and by how much it grew over the second half.
"""

import argparse
import asyncio
import json
import os
import sys
import time
from contextlib import AsyncExitStack, suppress
from itertools import count
from pathlib import Path
from subprocess import DEVNULL, PIPE, Popen
from tempfile import TemporaryDirectory

from missions.control import sockets
from missions.control.run_folders import SYSTEM_ROOT
from tests.benchmarks.watching import Measured, asked, mission, opened, page, shown, used
from tests.waiting import wait_until

LOOKS = 12
"""So often its memory is looked at, after the beginning."""


async def watched(host: str, token: str, run: str, studio: int, asks: argparse.Namespace) -> list[float]:
    """Watch for so long; return the memory of the studio (MB), over time."""
    seconds = 3600.0 * asks.hours / asks.speed
    until, held, found = time.monotonic() + seconds, list[float](), Measured()
    async with AsyncExitStack() as ends, asyncio.TaskGroup() as group:
        deaf = await ends.enter_async_context(opened(host, token))
        for number in count(1):  # the studio finds the run a little after its socket is there
            with suppress(RuntimeError):
                await asked(deaf, number, do="watch", run=run, pictures=10.0)
                break
            await asyncio.sleep(0.2)
        for _ in range(asks.clients):
            group.create_task(page(host, token, run, 0.0, until, 10.0, found))
        await asyncio.sleep(seconds / (4 * LOOKS))  # until all are there
        for _ in range(LOOKS):
            held.append(used(studio)[1])
            await asyncio.sleep((until - time.monotonic()) / (LOOKS + 1 - len(held)))
            if not found.ways:
                raise RuntimeError("nobody was told anything")
            found.ways.clear()
        held.append(used(studio)[1])
    return held


def measure(asks: argparse.Namespace) -> dict[str, object]:
    """Run, watch, and return the figures."""
    with TemporaryDirectory() as folder:
        os.environ["XDG_RUNTIME_DIR"] = os.environ["XDG_STATE_HOME"] = os.environ[SYSTEM_ROOT] = folder
        file = Path(folder) / "busy.yaml"
        file.write_text(mission(camera=True), encoding="utf-8")
        words = ["run", str(file), "--simulate", "fast", "--eyes", "truth", "--world", "living_room"]
        words += ["--speed", str(asks.speed), "--no-record"]
        run = Popen([sys.executable, "-m", "missions", *words], stdout=DEVNULL)
        studio = Popen([sys.executable, "-m", "missions", "studio", "--port=0"], stdout=PIPE, text=True)
        try:
            if studio.stdout is None:
                raise RuntimeError("a process without pipes")
            host, _, token = studio.stdout.readline().split()[1].partition("/?token=")
            wait_until(lambda: sockets.socket_path(str(run.pid)).exists())
            held = asyncio.run(watched(host.removeprefix("http://"), token, str(run.pid), studio.pid, asks))
        finally:
            for process in (run, studio):
                process.terminate()
                process.wait()
                if process.stdout is not None:
                    process.stdout.close()
    return {
        "studio, MB, over time": tuple(held),
        "grown over the second half, MB": held[-1] - held[len(held) // 2],
    }


def main() -> None:
    """Measure, and print."""
    words = argparse.ArgumentParser()
    words.add_argument("--hours", type=float, default=1.0)
    words.add_argument("--speed", type=float, default=10.0)
    words.add_argument("--clients", type=int, default=8)
    words.add_argument("--json", action="store_true")
    asks = words.parse_args()
    found = measure(asks)
    print(json.dumps(found, indent=2) if asks.json else shown(found))


if __name__ == "__main__":
    main()
