"""Verdict on a head from its camera pictures: the direction in which the picture moves when the head turns.

When the head turns left, the scene moves right in the picture; when it turns up, the scene moves down. Pictures are
compared by phase correlation.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import hypot, tan

import cv2
import numpy as np

from drivers.api import Image
from drivers.api.driver import Finding, failure, warning
from missions.plugins.setup.doctor.head_trial import PICTURE_WIDTH, TURN_ANGLE, PictureLookup

MIN_TEXTURE = 4.0
"""Minimum contrast of a usable picture: standard deviation in grey levels, without noise."""

MIN_RESPONSE = 0.06
"""Minimum share of the energy in the peak of the phase correlation for a credible shift."""

MIN_CORRELATION = 0.4
"""Minimum correlation of two aligned pictures at which the shift is that of the whole scene.

With a lower correlation, only a person in the scene may have moved.
"""

MAX_CONTRAST = 10.0
"""Maximum difference of a pixel from the brightness around it, in grey levels; larger ones are reduced to it.

Otherwise a person with high contrast would dominate the comparison of pictures.
"""

MIN_SHIFT_RATIO, MAX_SHIFT_RATIO = 0.5, 1.7
"""Maximum ratio of measured to expected shift of a turn; ``MIN_SHIFT_RATIO`` is the minimum."""

MAX_STILL_RATIO = 0.2
"""Maximum ratio of the measured to the expected shift of a picture at which the head counts as not moved."""

SWAPPED_SERVOS = "the servos of pan and tilt are swapped"

REVERSE_AXIS = "in the robot file, reverse this axis: `flip` of the servo, or `reverse` of the joint"


@dataclass(frozen=True, slots=True)
class Shift:
    """Shift of the scene between two pictures, to the right and down in pixels, and its confidence (0..1)."""

    x: float
    y: float
    response: float


def judge_head(pictures: PictureLookup, field_of_view: float) -> Iterator[Finding]:
    """Yield the findings on the pan and tilt axes of a head; the camera's ``field_of_view`` is in radians."""
    expected = PICTURE_WIDTH / 2 / tan(field_of_view / 2) * tan(TURN_ANGLE)
    pan = _judge_axis(pictures, ("ahead", "left", "between"), expected, vertical=False)
    tilt = _judge_axis(pictures, ("between", "up", "end"), expected, vertical=True)
    if "wrong way" in pan.message and "wrong way" in tilt.message:
        both = "both axes turn the wrong way, or the camera is mounted upside down"
        yield failure(
            "pan and tilt",
            f"{both}: {pan.message}; {tilt.message}",
            f"write `rotate: 180` into the section of the camera; else {REVERSE_AXIS}",
        )
        return
    swapped = SWAPPED_SERVOS in pan.message and SWAPPED_SERVOS in tilt.message
    for each in (pan, tilt):  # swapped plugs show on both axes, a walking person on one
        yield (
            each
            if swapped or SWAPPED_SERVOS not in each.message
            else _undecided(each.about, "something else moves in the pictures")
        )


def _judge_axis(pictures: PictureLookup, poses: tuple[str, str, str], expected: float, *, vertical: bool) -> Finding:
    """Return the finding on an axis of a head, by the pictures before its turn, after it, and after the return.

    ``expected`` is the expected shift in pixels. ``vertical`` is True for the tilt axis.
    """
    name = "tilt" if vertical else "pan"
    before, turned, after = (pictures(pose) for pose in poses)
    if before is None or turned is None or after is None:
        return warning(name, "direction unknown: no picture in one of its poses", "is the camera plugged in?")
    if min(_texture(each) for each in (before, turned, after)) < MIN_TEXTURE:
        return _undecided(name, "the pictures have too little detail")
    there, back, rest = measure_shift(before, turned), measure_shift(turned, after), measure_shift(before, after)
    if min(there.response, back.response) < MIN_RESPONSE:
        return _undecided(name, "the pictures have too little in common")
    way, aside = (there.y, there.x) if vertical else (there.x, there.y)
    if hypot(there.x, there.y) < MAX_STILL_RATIO * expected:
        what = f"the picture did not move when the head turned by {TURN_ANGLE * 57.3:.0f} deg"
        return warning(name, f"{what}: blocked, or the camera is not on the head", "check whether the head turns")
    off = hypot(there.x + back.x, there.y + back.y)
    agrees = min(overlap_correlation(before, turned, there), overlap_correlation(turned, after, back))
    if off > 0.3 * hypot(there.x, there.y) or hypot(rest.x, rest.y) > 0.3 * expected or agrees < MIN_CORRELATION:
        return _undecided(name, "something else moves in the pictures")
    measured = f"the picture moved by {way:+.0f} px, {expected:+.0f} expected"
    if abs(aside) > 2 * abs(way) and MIN_SHIFT_RATIO * expected <= abs(aside) <= MAX_SHIFT_RATIO * expected:
        what = f"it moves the picture {'sideways' if vertical else 'up and down'}: {SWAPPED_SERVOS}"
        return failure(name, what, "swap the plugs of the two servos, or their numbers in the robot file")
    if not MIN_SHIFT_RATIO * expected <= abs(way) <= MAX_SHIFT_RATIO * expected or abs(aside) > abs(way) / 4 + 4:
        return _undecided(name, measured)
    if way < 0:
        return failure(name, f"turns the wrong way: {measured}", REVERSE_AXIS)
    return Finding(name, f"turns in the expected direction: {measured}")


def measure_shift(one: Image, other: Image) -> Shift:
    """Return the shift of the scene from one grey picture to another, by phase correlation.

    Pictures of different size give a shift with confidence 0.
    """
    if one.shape != other.shape:
        return Shift(0.0, 0.0, 0.0)
    window = cv2.createHanningWindow((one.shape[1], one.shape[0]), cv2.CV_32F)
    (x, y), response = cv2.phaseCorrelate(_remove_brightness(one), _remove_brightness(other), window)
    return Shift(float(x), float(y), float(response))


def overlap_correlation(one: Image, other: Image, moved: Shift) -> float:
    """Return the correlation (-1..1) of the overlap of two pictures, with the shift undone."""
    x, y = round(moved.x), round(moved.y)
    height, width = one.shape[:2]
    if abs(x) >= width or abs(y) >= height:
        return 0.0
    here = _limit_contrast(one)[max(0, -y) : height - max(0, y), max(0, -x) : width - max(0, x)]
    there = _limit_contrast(other)[max(0, y) : height - max(0, -y), max(0, x) : width - max(0, -x)]
    power = float(np.sqrt(np.sum(here**2) * np.sum(there**2)))
    return float(np.sum(here * there)) / power if power else 0.0


def _limit_contrast(image: Image) -> "np.ndarray[tuple[int, ...], np.dtype[np.float32]]":
    """Return a picture with limited contrast, so that a person with high contrast counts no more than the room."""
    return np.clip(_remove_brightness(image), -MAX_CONTRAST, MAX_CONTRAST)


def _remove_brightness(image: Image) -> "np.ndarray[tuple[int, ...], np.dtype[np.float32]]":
    """Return a picture with less noise, from which the brightness around each pixel is subtracted."""
    smooth = cv2.GaussianBlur(image, (0, 0), 1.5).astype(np.float32)
    return np.asarray(smooth - cv2.GaussianBlur(smooth, (0, 0), 20), np.float32)


def _texture(image: Image) -> float:
    return float(np.std(cv2.GaussianBlur(image, (0, 0), 2).astype(np.float32)))


def _undecided(name: str, why: str) -> Finding:
    return warning(name, f"direction unknown: {why}", "point it at a room with furniture")
