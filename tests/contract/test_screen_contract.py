"""What ``drivers.api.Screen`` promises, kept by the page, by printed moods and by the twin."""

from collections.abc import Iterator
from math import inf, nan
from threading import Thread

import pytest

from drivers.api import Mood, Screen, ScreenContent
from drivers.screen.make import PrintedScreen
from drivers.screen.pages import PageScreen
from drivers.screen.twin import ScreenTwin
from tests.contract.rigs import InSimulatedTime, Rig, simulated


class ScreenRig(Rig):
    device: Screen

    def unplug(self) -> None:
        raise NotImplementedError("a page has no plug")

    def plug_in(self) -> None:
        raise NotImplementedError("a page has no plug")

    def close(self) -> None:
        self.device.close()


class Page(InSimulatedTime, ScreenRig):
    def __init__(self) -> None:
        super().__init__()
        self.device = PageScreen(self.clock, report=self.notices.append)


class Printed(InSimulatedTime, ScreenRig):
    def __init__(self) -> None:
        super().__init__()
        self.device = PrintedScreen(self.clock, print)


class Twin(InSimulatedTime, ScreenRig):
    def __init__(self) -> None:
        super().__init__()
        self.device = ScreenTwin(self.clock, report=self.notices.append)


@pytest.fixture(params=[simulated(Page, "page"), simulated(Printed, "printed"), simulated(Twin, "twin")])
def rig(request: pytest.FixtureRequest) -> Iterator[ScreenRig]:
    rig: ScreenRig = request.param()
    yield rig
    rig.close()


@pytest.fixture
def screen(rig: ScreenRig) -> Screen:
    """A screen that is ready."""
    rig.device.open()
    return rig.device


def test_unopened_screen_is_offline_and_keeps_its_content(rig: ScreenRig) -> None:
    health = rig.device.health()
    assert (health.online, health.detail) == (False, "screen: not opened yet")
    rig.device.mood(Mood.HAPPY)
    rig.device.show("hello")
    rig.device.open()
    assert rig.device.content() == ScreenContent(Mood.HAPPY, "hello")
    assert rig.device.health().online


def test_screen_is_awake_once_opened_and_asleep_at_rest(screen: Screen) -> None:
    assert screen.content() == ScreenContent(Mood.NEUTRAL)
    screen.mood(Mood.SAD)
    screen.show("good night")
    screen.mouth(0.5)
    screen.rest()
    screen.rest()
    assert screen.content() == ScreenContent(Mood.ASLEEP)
    screen.mood(Mood.HAPPY)
    assert screen.content() == ScreenContent(Mood.HAPPY)


@pytest.mark.parametrize("mood", Mood)
def test_mood_and_text_stay_until_replaced(screen: Screen, mood: Mood) -> None:
    screen.show("hello")
    screen.mood(mood)
    assert screen.content() == ScreenContent(mood, "hello")
    screen.show("")
    assert screen.content() == ScreenContent(mood)


def test_mouth_closes_after_its_timeout(rig: ScreenRig, screen: Screen) -> None:
    screen.mouth(0.5)
    assert screen.content().mouth == 0.5
    rig.wait(0.4)
    assert screen.content() == ScreenContent()
    screen.mouth(1.0)
    screen.mouth(0.0)
    assert screen.content().mouth == 0.0


@pytest.mark.parametrize(("asked", "kept"), [(-1.0, 0.0), (1.5, 1.0), (inf, 1.0), (-inf, 0.0), (nan, 0.0)])
def test_mouth_opening_is_clamped(screen: Screen, asked: float, kept: float) -> None:
    screen.mouth(asked)
    assert screen.content().mouth == kept


def test_closed_screen_is_asleep_and_awake_once_opened(screen: Screen) -> None:
    screen.show("hello")
    screen.close()
    screen.close()
    assert screen.content() == ScreenContent(Mood.ASLEEP)
    assert not screen.health().online
    screen.open()
    screen.open()
    assert screen.content() == ScreenContent(Mood.NEUTRAL)
    assert screen.health().online


def test_screen_is_thread_safe(screen: Screen) -> None:
    def tell(mood: Mood) -> None:
        for number in range(50):
            screen.mood(mood)
            screen.show(f"{mood} {number}")
            screen.mouth(number / 50)
            screen.content()

    threads = [Thread(target=tell, args=(mood,)) for mood in Mood]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert screen.content().text.endswith(" 49")
