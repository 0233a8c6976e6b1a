"""A recorder of the nodes of ROS 2."""

from drivers.api import GoalState, Progress, Reading, Ros2
from drivers.api.ros2 import Place
from drivers.clock import ManualClock
from missions.testing.recorders.spy import STOP, Spy, none


class RecordedRos2(Spy):
    """Keeps what was begun, called, sent and cancelled.

    ``comes`` is how far every request has come, ``says`` the newest messages by topic, ``nav2`` whether there is Nav2.
    """

    protocol = Ros2

    def __init__(self, clock: ManualClock) -> None:
        super().__init__("ros2", clock)
        self.nav2 = False
        self.comes = Progress(GoalState.RUNNING)
        self.says: dict[str, Reading[str]] = {}

    def navigates(self) -> bool:
        """Whether there is Nav2."""
        return self.nav2

    def offers(self, name: str) -> bool:
        """Whether there is anything."""
        return self.does(name)

    def does(self, action: str) -> bool:
        """Whether there is anything."""
        del action
        return self.nav2

    def nodes(self) -> int:
        """One node."""
        return 1

    def latest(self, topic: str) -> Reading[str]:
        """Return what the test says of a topic."""
        return self.says.get(topic, none())

    def progress(self, number: int) -> Progress:
        """Return how far all have come."""
        del number
        return self.comes

    def publish(self, topic: str, kind: str, values: str) -> None:
        """Keep a message."""
        self.keep(("publish", topic, kind, values))

    def call(self, service: str, kind: str, values: str) -> int:
        """Keep a call."""
        self.keep(("call", service, kind, values))
        return len(self.commands)

    def begin(self, action: str, kind: str, goal: str) -> int:
        """Keep a goal."""
        self.keep(("begin", action, kind, goal))
        return len(self.commands)

    def navigate(self, places: tuple[Place, ...], frame: str) -> int:
        """Keep the places."""
        self.keep(("navigate", places, frame))
        return len(self.commands)

    def cancel(self, number: int) -> None:
        """Keep that a request is cancelled."""
        self.keep_anyway(("cancel", number))

    def stop(self) -> None:
        """Keep that all are."""
        self.keep_anyway(STOP)
