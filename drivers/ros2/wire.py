"""ROS 2 on Zenoh as `rmw_zenoh` has it: keys of topics, liveliness tokens, attachments. And frames on a line to a part.

See docs/design.md of ros2/rmw_zenoh. Nothing here opens anything.
"""

import re
import struct
from dataclasses import dataclass

LIVELINESS_PREFIX = "@ros2_lv"
"""What the keys of liveliness tokens begin with."""

PUBLISHER, SUBSCRIBER, SERVER, CLIENT, NODE = "MP", "MS", "SS", "SC", "NN"
"""The kinds of entities, as tokens have them."""

FEEDBACK, STATUS = "_action/feedback", "_action/status"
SEND, RESULT, CANCEL = "_action/send_goal", "_action/get_result", "_action/cancel_goal"
"""The five end points of an action, after its name."""

CANCEL_KIND = "action_msgs/srv/CancelGoal"

BRIDGE = "zenoh-bridge-ros2dds"
"""What stands for the node, and for the hash of a type, of an entity behind a bridge: see ``drivers.ros2.bridge``."""

DEFAULT_QOS = "::,10:,:,:,,"
"""Reliable, volatile, the last ten kept: what rclcpp calls its default."""

LATCHED_QOS = ":1:,10:,:,:,,"
"""The same, but transient local: who comes later is given what was sent before."""

_UNNAMED = struct.Struct("<qqB")
_NAMED = struct.Struct("<16sq17sq11sB")
_FIELD_NAMES = b"\x0fsequence_number", b"\x10source_timestamp", b"\x0asource_gid"
_FRAME = struct.Struct("<HI")
_NAME = re.compile(r"/?\w+(/\w+)*", re.ASCII)

ABOUT_CHANNEL = 0xFFFF
"""The channel on which a line tells what it has found of the others."""

MISMATCH_CHANNEL = 0xFFFE
"""The channel on which a line tells of another type under the name of a topic."""

_MAX_FRAME_BYTES = 64_000_000
"""Bytes of a frame at most: more is no frame."""


def to_dds_type(name: str) -> str:
    """Return a type as keys have it: "std_msgs/msg/String" is "std_msgs::msg::dds_::String_"."""
    package, kind, word = name.split("/")
    return f"{package}::{kind}::dds_::{word}_"


def from_dds_type(name: str) -> str:
    """Return a type as ROS 2 writes it: the inverse of ``to_dds_type``. Raises ValueError for another form."""
    package, kind, inner, word = name.split("::")
    if inner != "dds_" or not word.endswith("_"):
        raise ValueError(f"{name}: no type of DDS")
    return f"{package}/{kind}/{word[:-1]}"


def topic_key(domain: int, name: str, kind: str = "*", digest: str = "*") -> str:
    """Return the key of a topic or a service; ``kind`` is its type as ``to_dds_type`` gives it, ``digest`` the type's hash."""
    return f"{domain}/{name.strip('/')}/{kind}/{digest}"


def full_name(name: str, namespace: str = "") -> str:
    """Return the full name of a topic: one that does not begin with "/" is within ``namespace``.

    Raises ValueError for what no topic is called: a wildcard of Zenoh would reach those of other robots.
    """
    full = name if name.startswith("/") else f"{namespace.rstrip('/')}/{name}"
    if not is_name(full):
        raise ValueError(f"{full!r:.80} is no name of a topic")
    return full


def is_name(name: str) -> bool:
    """Whether ROS 2 has topics, services and actions of this name."""
    return _NAME.fullmatch(name) is not None


NAME_HINT = "names are of letters, digits and _, with / between, such as /robot1/cmd_vel"
"""What to write."""


@dataclass(frozen=True, slots=True)
class Entity:
    """A node, or an end point of one: ``name`` is its topic or service, ``kind`` its type (as ROS 2 writes it)."""

    role: str
    domain: int
    zid: str
    node_id: str
    number: str
    node: str
    namespace: str = ""
    name: str = ""
    kind: str = ""
    digest: str = ""
    qos: str = ""

    @property
    def token(self) -> str:
        """The key of its liveliness token."""
        own = f"{LIVELINESS_PREFIX}/{self.domain}/{self.zid}/{self.node_id}/{self.number}/{self.role}/%"
        own += f"/{_mangle(self.namespace)}/{self.node}"
        if self.role == NODE:
            return own
        return f"{own}/{_mangle(self.name)}/{to_dds_type(self.kind)}/{self.digest}/{self.qos}"

    @property
    def is_latched(self) -> bool:
        """Whether its durability is transient local, which rmw numbers 1: its last messages are kept for who comes."""
        return self.qos.split(":")[1:2] == ["1"]

    @property
    def is_bridged(self) -> bool:
        """Whether it is behind a bridge to DDS."""
        return self.digest == BRIDGE

    @property
    def key(self) -> str:
        """The key on which it sends or listens."""
        if self.is_bridged:
            return self.name.strip("/")
        return topic_key(self.domain, self.name, to_dds_type(self.kind), self.digest)


