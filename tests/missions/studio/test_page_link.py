"""What the studio's page says over its connections, and when."""

import json
import os
from collections.abc import Mapping
from functools import partial
from itertools import count
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from missions.control.run_folders import SESSION_SUBFOLDER
from tests.browser import Browser
from tests.missions.studio.lossy import Lossy, lossy
from tests.missions.studio.page import Page
from tests.missions.studio.running import Client, run_of, simulated_run
from tests.missions.studio.serving import Served, studio
from tests.waiting import wait_until

SPY = """
window.sent = [];
const send = WebSocket.prototype.send;
let count = 0;
WebSocket.prototype.send = function (text) {
  this.number ??= ++count;
  window.sent.push({socket: this.number, ...JSON.parse(text)});
  return send.call(this, text);
};
"""
"""Keeps what the page sends, and over which of its connections."""


def overheard(browser: Browser, served: Served, view: str) -> Page:
    page = Page(browser, served, view=view)
    page.tab.ask("Page.addScriptToEvaluateOnNewDocument", source=SPY)
    page.tab.ask("Page.reload")
    wait_until(lambda: page.tab.evaluate("!!window.sent") and "operator" in page.link)
    return page


def sent(page: Page, *words: str) -> list[dict[str, Any]]:
    """Return the commands of these words that the page has sent, in order."""
    told: list[dict[str, Any]] = page.tab.evaluate("window.sent")
    return [each for each in told if each["do"] in words]


SLOW_ENTRY = """
window.refusals = 0;
const ask = window.fetch;
window.fetch = async (url, options) => {
  if (String(url).includes('token=')) await new Promise((entered) => (window.enter = entered));
  const answer = await ask(url, options);
  if (answer.status === 401) window.refusals += 1;
  return answer;
};
"""
"""Has the page's new cookie come late, and counts what is refused until then."""


def test_renewing_links_keeps_the_own_sign_in_and_stop_connection(browser: Browser) -> None:
    with studio() as served:
        page = overheard(browser, served, "#run")
        page.tab.evaluate(SLOW_ENTRY)
        page.press("Access links")
        page.press("New links")
        page.press("Press again to sign out everyone else")
        wait_until(lambda: page.tab.evaluate("window.refusals > 0"))
        page.tab.evaluate("window.enter()")
        page.wait_for("For operators:", "For viewers, who watch and stop:")
        assert served.operator not in page.tab.text()
        main = sent(page, "revoke")[0]["socket"]

        def own() -> list[int]:
            greetings = [each["socket"] for each in sent(page, "hello")]
            return sorted({each for each in greetings if each > main and greetings.count(each) > 1})

        wait_until(lambda: len(own()) == 2)  # they were let in: only then they say hello again and again
        page.stop.click()
        page.wait_for("nothing to stop")
        assert [each["socket"] for each in sent(page, "stop")][:3] == [*own(), main]  # again, if it was slow
        page.tab.ask("Page.reload")
        wait_until(lambda: page.tab.evaluate("!window.refusals") and "operator" in page.link)


def tells_of(stop: int, told: Mapping[str, Any]) -> bool:
    return told["say"] == "run" and int(told["stops"]) >= stop


def has_opened(network: Lossy, number: int) -> bool:
    return network.sockets == number


@pytest.mark.real_time
def test_stop_arrives_over_any_one_of_its_three_connections(browser: Browser, served: Served, tmp_path: Path) -> None:
    """How long it takes then, ``tests.benchmarks.pressing`` measures."""
    passes: list[int] = []  # the one connection that loses nothing, once there is one
    turns = count(1)

    def loses(number: int, up: bool) -> bool:
        return up and bool(passes) and number not in passes and next(turns) % LOST != 0

    with simulated_run(tmp_path) as process, lossy(served.port, 0.01, loses) as network:
        through = SimpleNamespace(host=f"127.0.0.1:{network.port}", operator=served.operator)
        client = Client(str(process.process.pid))
        for stop in (1, 2, 3):
            passes.clear()
            before = network.sockets
            page = Page(browser, cast("Served", through), view="#live")
            page.wait_for("waiting", "mission")
            wait_until(partial(has_opened, network, before + 3))
            passes.append(before + stop)  # the page's own two, then that of all else
            page.tab.evaluate("document.querySelector('.stop').dispatchEvent(new PointerEvent('pointerdown'))")
            client.hear(partial(tells_of, stop))
            assert client.ask("release", stop=stop)["ok"]
        client.link.close()


LOST = 20
"""How often a segment is lost: each time twice as long, so it does not come while anybody waits."""


def test_stop_has_its_own_connection(browser: Browser, served: Served) -> None:
    page = overheard(browser, served, "#run")
    wait_until(lambda: sent(page, "library"))
    page.stop.click()
    page.wait_for("nothing to stop")
    over = sent(page, "stop")[0]["socket"]
    told: list[dict[str, Any]] = page.tab.evaluate("window.sent")
    assert {each["do"] for each in told if each["socket"] == over} == {"hello", "stop"}
    assert over != sent(page, "library")[0]["socket"]


