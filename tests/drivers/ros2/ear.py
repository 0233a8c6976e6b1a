"""Who speaks the texts that are sent to a topic of ROS 2."""

from drivers.ros2.line import Channel
from drivers.ros2.make import STRING
from drivers.ros2.types import types
from drivers.ros2.virtual_topics import Topics


class VirtualEar(Topics):
    """What was sent to a topic of texts: ``said`` has it."""

    def __init__(self, topic: str) -> None:
        super().__init__([Channel(topic, (STRING,), sends=True)])
        self.said: list[str] = []

    def _hear(self, channel: int, payload: bytes, now: float) -> None:
        del now
        self.said.append(types().decode(self._kind(channel), payload).data)
