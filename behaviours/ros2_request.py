"""Asking the nodes of ROS 2 for something that takes its time: begun, watched, cancelled, and waited for."""

import json
from abc import abstractmethod
from typing import Any

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf
from drivers.api import GoalState, Progress, Ros2
from drivers.errors import DeviceFault

CANCEL_TIMEOUT = 3.0
"""Seconds after a cancel within which an action has ended."""

CANCELLED_STATES = frozenset({GoalState.CANCELLED, GoalState.FAILED})
"""How an action ends that was cancelled: some servers abort it."""


class Ros2RequestLeaf(Leaf):
    """A leaf around one request. ``begin`` sends it; halted, it cancels it and waits for its end.

    Running until the request is over; succeeds and fails as that does, with its reason. While nobody offers what it
    asks for it waits, as for a part that is unplugged.
    """

    needs = frozenset({"ros2"})
    halt_limit = 3.0
    _request_number: int | None = None

    def initialise(self) -> None:
        self._request_number = None
        self._request_number = self.begin()

    @abstractmethod
    def begin(self) -> int:
        """Send the request; return its number."""

    def update(self) -> Status:
        if self._request_number is None:
            return self.fail("it was not begun")
        return self.follow(self._request_number)

    def follow(self, number: int) -> Status:
        """Do one tick's work with a request."""
        progress = self.robot.ros2.progress(number)
        if progress.state is GoalState.SUCCEEDED:
            self.result = parse_json(progress.result)
            return SUCCESS
        if progress.is_final:
            return self.fail(progress.reason or f"it was {progress.state}")
        return self.wait(self.progress_text(progress))

    def progress_text(self, progress: Progress) -> str:
        """Say how far it has come."""
        return f"{progress.state}: {progress.feedback[:80]}" if progress.feedback else str(progress.state)

    def terminate(self, new_status: Status) -> None:
        if self._request_number is not None and new_status is not SUCCESS:
            self.robot.ros2.cancel(self._request_number)

    def halting(self) -> bool:
        return self._request_number is not None and not self.robot.ros2.progress(self._request_number).is_final


def has_ended(nodes: Ros2, number: int, since: float) -> bool:
    """Return whether an action has ended that was cancelled ``since`` seconds ago. Raises DeviceFault if it goes on."""
    progress = nodes.progress(number)
    if not progress.is_final and since > CANCEL_TIMEOUT:
        raise DeviceFault(f"the action was cancelled {since:.0f} s ago, and has not ended", hint="look at its node")
    return progress.is_final


def parse_json(text: str) -> Any:
    """Return what a text of JSON says; nothing for an empty one."""
    return json.loads(text) if text else {}
