"""Recorders: a robot's parts that keep what they were told, in order, and feel what the test says.

``base.commands == [drive(0.2, 0.0), STOP]`` is strict: a command too many fails as one too few does. ``times`` says
when each was given.
"""

from missions.plugins.testing.recorders.bench import (
    Bench,
    RecordedBase,
    RecordedHead,
    RecordedJoints,
    RecordedRanger,
    drive,
)
from missions.plugins.testing.recorders.senses import (
    CANCEL,
    ENABLE,
    GONE,
    HOLD,
    LATCH,
    RECOVER,
    RELAX,
    REST,
    STOP,
    RecordedSight,
    RecordedVoice,
    RecordedWords,
    Spy,
    face,
    good,
    none,
    stale,
)

__all__ = [
    "CANCEL",
    "ENABLE",
    "GONE",
    "HOLD",
    "LATCH",
    "RECOVER",
    "RELAX",
    "REST",
    "STOP",
    "Bench",
    "RecordedBase",
    "RecordedHead",
    "RecordedJoints",
    "RecordedRanger",
    "RecordedSight",
    "RecordedVoice",
    "RecordedWords",
    "Spy",
    "drive",
    "face",
    "good",
    "none",
    "stale",
]
