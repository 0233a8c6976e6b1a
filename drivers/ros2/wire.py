"""Wire format of `rmw_zenoh`: keys, liveliness tokens and attachments; and the frames of a topic port.

See docs/design.md of ros2/rmw_zenoh. No I/O.
"""

import re
import struct
from dataclasses import dataclass

LIVELINESS_PREFIX = "@ros2_lv"
"""Prefix of the keys of liveliness tokens."""

PUBLISHER, SUBSCRIBER, SERVER, CLIENT, NODE = "MP", "MS", "SS", "SC", "NN"
"""Roles of entities in tokens."""

FEEDBACK, STATUS = "_action/feedback", "_action/status"
SEND, RESULT, CANCEL = "_action/send_goal", "_action/get_result", "_action/cancel_goal"
"""Suffixes of the five end points of an action."""

CANCEL_KIND = "action_msgs/srv/CancelGoal"

BRIDGE = "zenoh-bridge-ros2dds"
"""Value that marks an entity behind a bridge, as its node and as its type hash; see ``drivers.ros2.bridge``."""

DEFAULT_QOS = "::,10:,:,:,,"
"""Default quality of service, that of rclcpp: reliable, volatile, the last ten messages kept."""

LATCHED_QOS = ":1:,10:,:,:,,"
"""Quality of service of a latched topic, transient local: late subscribers receive earlier messages."""

_UNNAMED = struct.Struct("<qqB")
_NAMED = struct.Struct("<16sq17sq11sB")
_FIELD_NAMES = b"\x0fsequence_number", b"\x10source_timestamp", b"\x0asource_gid"
_FRAME = struct.Struct("<HI")
_NAME = re.compile(r"/?\w+(/\w+)*", re.ASCII)

ABOUT_CHANNEL = 0xFFFF
"""Channel number of control frames about the nodes that publish or subscribe to the topic of a channel."""

MISMATCH_CHANNEL = 0xFFFE
"""Channel number of control frames about nodes that use another type under the name of a topic."""

_MAX_FRAME_BYTES = 64_000_000
"""Maximum size of a frame; larger ones are invalid."""


def to_dds_type(name: str) -> str:
    """Return a ROS 2 type as it is used in Zenoh keys: "std_msgs/msg/String" is "std_msgs::msg::dds_::String_"."""
    package, kind, word = name.split("/")
    return f"{package}::{kind}::dds_::{word}_"


def from_dds_type(name: str) -> str:
    """Return the ROS 2 name of a type in a Zenoh key, as ``to_dds_type`` makes it. Raises ValueError."""
    package, kind, inner, word = name.split("::")
    if inner != "dds_" or not word.endswith("_"):
        raise ValueError(f"{name}: no type of DDS")
    return f"{package}/{kind}/{word[:-1]}"


def topic_key(domain: int, name: str, kind: str = "*", digest: str = "*") -> str:
    """Return the Zenoh key of a topic or a service, with its DDS type ``kind`` and its type hash ``digest``.

    The defaults "*" match any type and hash.
    """
    return f"{domain}/{name.strip('/')}/{kind}/{digest}"


def full_name(name: str, namespace: str = "") -> str:
    """Return the full name of a topic: without a leading "/" it is within ``namespace``.

    Raises ValueError for an invalid name: a wildcard of Zenoh would reach other robots.
    """
    full = name if name.startswith("/") else f"{namespace.rstrip('/')}/{name}"
    if not is_name(full):
        raise ValueError(f"{full!r:.80} is not a valid topic name")
    return full


def is_name(name: str) -> bool:
    """True if the name is valid for ROS 2 topics, services and actions."""
    return _NAME.fullmatch(name) is not None


NAME_HINT = "names consist of letters, digits and _, separated by /, such as /robot1/cmd_vel"
"""Hint for a valid name."""


