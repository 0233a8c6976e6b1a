"""A head of two joints of a robot of ROS 2, led in small steps by their own topics."""

from drivers.joints_head import NeckDriver
from drivers.ros2.joints import TopicJoints


class Ros2Head(NeckDriver):
    """A ``JointsHead`` that steps itself, and opens and closes the ``TopicJoints`` that it is made of."""

    _joints: TopicJoints

    def open(self) -> None:
        """Start looking for its topics; returns at once."""
        self._joints.open()
        super().open()

    def close(self) -> None:
        """Stand where it is, and listen no more. Safe from any state, more than once."""
        super().close()
        self._joints.close()

    @property
    def latched(self) -> str:
        """Why it moves no more until it is enabled; empty while it does."""
        return self._joints.latched

    def enable(self) -> None:
        """Let it move again, after it was away for long."""
        self._joints.enable()
