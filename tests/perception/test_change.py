"""Motion: seen when something moves, and not when only the camera does."""

from collections.abc import Callable
from math import radians

import numpy as np
import pytest

from drivers.sim.people import Person
from drivers.sim.render import Renderer
from drivers.sim.viewpoint import Viewpoint
from drivers.sim.world import Light, LightChange, SimulatedWorld
from perception.scene_motion import MotionSense
from tests.perception.rendered import LENS, frame

STANDS = Person("Ben", look="ben", x=2.5, y=0.2)
WALKS = Person("Ben", look="ben", x=2.5, y=0.6, path=((2.5, -0.6),), speed=0.8)


def motions(person: Person, yaw: Callable[[float], float], *, light: float | Light = 1.0) -> list[float]:
    """What is said to move in a second of pictures, the first aside."""
    renderer = Renderer(SimulatedWorld(people=(person,), light=light), LENS, noise=4.0)
    sense, found = MotionSense(), []
    for number in range(16):
        time = number / 16
        scene = sense.measure(frame(renderer.draw(Viewpoint(z=1.1, yaw=yaw(time)), time), time))
        assert scene.motion is not None
        found.append(scene.motion)
    assert found[0] == 0.0
    return found[1:]


def test_still_scene_has_no_motion() -> None:
    assert max(motions(STANDS, lambda _: 0.0)) < 0.001


@pytest.mark.parametrize("light", [1.0, 0.4])
def test_walking_person_is_motion(light: float) -> None:
    assert np.median(motions(WALKS, lambda _: 0.0, light=light)) > 0.004


@pytest.mark.parametrize(("speed", "most"), [(10, 0.006), (30, 0.008), (60, 0.015)])
def test_head_turn_leaves_little_motion(speed: float, most: float) -> None:
    assert np.median(motions(STANDS, lambda time: radians(speed) * (time - 0.5))) < most


def test_walking_person_is_motion_during_a_head_turn() -> None:
    turning = [motions(who, lambda time: radians(30) * (time - 0.5)) for who in (WALKS, STANDS)]
    assert np.median(turning[0]) > 2 * np.median(turning[1])


def test_fading_light_is_not_motion() -> None:
    assert max(motions(STANDS, lambda _: 0.0, light=Light(1.0, (LightChange(0.2, 0.4, duration=0.6),)))) < 0.005


def test_unrelated_view_is_not_motion() -> None:
    random, sense = np.random.default_rng(1), MotionSense()
    for number in range(3):
        other = np.kron(random.integers(0, 256, (24, 32, 3), np.uint8), np.ones((20, 20, 1), np.uint8))
        assert sense.measure(frame(other, number / 20)).motion == 0.0


def test_changed_picture_size_restarts_the_motion_sense() -> None:
    sense = MotionSense()
    for number, shape in enumerate([(480, 640, 3), (240, 320, 3), (60, 80, 3), (60, 80, 3), (3, 3, 3)]):
        scene = sense.measure(frame(np.full(shape, 90, np.uint8), number / 20))
        assert (scene.motion, scene.brightness, scene.stamp) == (0.0, 90.0, number / 20)
