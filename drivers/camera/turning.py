"""Turning pictures."""

import cv2
import numpy as np

from drivers.api import Image
from drivers.api.turn import Turn

_ROTATIONS = (None, cv2.ROTATE_90_CLOCKWISE, cv2.ROTATE_180, cv2.ROTATE_90_COUNTERCLOCKWISE)
_FLIPS = {(True, False): 1, (False, True): 0, (True, True): -1}


def turned(image: Image, turn: Turn) -> Image:
    """Return a picture, turned and then mirrored."""
    rotation, flip = _ROTATIONS[turn.quarters], _FLIPS.get((turn.across, turn.down))
    found = image if rotation is None else cv2.rotate(image, rotation)
    found = found if flip is None else cv2.flip(found, flip)
    return np.asarray(found, np.uint8)


def unturned(image: Image, turn: Turn) -> Image:
    """Return the picture that ``turn`` makes ``image`` of."""
    return turned(turned(image, Turn(0, turn.across, turn.down)), Turn(-turn.quarters % 4))
