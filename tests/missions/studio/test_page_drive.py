"""Driving and stopping from the page, at a virtual base: whatever is lost, it comes to rest."""

import json
import os
import re
import signal
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from missions.control.pilot import MAX_STATE_AGE
from tests.browser import Browser, chromium
from tests.missions.command import Process
from tests.missions.lone_base import LoneBase
from tests.missions.studio.page import PHONE, VIEWS, Page
from tests.missions.studio.running import DRIVING, REST, run_of, seconds_to_rest, simulated_run
from tests.missions.studio.serving import Served
from tests.missions.views.pictures.drawn import HOSTILE
from tests.waiting import wait_until

STICK = "studio-stick"


@pytest.fixture
def scene(tmp_path: Path) -> Iterator[tuple[Process, LoneBase]]:
    with run_of(tmp_path) as found:
        yield found


def driver(browser: Browser, served: Served) -> Page:
    page = Page(browser, served, view="#drive")
    page.press("Take control")
    page.wait_for("You drive.")
    return page


def moving(base: LoneBase) -> Callable[[], bool]:
    return lambda: base.seen().moving


def hears_after(base: LoneBase, moment: float) -> Callable[[], bool]:
    return lambda: base.seen().heard_at > moment


@pytest.mark.real_time
def test_base_drives_while_stick_or_key_is_held_until_stop(
    browser: Browser, served: Served, scene: tuple[Process, LoneBase]
) -> None:
    page, base = driver(browser, served), scene[1]
    with page.held(STICK, up=60):
        wait_until(moving(base))
    assert seconds_to_rest(base, base.seen().heard_at) < REST
    page.tab.ask("Input.dispatchKeyEvent", type="keyDown", key="w", windowsVirtualKeyCode=87, text="w")
    wait_until(moving(base))
    page.tab.press(" ")
    assert seconds_to_rest(base, base.seen().heard_at) < REST
    page.wait_for("Stopped from this page")
    page.release()
    assert not base.seen().moving  # the key that was held all the while counts no more
    page.tab.ask("Input.dispatchKeyEvent", type="keyUp", key="w", windowsVirtualKeyCode=87)
    assert not base.seen().moving


LOSSES: dict[str, str] = {
    "the focus": "dispatchEvent(new Event('blur'))",
    "the page, which is hidden": "Object.defineProperty(document, 'hidden', {value: true});"
    "document.dispatchEvent(new Event('visibilitychange'))",
    "the pointer": "document.querySelector('studio-stick').dispatchEvent(new PointerEvent('pointercancel',"
    "{pointerId: window.held}))",
    "the page, which goes": "location.href = 'about:blank'",
}


@pytest.mark.real_time
def test_base_rests_when_its_input_is_lost(browser: Browser, served: Served, scene: tuple[Process, LoneBase]) -> None:
    base, rests = scene[1], dict[str, float]()
    for what, script in LOSSES.items():
        page = driver(browser, served)
        page.tab.evaluate("addEventListener('pointerdown', (event) => (window.held = event.pointerId), true)")
        with page.held(STICK, up=60):
            wait_until(moving(base))
            page.tab.evaluate(script)
            rests[what] = seconds_to_rest(base, base.seen().heard_at)
    hold(driver(browser, served))
    wait_until(moving(base))
    browser.close_tab()
    rests["the tab, which is closed"] = seconds_to_rest(base, base.seen().heard_at)
    assert {what: rest for what, rest in rests.items() if rest >= REST} == {}


def hold(page: Page) -> None:
    """Hold the stick for good."""
    x, y = page.middle(STICK)
    page.mouse("mousePressed", x, y)
    page.mouse("mouseMoved", x, y - 60)


def family(process: int) -> list[int]:
    """Return a process and all that it has started."""
    parents = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            parents[int(path.parent.name)] = int(path.read_text(encoding="ascii").rpartition(")")[2].split()[1])
    found = [process]
    for each in found:
        found += [child for child, parent in parents.items() if parent == each]
    return found


