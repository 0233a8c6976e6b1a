"""From a press of STOP in Chromium to the latch of each driver, beside other clients, over a good or a bad network.

    python -m tests.benchmarks.pressing [--presses 200] [--clients 8] [--delay 0.1 --loss 0.05] [--no-camera] [--json]

The run is that of ``tests.benchmarks.watching``, with its camera; so many clients watch it, and one more reads nothing.
With ``--delay`` (seconds, one way) and ``--loss`` (a share of segments) the page, and it alone, is behind
``tests.missions.studio.lossy``. Told are the times from the press in the page to when each part was told to be still,
and by how many the last of the parts was later than the bound.
"""

import argparse
import asyncio
import json
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from functools import partial
from random import Random
from threading import Thread
from typing import Any

from tests.benchmarks.watching import Busy, busy, notes_of, share, shown, watched
from tests.browser import Browser, Tab, chromium
from tests.missions.studio.lossy import lossy
from tests.missions.studio.running import Client
from tests.waiting import wait_until

PRESS = """(() => {
  const now = performance.timeOrigin + performance.now();
  document.querySelector('.stop').dispatchEvent(new PointerEvent('pointerdown'));
  return now;
})()"""

SEED = 18
"""Of what is lost, and of how long the person waits between two presses."""


def stopped_again(stops: int, told: Any) -> bool:
    """Say whether a run has been stopped more often than so."""
    return told["say"] == "run" and int(told["stops"]) > stops


def press(its: Busy, tab: Tab, asks: argparse.Namespace) -> dict[int, float]:
    """Press, release and go on, again and again; return when each press was, by the number of its stop.

    Times are those of ``time.monotonic``. Nobody releases before what the page sends besides has come, too: then it
    would be a new stop.
    """
    began, stops, chance = dict[int, float](), 0, Random(SEED)  # noqa: S311 - no secret
    client = Client(str(its.run.pid))
    with closing(client.link):
        for _ in range(asks.presses):
            apart = time.time() - time.monotonic()
            pressed = tab.evaluate(PRESS) / 1000 - apart
            stops = int(client.hear(partial(stopped_again, stops))["stops"])
            began[stops] = pressed
            time.sleep(0.25 + 9 * asks.delay)
            client.ask("release", stop=stops)
            client.ask("resume")
            time.sleep(chance.uniform(0.05, 0.2))
    return began


@contextmanager
def network(its: Busy, asks: argparse.Namespace) -> Iterator[str]:
    """Give the address at which the page finds the studio."""
    if not (asks.delay or asks.loss):
        yield its.host
        return
    chance = Random(SEED)  # noqa: S311 - no secret
    port = int(its.host.rpartition(":")[2])
    with lossy(port, asks.delay, lambda _number, _up: chance.random() < asks.loss) as between:
        yield f"127.0.0.1:{between.port}"


def measure(asks: argparse.Namespace) -> dict[str, object]:
    """Press so often, and return the figures."""
    with busy(camera=not asks.no_camera) as its, Browser(chromium()) as browser, network(its, asks) as host:
        others = Thread(target=lambda: asyncio.run(watched(its, asks, stops=False)))
        tab = browser.open(f"http://{host}/?token={its.token}#live")
        wait_until(lambda: "sequence" in tab.text() and "operator" in tab.text())
        others.start()
        began = press(its, tab, asks)
        others.join()
        notes = notes_of(its.notes)
    found: dict[str, dict[int, float]] = {}
    for number, part, told, _ in (each["latched"] for each in notes if "latched" in each):
        if number in began:
            found.setdefault(part, {}).setdefault(number, told - began[number])
    took = {part: list(each.values()) for part, each in found.items()}
    last = [max(each[number] for each in found.values()) for number in began]
    bound = 0.2 if asks.delay else 0.05
    return {
        "press to driver, ms: median, p99": {
            part: (share(each, 0.5), share(each, 0.99)) for part, each in took.items()
        },
        "to the last of them, ms: median, p99, worst": (share(last, 0.5), share(last, 0.99), 1000 * max(last)),
        f"later than {1000 * bound:g} ms": f"{sum(each > bound for each in last)} of {len(last)}",
    }


def main() -> None:
    """Measure, and print."""
    words = argparse.ArgumentParser()
    words.add_argument("--presses", type=int, default=200)
    words.add_argument("--clients", type=int, default=8)
    words.add_argument("--delay", type=float, default=0.0)
    words.add_argument("--loss", type=float, default=0.0)
    words.add_argument("--no-camera", action="store_true")
    words.add_argument("--json", action="store_true")
    asks = words.parse_args()
    asks.seconds = (0.5 + 10 * asks.delay) * asks.presses + 5.0
    found = measure(asks)
    print(json.dumps(found, indent=2) if asks.json else shown(found))


if __name__ == "__main__":
    main()
