"""What a simulated base draws: its motors by what they have to do, and all the rest of it.

All figures are our assumption, but for the limit at which the base tells of an overload.
"""

ELECTRONICS = 0.4
"""Amperes that the base draws standing still."""

OVERLOAD = 3.0
"""Amperes at which the base says that a motor is overloaded (vendor)."""

STALLED = 3.5
"""Amperes of a motor that drives with all it has."""

_FRICTION = 0.15  # amperes, for a wheel that turns at all
_SPEED = 0.3  # amperes more for each m/s of the rim
_IN_VAIN = 30.0  # amperes more for each metre that a wheel has slipped: its controller pushes ever harder


def current(speed: float, in_vain: float = 0.0) -> float:
    """Return the amperes of a motor whose wheel turns at ``speed`` (m/s at its rim).

    ``in_vain`` is how many metres it has turned since something solid has held up the base.
    """
    if speed == 0.0:
        return 0.0
    return min(_FRICTION + _SPEED * abs(speed) + _IN_VAIN * in_vain, STALLED)
