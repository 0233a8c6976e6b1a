"""Who may tell a base how to move, what came of it, and what a base does by itself whoever commands."""

from collections.abc import Callable, Iterator
from enum import StrEnum
from typing import Literal

from drivers.api.keys import Mistake, key, keys
from drivers.api.quick import dataclass

BUTTONS = 3
"""The buttons of a base are numbered from 0 to one less."""

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
    and is empty where they do not. ``source`` is None while nobody commands. ``fault`` says why ``source`` was stopped
    because the base did not do what it was told; it stands until that source lets go, and commands anew.
    """

    source: Source | None
    wanted: Velocity
    given: Velocity
    because: str = ""
    fault: str = ""


Steered = Callable[[Steering], None]
"""Where a driver tells of a new ``Steering``; called from the driver's own thread, must return at once."""


@keys
class Reflexes:
    """What a base does by itself, whoever commands. What it touches always stops it; the rest can be chosen.

    ``stop`` forbids what would make it worse for as long as it is felt; ``latch`` stands still until somebody enables
    the base again; ``back_off`` drives ``back_off_way`` metres back at ``back_off_speed`` (m/s). Beyond a cliff the
    base may only go straight back, and nowhere else until it is ``back_off_way`` from there. A battery counts as low or
    critical below so many percent, 0 for never. The buttons (0..2) latch and enable it; None for no button.
    """

    cliff: Literal["stop", "latch"] = key(
        default="stop", help="At an edge of the floor: stop, or stand still until somebody enables the base."
    )
    wheel_drop: Literal["stop", "latch"] = key(default="stop", help="The same for a wheel that hangs in the air.")
    bumper: Literal["stop", "back_off", "latch"] = key(
        default="back_off", help="What a bump does: `back_off` drives back a little."
    )
    back_off_way: float = key(
        "length", default=0.05, low=0.01, high=0.5, word="back_off", help="How far it drives back then."
    )
    back_off_speed: float = key("speed", default=0.1, low=0.05, high=0.3, help="How fast it drives back.")
    battery_low: float = key(
        "percent", default=25.0, low=0.0, high=100.0, help="The battery counts as low below this; `0 %` for never."
    )
    battery_critical: float = key(
        "percent", default=10.0, low=0.0, high=100.0, help="The same for critical: missions end then."
    )
    stop_button: int | None = key(
        default=None, low=0, high=BUTTONS - 1, help="The button that makes the base stand still until it is enabled."
    )
    enable_button: int | None = key(default=None, low=0, high=BUTTONS - 1, help="The button that enables it.")

    def mistakes(self) -> Iterator[Mistake]:
        """Yield what does not go together."""
        if 0 < self.battery_low < self.battery_critical:
            low, least = f"{self.battery_low:g} %", f"{self.battery_critical:g} %"
            message = f"'battery_critical' ({least}) is above 'battery_low' ({low})"
            yield Mistake(message, ("battery_critical",), ("battery_low",))
        if self.enable_button == self.stop_button is not None:
            message = f"button {self.enable_button} cannot both stop and enable the base"
            yield Mistake(message, ("enable_button",))
