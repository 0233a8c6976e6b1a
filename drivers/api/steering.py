"""Who may tell a base how to move, what came of it, and what a base does by itself whoever commands."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

COMMAND_LIFE = 0.3
"""Seconds for which a velocity command is valid; a base that hears no newer one stops."""


@dataclass(frozen=True, slots=True)
class Velocity:
    """``linear`` in m/s along x, ``angular`` in rad/s about z."""

    linear: float
    angular: float


STILL = Velocity(0.0, 0.0)
"""Standing."""


class Source(StrEnum):
    """Who commands the wheels, most important first."""

    SAFETY = "safety"  # the base's own reflexes
    TELEOP = "teleop"  # a person with keys or a game pad
    MISSION = "mission"


@dataclass(frozen=True, slots=True)
class Steering:
    """What a base is told now, and why; compared by value, so that a driver tells only what is new.

    ``wanted`` is what ``source`` asked for, ``given`` what of it is in force: within the limits, and what the reflexes
    permit, but before the ramp that leads there. ``because`` says in words why they differ ("limited", "cliff left"),
    and is empty where they do not. ``source`` is None while nobody commands.
    """

    source: Source | None
    wanted: Velocity
    given: Velocity
    because: str = ""


Steered = Callable[[Steering], None]
"""Where a driver tells of a new ``Steering``; called from the driver's own thread, must return at once."""


def unsteered(steering: Steering) -> None:
    """Tell nobody: for a base that nobody watches."""


@dataclass(frozen=True, slots=True)
class Reflexes:
    """What a base does by itself, whoever commands. What it touches always stops it; the rest can be chosen.

    ``stop`` forbids what would make it worse for as long as it is felt; ``latch`` stands still until somebody enables
    the base again; ``back_off`` drives ``back_off_way`` metres back at ``back_off_speed`` (m/s). Beyond a cliff the
    base may only go straight back, and nowhere else until it is ``back_off_way`` from there. A battery counts as low or
    critical below so many percent, 0 for never. The buttons (0..2) latch and enable it; None for no button.
    """

    cliff: Literal["stop", "latch"] = "stop"
    wheel_drop: Literal["stop", "latch"] = "stop"
    bumper: Literal["stop", "back_off", "latch"] = "back_off"
    back_off_way: float = 0.05
    back_off_speed: float = 0.1
    battery_low: float = 25.0
    battery_critical: float = 10.0
    stop_button: int | None = None
    enable_button: int | None = None