@dataclass(frozen=True, slots=True)
class Entity:
    """A ROS 2 node, or a topic or service of a node: ``name`` is its topic or service, ``kind`` its ROS 2 type.

    ``role`` tells which, such as publisher or subscriber. ``zid`` is the Zenoh session, ``digest`` the type hash.
    """

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
        """Key of the entity's liveliness token."""
        own = f"{LIVELINESS_PREFIX}/{self.domain}/{self.zid}/{self.node_id}/{self.number}/{self.role}/%"
        own += f"/{_mangle(self.namespace)}/{self.node}"
        if self.role == NODE:
            return own
        return f"{own}/{_mangle(self.name)}/{to_dds_type(self.kind)}/{self.digest}/{self.qos}"

    @property
    def is_latched(self) -> bool:
        """True if late subscribers get the last messages of this publisher (durability "transient local")."""
        return self.qos.split(":")[1:2] == ["1"]

    @property
    def is_bridged(self) -> bool:
        """True if the entity is behind a bridge to DDS."""
        return self.digest == BRIDGE

    @property
    def key(self) -> str:
        """Zenoh key on which the entity sends or receives."""
        if self.is_bridged:
            return self.name.strip("/")
        return topic_key(self.domain, self.name, to_dds_type(self.kind), self.digest)


def parse_entity(token: str) -> Entity | None:
    """Return the entity that a liveliness token announces; None if the token is not understood."""
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
    """Attachment of a message in `rmw_zenoh`: sequence number, send time (ns since 1970), and id of the sender.

    ``has_names`` is True for the form before version 0.2.4, in which the name of each field precedes its value. Sender
    and receiver must use the same form.
    """

    number: int
    sent_at: int
    gid: bytes
    has_names: bool = False

    def pack(self) -> bytes:
        """Return the attachment as bytes."""
        told = self.number, self.sent_at, len(self.gid)
        if self.has_names:
            return _NAMED.pack(*(each for pair in zip(_FIELD_NAMES, told, strict=True) for each in pair)) + self.gid
        return _UNNAMED.pack(*told) + self.gid


def parse_attachment(data: bytes) -> Attachment | None:
    """Return the attachment in ``data``; None if it is invalid."""
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
    """Return the number in a frame for a channel and ``kind``, the index of the message's type in that channel."""
    return channel | kind << 8


def frame(channel: int, payload: bytes, kind: int = 0) -> bytes:
    """Return a message of a channel as a frame. ``kind`` is the index of its type in the channel."""
    return _FRAME.pack(channel_code(channel, kind), len(payload)) + payload


def about_frame(channel: int, *kinds: str) -> bytes:
    """Return a control frame with the types by which nodes publish or subscribe to the topic of ``channel``.

    It has no types if there are no such nodes.
    """
    return frame(ABOUT_CHANNEL, struct.pack("<H", channel) + " ".join(kinds).encode())


def mismatch_frame(channel: int, reason: str) -> bytes:
    """Return a control frame with the reason of a type mismatch on ``channel``; an empty reason ends the mismatch."""
    return frame(MISMATCH_CHANNEL, struct.pack("<H", channel) + reason.encode())


def parse_mismatch(payload: bytes) -> tuple[int, str]:
    """Return channel and reason from the payload of a ``mismatch_frame``. Raises ValueError if malformed."""
    if len(payload) < 2:
        raise ValueError("too short")
    return struct.unpack_from("<H", payload)[0], payload[2:].decode(errors="replace")


DISCOVERY_REQUEST = frame(ABOUT_CHANNEL, b"")
"""Frame that requests control frames about the nodes that publish or subscribe to the topics of all channels."""


def parse_about(payload: bytes) -> tuple[int, tuple[str, ...]]:
    """Return channel and types from the payload of an ``about_frame``. Raises ValueError if malformed."""
    if len(payload) < 2:
        raise ValueError("too short")
    return struct.unpack_from("<H", payload)[0], tuple(payload[2:].decode().split())


class TopicFrameFinder:
    """Splits a stream of bytes into frames; a frame with an invalid size discards the buffered bytes."""

    def __init__(self) -> None:
        self._buffer = b""

    def feed(self, data: bytes) -> list[tuple[int, bytes]]:
        """Add received bytes; return the complete frames, each as channel and payload."""
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
