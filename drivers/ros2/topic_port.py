"""Port of a part to its ROS 2 topics, for a ``drivers.transport.link.SerialLink``.

The link reads and writes frames (``drivers.ros2.wire.frame``). A frame is a message of one of the topics (channels), or
a control frame about the nodes that publish or subscribe to these topics.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from threading import Condition

from drivers.api import StatusCallback
from drivers.errors import NotConnected
from drivers.ros2 import wire
from drivers.ros2.node import Ros2Node, topic_hint
from drivers.ros2.publisher import MessageFilter, Publisher
from drivers.ros2.types import types
from drivers.transport.link import LinkPort, SerialLink
from drivers.transport.loop import LoopFactory, ThreadLoop

RETRY_INTERVAL = 0.1
"""Seconds between attempts to reach a session."""

ROUTER_PORT = 7447
"""Default port number of Zenoh routers. It is passed to the link as baud rate, which a topic port does not have."""

GetNode = Callable[[str], Ros2Node]
"""Function that returns our ROS 2 node. Its argument is the part named in the error. Raises NotConnected."""


@dataclass(frozen=True, slots=True)
class TopicChannel:
    """A topic of a part: its full name, its possible types (best first), and whether the part sends commands on it.

    ``depth`` is the maximum number of messages in the queue; the oldest are dropped.
    """

    topic: str
    kinds: tuple[str, ...]
    is_command: bool = False
    depth: int = 10


def make_link(
    name: str,
    get_node: GetNode,
    channels: Sequence[TopicChannel],
    report: StatusCallback,
    loop: LoopFactory = ThreadLoop,
) -> SerialLink:
    """Return the link of the part ``name`` to its topics; the number of a channel is its index in ``channels``."""

    def dial(who: str, port: str, baud: int) -> LinkPort:
        del port, baud
        return TopicPort(get_node(who), channels)

    where = next((each.topic for each in channels), "")
    return SerialLink(
        name, where, ROUTER_PORT, retry_interval=RETRY_INTERVAL, report=report, opener=dial, make_loop=loop
    )


class TopicPort:
    """A ``drivers.transport.link.LinkPort`` to the topics ``channels``.

    The constructor raises NotConnected for an unknown type.
    """

    def __init__(self, node: Ros2Node, channels: Sequence[TopicChannel]) -> None:
        self._node, self._channels = node, channels
        self._changed = Condition()
        self._messages = [deque[bytes](maxlen=each.depth) for each in channels]
        self._control_frames: deque[bytes] = deque()
        self._publishers: dict[int, list[Publisher]] = {}  # by channel and type, as in frames
        self._remote_types: dict[int, tuple[str, ...]] = {}
        self._mismatches: dict[int, str] = {}
        self._bridge_counts: dict[int, int] = {}  # number of publishing bridges by channel: messages do not contain it
        self._filters: dict[int, list[MessageFilter]] = {}
        self._version = -1
        self._finder = wire.TopicFrameFinder()
        for number, each in enumerate(channels):
            types().preload(*each.kinds)
            if not each.is_command:
                self._filters[number] = node.subscribe(each.topic, each.kinds, self._message_handler(number), self)

    def read_available(self, timeout: float) -> bytes:
        """Return received frames; wait up to ``timeout`` seconds for one. Raises OSError if the session is lost."""
        self._update_remotes()
        with self._changed:
            if not (self._control_frames or any(self._messages)):
                self._changed.wait(timeout)
            found = list(self._control_frames)
            self._control_frames.clear()
            for each in self._messages:
                found += each
                each.clear()
        if self._node.is_lost:
            raise OSError(f"{self._channels[0].topic}: the session of Zenoh has gone")
        return b"".join(found)

    def write(self, data: bytes) -> None:
        """Send frames; without a subscriber they are dropped. Raises OSError if the session is lost."""
        if self._node.is_lost:
            raise OSError(f"{self._channels[0].topic}: the session of Zenoh has gone")
        for channel, payload in self._finder.feed(data):
            if channel == wire.ABOUT_CHANNEL:
                self._version = -1
                self._remote_types.clear()
                self._mismatches.clear()
            for sender in self._publishers.get(channel, ()):
                sender.send(payload)

    def set_dtr(self, *, on: bool) -> None:
        """Do nothing: there are no modem lines."""

    def close(self) -> None:
        """Unsubscribe."""
        self._node.undeclare(self)

    def _message_handler(self, number: int) -> Callable[[str, bytes], None]:
        def heard(kind: str, payload: bytes) -> None:
            with self._changed:
                if kind not in self._remote_types.get(number, ()):
                    self._announce(number, (kind,))
                self._messages[number].append(wire.frame(number, payload))
                self._changed.notify()

        return heard

    def _update_remotes(self) -> None:
        """Queue control frames if other nodes have begun or ended to publish or subscribe to the topics.

        A frame has the types of the subscribers, or the type of the publishers as often as there are publishers.
        """
        if self._version != self._node.version:
            self._version = self._node.version
            for number, channel in enumerate(self._channels):
                self._find_remotes(number, channel)
        now = self._node.now()
        for number, sieves in self._filters.items():
            with self._changed:
                if there := self._remote_types.get(number):
                    senders = sum(each.sender_count(now) for each in sieves)
                    self._announce(number, there[:1] * max(senders, self._bridge_counts.get(number, 0), 1))

    def _find_remotes(self, number: int, channel: TopicChannel) -> None:
        """Find the nodes that subscribe to (or publish) the topic of a channel, and announce their types.

        Commands are sent to every subscriber, whatever its type hash.
        """
        role = wire.SUBSCRIBER if channel.is_command else wire.PUBLISHER
        everybody = self._node.entities(role, channel.topic)
        found = [each for each in everybody if each.kind in channel.kinds]
        for place, kind in enumerate(channel.kinds if channel.is_command else ()):
            digests = sorted({each.digest for each in found if each.kind == kind})
            senders = [self._node.publisher(channel.topic, kind, each) for each in digests]
            self._publishers[wire.channel_code(number, place)] = senders
        there = {each.kind for each in found}
        self._bridge_counts[number] = len({each.zid for each in found if each.is_bridged})
        others = sorted({each.kind for each in everybody} - there)
        with self._changed:
            self._announce_mismatch(number, channel, others)
            if channel.is_command or not there or number not in self._remote_types:
                self._announce(number, tuple(kind for kind in channel.kinds if kind in there))

    def _announce(self, number: int, kinds: tuple[str, ...]) -> None:
        if self._remote_types.get(number) != kinds:
            self._remote_types[number] = kinds
            self._control_frames.append(wire.about_frame(number, *kinds))

    def _announce_mismatch(self, number: int, channel: TopicChannel, others: Sequence[str]) -> None:
        """Queue a control frame if the types ``others``, which the channel does not support, have changed."""
        what = "a node listens for" if channel.is_command else "a node sends"
        why = f"expected {' or '.join(channel.kinds)}, but {what} {' and '.join(others)}" if others else ""
        if self._mismatches.get(number, "") != why:
            self._mismatches[number] = why
            self._control_frames.append(wire.mismatch_frame(number, why))


def absent_error(part: str, channel: TopicChannel, reason: str = "") -> NotConnected:
    """Return the error for a command topic without a subscriber, or another topic without a publisher.

    ``reason`` is the reason why the existing nodes are unusable; empty if there are none.
    """
    if reason:
        return NotConnected(f"{part}: {reason}", hint=topic_hint(channel.topic))
    role = "subscriber" if channel.is_command else "publisher"
    hint = f"`mission ros2 topics` lists all topics; check {channel.topic} and its namespace"
    return NotConnected(f"{part}: no {role} of {channel.topic} ({' or '.join(channel.kinds)})", hint=hint)
