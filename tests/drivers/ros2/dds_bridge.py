"""A stand-in for zenoh-bridge-ros2dds: a robot of DDS behind it, by keys and tokens written out here once more.

It is a router, as the bridge is; the robot's devices are those of ``drivers.virtual``. It shares no code for keys and
tokens with the product.
"""

from collections.abc import Callable
from threading import Event, RLock, Thread
from typing import Any

from drivers.clock import SystemClock
from drivers.ros2 import wire
from drivers.ros2.node import TopicFaults
from drivers.ros2.session import ZenohAccess, open_session
from drivers.ros2.virtual import free_address
from drivers.ros2.virtual_topics import VirtualTopics

Asked = Callable[[bytes, Callable[[bytes], None]], None]


def escaped(text: str) -> str:
    return text.strip("/").replace("/", "§")


class DdsBridge:
    """Serves ``devices`` at ``path``. ``heard`` are keys and payloads, ``attached`` what came with any."""

    def __init__(self) -> None:
        self.clock = SystemClock()
        self.devices: list[VirtualTopics] = []
        self.node_setups: list[Callable[[Any], None]] = []
        self.path = free_address()
        self.heard: list[tuple[str, bytes]] = []
        self.attached: list[bytes] = []
        self.faults = TopicFaults("bridge", [], self.clock)
        self._session: Any = None
        self._declared: list[Any] = []
        self._lock, self._ending = RLock(), Event()
        self._thread: Thread | None = None

    # --- life ---------------------------------------------------------------------------------------------------------

    def open(self) -> None:
        self.replug()
        self._ending.clear()
        self._thread = Thread(target=self._run, name="dds bridge", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._ending.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self.unplug()

    def unplug(self) -> None:
        """End the bridge, and with it its router."""
        with self._lock:
            session, self._session = self._session, None
            self._declared.clear()
        if session is not None:
            session.close()

    def replug(self) -> None:
        session = open_session("bridge", ZenohAccess(endpoints=(), mode="router", listen=(self.path,)))
        with self._lock:
            self._session = session
            self.token("")
            for device in self.devices:
                for number, channel in enumerate(device.channels):
                    if channel.is_command:
                        self.subscribes(channel.topic, device._kind(number), self._feeder(device, number))
                    else:
                        self.token(f"MP/{escaped(channel.topic)}/{escaped(device._kind(number))}/:::10,1")
            for serve in self.node_setups:
                serve(self)

    # --- what there is behind it --------------------------------------------------------------------------------------

    def token(self, told: str) -> Any:
        """Announce something."""
        key = f"@/{self._session.zid()}/@ros2_lv" + (f"/{told}" if told else "")
        self._declared.append(self._session.liveliness().declare_token(key))
        return self._declared[-1]

    def subscribes(self, topic: str, kind: str, take: Callable[[bytes], None] = lambda _: None) -> None:
        """Have a node listen to a topic."""

        def heard(sample: Any) -> None:
            payload = bytes(sample.payload)
            self.heard.append((str(sample.key_expr), payload))
            if sample.attachment is not None:
                self.attached.append(bytes(sample.attachment))
            take(payload)

        self._declared.append(self._session.declare_subscriber(topic.strip("/"), heard))
        self.token(f"MS/{escaped(topic)}/{escaped(kind)}/:1::1,10")

    def put(self, topic: str, payload: bytes) -> None:
        """Have a node send a message."""
        self._session.put(topic.strip("/"), payload)

    # --- as ``drivers.ros2.node.Ros2Node`` has it, for the action servers of ``drivers.virtual``

    def serve(self, name: str, kind: str, asked: Asked) -> None:
        action, part, _ = name.partition("/_action/")

        def take(query: Any) -> None:
            if query.attachment is not None:
                self.attached.append(bytes(query.attachment))

            def answer(payload: bytes) -> None:
                with query:
                    query.reply(query.key_expr, payload)

            asked(bytes(query.payload), answer)

        self._declared.append(self._session.declare_queryable(name.strip("/"), take))
        if not part:
            self.token(f"SS/{escaped(name)}/{escaped(kind)}")
        elif kind.endswith("_SendGoal"):
            self.token(f"AS/{escaped(action)}/{escaped(kind.removesuffix('_SendGoal'))}")

    def publisher(self, name: str, kind: str) -> Any:
        del kind
        bridge = self

        class Sender:
            @staticmethod
            def send(payload: bytes) -> None:
                with bridge._lock:
                    if bridge._session is not None:
                        bridge.put(name, payload)

        return Sender()

    # --- the inside ---------------------------------------------------------------------------------------------------

    def _feeder(self, device: VirtualTopics, number: int) -> Callable[[bytes], None]:
        def take(payload: bytes) -> None:
            with self._lock:
                device.feed(wire.frame(number, payload), self.clock.now())

        return take

    def _run(self) -> None:
        finder = wire.TopicFrameFinder()
        while not self._ending.wait(0.005):
            with self._lock:
                now = self.clock.now()
                for device in self.devices:
                    for number, payload in finder.feed(device.poll(now)):
                        if number != wire.ABOUT_CHANNEL and self._session is not None:
                            self.put(device.channels[number].topic, payload)
