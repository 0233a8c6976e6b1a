"""Writes a record into a file, chunk by chunk.

Each chunk is whole by itself and stands in the file as a whole, or not at all. What could not be written is counted,
and the record tells of it as soon as it can be written to again.
"""

import os
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import datetime
from io import BytesIO
from typing import Any, NamedTuple

from mcap.writer import Writer

from drivers.api import COMMAND_LIFE, STILL, BaseState, HeadPose, JointState, RangeScan, Reading, Velocity
from drivers.api.joints import joint_called
from missions.codec import number
from missions.executive.tick_record import TickRecord
from missions.plugins.records.recording import foxglove
from missions.plugins.records.recording.foxglove import Epoch, Json
from missions.plugins.records.recording.head import FILES, LIMIT, METADATA, TREE, Contents, Head
from missions.plugins.records.recording.items import EVENTS, Checked, Feedback, Missed, Other, Picture, Seen, topic_of
from missions.plugins.records.recording.moments import Shortened
from missions.plugins.records.recording.schemas import schema
from missions.plugins.records.recording.tagged_values import dumps, tagged, to_json
from perception.api import Gaze, View

# The state of the robot over time, to plot and to look at, from what its parts have answered.
#
# The answers are all in the moments already, exactly; these are for people. So they are fewer: ``PERIOD`` seconds
# apart at least, and ``UNCHANGED`` seconds while a part only says again what it said.

PERIOD = 0.1
"""Seconds between two figures of one part, at least."""

TF_PERIOD = 0.05
"""Seconds between two places of a frame, at least."""


UNCHANGED = 0.5
"""Seconds between two of them that say the same, at least."""


class Figure(NamedTuple):
    """A message to be: on which topic, when, and what it says."""

    topic: str
    t: float
    data: Json


class Figures:
    """Follows the parts of one robot. ``eye`` is where its camera sits (m)."""

    def __init__(self, epoch: Epoch, eye: tuple[float, float, float]) -> None:
        self._epoch = epoch
        self._eye = eye
        self._told: dict[str, float] = {}  # by topic and frame, when it was told last
        self._stamps: dict[str, float] = {}  # and of when that was
        self._values: dict[str, object] = {}  # and what it said
        self._wanted = self._given = STILL
        self._driven = float("-inf")
        self._looking: HeadPose | None = None

    def of(self, moment: TickRecord) -> Iterator[Figure]:
        """Yield the figures that a moment brings."""
        newest: dict[tuple[str, str], object] = {}
        for part, what, arguments, value in moment.answers:
            newest[part, what] = value
            self._command(moment.t, part, what, arguments, value)
        joints: dict[str, object] = {}
        for (part, what), value in newest.items():
            if what == "states" and isinstance(value, Mapping):
                joints |= {joint_called(part, name): state for name, state in value.items()}
            match value:
                case Reading(value=BaseState() as state) as reading:
                    yield from self._base(moment.t, reading.stamp, str(reading.quality), state)
                case Reading(value=HeadPose() as pose) as reading if part == "head":
                    yield from self._head(moment.t, reading.stamp, str(reading.quality), pose)
                case Reading(value=RangeScan() as scan) if self._due("/scan", moment.t, scan.stamp, scan.number):
                    yield Figure("/scan", moment.t, foxglove.scan(self._epoch.stamp(scan.stamp), scan))
        yield from self._arms(moment.t, joints)

    def _command(self, t: float, part: str, what: str, arguments: tuple[object, ...], value: object) -> None:
        """Take in what a part was told, and what came of it."""
        match part, what, value:
            case "base", "drive", Velocity():
                asked = arguments[0]
                self._wanted = asked if isinstance(asked, Velocity) else value
                self._given, self._driven = value, t
            case "base", "stop" | "latch" | "rest", _:
                self._wanted = self._given = STILL
            case "head", "look", HeadPose():
                self._looking = value

    def _base(self, t: float, stamp: float, quality: str, state: BaseState) -> Iterator[Figure]:
        pose = state.pose
        if foxglove.is_finite(pose.x, pose.y, pose.heading) and self._due("odom", t, stamp, pose, TF_PERIOD):
            at = self._epoch.stamp(stamp)
            yield Figure("/tf", t, foxglove.base_transform(at, pose))
            yield Figure("/base/pose", t, foxglove.base_pose(at, pose))
        commanded = t - self._driven <= COMMAND_LIFE
        wanted, given = (self._wanted, self._given) if commanded else (STILL, STILL)
        if self._due("/state/base", t, stamp, (quality, state, wanted, given)):
            numbers = {
                "x": pose.x,
                "y": pose.y,
                "heading": pose.heading,
                "speed": state.velocity.linear,
                "turn": state.velocity.angular,
                "wanted_speed": wanted.linear,
                "wanted_turn": wanted.angular,
                "given_speed": given.linear,
                "given_turn": given.angular,
                "battery_voltage": state.battery_voltage,
                "battery_percent": state.battery_percent,
            }
            words = {
                "bumper": str(state.bumper),
                "cliff": str(state.cliff),
                "wheel_drop": str(state.wheel_drop),
                "charging": state.charging,
                "docked": state.docked,
                "reckoned": state.reckoned,
            }
            head = {"t": t, "stamp": stamp, "quality": quality}
            yield Figure(
                "/state/base", t, {**head, **{name: number(value) for name, value in numbers.items()}, **words}
            )

    def _head(self, t: float, stamp: float, quality: str, pose: HeadPose) -> Iterator[Figure]:
        if foxglove.is_finite(pose.pan, pose.tilt) and self._due("camera", t, stamp, pose, TF_PERIOD):
            gaze = Gaze(pose.pan, pose.tilt)
            yield Figure("/tf", t, foxglove.camera_transform(self._epoch.stamp(stamp), self._eye, gaze))
        wanted = self._looking
        if self._due("/state/head", t, stamp, (quality, pose, wanted)):
            yield Figure(
                "/state/head",
                t,
                {
                    "t": t,
                    "stamp": stamp,
                    "quality": quality,
                    "pan": number(pose.pan),
                    "tilt": number(pose.tilt),
                    "wanted_pan": None if wanted is None else number(wanted.pan),
                    "wanted_tilt": None if wanted is None else number(wanted.tilt),
                },
            )

    def _arms(self, t: float, states: Mapping[str, object]) -> Iterator[Figure]:
        joints = {
            name: {"stamp": reading.stamp, "quality": str(reading.quality), **_fields(reading.value)}
            for name, reading in states.items()
            if isinstance(reading, Reading) and isinstance(reading.value, JointState)
        }
        stamp = max((reading.stamp for reading in states.values() if isinstance(reading, Reading)), default=0.0)
        if joints and self._due("/state/arm", t, stamp, joints):
            yield Figure("/state/arm", t, {"t": t, "joints": joints})

    def _due(self, what: str, t: float, stamp: float, value: object, period: float = PERIOD) -> bool:
        """Say whether something is to be told now; then it counts as told."""
        if self._stamps.get(what) == stamp:
            return False
        # A tick may come a little early: what is due within a tenth of a period is due.
        wait = UNCHANGED if self._values.get(what) == value else period
        if t < self._told.get(what, float("-inf")) + 0.9 * wait:
            return False
        self._told[what], self._stamps[what], self._values[what] = t, stamp, value
        return True


