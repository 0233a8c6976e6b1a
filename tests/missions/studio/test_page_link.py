"""What the studio's page says over its connections, and when."""

from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import pytest

from drivers.clock import SystemClock
from tests.browser import Browser
from tests.missions.studio.lossy import AGAIN, lossy
from tests.missions.studio.page import Page
from tests.missions.studio.running import Client, run_of
from tests.missions.studio.serving import Served, studio
from tests.waiting import wait_until

pytestmark = pytest.mark.real_time

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


@pytest.fixture(scope="module")
def served() -> Iterator[Served]:
    with studio() as found:
        yield found


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


def test_who_makes_new_links_stays_in_and_sees_them(browser: Browser) -> None:
    with studio() as served:
        page = Page(browser, served, view="#run")
        page.press("Who may")
        page.press("New links")
        page.press("Shut all others out?")
        page.wait_for("For operators:", "To look and stop only:")
        assert served.operator not in page.tab.text()
        page.tab.ask("Page.reload")
        wait_until(lambda: "operator" in page.link)


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


def test_stop_has_its_connection_again_after_new_links_that_came_late(browser: Browser) -> None:
    with studio() as served:
        page = overheard(browser, served, "#run")
        page.tab.evaluate(SLOW_ENTRY)
        page.press("Who may")
        page.press("New links")
        page.press("Shut all others out?")
        wait_until(lambda: page.tab.evaluate("window.refusals > 0"))
        page.tab.evaluate("window.enter()")
        page.wait_for("For operators:")
        main = sent(page, "revoke")[0]["socket"]

        def own() -> list[int]:
            greetings = [each["socket"] for each in sent(page, "hello")]
            return sorted({each for each in greetings if each > main and greetings.count(each) > 1})

        wait_until(lambda: len(own()) == 2)  # they were let in: only then they say hello again and again
        page.stop.click()
        page.wait_for("there was nothing to stop")
        assert [each["socket"] for each in sent(page, "stop")] == [*own(), main]


def tells_of(stop: int, told: Mapping[str, Any]) -> bool:
    return told["say"] == "run" and int(told["stops"]) >= stop


@pytest.mark.parametrize("lost", [(1, 3), (2, 3), (1, 2)], ids=["1 and main", "2 and main", "its own two"])
def test_stop_takes_no_longer_where_two_connections_lose_it(
    browser: Browser, tmp_path: Path, lost: tuple[int, int]
) -> None:
    losing: list[int] = []  # the connections whose next segment upwards is lost

    def loses(number: int, up: bool) -> bool:
        if up and number in losing:
            losing.remove(number)
            return True
        return False

    with run_of(tmp_path) as (process, _), studio() as served, lossy(served.port, DELAY, loses) as network:
        served.port = network.port
        page = Page(browser, served, view="#live")
        page.wait_for("waiting", "mission")
        client, clock = Client(str(process.process.pid)), SystemClock()
        took: dict[tuple[int, ...], list[float]] = {lost: [], (): []}
        for stop, lose in enumerate([*took] * 5):  # by turns: both on an equally busy machine
            wait_until(lambda: network.upwards == 0)  # no copy of the press before comes with this one
            losing[:] = lose
            began = clock.now()
            page.tab.evaluate("document.querySelector('.stop').dispatchEvent(new PointerEvent('pointerdown'))")
            client.hear(partial(tells_of, stop + 1))
            took[lose].append(clock.now() - began)
        assert client.ask("release", stop=10)["ok"]  # one for each press
        client.link.close()
    assert median(took[lost]) < median(took[()]) + AGAIN * DELAY / 2, took


DELAY = 0.1
"""Seconds from the page to the studio, and as long back."""


def test_stop_has_a_connection_of_its_own_on_which_nothing_else_waits(browser: Browser, served: Served) -> None:
    page = overheard(browser, served, "#run")
    wait_until(lambda: sent(page, "library"))
    page.stop.click()
    page.wait_for("there was nothing to stop")
    over = sent(page, "stop")[0]["socket"]
    told: list[dict[str, Any]] = page.tab.evaluate("window.sent")
    assert {each["do"] for each in told if each["socket"] == over} == {"hello", "stop"}
    assert over != sent(page, "library")[0]["socket"]


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


def test_the_camera_is_asked_for_only_while_somebody_looks(browser: Browser, served: Served, tmp_path: Path) -> None:
    with run_of(tmp_path):
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


def test_who_drives_is_asked_for_the_wheels_and_hands_them_over(
    browser: Browser, served: Served, tmp_path: Path
) -> None:
    with run_of(tmp_path) as (process, _), served.client(served.operator) as other:
        run = str(process.process.pid)
        page = Page(browser, served, view="#drive")
        page.press("Take the wheels")
        page.wait_for("You drive.")
        other.ask("watch", run=run, state=False)
        assert not other.ask("take", run=run)["result"]["yours"]
        page.wait_for(f"{other.welcome['name']} asks for the wheels.")
        page.press("Hand over")
        page.wait_for(f"{other.welcome['name']} drives.")
        page.press("Ask")
        page.wait_for(f"You have asked {other.welcome['name']} for the wheels.")
        other.send(do="give", run=run)
        page.wait_for("You drive.")
