"""Verdict on a head from the pictures of its camera: does the picture move as it must when the head turns?

To its left, the scene moves to the right of the picture; up, it moves down. Pictures are compared by phase correlation.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import hypot, tan

import cv2
import numpy as np

from drivers.api import Image
from drivers.api.driver import Finding, warning, wrong
from missions.plugins.setup.doctor.head_trial import ANGLE, WIDTH, Pictures

TEXTURE = 4.0
"""Grey levels (standard deviation, without noise) that a picture has at least that shows something."""

RESPONSE = 0.06
"""Share of the picture's energy in the peak of the correlation, from which on a shift is believed."""

AGREEMENT = 0.4
"""Correlation from which on the whole picture has moved by a shift, and not just a person in it."""

CONTRAST = 10.0
"""Grey levels beyond which a contrast counts no more."""

LEAST, MOST = 0.5, 1.7
"""Shares of the expected shift between which a shift is one of this turn."""

STAYED = 0.2
"""Share of the expected shift up to which a picture has not moved."""

SWAPPED = "the servos of pan and tilt are swapped"

CURE = "in the robot file, turn this axis round: `flip` of the servo, or `reverse` of the joint"


@dataclass(frozen=True, slots=True)
class Shift:
    """Pixels by which a scene moved to the right and down, and how sure that is (0..1)."""

    x: float
    y: float
    response: float


def judge(pictures: Pictures, field_of_view: float) -> Iterator[Finding]:
    """Yield the findings on pan and tilt; ``field_of_view`` is that of the camera, in radians."""
    expected = WIDTH / 2 / tan(field_of_view / 2) * tan(ANGLE)
    pan = _axis(pictures, ("ahead", "left", "between"), expected, across=False)
    tilt = _axis(pictures, ("between", "up", "end"), expected, across=True)
    if "wrong way" in pan.what and "wrong way" in tilt.what:
        both = "both axes turn the wrong way, or the camera is mounted upside down"
        yield wrong(
            "pan and tilt",
            f"{both}: {pan.what}; {tilt.what}",
            f"write `rotate: 180` into the section of the camera; else {CURE}",
        )
        return
    swapped = SWAPPED in pan.what and SWAPPED in tilt.what
    for each in (pan, tilt):  # of swapped plugs both axes tell; of a person who walks by, one
        yield (
            each
            if swapped or SWAPPED not in each.what
            else _unknown(each.about, "something else moves in the pictures")
        )


def _axis(pictures: Pictures, poses: tuple[str, str, str], expected: float, *, across: bool) -> Finding:
    """Judge an axis by its turn there and back; ``across`` for the one that moves the picture down."""
    name = "tilt" if across else "pan"
    before, turned, after = (pictures(pose) for pose in poses)
    if before is None or turned is None or after is None:
        return warning(name, "cannot tell: no picture came in one of its poses", "is the camera plugged in?")
    if min(_texture(each) for each in (before, turned, after)) < TEXTURE:
        return _unknown(name, "the pictures show nothing to go by")
    there, back, rest = shift(before, turned), shift(turned, after), shift(before, after)
    if min(there.response, back.response) < RESPONSE:
        return _unknown(name, "the pictures have too little in common")
    way, aside = (there.y, there.x) if across else (there.x, there.y)
    if hypot(there.x, there.y) < STAYED * expected:
        what = f"the picture did not move when the head turned by {ANGLE * 57.3:.0f} deg"
        return warning(name, f"{what}: blocked, or the camera is not on the head", "look whether the head turns")
    off = hypot(there.x + back.x, there.y + back.y)
    agrees = min(agreement(before, turned, there), agreement(turned, after, back))
    if off > 0.3 * hypot(there.x, there.y) or hypot(rest.x, rest.y) > 0.3 * expected or agrees < AGREEMENT:
        return _unknown(name, "something else moves in the pictures")
    told = f"the picture moved by {way:+.0f} px, {expected:+.0f} expected"
    if abs(aside) > 2 * abs(way) and LEAST * expected <= abs(aside) <= MOST * expected:
        what = f"it moves the picture {'sideways' if across else 'up and down'}: {SWAPPED}"
        return wrong(name, what, "swap the plugs of the two servos, or their numbers in the robot file")
    if not LEAST * expected <= abs(way) <= MOST * expected or abs(aside) > abs(way) / 4 + 4:
        return _unknown(name, told)
    if way < 0:
        return wrong(name, f"turns the wrong way: {told}", CURE)
    return Finding(name, f"turns the right way: {told}")


def shift(one: Image, other: Image) -> Shift:
    """Return by how many pixels the scene moved from one grey picture to another of the same size."""
    if one.shape != other.shape:
        return Shift(0.0, 0.0, 0.0)
    window = cv2.createHanningWindow((one.shape[1], one.shape[0]), cv2.CV_32F)
    (x, y), response = cv2.phaseCorrelate(_even(one), _even(other), window)
    return Shift(float(x), float(y), float(response))


def agreement(one: Image, other: Image, moved: Shift) -> float:
    """Return the correlation (-1..1) of two pictures where they overlap, once the shift between them is undone."""
    x, y = round(moved.x), round(moved.y)
    height, width = one.shape[:2]
    if abs(x) >= width or abs(y) >= height:
        return 0.0
    here = _flat(one)[max(0, -y) : height - max(0, y), max(0, -x) : width - max(0, x)]
    there = _flat(other)[max(0, y) : height - max(0, -y), max(0, x) : width - max(0, -x)]
    power = float(np.sqrt(np.sum(here**2) * np.sum(there**2)))
    return float(np.sum(here * there)) / power if power else 0.0


def _flat(image: Image) -> "np.ndarray[tuple[int, ...], np.dtype[np.float32]]":
    """Return a picture in which a person of strong contrast weighs no more than the room."""
    return np.clip(_even(image), -CONTRAST, CONTRAST)


def _even(image: Image) -> "np.ndarray[tuple[int, ...], np.dtype[np.float32]]":
    """Return a picture whose noise and brightness matter less."""
    smooth = cv2.GaussianBlur(image, (0, 0), 1.5).astype(np.float32)
    return np.asarray(smooth - cv2.GaussianBlur(smooth, (0, 0), 20), np.float32)


def _texture(image: Image) -> float:
    return float(np.std(cv2.GaussianBlur(image, (0, 0), 2).astype(np.float32)))


def _unknown(name: str, why: str) -> Finding:
    return warning(name, f"cannot tell whether it turns the right way: {why}", "let it look at a room with furniture")
