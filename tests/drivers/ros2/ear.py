"""Who speaks the texts that are sent to a topic of ROS 2."""

from drivers.ros2.make import STRING
from drivers.ros2.topic_port import TopicChannel
from drivers.ros2.types import types
from drivers.ros2.virtual_topics import VirtualTopics


class VirtualEar(VirtualTopics):
    """What was sent to a topic of texts: ``said`` has it."""

    def __init__(self, topic: str) -> None:
        super().__init__([TopicChannel(topic, (STRING,), is_command=True)])
        self.said: list[str] = []

    def _handle_message(self, channel: int, payload: bytes, now: float) -> None:
        del now
        self.said.append(types().decode(self._kind(channel), payload).data)
