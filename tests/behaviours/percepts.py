"""Percepts for tests."""

from perception.api import Box, Percept


def percept(stamp: float, *, number: int = 1, bearing: float = 0.0) -> Percept:
    """Return what all percepts have in common, of something that stands still."""
    return Percept(
        number,
        stamp,
        Box(300, 220, 40, 40),
        bearing=bearing,
        elevation=0.0,
        yaw=bearing,
        pitch=0.0,
        yaw_rate=0.0,
        pitch_rate=0.0,
        distance=1.5,
    )
