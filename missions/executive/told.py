"""Commands as events tell them, where that is not the method and its arguments: rounded, and wanted against given."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from drivers.api import Base, Head, Joints

Values = Mapping[str, object]
"""A command as an event tells it."""

Tell = Callable[[str, str, Values], None]
"""Told of a command: to which part, from which source, with which values."""


def _drive(arguments: tuple[Any, ...], given: Any) -> Values:
    """Return what is in force, and where not all of it is, what was wanted too."""
    velocity = arguments[0]
    told = {"linear": round(given.linear, 4), "angular": round(given.angular, 4)}
    if given != velocity:
        told |= {"wanted_linear": round(velocity.linear, 4), "wanted_angular": round(velocity.angular, 4)}
    return told


def _stop(_: tuple[Any, ...], __: Any) -> Values:
    return {"linear": 0.0, "angular": 0.0}


def _tune(arguments: tuple[Any, ...], _: Any) -> Values:
    return {"tune": str(arguments[0])}


def _look(_: tuple[Any, ...], accepted: Any) -> Values:
    return {"pan": round(accepted.pan, 4), "tilt": round(accepted.tilt, 4)}


def _move(_: tuple[Any, ...], accepted: Any) -> Values:
    return {joint: round(goal, 4) for joint, goal in accepted.items()}


def _follow(arguments: tuple[Any, ...], _: Any) -> Values:
    return {"follow": {coupling.follower: coupling.leader for coupling in arguments[0]}}


def _recover(_: tuple[Any, ...], recovered: Any) -> Values:
    return {"recover": list(recovered)}


TOLD: Mapping[Callable[..., object], Callable[[tuple[Any, ...], Any], Values]] = MappingProxyType(
    {
        Base.drive: _drive,
        Base.stop: _stop,
        Base.play: _tune,
        Head.look: _look,
        Joints.move: _move,
        Joints.follow: _follow,
        Joints.recover: _recover,
    }
)
"""What is told of a command, by its method: from its arguments as they are kept, and from what the device returned.

Of a command that is told before the device has it, nothing is returned yet: None. A method that is not here is told by
its name, with its arguments.
"""
