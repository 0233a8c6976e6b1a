"""States of all nodes at a given time, computed from the events until that time."""

from collections.abc import Iterable, Mapping

from missions.executive.events import Event, NodeChanged
from missions.trees.drawing import SIGNS, NodeState, Status

STATUSES: Mapping[str, Status] = {status: status for status in SIGNS}
"""Node statuses by their word in run events."""

TIME_TOLERANCE = 1e-6
"""Difference in seconds within which two times are equal, since a sum of ticks differs slightly from a typed time."""


def state_after(change: NodeChanged) -> NodeState:
    """Return the state of a node after ``change``. Raises KeyError for an unknown status."""
    return NodeState(STATUSES[change.status], change.reason, change.t)


class NodeStates:
    """Follows the events of a run. ``by_key`` holds the state of each node; nodes that never ran are missing."""

    def __init__(self) -> None:
        self.by_key: dict[str, NodeState] = {}

    def on_event(self, event: Event) -> None:
        """Update the states of the nodes with an event."""
        if isinstance(event, NodeChanged):
            self.by_key[event.node] = state_after(event)


def states_at(events: Iterable[Event], time: float) -> dict[str, NodeState]:
    """Return the states of all nodes ``time`` seconds into a run, including the events at that time."""
    states = NodeStates()
    for event in events:
        if event.t <= time + TIME_TOLERANCE:
            states.on_event(event)
    return states.by_key
