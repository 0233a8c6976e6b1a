"""Coloured things: found where they are in any light, by name, not where they are not, and at what distance."""

from math import degrees, isnan, radians
from pathlib import Path
from random import Random

import cv2
import numpy as np
import pytest

from config.colours import COLOURS
from config.object import HUES
from perception.api import ANY, BALL, BOX, Gaze, Image, Thing, ThingSpec
from perception.colour_spots import SpotFinder, ThingSense
from tests.perception.rendered import CAMERA, frame, thing_scene

RED_BALL = ThingSpec("red ball", "red", BALL)


def picture(*things: tuple[str, str, tuple[int, int], int]) -> Image:
    """Draw things on a grey wall: colour, shape, middle, and pixels from the middle to the side."""
    drawn = np.full((480, 640, 3), 150, np.uint8)
    for colour, shape, (x, y), half in things:
        paint = COLOURS[colour][::-1]
        if shape == BALL:
            cv2.circle(drawn, (x, y), half, paint, cv2.FILLED, cv2.LINE_AA)
        else:
            cv2.rectangle(drawn, (x - half, y - half), (x + half, y + half), paint, cv2.FILLED)
    return drawn


def see(sense: ThingSense, image: Image, times: int = 2, gaze: Gaze | None = None) -> tuple[Thing, ...]:
    """Look at the same picture so often."""
    for number in range(times):
        things = sense.sense(frame(image, number / 20), CAMERA, gaze)
    return things


def test_things_are_found_at_half_a_metre_to_three_in_bad_pictures_and_nothing_else_is() -> None:
    random, finder = Random(7), SpotFinder(COLOURS, HUES)  # noqa: S311 - a reproducible scene is no secret
    shown = [scene for _ in range(100) if (scene := thing_scene(random, HUES)) is not None]
    found = false = 0
    for scene in shown:
        asked = [spot for spot in finder.find(scene.image) if (spot.colour, spot.shape) == (scene.colour, scene.shape)]
        hits = [it for it in asked if scene.inside(it.box.x, it.box.y, it.box.width, it.box.height)]
        found += bool(hits)
        false += len(asked) - len(hits)
    assert len(shown) > 60
    assert found >= 0.95 * len(shown)
    assert false <= 0.01 * len(shown)


def test_footage_without_objects_gives_few_false_ones(footage: Path) -> None:
    """A frame is asked for 21 things at once: each of 7 colours as a ball, as a box, and as either."""
    asked = [ThingSpec(f"{hue} {shape}", hue, shape) for hue in HUES for shape in (BALL, BOX, ANY)]
    frames = false = 0
    for clip in sorted(footage.glob("*.mkv")):
        sense, film = ThingSense(asked, COLOURS), cv2.VideoCapture(str(clip))
        while (taken := film.read())[0]:
            false += len(sense.sense(frame(np.asarray(taken[1], np.uint8), frames / 20), CAMERA, None))
            frames += 1
        film.release()
    assert frames > 100
    assert false < 0.1 * frames


def test_object_has_its_requested_name_and_direction() -> None:
    sense = ThingSense([RED_BALL], COLOURS)
    (thing,) = see(sense, picture(("red", BALL, (480, 240), 30), ("red", BOX, (150, 240), 30)), gaze=Gaze(0.5, 0.0))
    assert (thing.id, thing.name, thing.colour, thing.shape) == (1, "red ball", "red", "ball")
    assert degrees(thing.bearing) == pytest.approx(degrees(CAMERA.pixel_to_angles(480, 240)[0]), abs=0.3)
    assert thing.yaw == pytest.approx(0.5 + thing.bearing, abs=1e-3)
    assert thing.size is None
    assert isnan(thing.distance)


def test_one_look_is_not_enough() -> None:
    sense = ThingSense([RED_BALL], COLOURS)
    red = picture(("red", BALL, (320, 240), 30))
    assert see(sense, red, times=1) == ()
    assert len(see(sense, red, times=2)) == 1


def test_one_spot_may_be_several_requested_objects() -> None:
    sense = ThingSense([RED_BALL, ThingSpec("red", "red"), ThingSpec("blue", "blue")], COLOURS)
    things = see(sense, picture(("red", BALL, (200, 200), 40), ("green", BALL, (400, 200), 40)))
    assert sorted(thing.name for thing in things) == ["red", "red ball"]


def test_the_largest_comes_first() -> None:
    sense = ThingSense([RED_BALL], COLOURS)
    small, large = ("red", BALL, (100, 100), 20), ("red", BALL, (400, 300), 60)
    assert [round(thing.box.width) > 80 for thing in see(sense, picture(small, large))] == [True, False]


@pytest.mark.parametrize("away", [0.6, 1.5, 2.8])
def test_ball_distance_follows_from_its_size(away: float) -> None:
    sense = ThingSense([ThingSpec("apple", "red", BALL, 0.12)], COLOURS)
    half = round(0.06 * CAMERA.focal / away)
    (apple,) = see(sense, picture(("red", BALL, (320, 240), half)))
    assert apple.distance == pytest.approx(0.06 * CAMERA.focal / half, rel=0.08)


def test_implausibly_distant_object_is_ignored() -> None:
    sense = ThingSense([ThingSpec("balloon", "red", BALL, 1.0)], COLOURS)
    assert see(sense, picture(("red", BALL, (320, 240), 25))) == ()


@pytest.mark.parametrize("middle", [(10, 240), (635, 240), (320, 8), (320, 470)])
def test_object_cut_off_by_the_picture_edge_is_ignored(middle: tuple[int, int]) -> None:
    assert SpotFinder(COLOURS, ["red"]).find(picture(("red", BALL, middle, 40))) == []


def test_a_part_of_something_larger_of_a_similar_colour_is_no_thing() -> None:
    pullover = picture(("orange", BOX, (320, 300), 150))
    cv2.circle(pullover, (320, 300), 30, (30, 140, 240), cv2.FILLED)  # a fold in better light: yellowish
    assert SpotFinder(COLOURS, ["yellow"]).find(pullover) == []


def test_empty_request_finds_nothing() -> None:
    assert see(ThingSense([], COLOURS), picture(("red", BALL, (320, 240), 30))) == ()


def test_an_unknown_colour_is_refused() -> None:
    with pytest.raises(ValueError, match="no such colour: mauve"):
        SpotFinder(COLOURS, ["mauve"])


@pytest.mark.parametrize("size", [(320, 240), (1280, 960), (160, 120), (640, 2), (3, 480)])
def test_any_size_of_picture_can_be_searched(size: tuple[int, int]) -> None:
    plain = np.asarray(cv2.resize(picture(("red", BALL, (320, 240), 60)), size, interpolation=cv2.INTER_AREA), np.uint8)
    found = SpotFinder(COLOURS, ["red"]).find(plain)
    if min(size) > 100:
        (ball,) = found
        assert ball.box.centre == pytest.approx((size[0] / 2, size[1] / 2), abs=0.01 * size[0])


def test_still_object_keeps_its_yaw_during_a_head_turn() -> None:
    sense = ThingSense([RED_BALL], COLOURS)
    for step in range(12):
        pan = radians(2 * step - 10)
        x, y = CAMERA.angles_to_pixel(-pan, 0.0)
        things = sense.sense(frame(picture(("red", BALL, (round(x), round(y)), 25)), step / 20), CAMERA, Gaze(pan, 0.0))
    assert degrees(things[0].yaw) == pytest.approx(0.0, abs=0.3)
    assert things[0].id == 1
