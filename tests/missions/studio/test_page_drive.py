"""Driving and stopping from the page, at a virtual base: whatever is lost, it comes to rest."""

import json
import os
import re
import signal
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from missions.studio.wheels import ANEW
from tests.browser import Browser, chromium
from tests.missions.command import Process
from tests.missions.lone_base import LoneBase
from tests.missions.studio.page import PHONE, VIEWS, Page
from tests.missions.studio.running import DRIVING, REST, run_of, seconds_to_rest
from tests.missions.studio.serving import Served, studio
from tests.missions.views.pictures.drawn import HOSTILE
from tests.waiting import wait_until

pytestmark = pytest.mark.real_time

STICK = "studio-stick"


@pytest.fixture(scope="module")
def served() -> Iterator[Served]:
    with studio() as found:
        yield found


@pytest.fixture
def scene(tmp_path: Path) -> Iterator[tuple[Process, LoneBase]]:
    with run_of(tmp_path) as found:
        yield found


def driver(browser: Browser, served: Served) -> Page:
    page = Page(browser, served, view="#drive")
    page.press("Take the wheels")
    page.wait_for("You drive.")
    return page


def moving(base: LoneBase) -> Callable[[], bool]:
    return lambda: base.seen().moving


def test_the_base_drives_while_the_stick_is_held_and_rests_when_it_is_let_go(
    browser: Browser, served: Served, scene: tuple[Process, LoneBase]
) -> None:
    page, base = driver(browser, served), scene[1]
    with page.held(STICK, up=60):
        wait_until(moving(base))
    assert seconds_to_rest(base, base.seen().heard_at) < REST


def test_the_base_drives_while_a_key_is_held_and_rests_at_stop_until_it_is_released(
    browser: Browser, served: Served, scene: tuple[Process, LoneBase]
) -> None:
    page, base = driver(browser, served), scene[1]
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


@pytest.mark.parametrize("script", LOSSES.values(), ids=LOSSES)
def test_the_base_rests_when_what_drives_it_is_lost(
    browser: Browser, served: Served, scene: tuple[Process, LoneBase], script: str
) -> None:
    page, base = driver(browser, served), scene[1]
    page.tab.evaluate("addEventListener('pointerdown', (event) => (window.held = event.pointerId), true)")
    with page.held(STICK, up=60):
        wait_until(moving(base))
        page.tab.evaluate(script)
        assert seconds_to_rest(base, base.seen().heard_at) < REST


def test_the_base_rests_when_the_tab_is_closed(
    browser: Browser, served: Served, scene: tuple[Process, LoneBase]
) -> None:
    page, base = driver(browser, served), scene[1]
    x, y = page.middle(STICK)
    page.mouse("mousePressed", x, y)
    page.mouse("mouseMoved", x, y - 60)
    wait_until(moving(base))
    browser.close_tab()
    assert seconds_to_rest(base, base.seen().heard_at) < REST


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


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "stopped, as by a laptop's lid"])
def test_the_base_rests_when_the_browser_is_killed_or_stopped(
    served: Served, scene: tuple[Process, LoneBase], number: signal.Signals
) -> None:
    with Browser(chromium()) as browser:
        page, base = driver(browser, served), scene[1]
        processes = family(browser._process)
        x, y = page.middle(STICK)
        page.mouse("mousePressed", x, y)
        page.mouse("mouseMoved", x, y - 60)
        wait_until(moving(base))
        for each in processes if number == signal.SIGSTOP else processes[:1]:
            with suppress(ProcessLookupError):
                os.kill(each, number)
        since = base.seen().heard_at
        rest = seconds_to_rest(base, since)
        wait_until(lambda: base.seen().heard_at > since + rest + ANEW)
        base.seen(forget=True)
        if number == signal.SIGSTOP:
            for each in processes:
                os.kill(each, signal.SIGCONT)
            page.tab.evaluate("new Promise((done) => setTimeout(done, 500))")  # the stick is held all the while
        assert rest < REST
        assert base.seen().top == 0


def test_a_robot_is_driven_without_a_mission(browser: Browser) -> None:
    with studio() as served:
        page = Page(browser, served, view="#drive")
        page.wait_for("Nothing runs that could be driven.")
        wait_until(lambda: page.enabled("Drive without a mission"))
        page.tab.evaluate("document.querySelector('.actions .main').click()")
        page.press("Take the wheels")
        page.wait_for("You drive.")
        with page.held(STICK, up=60):
            wait_until(lambda: re.search(r"is at (0\.[1-9]|[1-9])", page.tab.find("image", "Plan").name))
        page.go("Live")
        page.press("End the mission")
        page.press("Press again to end it")
        page.wait_for("halted by operator")


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
        assert not page.enabled("Go on")
        page.release()
        assert not base.seen().moving
        page.press("Go on")
        wait_until(moving(base))
        page.press("End the mission")
        page.press("Press again to end it")
        page.wait_for("halted by operator")


@pytest.mark.usefixtures("scene")
def test_typing_a_space_is_no_stop_and_escape_is(browser: Browser, served: Served) -> None:
    page = Page(browser, served, view="#run")
    page.tab.find("searchbox", "Search").focus()
    page.tab.press("a", " ", "b")
    assert page.tab.evaluate("document.activeElement.value") == "a b"
    assert not page.says("Stopped")
    page.tab.press("Escape")
    page.wait_for("Stopped from this page")
    page.release()


def test_texts_of_strangers_are_texts(browser: Browser, served: Served, tmp_path: Path) -> None:
    text = json.dumps(HOSTILE)
    mission = f"mission: m\nparams: {{kept: {text}}}\ntree:\n  wait: 1000 s\n  name: {text}\n"
    with run_of(tmp_path, mission):
        page = Page(browser, served, view="#live")
        page.tab.evaluate("window.alert = () => (window.hurt = true)")
        page.wait_for("<img src=x onerror=alert(1)>")
        wait_until(lambda: any(HOSTILE[:20] in each.name for each in page.tab.all("treeitem")))
        assert page.tab.evaluate("document.querySelectorAll('main img[src=x], main script').length") == 0
        assert not page.tab.evaluate("window.hurt === true")
        assert page.tab.errors == []