def parse_entity(token: str) -> Entity | None:
    """Return whose token that is; None for one that is not understood."""
    parts = token.split("/")
    if len(parts) < 9 or parts[0] != LIVELINESS_PREFIX:
        return None
    _, domain, zid, node_id, number, role, _, namespace, node, *rest = parts
    try:
        told = int(domain)
        if role == NODE:
            return Entity(role, told, zid, node_id, number, node, _demangle(namespace))
        name, kind, digest, *qos = rest
        return Entity(
            role, told, zid, node_id, number, node, _demangle(namespace), _demangle(name), from_dds_type(kind), digest,
            "/".join(qos),
        )  # fmt: skip
    except ValueError:
        return None


def _mangle(name: str) -> str:
    return name.replace("/", "%") or "%"


def _demangle(name: str) -> str:
    return "" if name == "%" else name.replace("%", "/")


@dataclass(frozen=True, slots=True)
class Attachment:
    """What goes with each message: a number that counts up, when it was sent (ns since 1970), and by whom.

    Those of `rmw_zenoh` before 0.2.4 are ``has_names``: each part has its name before it, and must have.
    """

    number: int
    sent_at: int
    gid: bytes
    has_names: bool = False

    def pack(self) -> bytes:
        """Return it as it is on the wire."""
        told = self.number, self.sent_at, len(self.gid)
        if self.has_names:
            return _NAMED.pack(*(each for pair in zip(_FIELD_NAMES, told, strict=True) for each in pair)) + self.gid
        return _UNNAMED.pack(*told) + self.gid


def parse_attachment(data: bytes) -> Attachment | None:
    """Return what was attached; None for what is none."""
    named = data.startswith(_FIELD_NAMES[0])
    form = _NAMED if named else _UNNAMED
    if len(data) <= form.size:
        return None
    *told, length = form.unpack_from(data)
    if named and (told[0], told[2], told[4]) != _FIELD_NAMES:
        return None
    number, sent = told[1::2] if named else told
    return Attachment(number, sent, data[form.size :], named) if length == len(data) - form.size else None


def channel_code(channel: int, kind: int) -> int:
    """Return what stands for a channel, and for the place of a type among those of it, in a frame."""
    return channel | kind << 8


def frame(channel: int, payload: bytes, kind: int = 0) -> bytes:
    """Return a message of a channel as it is on the line between a part and its session.

    ``kind`` as in ``channel_code``.
    """
    return _FRAME.pack(channel_code(channel, kind), len(payload)) + payload


def about_frame(channel: int, *kinds: str) -> bytes:
    """Return the frame that tells of a channel: the types of those who are there, nothing for nobody."""
    return frame(ABOUT_CHANNEL, struct.pack("<H", channel) + " ".join(kinds).encode())


def mismatch_frame(channel: int, reason: str) -> bytes:
    """Return the frame that tells of another type under the name of a channel; empty once it is there no more."""
    return frame(MISMATCH_CHANNEL, struct.pack("<H", channel) + reason.encode())


def parse_mismatch(payload: bytes) -> tuple[int, str]:
    """Return the channel and the words of a frame of ``mismatch_frame``. Raises ValueError for what is none."""
    if len(payload) < 2:
        raise ValueError("too short")
    return struct.unpack_from("<H", payload)[0], payload[2:].decode(errors="replace")


DISCOVERY_REQUEST = frame(ABOUT_CHANNEL, b"")
"""Asks who is there, on every channel."""


def parse_about(payload: bytes) -> tuple[int, tuple[str, ...]]:
    """Return the channel and the types of a frame of ``about_frame``. Raises ValueError for what is none."""
    if len(payload) < 2:
        raise ValueError("too short")
    return struct.unpack_from("<H", payload)[0], tuple(payload[2:].decode().split())


class TopicFrameFinder:
    """Cuts what comes along a line into frames: (channel, payload). Overlong ones begin anew."""

    def __init__(self) -> None:
        self._buffer = b""

    def feed(self, data: bytes) -> list[tuple[int, bytes]]:
        """Return the frames that are whole by now."""
        held = self._buffer + data if self._buffer else data
        at, found = 0, []
        while at + _FRAME.size <= len(held):
            channel, length = _FRAME.unpack_from(held, at)
            if length > _MAX_FRAME_BYTES:
                at = len(held)
                break
            end = at + _FRAME.size + length
            if end > len(held):
                break
            found.append((channel, held[at + _FRAME.size : end]))
            at = end
        self._buffer = held[at:]
        return found
