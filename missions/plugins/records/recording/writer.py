"""Writer of records, chunk by chunk.

Each chunk is decodable alone, and is written completely or not at all. Failed messages are counted, and the counts are
written to the record as soon as it is writable again.
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

from drivers.api import COMMAND_TIMEOUT, ZERO_VELOCITY, BaseState, HeadPose, JointState, RangeScan, Reading, Velocity
from drivers.api.joints import qualified_joint_name
from missions.codec import number
from missions.executive.tick_record import TickRecord
from missions.plugins.records.recording import foxglove
from missions.plugins.records.recording.foxglove import Epoch, Json
from missions.plugins.records.recording.items import (
    EVENT_TOPICS,
    FeedbackItem,
    HealthItem,
    LossItem,
    OpaqueValue,
    PictureItem,
    ViewItem,
    topic_of,
)
from missions.plugins.records.recording.record_header import (
    FILES_METADATA,
    LIMIT_METADATA,
    TREE_ATTACHMENT,
    VERSIONS_METADATA,
    RecordContents,
    RecordHeader,
)
from missions.plugins.records.recording.schemas import schema
from missions.plugins.records.recording.tagged_values import dumps, tag_value, to_json
from missions.plugins.records.recording.tick_codec import TickEncoder
from perception.api import Gaze, View

# The states of the robot's parts, for plots and people.
#
# Tick records hold all replies exactly already. So states are sampled: at least ``STATE_INTERVAL`` seconds apart, and
# ``UNCHANGED_INTERVAL`` seconds apart while a part repeats the same state.

STATE_INTERVAL = 0.1
"""Minimum seconds between two recorded states of one part of the robot."""

TRANSFORM_INTERVAL = 0.05
"""Minimum seconds between two recorded transforms of one coordinate frame."""


UNCHANGED_INTERVAL = 0.5
"""Minimum seconds between two recorded states of one part that are equal."""


class PartStateMessage(NamedTuple):
    """A state message of a part to write to the record: topic, time (s) and content."""

    topic: str
    t: float
    data: Json


class StateSampler:
    """Samples the states of a robot's parts from tick records. ``eye`` is the position of the robot's camera (m)."""

    def __init__(self, epoch: Epoch, eye: tuple[float, float, float]) -> None:
        self._epoch = epoch
        self._eye = eye
        self._sent_at: dict[str, float] = {}  # last message time by topic and frame
        self._stamps: dict[str, float] = {}  # measurement time of that message
        self._values: dict[str, object] = {}  # content of that message
        self._requested = self._applied = ZERO_VELOCITY
        self._driven_at = float("-inf")
        self._head_goal: HeadPose | None = None

    def sample(self, tick_record: TickRecord) -> Iterator[PartStateMessage]:
        """Yield the state messages to write for the replies of the parts in a tick record."""
        newest: dict[tuple[str, str], object] = {}
        for part, what, arguments, value in tick_record.answers:
            newest[part, what] = value
            self._track_command(tick_record.t, part, what, arguments, value)
        joints: dict[str, object] = {}
        for (part, what), value in newest.items():
            if what == "states" and isinstance(value, Mapping):
                joints |= {qualified_joint_name(part, name): state for name, state in value.items()}
            match value:
                case Reading(value=BaseState() as state) as reading:
                    yield from self._base_messages(tick_record.t, reading.stamp, str(reading.quality), state)
                case Reading(value=HeadPose() as pose) as reading if part == "head":
                    yield from self._head_messages(tick_record.t, reading.stamp, str(reading.quality), pose)
                case Reading(value=RangeScan() as scan) if self._accept(
                    "/scan", tick_record.t, scan.stamp, scan.number
                ):
                    yield PartStateMessage(
                        "/scan", tick_record.t, foxglove.scan_message(self._epoch.stamp(scan.stamp), scan)
                    )
        yield from self._arm_messages(tick_record.t, joints)

    def _track_command(self, t: float, part: str, name: str, arguments: tuple[object, ...], value: object) -> None:
        """Store the setpoint that a command sends to a part, for later state messages."""
        match part, name, value:
            case "base", "drive", Velocity():
                argument = arguments[0]
                self._requested = argument if isinstance(argument, Velocity) else value
                self._applied, self._driven_at = value, t
            case "base", "stop" | "latch" | "rest", _:
                self._requested = self._applied = ZERO_VELOCITY
            case "head", "look", HeadPose():
                self._head_goal = value

    def _base_messages(self, t: float, stamp: float, quality: str, state: BaseState) -> Iterator[PartStateMessage]:
        pose = state.pose
        if foxglove.is_finite(pose.x, pose.y, pose.heading) and self._accept(
            "odom", t, stamp, pose, TRANSFORM_INTERVAL
        ):
            at = self._epoch.stamp(stamp)
            yield PartStateMessage("/tf", t, foxglove.base_transform(at, pose))
            yield PartStateMessage("/base/pose", t, foxglove.pose_message(at, pose))
        commanded = t - self._driven_at <= COMMAND_TIMEOUT
        wanted, given = (self._requested, self._applied) if commanded else (ZERO_VELOCITY, ZERO_VELOCITY)
        if self._accept("/state/base", t, stamp, (quality, state, wanted, given)):
            numbers = {
                "x": pose.x,
                "y": pose.y,
                "heading": pose.heading,
                "speed": state.velocity.linear,
                "turn": state.velocity.angular,
                "requested_speed": wanted.linear,
                "requested_turn": wanted.angular,
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
            yield PartStateMessage(
                "/state/base", t, {**head, **{name: number(value) for name, value in numbers.items()}, **words}
            )

    def _head_messages(self, t: float, stamp: float, quality: str, pose: HeadPose) -> Iterator[PartStateMessage]:
        if foxglove.is_finite(pose.pan, pose.tilt) and self._accept("camera", t, stamp, pose, TRANSFORM_INTERVAL):
            gaze = Gaze(pose.pan, pose.tilt)
            yield PartStateMessage("/tf", t, foxglove.camera_transform(self._epoch.stamp(stamp), self._eye, gaze))
        wanted = self._head_goal
        if self._accept("/state/head", t, stamp, (quality, pose, wanted)):
            yield PartStateMessage(
                "/state/head",
                t,
                {
                    "t": t,
                    "stamp": stamp,
                    "quality": quality,
                    "pan": number(pose.pan),
                    "tilt": number(pose.tilt),
                    "requested_pan": None if wanted is None else number(wanted.pan),
                    "requested_tilt": None if wanted is None else number(wanted.tilt),
                },
            )

    def _arm_messages(self, t: float, states: Mapping[str, object]) -> Iterator[PartStateMessage]:
        joints = {
            name: {"stamp": reading.stamp, "quality": str(reading.quality), **_fields(reading.value)}
            for name, reading in states.items()
            if isinstance(reading, Reading) and isinstance(reading.value, JointState)
        }
        stamp = max((reading.stamp for reading in states.values() if isinstance(reading, Reading)), default=0.0)
        if joints and self._accept("/state/arm", t, stamp, joints):
            yield PartStateMessage("/state/arm", t, {"t": t, "joints": joints})

    def _accept(self, key: str, t: float, stamp: float, value: object, interval: float = STATE_INTERVAL) -> bool:
        """Return whether to record a part's state now; if so, remember it as recorded.

        A state with the same ``stamp`` is not recorded twice. After one state, the next is recorded after ``interval``
        (s), or later if its value is unchanged.
        """
        if self._stamps.get(key) == stamp:
            return False
        # A tick may come early by up to a tenth of the interval.
        wait = UNCHANGED_INTERVAL if self._values.get(key) == value else interval
        if t < self._sent_at.get(key, float("-inf")) + 0.9 * wait:
            return False
        self._sent_at[key], self._stamps[key], self._values[key] = t, stamp, value
        return True


def _fields(state: JointState) -> Json:
    fields = to_json(state)
    return fields if isinstance(fields, dict) else {}


# Output file that is written in complete chunks only.


class ChunkSink(BytesIO):
    """Buffer that ``flush`` writes to the file descriptor ``fd`` completely or not at all.

    If the disk is full, the file reaches a size limit, or an I/O error occurs, the buffer is lost, and the file stays
    as after the last successful flush. ``error`` has the exception of the newest flush. Positions are those in the
    file. The sink never closes ``fd``.
    """

    def __init__(self, fd: int) -> None:
        super().__init__()
        self.written_bytes = 0
        """Number of bytes in the file."""
        self.error: OSError | None = None
        self._fd = fd

    def tell(self) -> int:
        """Return the file position of the next byte."""
        return self.written_bytes + super().tell()

    def flush(self) -> None:
        """Write the buffer to the file; never raises."""
        left = memoryview(self.getvalue())
        size = len(left)
        self.seek(0)
        self.truncate()
        self.error = None
        try:
            while left:
                left = left[os.write(self._fd, left) :]
        except OSError as error:
            self.error = error
            os.ftruncate(self._fd, self.written_bytes)
            os.lseek(self._fd, self.written_bytes, os.SEEK_SET)
        else:
            self.written_bytes += size

    def sync(self) -> None:
        """Wait until the file is on the disk. Raises OSError."""
        os.fdatasync(self._fd)


# Conversion of items to messages.
#
# Messages are JSON; ours have ``t`` in seconds of the run. Their schemas are in
# ``missions.plugins.records.recording.schemas``. Events have the fields of ``missions.executive.events``.

TOPIC_SCHEMAS: Mapping[str, str] = {
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
"""Name of the JSON Schema of the messages on each topic of a record."""

MAX_KEPT_VIEWS = 16
"""Number of recent views that are kept until their pictures arrive, which takes longer because of JPEG encoding."""


class RecordMessage(NamedTuple):
    """A message to write to the record: topic, time (s) and bytes."""

    topic: str
    t: float
    data: bytes


class MessageBuilder:
    """Builds the messages of a record from the items that a run sends.

    It remembers earlier items, since a message need not repeat an unchanged reply.
    """

    def __init__(self, header: RecordHeader) -> None:
        self.epoch = Epoch(round(datetime.fromisoformat(header.started).timestamp() * 1e6) * 1000)
        self._header = header
        self._tick_encoder = TickEncoder()
        self._state_sampler = StateSampler(self.epoch, header.eye)
        self._views: dict[float, View] = {}

    def reset(self) -> None:
        """Forget the replies already written, so that the following messages can be decoded without earlier ones."""
        self._tick_encoder.reset()

    def header_message(self) -> RecordMessage:
        """Return the first message of a record."""
        return RecordMessage("/mission", 0.0, dumps(to_json(self._header)))

    def loss_message(self, t: float, counts: Mapping[str, int], reason: str) -> RecordMessage:
        """Return the message with the ``counts`` of lost messages by topic, and the reason."""
        return RecordMessage("/lost", t, dumps({"t": t, "counts": dict(counts), "why": reason}))

    def messages(self, item: Any) -> Iterator[RecordMessage]:
        """Yield the messages that store an item of the run in the record."""
        match item:
            case TickRecord():
                yield RecordMessage("/moments", item.t, self._tick_encoder.encode(item))
                for topic, t, data in self._state_sampler.sample(item):
                    yield RecordMessage(topic, t, dumps(data))
            case ViewItem():
                yield from self._view_messages(item)
            case PictureItem():
                yield from self._picture_messages(item)
            case HealthItem():
                devices = {name: to_json(health) for name, health in item.health.items()}
                yield RecordMessage("/state/devices", item.t, dumps({"t": item.t, "devices": devices}))
            case FeedbackItem():
                yield RecordMessage("/feedback", item.t, dumps(item._asdict()))
            case OpaqueValue() if type(item).__name__ == "Logged":
                yield self._log_message(**vars(item))
            case OpaqueValue():
                topic, values = EVENT_TOPICS[type(item).__name__], vars(item)
                yield RecordMessage(
                    topic, values["t"], dumps({name: tag_value(value) for name, value in values.items()})
                )

    def _view_messages(self, item: ViewItem) -> Iterator[RecordMessage]:
        view = item.view
        if view.looked is not None:
            self._views[view.looked] = view
            while len(self._views) > MAX_KEPT_VIEWS:
                del self._views[next(iter(self._views))]
        written = to_json(view)
        yield RecordMessage("/percepts", item.t, dumps({"t": item.t, **(written if isinstance(written, dict) else {})}))

    def _picture_messages(self, picture: PictureItem) -> Iterator[RecordMessage]:
        stamp, gaze = self.epoch.stamp(picture.t), picture.gaze
        looked = None if gaze is None else {"yaw": number(gaze.yaw), "pitch": number(gaze.pitch)}
        image = foxglove.image_message(stamp, picture.jpeg)
        yield RecordMessage("/camera", picture.t, dumps({**image, "t": picture.t, "gaze": looked}))
        view = self._views.pop(picture.t, None)
        if view is not None:
            yield RecordMessage("/camera/marks", picture.t, dumps(foxglove.annotations_message(stamp, view)))

    def _log_message(self, t: float, level: str, text: str) -> RecordMessage:
        line = foxglove.log_message(self.epoch.stamp(t), level, text, self._header.file)
        return RecordMessage("/log", t, dumps({**line, "t": t, "kind": level}))


MAX_CHUNK_BYTES = 1_000_000
"""Size of the messages of a chunk, in bytes, from which on the chunk is written."""

MESSAGE_OVERHEAD = 64
"""Estimated bytes of a message in the file in addition to its content, and of each topic of a chunk in the index."""

LOST_TOPIC = "/lost"
"""Topic of messages that count lost messages."""


@dataclass(frozen=True, slots=True)
class WriteResult:
    """Result of writing a record: counts of written and lost messages by topic, and the reason of losses.

    ``whole`` is True if the record was closed. ``ended`` is the time (s) at which the record reached its size limit, or
    None.
    """

    counts: Mapping[str, int] = field(default_factory=dict)
    lost: Mapping[str, int] = field(default_factory=dict)
    why: str = ""
    whole: bool = False
    ended: float | None = None


class RecordWriter:
    """Writes one record of at most ``limit`` bytes. Not thread-safe.

    ``limit_reached_at`` is the time (s) at which the record reached its limit, or None; ``lost`` counts lost messages
    by topic. ``is_failing`` is True if the last write to the disk failed. Only ``begin`` raises disk errors; other
    methods count the messages as lost. A record that lost a chunk has no index and needs a repair.
    """

    def __init__(self, sink: ChunkSink, contents: RecordContents, *, limit: float = float("inf")) -> None:
        self.limit_reached_at: float | None = None
        self.is_failing = False
        self.lost: Counter[str] = Counter()
        self._sink = sink
        self._contents = contents
        self._limit = limit
        self._max_chunk_bytes = min(MAX_CHUNK_BYTES, limit / 20)
        # Any: the mcap writer is only partly typed. The chunk size is huge, since ``flush`` ends chunks.
        # Its default compression of chunks is zstd.
        self._writer: Any = Writer(sink, chunk_size=64 * MAX_CHUNK_BYTES)
        self._builder = MessageBuilder(contents.header)
        self._channels: dict[str, int] = {}
        self._counts: Counter[str] = Counter()
        self._chunk_counts: Counter[str] = Counter()
        self._unrecorded_losses: Counter[str] = Counter()  # lost messages that the record does not count yet
        self._reasons: dict[str, None] = {}
        self._has_gaps = False  # unknown to the mcap writer, so its index would be wrong
        self._chunk_bytes = self._index_bytes = 0
        self._last_time = 0.0

    @property
    def loss_reason(self) -> str:
        """All reasons for which messages were lost, each once."""
        return "; ".join(self._reasons)

    def begin(self) -> None:
        """Write the files, header and schemas of the record. Raises OSError."""
        writer, head = self._writer, self._contents.header
        writer.start(profile="missiontree", library="missiontree")
        began = self._builder.epoch.nanoseconds(0.0)
        writer.add_metadata(VERSIONS_METADATA, {**head.versions, "seed": str(head.seed), "format": str(head.format)})
        writer.add_metadata(FILES_METADATA, dict(head.paths))
        for name, data in self._contents.files.items():
            writer.add_attachment(began, began, name, "application/octet-stream", data)
        if self._contents.tree:
            writer.add_attachment(began, began, TREE_ATTACHMENT, "application/json", self._contents.tree)
        # Define all channels in the first chunk: later chunks may be lost without harm to others.
        for topic, name in TOPIC_SCHEMAS.items():
            data = schema(name)
            number = writer.register_schema(name, "jsonschema", data)
            self._channels[topic] = writer.register_channel(topic, "json", number)
            self._index_bytes += len(data) + MESSAGE_OVERHEAD
        self._write_message(self._builder.header_message())
        self.flush()
        if self._sink.error is not None:
            raise self._sink.error

    def add(self, item: object) -> None:
        """Write the messages of an item of the run; ignored after the size limit is reached."""
        if isinstance(item, LossItem):
            self._count_losses(Counter(item.counts), item.reason)
        elif self.limit_reached_at is None:
            for message in self._builder.messages(item):
                self._write_message(message)
            if self._chunk_bytes > self._max_chunk_bytes:
                self.flush()

    def reject(self, item: object, reason: str) -> None:
        """Count the messages of ``item``, which cannot be written, as lost for this reason."""
        self._count_losses(Counter({topic_of(item): 1}), reason)

    def sync(self) -> None:
        """Wait until all written chunks are on the disk; the next flush reports errors."""
        with suppress(OSError):
            self._sink.sync()

    def flush(self) -> None:
        """Write the current chunk to the file, or count its messages as lost."""
        if self.limit_reached_at is not None:
            return
        telling, self._unrecorded_losses = self._unrecorded_losses, Counter()
        if telling:
            self._write_message(self._builder.loss_message(self._last_time, telling, self.loss_reason))
        if not self._chunk_counts:
            return
        self._builder.reset()
        self._writer.flush()
        chunk, self._chunk_counts, self._chunk_bytes = self._chunk_counts, Counter(), 0
        self._index_bytes += MESSAGE_OVERHEAD * (2 + len(chunk))
        trouble = self._sink.error
        self.is_failing = trouble is not None
        if trouble is None:
            self._counts += chunk
        else:
            self._has_gaps = True
            del chunk[LOST_TOPIC]
            self._unrecorded_losses = telling
            self._count_losses(chunk, trouble.strerror or str(trouble))
        if self._sink.written_bytes + self._index_bytes + self._max_chunk_bytes > self._limit:
            self.limit_reached_at = self._last_time
            self._writer.add_metadata(LIMIT_METADATA, {"t": f"{self._last_time:.3f}", "bytes": f"{self._limit:.0f}"})

    def close(self) -> WriteResult:
        """Close the record as far as possible; return the result. Call it once."""
        self.flush()
        if self._unrecorded_losses:
            self.flush()  # the lost chunk did not fit, but the count of its losses may
        whole = not self._has_gaps
        if whole:
            self._writer.finish()
            self._sink.flush()
            whole = self._sink.error is None
        return WriteResult(dict(self._counts), dict(self.lost), self.loss_reason, whole, self.limit_reached_at)

    def _write_message(self, message: RecordMessage) -> None:
        topic, t, data = message
        time, number = self._builder.epoch.nanoseconds(t), self._counts[topic] + self._chunk_counts[topic]
        self._writer.add_message(self._channels[topic], time, data, time, number)
        self._chunk_counts[topic] += 1
        self._chunk_bytes += len(data) + MESSAGE_OVERHEAD
        self._last_time = max(self._last_time, t)

    def _count_losses(self, counts: Counter[str], reason: str) -> None:
        self.lost += counts
        self._unrecorded_losses += counts
        self._reasons[reason] = None
