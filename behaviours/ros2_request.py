"""Base class of leaves that send a request to a ROS 2 node, follow its progress, and cancel it when halted."""

import json
from abc import abstractmethod
from typing import Any

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf
from drivers.api import GoalState, Progress, Ros2
from drivers.errors import DeviceFault

CANCEL_TIMEOUT = 3.0
"""Seconds within which an action must end after a cancel request."""

CANCELLED_STATES = frozenset({GoalState.CANCELLED, GoalState.FAILED})
"""States in which a cancelled action may end; some servers abort it."""


class Ros2RequestLeaf(Leaf):
    """Base class of leaves with one request. ``begin`` sends it; a halt cancels it and waits for its end.

    Running until the request is over; then it succeeds or fails with the request's reason. If no node offers the
    service or action, it waits, as for an unplugged part.
    """

    needs = frozenset({"ros2"})
    halt_limit = 3.0
    _request_number: int | None = None

    def initialise(self) -> None:
        self._request_number = None
        self._request_number = self.begin()

    @abstractmethod
    def begin(self) -> int:
        """Send the request and return its number."""

    def update(self) -> Status:
        if self._request_number is None:
            return self.fail("the request was not sent")
        return self.follow(self._request_number)

    def follow(self, number: int) -> Status:
        """Return the leaf's status for request ``number``: RUNNING with its progress, SUCCESS or FAILURE."""
        progress = self.robot.ros2.progress(number)
        if progress.state is GoalState.SUCCEEDED:
            self.result = parse_json(progress.result)
            return SUCCESS
        if progress.is_final:
            return self.fail(progress.reason or f"it was {progress.state}")
        return self.wait(self.progress_text(progress))

    def progress_text(self, progress: Progress) -> str:
        """Return the progress as a text for people."""
        return f"{progress.state}: {progress.feedback[:80]}" if progress.feedback else str(progress.state)

    def terminate(self, new_status: Status) -> None:
        if self._request_number is not None and new_status is not SUCCESS:
            self.robot.ros2.cancel(self._request_number)

    def halting(self) -> bool:
        return self._request_number is not None and not self.robot.ros2.progress(self._request_number).is_final


def has_ended(nodes: Ros2, number: int, since: float) -> bool:
    """Return True if an action has ended that was cancelled ``since`` seconds ago.

    Raises DeviceFault if it has not ended within CANCEL_TIMEOUT.
    """
    progress = nodes.progress(number)
    if not progress.is_final and since > CANCEL_TIMEOUT:
        raise DeviceFault(f"the action was cancelled {since:.0f} s ago, and has not ended", hint="look at its node")
    return progress.is_final


def parse_json(text: str) -> Any:
    """Return the value of a JSON text, or an empty dict for an empty text."""
    return json.loads(text) if text else {}