def _fields(state: JointState) -> Json:
    fields = to_json(state)
    return fields if isinstance(fields, dict) else {}


# The end of a record's file: what is written to it is there as a whole, or not at all.


class Sink(BytesIO):
    """Collects what is written until ``flush``, which brings all of it to the file ``number``, or nothing.

    A disk that is full, a limit or a fault leave the file as it was after the last flush that succeeded; ``trouble`` is
    then what went wrong with the newest flush, and what was collected is gone. Positions are those in the file. It does
    not own the file.
    """

    def __init__(self, number: int) -> None:
        super().__init__()
        self.good = 0
        """Bytes that are in the file."""
        self.trouble: OSError | None = None
        self._number = number

    def tell(self) -> int:
        """Return where in the file the next byte will be."""
        return self.good + super().tell()

    def flush(self) -> None:
        """Bring what was collected to the file; never raises."""
        left = memoryview(self.getvalue())
        size = len(left)
        self.seek(0)
        self.truncate()
        self.trouble = None
        try:
            while left:
                left = left[os.write(self._number, left) :]
        except OSError as error:
            self.trouble = error
            os.ftruncate(self._number, self.good)
            os.lseek(self._number, self.good, os.SEEK_SET)
        else:
            self.good += size

    def sync(self) -> None:
        """Wait until what is in the file is on the disk. Raises OSError."""
        os.fdatasync(self._number)


# From what a run hands over to the messages of its record.
#
# Each message is JSON, with ``t`` in seconds of the run where it is ours; its topic's schema stands in
# ``missions.plugins.records.recording.schemas``. An event is its fields, as ``missions.executive.events`` has them.

