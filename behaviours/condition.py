"""Condition of a mission, as the leaves ``check`` and ``wait_until`` evaluate it."""

from typing import Protocol


class UnmeasuredError(ValueError):
    """Raised for a condition that reads a position from dead reckoning: the base does not measure its motion."""


class Condition(Protocol):
    """Condition in a mission, bound to the variables of the mission."""

    def is_true(self) -> bool:
        """Evaluate the condition.

        Raises UnmeasuredError, SensorSilent if a sensor has not reported, and ValueError if it cannot be calculated,
        such as a comparison with the distance of a face while none is seen.
        """

    def false_reason(self) -> str:
        """Return the reason of a failure: the condition, with the present values that it reads."""
