"""Protocol of the ROS 2 nodes of a robot: topics, services, and actions such as Nav2's navigation."""

from enum import StrEnum
from typing import Annotated, Protocol

from drivers.api.device import Device, Reading
from drivers.api.fast_dataclass import dataclass
from drivers.api.marks import UNSAMPLED, command

MapPose = tuple[float, float, float]
"""x and y in metres, and a heading in radians, in a frame that is given separately."""

START_FRAME = "start"
"""Name of the frame whose origin is the first reported pose of the base; ``base.x`` and ``base.y`` are in it."""


class GoalState(StrEnum):
    """State of a request to a ROS 2 service or action."""

    SENT = "sent"
    RUNNING = "running"
    CANCELLING = "cancelling"
    SUCCEEDED = "succeeded"
    CANCELLED = "cancelled"
    FAILED = "failed"
    UNKNOWN = "unknown"  # its server is gone, or does not reply


FINAL_STATES = frozenset({GoalState.SUCCEEDED, GoalState.CANCELLED, GoalState.FAILED, GoalState.UNKNOWN})
"""States of a request after which nothing more is received for it."""


@dataclass(frozen=True, slots=True)
class Progress:
    """Progress of a ROS 2 request: state, reason of a failure, latest feedback and result as JSON (or empty)."""

    state: GoalState
    reason: str = ""
    feedback: str = ""
    result: str = ""

    @property
    def is_final(self) -> bool:
        """True if nothing more will be received for the request."""
        return self.state in FINAL_STATES


class Ros2(Device, Protocol):
    """ROS 2 nodes of a robot. Messages are JSON objects with the fields of their type.

    Names that do not begin with "/" are in the robot's namespace. All calls return at once; query the ``progress`` of a
    request by its number.
    """

    def offers(self, name: str) -> bool:
        """Return whether an action, a service or a topic with this name is available now."""
        ...

    def does(self, action: str) -> bool:
        """Return whether an action with this name is available now."""
        ...

    def navigates(self) -> bool:
        """Return whether Nav2 is available."""
        ...

    def latest(self, topic: str) -> Reading[str]:
        """Return the latest message of a topic as JSON.

        The first call subscribes to the topic, so its reading has no value yet.
        """
        ...

    def progress(self, number: int) -> Progress:
        """Return the progress of a request, by its number."""
        ...

    @command("after", moves=True)
    def publish(self, topic: str, kind: str, values: str) -> None:
        """Publish a message with the JSON ``values`` on a topic; ``kind`` is the type of the message.

        Raises BadRequest for values that do not fit the type, and NotConnected.
        """
        ...

    @command("after", moves=True)
    def call(self, service: str, kind: str, values: str) -> int:
        """Call a service and return the number of the request. Raises BadRequest, NotConnected.

        ``values`` is the request as JSON, ``kind`` its type; if ``kind`` is empty, the type that the server announces
        is used.
        """
        ...

    @command("after", moves=True)
    def begin(self, action: str, kind: str, goal: str) -> int:
        """Start an action and return the number of the request. Raises BadRequest, NotConnected.

        ``goal`` is JSON, ``kind`` the type of the action; if ``kind`` is empty, the type that the server announces is
        used.
        """
        ...

    @command("after", moves=True, converters={"places": tuple})
    def navigate(self, places: tuple[MapPose, ...], frame: str) -> int:
        """Start a drive with Nav2 through ``places`` in their order, and return the number of the request.

        ``frame`` is the frame of the places. Raises NotConnected without Nav2.
        """
        ...

    @command("before")
    def cancel(self, number: int) -> None:
        """Cancel an action; ``progress`` reports its end. Safe from any state, more than once."""
        ...

    @command("before")
    def stop(self) -> None:
        """Cancel all actions that this robot started. Safe from any state, more than once."""
        ...

    def nodes(self) -> Annotated[int, UNSAMPLED]:
        """Return the number of other ROS 2 nodes."""
        ...
