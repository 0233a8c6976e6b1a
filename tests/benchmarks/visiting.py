"""What the studio's page costs who visits it: bytes, time to the first view, and how long it keeps a slow processor.

    python -m tests.benchmarks.visiting [--slower 4] [--seconds 20] [--json]

Chromium opens each view afresh, without a cache, with its processor throttled so many times, and looks at it for so
long; the run that goes on is that of ``tests.benchmarks.watching``, 60 nodes at 20 Hz with its camera. A long task is
one of 50 ms or more, as the browser itself counts them (PerformanceObserver, ``longtask``).
"""

import argparse
import json
import time

from tests.benchmarks.watching import busy, shown
from tests.browser import Browser, Tab, chromium
from tests.missions.studio.page import VIEWS
from tests.waiting import wait_until

COUNTED = """
window.long = [];
new PerformanceObserver((list) => { for (const each of list.getEntries()) window.long.push(each.duration); })
  .observe({ type: 'longtask', buffered: true });
"""
"""Has the page keep how long (ms) each of its long tasks took, from its beginning on."""

BYTES = "performance.getEntries().reduce((sum, each) => sum + (each.transferSize ?? 0), 0)"

SEEN = "performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? 0"


def visit(tab: Tab, address: str, seconds: float) -> dict[str, object]:
    """Open a view afresh, look at it for so long, and return what that cost."""
    tab.ask("Page.navigate", url="about:blank")
    tab.ask("Page.navigate", url=address)
    wait_until(lambda: "operator" in str(tab.evaluate("document.getElementById('link')?.textContent ?? ''")))
    time.sleep(seconds)
    long = sorted(map(float, tab.evaluate("window.long")))
    return {
        "kB": tab.evaluate(BYTES) / 1000,
        "first view, ms": float(tab.evaluate(SEEN)),
        "long tasks": len(long),
        "longest, ms": long[-1] if long else 0.0,
    }


def measure(asks: argparse.Namespace) -> dict[str, object]:
    """Visit each view, and return the figures."""
    with busy(camera=True) as its, Browser(chromium()) as browser:
        tab = browser.open(f"http://{its.host}/?token={its.token}")
        tab.ask("Network.setCacheDisabled", cacheDisabled=True)
        tab.ask("Page.addScriptToEvaluateOnNewDocument", source=COUNTED)
        tab.ask("Emulation.setCPUThrottlingRate", rate=asks.slower)
        return {
            view: visit(tab, f"http://{its.host}/#{view.lower()}", asks.seconds if view == "Live" else 5.0)
            for view in VIEWS
        }


def main() -> None:
    """Measure, and print."""
    words = argparse.ArgumentParser()
    words.add_argument("--slower", type=float, default=4.0)
    words.add_argument("--seconds", type=float, default=20.0)
    words.add_argument("--json", action="store_true")
    asks = words.parse_args()
    found = measure(asks)
    print(json.dumps(found, indent=2) if asks.json else shown(found))


if __name__ == "__main__":
    main()
