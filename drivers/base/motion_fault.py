"""The verdict of the progress monitor, and its words."""

from collections.abc import Mapping
from math import degrees

from drivers.api import BaseState, Velocity
from drivers.api.quick import dataclass
from drivers.base.hazards import describe


@dataclass(frozen=True, slots=True)
class MotionFault:
    """Why a base was stopped: what was commanded, what was measured, the likely cause; and what to try."""

    reason: str
    hint: str


LINEAR_CAUSES: Mapping[str, tuple[str, str]] = {
    "none": (
        "blocked or not connected",
        "free its wheels; is an E-stop pressed? look at motors, encoders and their cables",
    ),
    "less": (
        "held back, or one wheel is blocked or not connected",
        "free its wheels; look at motors, encoders and their cables",
    ),
    "more": ("faster than commanded", "check the wheels' measures in the robot file, and the slope"),
    "opposite": (
        "the sign of its motors or encoders is swapped",
        "swap the wires of both motors, or of both encoders; `mission doctor --move` tells which",
    ),
}
"""Likely cause of each deviation in driving, and what helps."""

ANGULAR_CAUSES: Mapping[str, tuple[str, str]] = {
    "none": (
        "blocked, slipping, or its gyro or encoders are not connected",
        "free its wheels; look at motors, encoders and their cables",
    ),
    "less": ("held back, slipping, or one wheel is blocked or not connected", "free its wheels"),
    "more": (
        "one wheel is blocked or not connected, or the sign of one is swapped",
        "free its wheels; look at motors, encoders and their cables",
    ),
    "opposite": (
        "the sides of its wheels, or the sign of one, are swapped",
        "swap left and right; `mission doctor --move` tells which",
    ),
}
"""The same of turning."""


def commanded(velocity: Velocity) -> str:
    """Say what is commanded: "commanded 0.2 m/s"."""
    parts = []
    if velocity.linear or not velocity.angular:
        parts.append(f"{velocity.linear:.2g} m/s")
    if velocity.angular:
        parts.append(f"{degrees(velocity.angular):.0f} deg/s")
    return f"commanded {' and '.join(parts)}"


def reported_by(instrument: str) -> str:
    """Say that an instrument reports something."""
    return f"{instrument} {'report' if instrument.endswith('s') else 'reports'}"


def overcurrent(state: BaseState) -> str:
    """Say which wheels are overloaded."""
    wheels = "wheels" if state.overcurrent.left and state.overcurrent.right else "wheel"
    return f"overcurrent on the {state.overcurrent} {wheels}"


def felt(state: BaseState) -> str:
    """Say what else the base reports that may be the cause."""
    found = [overcurrent(state)] if state.overcurrent else []
    return "".join(f"; {each}" for each in (*found, *sorted(state.hazards)))


def hint_of(state: BaseState) -> str:
    """Return what helps against the hazards that the base reports."""
    told = (describe(hazard) for hazard in sorted(state.hazards))
    return "; ".join(dict.fromkeys(hint for _, hint in filter(None, told)))