@pytest.mark.real_time
def test_base_rests_when_the_browser_is_suspended_or_killed(served: Served, scene: tuple[Process, LoneBase]) -> None:
    base, rests = scene[1], dict[str, float]()
    with Browser(chromium()) as browser:
        for what in ("stopped", "killed"):
            page, processes = driver(browser, served), family(browser._process)
            base.seen(forget=True)
            hold(page)
            wait_until(moving(base))
            for each in processes if what == "stopped" else processes[:1]:
                with suppress(ProcessLookupError):
                    os.kill(each, signal.SIGSTOP if what == "stopped" else signal.SIGKILL)
            since = base.seen().heard_at
            rests[what] = rest = seconds_to_rest(base, since)
            wait_until(hears_after(base, since + rest + MAX_STATE_AGE))
            base.seen(forget=True)
            if what == "stopped":
                for each in processes:
                    with suppress(ProcessLookupError):
                        os.kill(each, signal.SIGCONT)
                page.tab.evaluate("new Promise((done) => setTimeout(done, 500))")  # the stick is held all the while
            assert base.seen().top == 0, what
    assert {what: rest for what, rest in rests.items() if rest >= REST} == {}


PADS = """
window.pads = [0, 1].map((index) => ({
  index, connected: true, mapping: 'standard', axes: [0, 0, 0, 0],
  buttons: Array.from({length: 17}, () => ({pressed: false})),
}));
navigator.getGamepads = () => window.pads;
window.red = (number, pressed) => (window.pads[number].buttons[1].pressed = pressed);
window.stops = new Set();
const send = WebSocket.prototype.send;
WebSocket.prototype.send = function (text) {
  const command = JSON.parse(text);
  if (command.do === 'stop') window.stops.add(command.press);
  return send.call(this, text);
};
"""
"""Two game pads, and the stops that the page sends; one that is sent several times counts once."""


@pytest.mark.real_time
def test_the_red_button_of_a_game_pad_stops_once_also_while_driving_is_blocked_and_on_every_view(
    browser: Browser, served: Served, scene: tuple[Process, LoneBase]
) -> None:
    page, base = driver(browser, served), scene[1]
    page.tab.evaluate(PADS)

    def stops() -> int:
        page.tab.evaluate("new Promise((done) => setTimeout(done, 300))")  # several turns of the page
        return int(page.tab.evaluate("window.stops.size"))

    with page.held(STICK, up=60):
        wait_until(moving(base))
        page.tab.evaluate("dispatchEvent(new Event('gamepaddisconnected'))")  # driving is blocked until all is let go
        wait_until(lambda: not moving(base)())
        assert stops() == 0
        page.tab.evaluate("window.red(0, true)")
        page.wait_for("Stopped from this page")
        assert stops() == 1  # although the button is held
    page.release()  # the button is still held
    page.go("Live")
    page.tab.evaluate("window.red(1, true)")
    page.wait_for("Stopped from this page")
    assert stops() == 2


@pytest.mark.real_time
def test_every_button_of_an_unknown_pad_stops(
    browser: Browser, served: Served, scene: tuple[Process, LoneBase]
) -> None:
    page, base = driver(browser, served), scene[1]
    page.tab.evaluate(PADS)
    page.tab.evaluate("window.pads = window.pads.slice(0, 1); window.pads[0].mapping = ''")
    page.wait_for("Every button is STOP")
    page.tab.evaluate("window.pads[0].axes[1] = -1; window.pads[0].buttons[4].pressed = true")
    page.wait_for("Stopped from this page")
    assert page.tab.evaluate("window.stops.size") == 1
    assert not moving(base)()


@pytest.mark.real_time
def test_a_robot_is_driven_without_a_mission(browser: Browser, served: Served) -> None:
    page = Page(browser, served, view="#drive")
    page.wait_for("There is no run to drive.")
    wait_until(lambda: page.enabled("Drive without a mission"))
    page.tab.evaluate("document.querySelector('.actions .main').click()")
    page.wait_for("You drive.")
    with page.held(STICK, up=60):
        wait_until(lambda: re.search(r"is at (0\.[1-9]|[1-9])", page.tab.find("image", "Map").name))
    page.go("Live")
    page.press("End the mission")
    page.press("Press again to end it")
    page.wait_for("halted by operator")


