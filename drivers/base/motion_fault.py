"""The verdict of the progress monitor."""

from drivers.api.quick import dataclass


@dataclass(frozen=True, slots=True)
class MotionFault:
    """Why a base was stopped: what was commanded, what was measured, the likely cause; and what to try."""

    reason: str
    hint: str
