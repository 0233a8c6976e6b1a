"""Eyes that nobody asks rest, and what they say next is of pictures that they have searched since."""

from collections.abc import Iterator
from math import radians
from threading import Event

import numpy as np
import pytest

from drivers.clock import ManualClock
from perception.api import Gaze, Image
from perception.eyes import REST_AFTER, WARM_UP_PICTURES, WARM_UP_TIMEOUT, Eyes, Vision
from perception.senses import ActiveSenses, FaceSense
from perception.tracks import FaceSighting, Tracker
from tests.waiting import wait_until


class Picture:
    def __init__(self, stamp: float) -> None:
        self.stamp = stamp
        self.image: Image = np.zeros((48, 64, 3), np.uint8)


class Camera:
    """Gives a picture whenever it is asked, as long as it is ``there``; counts them."""

    def __init__(self) -> None:
        self.read_so_far = 0
        self.there = True

    def read(self, timeout: float) -> Picture | None:
        Event().wait(min(timeout, 0.001))
        if not self.there:
            return None
        self.read_so_far += 1
        return Picture(float(self.read_so_far))


class Nobody:
    def find(self, image: Image) -> list[FaceSighting]:
        del image
        return []


class Robot:
    """Eyes that may rest, on a clock of their own."""

    def __init__(self) -> None:
        self.clock, self.camera, self.begun_afresh = ManualClock(100.0), Camera(), 0
        senses = ActiveSenses(faces=FaceSense(Nobody(), Tracker()))
        vision = Vision(
            lambda _: Gaze(0.0, 0.0),
            field_of_view=radians(60),
            senses=senses,
            now=self.clock.now,
            on_resume=self.begin_afresh,
        )
        self.eyes = Eyes(self.camera, vision)
        self.eyes.may_rest = True

    def begin_afresh(self) -> None:
        self.begun_afresh += 1

    def fall_asleep(self) -> None:
        self.clock.advance(REST_AFTER + 0.1)
        wait_until(lambda: self.eyes._warm_pictures == 0)

    def until_searched(self, more: int) -> None:
        before = self.searched()
        wait_until(lambda: self.searched() >= before + more)

    def searched(self) -> int:
        return self.eyes.vision.effort.frames


@pytest.fixture
def robot() -> Iterator[Robot]:
    robot = Robot()
    robot.eyes.open()
    yield robot
    robot.eyes.close()


def test_queried_eyes_stay_awake(robot: Robot) -> None:
    for _ in range(3):
        robot.clock.advance(0.9 * REST_AFTER)
        assert robot.eyes.is_awake()
        assert robot.eyes.wake()
        robot.until_searched(4)
    assert robot.begun_afresh == 0


def test_eyes_without_queries_stop_reading_pictures(robot: Robot) -> None:
    robot.until_searched(4)
    robot.fall_asleep()
    read = robot.camera.read_so_far
    robot.clock.advance(60.0)
    assert not robot.eyes.is_awake()  # which asks for nothing
    Event().wait(0.05)  # in which they would read fifty
    assert robot.camera.read_so_far == read
    assert not robot.eyes.wake()
    before = robot.searched()
    wait_until(robot.eyes.wake)
    assert robot.searched() >= before + WARM_UP_PICTURES
    assert robot.begun_afresh == 1


def test_wake_gives_up_without_pictures(robot: Robot) -> None:
    robot.until_searched(4)
    robot.fall_asleep()
    robot.camera.there = False
    assert not robot.eyes.wake()
    robot.clock.advance(WARM_UP_TIMEOUT / 2)
    assert not robot.eyes.wake()
    robot.clock.advance(WARM_UP_TIMEOUT)
    assert robot.eyes.wake()


def test_eyes_at_rest_are_closed_at_once(robot: Robot) -> None:
    robot.fall_asleep()
    robot.eyes.close()


def test_eyes_with_may_rest_off_never_rest(robot: Robot) -> None:
    robot.eyes.may_rest = False
    robot.clock.advance(10 * REST_AFTER)
    robot.until_searched(4)
    assert robot.eyes.wake()