@pytest.mark.real_time
def test_driver_moves_the_robot_while_simulated_time_is_paused(
    browser: Browser, served: Served, tmp_path: Path
) -> None:
    with simulated_run(tmp_path):
        page = Page(browser, served, view="#live")
        page.press("Pause")
        page.wait_for("paused")
        page.go("Drive")
        page.wait_for("The mission is paused.")
        page.press("Take control")
        page.wait_for("You drive. The mission is paused.")
        with page.held(STICK, up=60):
            wait_until(lambda: re.search(r"is at (0\.[1-9]|[1-9])", page.tab.find("image", "Map").name))
        page.press("Resume")
        wait_until(lambda: not page.says("The mission is paused."))


@pytest.mark.real_time
def test_stop_in_simulated_time_brakes_and_release_continues(browser: Browser, served: Served, tmp_path: Path) -> None:
    with simulated_run(tmp_path, DRIVING):
        page = Page(browser, served, view="#robot")
        wait_until(lambda: re.search(r"speed 0\.[1-9]", page.tab.text()))
        page.stop.click()
        page.wait_for("speed 0 m/s", "Stopped from this page")
        page.go("Drive")
        page.release()
        page.press("Resume")  # beside what says that it is released
        page.go("Robot")
        wait_until(lambda: re.search(r"speed 0\.[1-9]", page.tab.text()))


@pytest.mark.real_time
def test_a_viewer_stops_on_every_view_and_only_an_operator_releases(
    browser: Browser, served: Served, tmp_path: Path
) -> None:
    with run_of(tmp_path, DRIVING) as (_, base):
        page = Page(browser, served, served.viewer, size=PHONE)
        wait_until(moving(base))
        page.stop.click()
        assert seconds_to_rest(base, base.seen().heard_at) < REST
        for view in VIEWS:
            page.go(view)
            page.wait_for("Stopped from this page")
            assert not page.enabled("release")
        page = Page(browser, served, view="#live")
        page.wait_for("stopped by viewer")
        assert not page.enabled("Resume")
        page.release()
        assert not base.seen().moving
        page.press("Resume")
        wait_until(moving(base))
        page.press("End the mission")
        page.press("Press again to end it")
        page.wait_for("halted by operator")


def test_typing_a_space_is_no_stop_and_escape_is(browser: Browser, served: Served, tmp_path: Path) -> None:
    with simulated_run(tmp_path):
        page = Page(browser, served, view="#run")
        page.tab.find("searchbox", "Search").focus()
        page.tab.press("a", " ", "b")
        assert page.tab.evaluate("document.activeElement.value") == "a b"
        assert not page.says("Stopped")
        page.tab.press("Escape")
        page.wait_for("Stopped from this page")
        page.release()


def test_no_view_of_a_run_is_too_wide_for_phones_tablets_and_desktops(
    browser: Browser, served: Served, tmp_path: Path
) -> None:
    with simulated_run(tmp_path):
        for size in ((390, 844), (844, 390), (820, 1180), (1440, 900)):
            page = Page(browser, served, size=size, view="#live")
            page.wait_for("tick ")
            for view in ("Live", "Drive", "Robot"):
                page.go(view)
                what = (view, size)
                assert page.tab.evaluate("document.documentElement.scrollWidth") <= size[0], what
                tops = page.tab.evaluate("[...document.querySelectorAll('nav a')].map((each) => each.offsetTop)")
                assert len(set(tops)) <= 2, what  # the views stand in two rows at most


def test_texts_of_strangers_are_texts(browser: Browser, served: Served, tmp_path: Path) -> None:
    text = json.dumps(HOSTILE)
    mission = f"mission: m\nparams: {{kept: {text}}}\ntree:\n  wait: 1000 s\n  name: {text}\n"
    with simulated_run(tmp_path, mission):
        page = Page(browser, served, view="#live")
        page.tab.evaluate("window.alert = () => (window.hurt = true)")
        page.wait_for("<img src=x onerror=alert(1)>")
        wait_until(lambda: any(HOSTILE[:20] in each.name for each in page.tab.all("treeitem")))
        assert page.tab.evaluate("document.querySelectorAll('main img[src=x], main script').length") == 0
        assert not page.tab.evaluate("window.hurt === true")
        assert page.tab.errors == []
