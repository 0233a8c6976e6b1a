"""What a behaviour sees of the nodes of ROS 2: topics, services, and actions such as driving to a place by Nav2."""

from enum import StrEnum
from typing import Annotated, Protocol

from drivers.api.device import Device, Reading
from drivers.api.fast_dataclass import dataclass
from drivers.api.marks import UNSAMPLED, command

MapPose = tuple[float, float, float]
"""x and y in metres, and a heading in radians: in a frame that is named beside it."""

START_FRAME = "start"
"""The frame of ``base.x`` and ``base.y``: where the base was when it was first heard."""


class GoalState(StrEnum):
    """How far a request has come."""

    SENT = "sent"
    RUNNING = "running"
    CANCELLING = "cancelling"
    SUCCEEDED = "succeeded"
    CANCELLED = "cancelled"
    FAILED = "failed"
    UNKNOWN = "unknown"  # its server has gone, or does not answer


FINAL_STATES = frozenset({GoalState.SUCCEEDED, GoalState.CANCELLED, GoalState.FAILED, GoalState.UNKNOWN})
"""The states after which nothing more comes."""


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a request has come, why it failed, and the newest feedback and the result, as JSON; empty for none."""

    state: GoalState
    reason: str = ""
    feedback: str = ""
    result: str = ""

    @property
    def is_final(self) -> bool:
        """True once nothing more comes."""
        return self.state in FINAL_STATES


class Ros2(Device, Protocol):
    """The nodes of ROS 2 that a robot is made of. Values go as JSON objects with the fields of their type.

    Names that do not begin with "/" are within the robot's namespace. All calls return at once; who has begun something
    asks for its ``progress`` by the number that it was given.
    """

    def offers(self, name: str) -> bool:
        """Whether there is an action, a service or a topic of this name now."""
        ...

    def does(self, action: str) -> bool:
        """Whether there is an action of this name now: neither a service nor a topic."""
        ...

    def navigates(self) -> bool:
        """Whether there is Nav2 to drive by."""
        ...

    def latest(self, topic: str) -> Reading[str]:
        """Return the newest message of a topic: none until it was asked for once, and one has come."""
        ...

    def progress(self, number: int) -> Progress:
        """Return how far a request has come."""
        ...

    @command("after", moves=True)
    def publish(self, topic: str, kind: str, values: str) -> None:
        """Send a message of a type. Raises BadRequest for values that do not fit it, NotConnected."""
        ...

    @command("after", moves=True)
    def call(self, service: str, kind: str, values: str) -> int:
        """Ask a service; an empty ``kind`` is that of who offers it. Raises BadRequest, NotConnected."""
        ...

    @command("after", moves=True)
    def begin(self, action: str, kind: str, goal: str) -> int:
        """Begin an action; an empty ``kind`` is that of who offers it. Raises BadRequest, NotConnected."""
        ...

    @command("after", moves=True, converters={"places": tuple})
    def navigate(self, places: tuple[MapPose, ...], frame: str) -> int:
        """Have Nav2 drive to a place, through others before it. Raises NotConnected where there is no Nav2."""
        ...

    @command("before")
    def cancel(self, number: int) -> None:
        """Cancel an action; ``progress`` says when it has ended. Safe from any state, more than once."""
        ...

    @command("before")
    def stop(self) -> None:
        """Cancel all actions that were begun here. Safe from any state, more than once."""
        ...

    def nodes(self) -> Annotated[int, UNSAMPLED]:
        """Return how many nodes there are besides ours."""
        ...
