"""A record for reports: for 6 s a robot turns to somebody, greets them, drives ahead, and bumps into something.

All of its texts are hostile: a page must show them, and take none for more than text.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from drivers.api import BaseState, HeadPose, Pose2D, Quality, Reading, Velocity
from missions.executive.events import (
    CommandSent,
    Ended,
    FaultRaised,
    Logged,
    NodeChanged,
    Notified,
    ReflexFired,
    VariableSet,
)
from missions.executive.tick_record import Answer, TickRecord
from missions.plugins.records.recording.items import LossItem, PictureItem, ViewItem, pack_items, unpack_items
from missions.plugins.records.recording.record_header import RecordContents, RecordHeader
from missions.plugins.records.recording.writer import ChunkSink, RecordWriter
from missions.trees.drawing import Badge, TreeBox, TreeDrawing, to_json
from perception.api import Box as Place
from perception.api import Face, View
from tests.missions.records.recording.small_record import HEAD
from tests.missions.views.pictures.drawn import HOSTILE

END = 6.0
FAILED = 5.0
"""When `drive` fails."""


def _leaf(key: str, kind: str, line: int, said: str = "") -> TreeBox:
    return TreeBox(key, kind, kind, "■", "m.yaml", line, said, {"text": said} if said else {})


DRAWING = TreeDrawing(
    "m",
    HOSTILE,
    "m.yaml",
    TreeBox(
        "1", "sequence", "sequence", "→", "m.yaml", 2,
        children=(
            replace(_leaf("1.1", "track_face", 3), keep_as="person"),
            replace(_leaf("1.2.1", "say", 4, HOSTILE), badges=(Badge("1.2", "timeout", "5 s", 5),)),
            TreeBox("1.3", "mission", "go", "▣", "m.yaml", 6, mission="go", children=(_leaf("1.3.1", "drive", 2),)),
            _leaf("1.4", "wait", 9),
        ),
    ),
)  # fmt: skip

WHERE = replace(HEAD, mission="m", values={"patience": "5 s"}, robot=HOSTILE)
FILES = {"mission/greet.yaml": HOSTILE.encode()}

Item = (
    NodeChanged
    | VariableSet
    | CommandSent
    | FaultRaised
    | Logged
    | Notified
    | ReflexFired
    | Ended
    | TickRecord
    | ViewItem
    | PictureItem
)


def picture(shade: int) -> bytes:
    """Return a JPEG of 640 by 480 pixels."""
    return cv2.imencode(".jpg", np.full((480, 640, 3), shade, np.uint8))[1].tobytes()


def face(t: float, *, number: int = 1, bearing: float = 0.2) -> Face:
    """Return a face as a picture of ``t`` shows it."""
    return Face(number, t, Place(100.0, 50.0, 60.0, 60.0), bearing, -0.1, 0.0, 0.0, 0.0, 0.0, 1.5)


def changes() -> list[NodeChanged]:
    """Return what the nodes did."""
    found = [
        (0.1, "1.1", "track_face", "running", ""),
        (0.1, "1", "sequence", "running", ""),
        (3.0, "1.1", "track_face", "idle", "face 1, 0 deg off"),
        (3.0, "1.2.1", "say", "running", HOSTILE),
        (3.0, "1.2", "timeout", "running", HOSTILE),
        (4.0, "1.2.1", "say", "success", ""),
        (4.0, "1.2", "timeout", "success", ""),
        (4.0, "1.3.1", "drive", "running", ""),
        (4.0, "1.3", "mission", "running", ""),
        (FAILED, "1.3.1", "drive", "failure", HOSTILE),
        (FAILED, "1.3", "mission", "failure", HOSTILE),
        (END, "1", "sequence", "failure", HOSTILE),
    ]
    return [NodeChanged(t, round(20 * t), key, kind, kind, 1, status, reason) for t, key, kind, status, reason in found]


def items() -> list[Item]:
    """Return all that the run hands over, in order."""
    found: list[Item] = [
        *changes(),
        VariableSet(0.0, 0, "", "patience", 5.0),
        VariableSet(0.0, 0, "", "greeting", HOSTILE),
        VariableSet(2.0, 40, "", "person", face(2.0)),
        VariableSet(4.0, 80, "1.3", "person", None),
        FaultRaised(0.0, "base", "online", "it is there"),
        FaultRaised(4.5, "base", "offline", HOSTILE, HOSTILE),
        FaultRaised(4.8, "base", "online", "it is there again"),
        ReflexFired(FAILED, 100, "bumper", "left", True),
        Logged(3.0, "voice", HOSTILE),
        Logged(3.5, "person", "Anna: Hello"),
        Notified(3.6, 70, "Anna was met"),
        *(_moment(tick) for tick in range(2, 121)),
        *(ViewItem(second + 0.01, View(float(second), (face(float(second)),))) for second in range(1, 6)),
        *(PictureItem(float(second), picture(40 * second), None) for second in range(1, 6)),
        Ended(END, "m", "failure", HOSTILE, END, 119),
    ]
    return sorted(found, key=lambda item: item.t)


def _moment(tick: int) -> TickRecord:
    t = tick / 20
    asked = Velocity(0.2 if 4.0 <= t < FAILED else 0.0, 0.0)
    x = 0.2 * min(max(0.0, t - 4.0), 1.0)
    state = BaseState(Pose2D(x, 0.0, 0.0), asked, battery_percent=80.0 - t)
    pose = Reading(HeadPose(0.05 * t, -0.1), t, Quality.GOOD)
    answers: list[Answer] = [
        ("base", "state", (), Reading(state, t, Quality.GOOD)),
        ("base", "drive", (asked,), asked),
        ("head", "pose", (), pose),
        ("head", "look", (HeadPose(0.05 * t + 0.02, -0.1),), HeadPose(0.05 * t + 0.02, -0.1)),
    ]
    return TickRecord("tick", tick - 1, t, 0.08 if tick == 60 else 0.0, 1e-4, answers)


def write(
    path: Path,
    what: Sequence[Item | LossItem],
    *,
    head: RecordHeader = WHERE,
    drawing: TreeDrawing = DRAWING,
    files: Mapping[str, bytes] = FILES,
) -> Path:
    """Write a record; return its path."""
    with path.open("wb", buffering=0) as file:
        writer = RecordWriter(
            ChunkSink(file.fileno()), RecordContents(head, files, json.dumps(to_json(drawing)).encode())
        )
        writer.begin()
        for item in unpack_items(pack_items(what)):
            writer.add(item)
        assert writer.close().whole
    return path
