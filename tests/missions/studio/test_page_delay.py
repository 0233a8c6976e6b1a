"""Driving from the page over a slow network: it is refused, and the page says why."""

from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

from missions.control.pilot import MAX_STATE_AGE
from tests.browser import Browser
from tests.missions.lone_base import LoneBase
from tests.missions.studio.lossy import lossy
from tests.missions.studio.page import Page
from tests.missions.studio.running import run_of, seconds_to_rest
from tests.missions.studio.serving import Served
from tests.missions.studio.test_delay import BRAKING, never
from tests.missions.studio.test_page_drive import STICK, moving
from tests.waiting import wait_until

pytestmark = pytest.mark.real_time

SLOW = "Driving is refused: the connection is too slow."


def holds_still(page: Page, base: LoneBase, seconds: float) -> bool:
    """Hold the stick for so long; say whether the base has stood all the while."""
    base.seen(forget=True)
    with page.held(STICK, up=60):
        page.tab.evaluate(f"new Promise((done) => setTimeout(done, {1000 * seconds}))")
    return base.seen().top == 0.0


def test_page_shows_why_driving_is_refused_and_recovers(browser: Browser, served: Served, tmp_path: Path) -> None:
    with run_of(tmp_path) as (_, base), lossy(served.port, 0.0, never) as network:
        through = SimpleNamespace(host=f"127.0.0.1:{network.port}", operator=served.operator)
        page = Page(browser, cast("Served", through), view="#drive")
        page.press("Take control")
        page.wait_for("You drive.", "Round trip: ", "driving needs at most 500 ms")
        with page.held(STICK, up=60):
            wait_until(moving(base))
            network.up = network.down = 1.0
            pressed = base.seen().heard_at
            assert seconds_to_rest(base, pressed) <= MAX_STATE_AGE + BRAKING
            page.wait_for("Driving is refused: ")
        page.wait_for(SLOW, "You have control.", "slow connection: round trip 2.")
        assert holds_still(page, base, 1.0)
        network.up = network.down = 0.0
        wait_until(lambda: not page.says("Driving is refused"))
        with page.held(STICK, up=60):
            wait_until(moving(base))


def test_page_without_new_states_shows_the_reason_and_stops_driving(
    browser: Browser, served: Served, tmp_path: Path
) -> None:
    with run_of(tmp_path) as (_, base), lossy(served.port, 0.0, never) as network:
        through = SimpleNamespace(host=f"127.0.0.1:{network.port}", operator=served.operator)
        page = Page(browser, cast("Served", through), view="#drive")
        page.press("Take control")
        page.wait_for("You drive.")
        with page.held(STICK, up=60):
            wait_until(moving(base))
            network.down = 4.0
            assert seconds_to_rest(base, base.seen().heard_at) <= MAX_STATE_AGE + BRAKING
            page.wait_for("Driving is refused: no new state from the robot.")
