"""A gesture file as a movement."""

from config.gesture import GestureConfig
from drivers.api import Gesture, Keyframe


def movement(config: GestureConfig) -> Gesture:
    """Return what a gesture file says, as behaviours take it."""
    keyframes = tuple(Keyframe(time, positions) for time, positions in config.keyframes)
    return Gesture(config.name, config.summary, keyframes, config.interpolation)
