"""A recorder of the nodes of ROS 2."""

from drivers.api import GoalState, Progress, Reading, Ros2
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

    def does(self, name: str) -> bool:
        """Whether there is anything."""
        del name
        return self.nav2

    offers = does

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

    def call(self, *given: str) -> int:
        """Keep a call."""
        return self._begun("call", given)

    def begin(self, *given: str) -> int:
        """Keep a goal."""
        return self._begun("begin", given)

    def navigate(self, *given: object) -> int:
        """Keep the places."""
        return self._begun("navigate", given)

    def _begun(self, word: str, given: tuple[object, ...]) -> int:
        self.keep((word, *given))
        return len(self.commands)

    def cancel(self, number: int) -> None:
        """Keep that a request is cancelled."""
        self.keep_anyway(("cancel", number))

    def stop(self) -> None:
        """Keep that all are."""
        self.keep_anyway(STOP)
