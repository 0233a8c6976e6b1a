"""A small record of a run that never was, to read, damage and mend: for 4 s a head turns until it sees somebody."""

import json
from collections.abc import Sequence
from pathlib import Path

from drivers.api import BaseState, HeadPose, Pose2D, Quality, Reading, Velocity
from drivers.errors import NoReply
from missions.executive.events import (
    CommandSent,
    Ended,
    Event,
    FaultRaised,
    Logged,
    NodeChanged,
    ReflexFired,
    VariableSet,
)
from missions.executive.tick_record import Answer, TickRecord
from missions.plugins.records.recording.items import (
    HealthItem,
    LossItem,
    PictureItem,
    ViewItem,
    pack_items,
    unpack_items,
)
from missions.plugins.records.recording.record_header import RecordContents, RecordHeader
from missions.plugins.records.recording.writer import ChunkSink, RecordWriter
from missions.trees.drawing import TreeBox, TreeDrawing, to_json
from perception.api import Box as Place
from perception.api import Face, View

HEAD = RecordHeader(
    mission="greet",
    file="mission/greet.yaml",
    robot="turtlebot2",
    world="living_room",
    params={"patience": "5 s"},
    seed=7,
    simulate="fast",
    eyes="pixels",
    rate=20.0,
    started="2026-11-21T14:03:00+00:00",
    versions={"missiontree": "0.1.0", "python": "3.11"},
    command=("mission", "run", "greet"),
    parts=("base", "head", "camera"),
)

TREE = TreeDrawing(
    "greet",
    "Greet somebody",
    "greet.yaml",
    TreeBox(
        "1",
        "sequence",
        "sequence",
        "→",
        "greet.yaml",
        3,
        children=(TreeBox("1.1", "look_for", "look_for", "■", "greet.yaml", 4),),
    ),
)

FILES = {"mission/greet.yaml": b"mission: greet\n", "robot/turtlebot2.yaml": b"robot: turtlebot2\n"}

JPEG = b"\xff\xd8 not much of a picture \xff\xd9"

TICKS = 80
END = 4.0

Item = Event | TickRecord | ViewItem | PictureItem | HealthItem | LossItem


def moments() -> list[TickRecord]:
    """Return one every 50 ms; the battery is the same all the time, a head that does not answer once."""
    return [
        TickRecord("tick", tick, tick / 20, 0.06 if tick == 20 else 0.0, 1e-4, _answers(tick))
        for tick in range(1, TICKS + 1)
    ]


def _answers(tick: int) -> list[Answer]:
    t = tick / 20
    state = BaseState(Pose2D(0.1 * t, 0.0, 0.0), Velocity(0.1, 0.0), battery_percent=80.0)
    pose = Reading(HeadPose(0.05 * t, 0.0), t, Quality.GOOD)
    return [
        ("base", "latched", (), ""),
        ("base", "state", (), Reading(state, t, Quality.GOOD)),
        ("head", "pose", (), NoReply("head: silent", hint="wait") if tick == 40 else pose),
    ]


def face(t: float) -> Face:
    """Return a face as it was seen at ``t``."""
    return Face(1, t, Place(10.0, 20.0, 30.0, 40.0), 0.1, 0.0, 0.1, 0.0, 0.0, 0.0, 1.5)


def items() -> list[Item]:
    """Return all that the run hands over, in order."""
    found: list[Event | TickRecord | ViewItem | PictureItem] = [
        NodeChanged(0.05, 1, "1", "sequence", "sequence", 3, "running", ""),
        NodeChanged(0.05, 1, "1.1", "look_for", "look_for", 4, "running", "nobody yet"),
        VariableSet(0.05, 1, "", "patience", 5.0),
        CommandSent(0.05, 1, "head", "look_for (1.1)", {"pan": 0.5, "tilt": 0.0}),
        FaultRaised(1.0, "head", "offline", "no reply", "look at the plug"),
        Logged(1.5, "voice", "Hello there"),
        ReflexFired(2.0, 40, "bumper", "left", True),
        NodeChanged(2.5, 50, "1.1", "look_for", "look_for", 4, "failure", "Nobody came"),
        VariableSet(3.0, 60, "", "patience", 2.5),
        NodeChanged(END, TICKS, "1.1", "look_for", "look_for", 4, "success", ""),
        NodeChanged(END, TICKS, "1", "sequence", "sequence", 3, "success", ""),
        *moments(),
        *(ViewItem(second + 0.01, View(float(second), (face(float(second)),))) for second in range(4)),
        *(PictureItem(float(second), JPEG, None) for second in range(4)),
        Ended(END, "greet", "success", "", END, TICKS),
    ]
    return [*sorted(found, key=lambda item: item.t), LossItem({"/camera": 3}, "the disk was slow")]


def write(path: Path, what: Sequence[Item], *, close: bool = True, head: RecordHeader = HEAD, every: int = 10) -> Path:
    """Write a record as a run's writer does, in chunks of ``every`` items; return its path."""
    contents = RecordContents(head, FILES, json.dumps(to_json(TREE)).encode())
    with path.open("wb", buffering=0) as file:
        writer = RecordWriter(ChunkSink(file.fileno()), contents)
        writer.begin()
        for number, item in enumerate(unpack_items(pack_items(what)), start=1):
            writer.add(item)
            if number % every == 0:
                writer.flush()
        writer.flush()
        if close:
            assert writer.close().whole
    return path
