"""What missions name and the library holds: gestures and controllers, as leaves take them."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeVar

from behaviours.tracking.follow import RuleBases
from config.controller import load_controller
from config.faults import InvalidFileError
from config.gesture import load_gesture
from config.library import UnknownNameError, find
from drivers.api import Gesture, Keyframe

T = TypeVar("T")


def gesture(name: str) -> Gesture:
    """Return a gesture by name or path. Raises LookupError with what is known, or what is wrong with its file."""
    found = _load(load_gesture, "gestures", name)
    return Gesture(found.name, found.summary, tuple(Keyframe(time, joints) for time, joints in found.keyframes))


def controller(name: str) -> RuleBases:
    """Return a controller's rule bases by name or path. Raises as ``gesture`` does."""
    found = _load(load_controller, "controllers", name)
    try:
        return RuleBases.from_mapping(found.values)
    except ValueError as error:
        raise LookupError(f"names controller '{name}', which is wrong: {error}") from error


THINGS: Mapping[str, Callable[[str], object]] = {"gesture": gesture, "controller": controller}
"""How each kind of thing is found."""


def _load(load: Callable[[Path], T], kind: str, name: str) -> T:
    try:
        return load(find(kind, name))
    except UnknownNameError as error:
        raise LookupError(f"needs a {kind.removesuffix('s')}: {error}") from error
    except InvalidFileError as error:
        raise LookupError(f"names a {kind.removesuffix('s')} that is wrong: {error}") from error
