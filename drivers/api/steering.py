"""Velocity commands of a base: their sources, limits, reflexes, and the result of arbitration."""

from collections.abc import Callable, Iterator
from enum import StrEnum
from math import atan2, hypot, pi, tau
from typing import Annotated, Literal

from drivers.api.fast_dataclass import dataclass
from drivers.api.keys import KeyDiagnostic, inside, key, keys

BUTTON_COUNT = 3
"""Number of buttons of a base; they are numbered from 0."""

COMMAND_TIMEOUT = 0.3
"""Seconds for which a velocity command is valid; a base that receives no newer one stops."""


@dataclass(frozen=True, slots=True)
class Velocity:
    """Velocity of a base: ``linear`` in m/s along x, ``angular`` in rad/s about z."""

    linear: float
    angular: float


ZERO_VELOCITY = Velocity(0.0, 0.0)
"""Velocity of a base at rest."""


class Source(StrEnum):
    """Source of velocity commands, highest priority first."""

    SAFETY = "safety"  # the base's own reflexes
    TELEOP = "teleop"  # a person with keys or a game pad
    MISSION = "mission"


@dataclass(frozen=True, slots=True)
class Steering:
    """Current command of a base and the velocity in force; drivers report it only if it has changed.

    ``requested`` is the velocity that ``source`` requests. ``allowed`` is the velocity in force: after limits and
    reflexes, but before the ramp. ``reason`` is the reason of a difference ("limited", "cliff left"), or empty.
    ``source`` is None without a command. ``fault`` is the reason for which ``source`` was stopped since the base did
    not move as commanded; it stays until that source stops and sends a new command.
    """

    source: Source | None
    requested: Velocity
    allowed: Velocity
    reason: str = ""
    fault: str = ""


SteeringCallback = Callable[[Steering], None]
"""Receives each change of ``Steering``; called from the driver's own thread, must return at once."""


@keys
class Reflexes:
    """Reflexes of a base, independent of the source of commands.

    Cliff, wheel drop and bumper always stop the base; the rest is configurable. While a contact lasts, ``stop`` forbids
    motion towards it; ``latch`` stops until a person enables the base; ``back_off`` drives back by
    ``back_off_distance`` metres at ``back_off_speed`` (m/s). At a cliff the base may only drive straight back until it
    is ``back_off_distance`` away. The battery is low or critical below these percentages, 0 for never. The buttons
    (0..2) latch and enable the base; None for no button.
    """

    cliff: Literal["stop", "latch"] = key(
        default="stop", help="Reaction to an edge of the floor: stop, or latch until a person enables the base."
    )
    wheel_drop: Literal["stop", "latch"] = key(default="stop", help="Reaction to a wheel that hangs in the air.")
    bumper: Literal["stop", "back_off", "latch"] = key(
        default="back_off", help="Reaction to a bump: `back_off` drives back a little."
    )
    back_off_distance: float = key(
        "length", default=0.05, low=0.01, high=0.5, word="back_off", help="Distance of a back-off."
    )
    back_off_speed: float = key("speed", default=0.1, low=0.05, high=0.3, help="Speed of a back-off.")
    battery_low: float = key(
        "percent", default=25.0, low=0.0, high=100.0, help="Charge below which the battery is low; `0 %` for never."
    )
    battery_critical: float = key(
        "percent",
        default=10.0,
        low=0.0,
        high=100.0,
        help="Charge below which the battery is critical, and missions end.",
    )
    stop_button: int | None = key(
        default=None,
        low=0,
        high=BUTTON_COUNT - 1,
        help="Button that latches the base.",
    )
    enable_button: int | None = key(default=None, low=0, high=BUTTON_COUNT - 1, help="Button that enables the base.")

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield an error for each contradiction between the keys of the reflexes."""
        if 0 < self.battery_low < self.battery_critical:
            low, least = f"{self.battery_low:g} %", f"{self.battery_critical:g} %"
            message = f"'battery_critical' ({least}) is above 'battery_low' ({low})"
            yield KeyDiagnostic(message, ("battery_critical",), ("battery_low",))
        if self.enable_button == self.stop_button is not None:
            message = f"button {self.enable_button} cannot both stop and enable the base"
            yield KeyDiagnostic(message, ("enable_button",))


# Range guard of a base: its keys, and its reasons for slowing the base down.

OBSTACLE_REASON = "something is in the way"
"""First words of the reason for which the range guard slows the base down; distance and direction follow."""

SCANS_LATE_REASON = "the range finder's scans are late"
SCANS_MISSING_REASON = "the range finder does not report"
OUT_OF_SIGHT_REASON = "the range finder does not see that direction"
GUARD_FAILED_REASON = "the range guard failed"

_GUARD_REASONS = (OBSTACLE_REASON, SCANS_LATE_REASON, SCANS_MISSING_REASON, OUT_OF_SIGHT_REASON, GUARD_FAILED_REASON)

MIN_GAP = 0.02
"""Smallest gap in metres between base and obstacles that a robot file may set: the noise of a range finder."""

Footprint = float | tuple[tuple[float, float], ...]
"""Radius of a round body about the middle of the base, or the corners of its outline, in metres."""


def is_guarded(steering: Steering) -> bool:
    """Return whether the range guard slows the base down or stops it."""
    return steering.reason.startswith(_GUARD_REASONS)


@keys
class RangeGuardKeys:
    """Keys of the range guard: the body of the base, and its distance from obstacles."""

    footprint: (
        float | tuple[Annotated[tuple[float, float], inside("length", wrong="'{}' needs [x, y]")], ...] | None
    ) = key(
        "length",
        default=None,
        low=0.02,
        high=2.0,
        help="Body from above: a radius, or corners [x, y], from the middle of its wheels; default: the driver's.",
        hint="footprint: 0.18 m",
    )
    gap: float = key(
        "length", default=0.05, low=MIN_GAP, high=1.0, help="Minimum distance between the body and obstacles."
    )
    reaction: float | None = key(
        "duration",
        default=None,
        low=0.02,
        high=5.0,
        help="Delay of the wheels after a command; the default is the driver's.",
    )
    unseen: Literal["slow", "free"] = key(
        default="slow",
        help="Motion to where the range finder does not look: at 0.1 m/s at most, or free.",
    )

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield an error for a footprint that does not enclose the middle of the base."""
        if not isinstance(self.footprint, tuple):
            return
        angles = sorted(atan2(y, x) for x, y in self.footprint)
        gaps = [
            after - before
            for before, after in zip(angles, [*angles[1:], *(each + tau for each in angles[:1])], strict=True)
        ]
        if len(angles) < 3 or max(gaps) > pi - 1e-6 or min(hypot(x, y) for x, y in self.footprint) < 1e-3:
            message = "'footprint': the corners must enclose the middle between the wheels, [0 m, 0 m]"
            yield KeyDiagnostic(
                message,
                ("footprint",),
                hint="footprint: [[15 cm, 10 cm], [15 cm, -10 cm], [-10 cm, -10 cm], [-10 cm, 10 cm]]",
            )