SCHEMAS: Mapping[str, str] = {
    "/mission": "missiontree.Mission",
    "/moments": "missiontree.Moment",
    "/nodes": "missiontree.NodeChanged",
    "/feedback": "missiontree.Feedback",
    "/variables": "missiontree.VariableSet",
    "/percepts": "missiontree.View",
    "/commands": "missiontree.CommandSent",
    "/faults": "missiontree.FaultRaised",
    "/reflexes": "missiontree.ReflexFired",
    "/notices": "missiontree.Notified",
    "/end": "missiontree.Ended",
    "/lost": "missiontree.Lost",
    "/log": "foxglove.Log",
    "/camera": "foxglove.CompressedImage",
    "/camera/marks": "foxglove.ImageAnnotations",
    "/tf": "foxglove.FrameTransform",
    "/base/pose": "foxglove.PoseInFrame",
    "/scan": "foxglove.LaserScan",
    "/state/base": "missiontree.BaseState",
    "/state/head": "missiontree.HeadState",
    "/state/arm": "missiontree.ArmState",
    "/state/devices": "missiontree.DeviceStates",
}
"""The schema of every topic."""

VIEWS_KEPT = 16
"""So many views wait for the picture that they were found in: a picture is there later, once it is packed."""


class Message(NamedTuple):
    """What is to be written: on which topic, of when, and what."""

    topic: str
    t: float
    data: bytes


class Topics:
    """Makes messages of the items of one run."""

    def __init__(self, head: Head) -> None:
        self.epoch = Epoch(round(datetime.fromisoformat(head.started).timestamp() * 1e6) * 1000)
        self._head = head
        self._moments = Shortened()
        self._figures = Figures(self.epoch, head.eye)
        self._views: dict[float, View] = {}

    def forget(self) -> None:
        """Let what comes next be read without what was before."""
        self._moments.forget()

    def first(self) -> Message:
        """Return the message at the beginning of a record."""
        return Message("/mission", 0.0, dumps(to_json(self._head)))

    def lost(self, t: float, counts: Mapping[str, int], why: str) -> Message:
        """Return the message that says that others are missing."""
        return Message("/lost", t, dumps({"t": t, "counts": dict(counts), "why": why}))

    def messages(self, item: Any) -> Iterator[Message]:
        """Yield the messages that an item makes."""
        match item:
            case TickRecord():
                yield Message("/moments", item.t, self._moments.written(item))
                for topic, t, data in self._figures.of(item):
                    yield Message(topic, t, dumps(data))
            case Seen():
                yield from self._seen(item)
            case Picture():
                yield from self._picture(item)
            case Checked():
                devices = {name: to_json(health) for name, health in item.health.items()}
                yield Message("/state/devices", item.t, dumps({"t": item.t, "devices": devices}))
            case Feedback():
                yield Message("/feedback", item.t, dumps(item._asdict()))
            case Other() if type(item).__name__ == "Logged":
                yield self._logged(**vars(item))
            case Other():
                topic, values = EVENTS[type(item).__name__], vars(item)
                yield Message(topic, values["t"], dumps({name: tagged(value) for name, value in values.items()}))

    def _seen(self, seen: Seen) -> Iterator[Message]:
        view = seen.view
        if view.looked is not None:
            self._views[view.looked] = view
            while len(self._views) > VIEWS_KEPT:
                del self._views[next(iter(self._views))]
        written = to_json(view)
        yield Message("/percepts", seen.t, dumps({"t": seen.t, **(written if isinstance(written, dict) else {})}))

    def _picture(self, picture: Picture) -> Iterator[Message]:
        stamp, gaze = self.epoch.stamp(picture.t), picture.gaze
        looked = None if gaze is None else {"yaw": number(gaze.yaw), "pitch": number(gaze.pitch)}
        image = foxglove.image(stamp, picture.jpeg)
        yield Message("/camera", picture.t, dumps({**image, "t": picture.t, "gaze": looked}))
        view = self._views.pop(picture.t, None)
        if view is not None:
            yield Message("/camera/marks", picture.t, dumps(foxglove.marks(stamp, view)))

    def _logged(self, t: float, level: str, text: str) -> Message:
        line = foxglove.log(self.epoch.stamp(t), level, text, self._head.file)
        return Message("/log", t, dumps({**line, "t": t, "kind": level}))


CHUNK = 1_000_000
"""Bytes of messages after which a chunk is written, at the latest."""

OVERHEAD = 64
"""Bytes that a message takes beside what it says; and in the index, a chunk for each topic in it."""

LOST = "/lost"
"""The topic that tells what is missing."""


@dataclass(frozen=True, slots=True)
class Written:
    """What became of a record: the messages written and lost by topic, why they were lost, and whether it was closed.

    ``ended`` is when it reached its limit, in seconds of the run; None where it did not.
    """

    counts: Mapping[str, int] = field(default_factory=dict)
    lost: Mapping[str, int] = field(default_factory=dict)
    why: str = ""
    whole: bool = False
    ended: float | None = None


