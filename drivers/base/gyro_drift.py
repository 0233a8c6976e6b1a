"""Finding of a checkup on the drift of a gyro at rest."""

from math import degrees

from drivers.api.driver import Finding, failure, warning

DRIFT_WARNING, DRIFT_WRONG = 0.3, 5.0
"""Drift at rest in deg/s from which on there is a warning, or an error."""

TURN_SPEED = 40.0
"""Turn rate in deg/s for the example in the finding: how far off a turn by 90 degrees at this rate ends."""


def drift(turned: float, seconds: float) -> Finding:
    """Return the finding of a checkup for a gyro that reported ``turned`` radians in ``seconds`` at rest."""
    rate = degrees(turned) / seconds if seconds else 0.0
    off = abs(rate) * 90 / TURN_SPEED
    if abs(rate) < DRIFT_WARNING:
        return Finding("gyro drift", f"{rate:+.2f} deg/s at rest")
    what = (
        f"{rate:+.2f} deg/s at rest: unless a run learns that while the base is at rest, a turn of 90 deg at "
        f"{TURN_SPEED:g} deg/s ends {off:.1f} deg off"
    )
    if abs(rate) < DRIFT_WRONG:
        return warning("gyro drift", what, "keep the base still while it is switched on; let it warm up")
    return failure("gyro drift", what, "switch the base off and on at rest; if that does not help, its gyro is broken")
