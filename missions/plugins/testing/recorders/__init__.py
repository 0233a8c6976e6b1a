"""Recorders: a robot's parts that keep what they were told, in order, and feel what the test says.

``base.commands == [drive(0.2, 0.0), STOP]`` is strict: a command too many fails as one too few does. ``times`` says
when each was given.
"""

from missions.plugins.testing.recorders.bench import (
    LeafTestBench,
    RecordedBase,
    RecordedHead,
    RecordedJoints,
    RecordedRanger,
    drive,
)
from missions.plugins.testing.recorders.senses import (
    CANCEL,
    ENABLE,
    HOLD,
    LATCH,
    OFFLINE_ERROR,
    RECOVER,
    RELAX,
    REST,
    STOP,
    RecordedSight,
    RecordedUtterance,
    RecordedVoice,
    Spy,
    face,
    good,
    none,
    stale,
)

__all__ = [
    "CANCEL",
    "ENABLE",
    "HOLD",
    "LATCH",
    "OFFLINE_ERROR",
    "RECOVER",
    "RELAX",
    "REST",
    "STOP",
    "LeafTestBench",
    "RecordedBase",
    "RecordedHead",
    "RecordedJoints",
    "RecordedRanger",
    "RecordedSight",
    "RecordedUtterance",
    "RecordedVoice",
    "Spy",
    "drive",
    "face",
    "good",
    "none",
    "stale",
]
