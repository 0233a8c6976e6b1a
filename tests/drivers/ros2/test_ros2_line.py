"""The line from a part to its topics, with a node that is told by hand who is there."""

from collections.abc import Callable
from typing import Any, cast

from drivers.ros2 import wire
from drivers.ros2.base import ODOMETRY, TWISTS
from drivers.ros2.node import Ros2Node
from drivers.ros2.publisher import MessageFilter
from drivers.ros2.topic_port import TopicChannel, TopicPort
from drivers.ros2.wire import Attachment, Entity

CHANNELS = [TopicChannel("/cmd_vel", TWISTS, is_command=True), TopicChannel("/odom", (ODOMETRY,))]


class Network:
    """A node: ``found`` are the others, ``sent`` is what was sent, by type and hash."""

    is_lost = False

    def __init__(self) -> None:
        self.found = [Entity("MP", 0, "z", "0", "2", "node", "", "/odom", ODOMETRY, "o")]
        self.sent: list[tuple[str, str, bytes]] = []
        self.version, self.time = 0, 5.0
        self.sieve = MessageFilter()
        self.heard: Callable[[str, bytes], None] = lambda kind, payload: None  # noqa: ARG005

    def now(self) -> float:
        return self.time

    def entities(self, role: str, name: str) -> list[Entity]:
        return [each for each in self.found if (each.role, each.name) == (role, name)]

    def listens(self, *there: tuple[str, str]) -> None:
        """Have nodes listen for velocities with these types and hashes, and no others."""
        self.version += 1
        self.found = self.found[:1]
        self.found += [Entity("MS", 0, "z", "0", "1", "node", "", "/cmd_vel", kind, digest) for kind, digest in there]

    def publisher(self, _: str, kind: str, digest: str) -> Any:
        class Sender:
            @staticmethod
            def send(payload: bytes) -> None:
                self.sent.append((kind, digest, payload))

        return Sender()

    def subscribe(self, _name: str, _kinds: Any, heard: Any, *_: Any) -> list[MessageFilter]:
        self.heard = heard
        return [self.sieve]


def said(port: TopicPort) -> dict[int, tuple[str, ...]]:
    """Return what the port tells of its channels now."""
    frames = wire.TopicFrameFinder().feed(port.read_available(0.0))
    return dict(wire.parse_about(payload) for channel, payload in frames if channel == wire.ABOUT_CHANNEL)


def test_message_is_sent_to_subscribers_of_every_type_and_hash() -> None:
    network = Network()
    port = TopicPort(cast(Ros2Node, network), CHANNELS)
    network.listens((TWISTS[1], "RIHS01_a"), (TWISTS[0], "RIHS01_b"), (TWISTS[0], "TypeHashNotSupported"))
    assert said(port)[0] == TWISTS
    port.write(wire.frame(0, b"twist", 0) + wire.frame(0, b"stamped", 1))
    assert network.sent == [
        (TWISTS[0], "RIHS01_b", b"twist"), (TWISTS[0], "TypeHashNotSupported", b"twist"),
        (TWISTS[1], "RIHS01_a", b"stamped"),
    ]  # fmt: skip


def test_late_subscriber_never_receives_messages_of_the_old_type() -> None:
    network = Network()
    port = TopicPort(cast(Ros2Node, network), CHANNELS)
    assert said(port)[0] == ()
    port.write(wire.frame(0, b"twist", 0))
    network.listens((TWISTS[0], "a"))
    assert said(port)[0] == TWISTS[:1]
    network.listens((TWISTS[1], "a"))
    assert said(port)[0] == TWISTS[1:]
    port.write(wire.frame(0, b"twist", 0))  # by who has not heard of that yet
    port.write(wire.frame(0, b"stamped", 1))
    assert network.sent == [(TWISTS[1], "a", b"stamped")]


def test_two_nodes_are_reported_as_two_and_a_restarted_node_as_one() -> None:
    network = Network()
    port = TopicPort(cast(Ros2Node, network), CHANNELS)

    def heard(gid: bytes) -> dict[int, tuple[str, ...]]:
        network.time += 0.1
        network.sieve.accepts(Attachment(round(100 * network.time), 0, gid), network.time)
        network.heard(ODOMETRY, b"")
        return said(port)

    assert heard(b"a")[1] == (ODOMETRY,)
    assert heard(b"b")[1] == (ODOMETRY, ODOMETRY)
    told = [heard(b"b") for _ in range(20)]
    assert [each[1] for each in told if 1 in each] == [(ODOMETRY,)]
