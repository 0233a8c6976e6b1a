"""What each node is doing at a moment: the changes of nodes up to then, folded into one status each."""

from collections.abc import Iterable, Mapping

from missions.executive.events import Event, NodeChanged
from missions.trees.drawing import SIGNS, NodeState, Status

STATUSES: Mapping[str, Status] = {status: status for status in SIGNS}
"""The words of events as statuses; no other word is one."""

TIME_TOLERANCE = 1e-6
"""Seconds within which two times are one: a sum of many ticks is a trifle off what a person reads and types."""


def state_after(change: NodeChanged) -> NodeState:
    """Return what a node is doing after ``change``. Raises KeyError for a status that is none."""
    return NodeState(STATUSES[change.status], change.reason, change.t)


class NodeStates:
    """Follows the events of a run. ``by_key`` has what each node is doing, by key; nodes that never ran are not there."""

    def __init__(self) -> None:
        self.by_key: dict[str, NodeState] = {}

    def on_event(self, event: Event) -> None:
        """Follow one event."""
        if isinstance(event, NodeChanged):
            self.by_key[event.node] = state_after(event)


def states_at(events: Iterable[Event], time: float) -> dict[str, NodeState]:
    """Return what each node was doing ``time`` seconds into a run, with all that happened at that very time.

    Time stands still within a tick, so that a tick shows as a whole or not at all. ``events`` of several threads need
    not be in order of time, but those of the nodes must be.
    """
    states = NodeStates()
    for event in events:
        if event.t <= time + TIME_TOLERANCE:
            states.on_event(event)
    return states.by_key
