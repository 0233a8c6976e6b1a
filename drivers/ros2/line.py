"""The line from a part to its topics of ROS 2, in the form of a port: a ``drivers.transport.link.Link`` owns it.

What goes along it are frames (``drivers.ros2.wire.frame``): of a channel, which is a topic, or about who is there.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from threading import Condition

from drivers.api import Report
from drivers.errors import NotConnected
from drivers.ros2 import wire
from drivers.ros2.node import Node, hint_for
from drivers.ros2.publisher import Publisher, Sieve
from drivers.ros2.types import types
from drivers.transport.link import Link, Port
from drivers.transport.loop import MakeLoop, ThreadLoop

RETRY = 0.1
"""Seconds until a session that is not there yet is looked for again."""

BAUD = 7447
"""What stands where other lines have a rate: the port of Zenoh's routers."""

Nodes = Callable[[str], Node]
"""Returns the node, for somebody. Raises NotConnected while there is none."""


@dataclass(frozen=True, slots=True)
class Channel:
    """A topic of a part: its full name, the types that it may have, the best first, and whether the part sends on it.

    ``depth`` is how many messages wait for the part at most: the newest.
    """

    topic: str
    kinds: tuple[str, ...]
    sends: bool = False
    depth: int = 10


def link(name: str, nodes: Nodes, channels: Sequence[Channel], report: Report, loop: MakeLoop = ThreadLoop) -> Link:
    """Return the link of a part to its topics, whose numbers are their places."""

    def dial(who: str, port: str, baud: int) -> Port:
        del port, baud
        return TopicPort(nodes(who), channels)

    where = next((each.topic for each in channels), "")
    return Link(name, where, BAUD, retry=RETRY, report=report, dial=dial, loop=loop)


class TopicPort:
    """A ``drivers.transport.link.Port`` to topics. Raises NotConnected for a type that is not known."""

    def __init__(self, node: Node, channels: Sequence[Channel]) -> None:
        self._node, self._channels = node, channels
        self._changed = Condition()
        self._waiting = [deque[bytes](maxlen=each.depth) for each in channels]
        self._said: deque[bytes] = deque()
        self._senders: dict[int, list[Publisher]] = {}  # by channel and type, as frames have them
        self._there: dict[int, tuple[str, ...]] = {}
        self._mismatches: dict[int, str] = {}
        self._bridges: dict[int, int] = {}  # how many bridges send on a channel, which messages do not tell
        self._sieves: dict[int, list[Sieve]] = {}
        self._version = -1
        self._finder = wire.FrameFinder()
        for number, each in enumerate(channels):
            types().warm(*each.kinds)
            if not each.sends:
                self._sieves[number] = node.subscribe(each.topic, each.kinds, self._hear(number), self)

    def arrived(self, patience: float) -> bytes:
        """Return the frames that have come; wait up to ``patience`` seconds for the first. Raises OSError if lost."""
        self._look()
        with self._changed:
            if not (self._said or any(self._waiting)):
                self._changed.wait(patience)
            found = list(self._said)
            self._said.clear()
            for each in self._waiting:
                found += each
                each.clear()
        if self._node.lost:
            raise OSError(f"{self._channels[0].topic}: the session of Zenoh has gone")
        return b"".join(found)

    def write(self, data: bytes) -> None:
        """Send frames; those for nobody are dropped, as a topic drops them. Raises OSError if the session is lost."""
        if self._node.lost:
            raise OSError(f"{self._channels[0].topic}: the session of Zenoh has gone")
        for channel, payload in self._finder.feed(data):
            if channel == wire.ABOUT:
                self._version = -1
                self._there.clear()
                self._mismatches.clear()
            for sender in self._senders.get(channel, ()):
                sender.send(payload)

    def set_dtr(self, *, on: bool) -> None:
        """Do nothing: there are no modem lines."""

    def close(self) -> None:
        """Listen no more."""
        self._node.forget(self)

    def _hear(self, number: int) -> Callable[[str, bytes], None]:
        def heard(kind: str, payload: bytes) -> None:
            with self._changed:
                if kind not in self._there.get(number, ()):
                    self._say(number, (kind,))
                self._waiting[number].append(wire.frame(number, payload))
                self._changed.notify()

        return heard

    def _look(self) -> None:
        """Tell who is there, as that changes: who listens, with which types, and how many are heard."""
        if self._version != self._node.version:
            self._version = self._node.version
            for number, channel in enumerate(self._channels):
                self._find(number, channel)
        now = self._node.now()
        for number, sieves in self._sieves.items():
            with self._changed:
                if there := self._there.get(number):
                    senders = sum(each.senders(now) for each in sieves)
                    self._say(number, there[:1] * max(senders, self._bridges.get(number, 0), 1))

    def _find(self, number: int, channel: Channel) -> None:
        """Look for who is at the other end; all that listen are told, whatever their types and hashes."""
        role = wire.SUBSCRIBER if channel.sends else wire.PUBLISHER
        everybody = self._node.entities(role, channel.topic)
        found = [each for each in everybody if each.kind in channel.kinds]
        for place, kind in enumerate(channel.kinds if channel.sends else ()):
            digests = sorted({each.digest for each in found if each.kind == kind})
            senders = [self._node.publisher(channel.topic, kind, each) for each in digests]
            self._senders[wire.at(number, place)] = senders
        there = {each.kind for each in found}
        self._bridges[number] = len({each.zid for each in found if each.bridged})
        others = sorted({each.kind for each in everybody} - there)
        with self._changed:
            self._say_mismatch(number, channel, others)
            if channel.sends or not there or number not in self._there:
                self._say(number, tuple(kind for kind in channel.kinds if kind in there))

    def _say(self, number: int, kinds: tuple[str, ...]) -> None:
        if self._there.get(number) != kinds:
            self._there[number] = kinds
            self._said.append(wire.about(number, *kinds))

    def _say_mismatch(self, number: int, channel: Channel, others: Sequence[str]) -> None:
        """Tell of other types than those expected, as they come and go."""
        what = "a node listens for" if channel.sends else "a node sends"
        why = f"expected {' or '.join(channel.kinds)}, but {what} {' and '.join(others)}" if others else ""
        if self._mismatches.get(number, "") != why:
            self._mismatches[number] = why
            self._said.append(wire.mismatch(number, why))


def absent(who: str, channel: Channel, why: str = "") -> NotConnected:
    """Say that nobody is there for a channel; or ``why`` who is there is of no use."""
    if why:
        return NotConnected(f"{who}: {why}", hint=hint_for(channel.topic))
    verb = "listens to" if channel.sends else "sends"
    hint = f"`mission ros2 topics` lists what there is; is {channel.topic} right, and its namespace?"
    return NotConnected(f"{who}: nobody {verb} {channel.topic} ({' or '.join(channel.kinds)})", hint=hint)
