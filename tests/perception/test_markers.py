"""Markers: which robot, where, and which way it is turned; never one that is not there."""

from math import degrees, hypot, radians
from pathlib import Path
from random import Random

import cv2
import numpy as np
import pytest

from perception.api import Gaze, Image, Marker
from perception.markers import MarkerSense, marker_dictionary
from perception.tracks import MARKER_FAMILIES, MarkerSet
from tests.perception.rendered import CAMERA, LIGHTS, cell, frame, marker_picture, poorly

R2 = MarkerSet(robots={7: "R2"})


def see(sense: MarkerSense, image: Image, *, pitch: float = 0.0) -> tuple[Marker, ...]:
    """Look at the same picture twice."""
    sense.sense(frame(image, 0.0), CAMERA, Gaze(0.0, pitch))
    return sense.sense(frame(image, 0.05), CAMERA, Gaze(0.0, pitch))


def test_of_four_pixels_a_cell_and_more_the_right_number_is_read() -> None:
    random, sense = Random(3), MarkerSense(R2)  # noqa: S311 - a reproducible scene is no secret
    right = wrong = total = 0
    while total < 60:
        number, away, turned = random.randrange(50), random.uniform(0.6, 3.2), random.uniform(-0.6, 0.6)
        aside = random.uniform(-0.3, 0.3) * away
        if cell(away, aside, turned) < 4.0:
            continue
        clean = marker_picture(number, away, turned=turned, aside=aside)
        light, blur, noise = random.choice(list(LIGHTS)), random.choice((0.0, 0.7)), random.choice((0.0, 4.0, 8.0))
        numbers = [found for found, _ in sense.find(poorly(clean, random, light=light, blur=blur, noise=noise))]
        total += 1
        right += number in numbers
        wrong += any(found != number for found in numbers)
    assert right >= 0.99 * total
    assert wrong == 0


@pytest.mark.parametrize("away", [0.8, 1.6])
@pytest.mark.parametrize("turned", [-0.5, -0.2, 0.3, 0.5])
def test_marker_gives_the_pose_of_a_robot(away: float, turned: float) -> None:
    (marker,) = see(MarkerSense(R2), marker_picture(7, away, turned=turned, aside=0.2))
    assert (marker.number, marker.name) == (7, "R2")
    assert marker.distance == pytest.approx(hypot(away, 0.2), rel=0.03)
    assert degrees(marker.bearing) == pytest.approx(degrees(np.arctan2(0.2, away)), abs=0.5)
    assert degrees(marker.heading) == pytest.approx(degrees(turned), abs=6)


def test_marker_heading_is_independent_of_camera_pitch() -> None:
    for pitch in (0.0, radians(20)):
        image = marker_picture(7, 1.0, turned=0.5, height=0.6 if pitch else 0.29, pitch=pitch)
        (marker,) = see(MarkerSense(R2), image, pitch=pitch)
        assert degrees(marker.heading) == pytest.approx(degrees(0.5), abs=4)


def test_unnamed_robot_has_no_name() -> None:
    (marker,) = see(MarkerSense(R2), marker_picture(9, 1.0))
    assert (marker.number, marker.name) == (9, "")


def test_two_markers_of_a_robot_are_one_robot() -> None:
    image = marker_picture(7, 0.8, turned=radians(45))
    assert len([number for number, _ in MarkerSense(R2).find(image)]) == 2
    assert len(see(MarkerSense(R2), image)) == 1


@pytest.mark.parametrize("family", MARKER_FAMILIES)
def test_every_family_is_read(family: str) -> None:
    dictionary = marker_dictionary(family)
    page = np.full((480, 640, 3), 220, np.uint8)
    page[150:330, 230:410] = cv2.aruco.generateImageMarker(dictionary, 5, 180)[..., None]
    sense = MarkerSense(MarkerSet(family, size=0.1))
    (marker,) = see(sense, page)
    assert marker.number == 5
    assert marker.distance == pytest.approx(0.1 * CAMERA.focal / 180, rel=0.02)
    assert marker.heading == pytest.approx(0.0, abs=0.1)
    assert marker.box.centre == pytest.approx((320, 240), abs=2)


def test_footage_without_markers_gives_none(footage: Path) -> None:
    sense, film = MarkerSense(R2), cv2.VideoCapture(str(footage / "learn.mkv"))
    while (taken := film.read())[0]:
        assert sense.find(np.asarray(taken[1], np.uint8)) == []
    film.release()


def test_invalid_marker_set_is_refused() -> None:
    with pytest.raises(ValueError, match="no family '9x9'; known are: 4x4_50"):
        MarkerSet("9x9")
    with pytest.raises(ValueError, match="must be above 0 m"):
        MarkerSet(size=0.0)
