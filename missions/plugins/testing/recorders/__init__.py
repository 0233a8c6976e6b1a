"""Recorders: parts of a robot that record their commands in order, and return readings set by the test.

``base.commands == [drive(0.2, 0.0), STOP]`` is strict: an extra command fails like a missing one. ``times`` holds the
time of each command.
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