ROUND_TRIPS = """
(async () => {
  const {Link} = await import(new URL('link.js', document.querySelector('script[type=module]').src));
  const kept = [WebSocket, setInterval, performance.now];
  let now = 0, look, socket;
  window.WebSocket = class {
    static OPEN = 1;
    readyState = 1;
    hellos = [];
    constructor() { socket = this; }
    send(text) { this.hellos.push(JSON.parse(text)); }
  };
  window.setInterval = (call) => (look = call);
  performance.now = () => now;
  try {
    const link = new Link('2');
    const hear = (message) => socket.onmessage({data: JSON.stringify(message)});
    const answer = (how) => {
      const {id} = socket.hellos.shift();
      hear(how === 'welcome' ? {say: 'welcome', page: 'other'}
        : {say: 'answer', ok: false, error: 'too_many', message: 'more than 100 commands a second', ...(id && {id})});
    };
    socket.onopen();
    const trips = [];
    for (const [how, delay] of %s) {
      if (trips.length) now += 1000, look();
      now += delay;
      if (how === 'another') hear({say: 'answer', ok: false, error: 'too_many', message: ''});
      answer(how === 'refused' ? how : 'welcome');
      trips.push(link.roundTrip);
    }
    now += 1000, look(), now += 700;
    return [...trips, link.roundTrip];
  } finally {
    [window.WebSocket, window.setInterval, performance.now] = kept;
  }
})()
"""
"""The round trips of a link whose hellos are answered in some ways after some milliseconds, then not within 700 ms."""


@pytest.mark.parametrize(
    "answers",
    [
        [("welcome", 10), ("welcome", 20)],
        [("welcome", 10), ("refused", 20), ("welcome", 30)],
        [("welcome", 10), *[("refused", 20)] * 5, ("welcome", 900), ("welcome", 40)],
        [("welcome", 10), ("another", 20), ("welcome", 30)],  # of a drive command, which has no number
    ],
)
def test_round_trip_is_known_after_refused_hellos(
    browser: Browser, served: Served, answers: list[tuple[str, int]]
) -> None:
    page = Page(browser, served, view="#run")
    assert page.tab.evaluate(ROUND_TRIPS % json.dumps(answers)) == [*(delay for _, delay in answers), 700]


def test_stop_stays_red_under_the_mouse(browser: Browser, served: Served) -> None:
    page = Page(browser, served, view="#run")
    colour = "getComputedStyle(document.querySelector('.stop')).backgroundColor"
    red = page.tab.evaluate(colour)
    x, y = page.tab.evaluate(
        "(() => { const b = document.querySelector('.stop').getBoundingClientRect();"
        "return [b.left + b.width / 2, b.top + b.height / 2] })()"
    )
    page.tab.ask("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
    wait_until(lambda: page.tab.evaluate("!!document.querySelector('.stop:hover')"))
    assert page.tab.evaluate(colour) == red


def test_uncertain_stop_is_shown_in_red(browser: Browser, served: Served) -> None:
    runs = Path(served.runtime) / "system/run/user" / str(os.geteuid()) / SESSION_SUBFOLDER
    runs.parent.mkdir(parents=True)
    page = Page(browser, served, view="#run")
    runs.symlink_to(runs)  # a folder that nobody can read
    try:
        page.wait_for("STOP may not reach every run", "Too many levels of symbolic links")
        page.stop.click()
        page.wait_for(
            "PERHAPS NOT STOPPED", "Too many levels of symbolic links", "Press the emergency stop on the robot"
        )
        colour = "getComputedStyle(document.querySelector('.latched')).backgroundColor"
        assert page.tab.evaluate(colour) == "rgb(196, 18, 26)"
    finally:
        runs.unlink()
    page.stop.click()
    page.wait_for("nothing to stop")
    assert "PERHAPS" not in page.tab.text()


def test_camera_pictures_are_requested_only_while_the_page_is_visible(
    browser: Browser, served: Served, tmp_path: Path
) -> None:
    with simulated_run(tmp_path):
        page = overheard(browser, served, "#live")

        def pictures() -> float:
            watches = sent(page, "watch")
            return float(watches[-1].get("pictures", 0)) if watches else -1.0

        wait_until(lambda: pictures() > 0)
        hidden = "Object.defineProperty(document, 'hidden', {value: %s, configurable: true});"
        told = "document.dispatchEvent(new Event('visibilitychange'))"
        page.tab.evaluate(hidden % "true" + told)
        wait_until(lambda: pictures() == 0)
        page.tab.evaluate(hidden % "false" + told)
        wait_until(lambda: pictures() > 0)
        page.go("Tasks")
        wait_until(lambda: pictures() == 0)


def test_control_is_handed_over_on_request(browser: Browser, served: Served, tmp_path: Path) -> None:
    with run_of(tmp_path) as (process, _), served.client(served.operator) as other:
        run = str(process.process.pid)
        page = Page(browser, served, view="#drive")
        page.press("Take control")
        page.wait_for("You drive.")
        other.ask("watch", run=run, state=False)
        assert not other.ask("take", run=run)["result"]["yours"]
        page.wait_for(f"{other.welcome['name']} asks for control.")
        page.press("Hand over")
        page.wait_for(f"{other.welcome['name']} drives.")
        page.press("Ask")
        page.wait_for(f"You have asked {other.welcome['name']} for control.")
        other.send(do="give", run=run)
        page.wait_for("You drive.")