class RecordWriter:
    """Writes one record of at most ``limit`` bytes. For one thread.

    ``ended`` is when it reached that, and ``lost`` what is missing, and ``why``; it is ``failing`` while it cannot
    write. Nothing but ``begin`` raises for what is wrong with the disk. A record that the disk lost something of lacks
    its index: mend it.
    """

    def __init__(self, sink: Sink, contents: Contents, *, limit: float = float("inf")) -> None:
        self.ended: float | None = None
        self.failing = False
        self.lost: Counter[str] = Counter()
        self._sink = sink
        self._contents = contents
        self._limit = limit
        self._most = min(CHUNK, limit / 20)
        # Any, since only half of it is typed. When a chunk ends is said here.
        self._writer: Any = Writer(sink, chunk_size=64 * CHUNK)
        self._topics = Topics(contents.head)
        self._channels: dict[str, int] = {}
        self._counts: Counter[str] = Counter()
        self._chunk: Counter[str] = Counter()  # messages in the chunk in progress
        self._untold: Counter[str] = Counter()  # messages lost of which the record does not tell yet
        self._reasons: dict[str, None] = {}
        self._holes = False  # of which the library does not know, so that the index that it would write is wrong
        self._size = self._index = 0
        self._t = 0.0

    @property
    def why(self) -> str:
        """Why something is missing: every reason that there was, once."""
        return "; ".join(self._reasons)

    def begin(self) -> None:
        """Write what stands at the beginning. Raises OSError where that cannot be."""
        writer, head = self._writer, self._contents.head
        writer.start(profile="missiontree", library="missiontree")
        began = self._topics.epoch.nanoseconds(0.0)
        writer.add_metadata(METADATA, {**head.versions, "seed": str(head.seed), "format": str(head.format)})
        writer.add_metadata(FILES, dict(head.paths))
        for name, data in self._contents.files.items():
            writer.add_attachment(began, began, name, "application/octet-stream", data)
        if self._contents.tree:
            writer.add_attachment(began, began, TREE, "application/json", self._contents.tree)
        # All channels stand in the first chunk, so that no chunk that may be lost has one that another needs.
        for topic, name in SCHEMAS.items():
            data = schema(name)
            number = writer.register_schema(name, "jsonschema", data)
            self._channels[topic] = writer.register_channel(topic, "json", number)
            self._index += len(data) + OVERHEAD
        self._put(self._topics.first())
        self.flush()
        if self._sink.trouble is not None:
            raise self._sink.trouble

    def add(self, item: object) -> None:
        """Write an item; once the limit is reached, none."""
        if isinstance(item, Missed):
            self._lose(Counter(item.counts), item.why)
        elif self.ended is None:
            for message in self._topics.messages(item):
                self._put(message)
            if self._size > self._most:
                self.flush()

    def refuse(self, item: object, why: str) -> None:
        """Count an item as lost that cannot be written."""
        self._lose(Counter({topic_of(item): 1}), why)

    def sync(self) -> None:
        """Wait until what was written is on the disk. What goes wrong with that, the next flush is told too."""
        with suppress(OSError):
            self._sink.sync()

    def flush(self) -> None:
        """Bring the chunk in progress to the file, or count what was in it as lost."""
        if self.ended is not None:
            return
        telling, self._untold = self._untold, Counter()
        if telling:
            self._put(self._topics.lost(self._t, telling, self.why))
        if not self._chunk:
            return
        self._topics.forget()
        self._writer.flush()
        chunk, self._chunk, self._size = self._chunk, Counter(), 0
        self._index += OVERHEAD * (2 + len(chunk))
        trouble = self._sink.trouble
        self.failing = trouble is not None
        if trouble is None:
            self._counts += chunk
        else:
            self._holes = True
            del chunk[LOST]
            self._untold = telling
            self._lose(chunk, trouble.strerror or str(trouble))
        if self._sink.good + self._index + self._most > self._limit:
            self.ended = self._t
            self._writer.add_metadata(LIMIT, {"t": f"{self._t:.3f}", "bytes": f"{self._limit:.0f}"})

    def close(self) -> Written:
        """Close the record as far as that is possible; return what became of it. Once."""
        self.flush()
        if self._untold:
            self.flush()  # for what was lost there was no room, but there may be for the news of it
        whole = not self._holes
        if whole:
            self._writer.finish()
            self._sink.flush()
            whole = self._sink.trouble is None
        return Written(dict(self._counts), dict(self.lost), self.why, whole, self.ended)

    def _put(self, message: Message) -> None:
        topic, t, data = message
        time, number = self._topics.epoch.nanoseconds(t), self._counts[topic] + self._chunk[topic]
        self._writer.add_message(self._channels[topic], time, data, time, number)
        self._chunk[topic] += 1
        self._size += len(data) + OVERHEAD
        self._t = max(self._t, t)

    def _lose(self, counts: Counter[str], why: str) -> None:
        self.lost += counts
        self._untold += counts
        self._reasons[why] = None
