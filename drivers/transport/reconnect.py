"""Reconnect tracking of an actuator: detects disconnects, and applies the reconnect policy.

The clock is not read: times are arguments.
"""

from math import inf

from drivers.api import ReconnectPolicy
from drivers.errors import DeviceFault


class ReconnectTracker:
    """Tracks the disconnects of a part, and latches the part after a long one. Not thread-safe.

    ``reconnected_at`` is the time of the last reconnect after which earlier commands are dropped, None if there was
    none. ``latched`` is the reason of the latch; empty if the part is not latched.
    """

    def __init__(self, policy: ReconnectPolicy | None = None) -> None:
        self.reconnected_at: float | None = None
        self.latched = ""
        self._policy = policy or ReconnectPolicy()
        self._reported_at = -inf

    @property
    def min_absence(self) -> float:
        """Shortest disconnect in seconds after which earlier commands are dropped."""
        return self._policy.decide_after

    def restart(self) -> None:
        """Reset the state: the next report is the first one."""
        self.reconnected_at, self.latched, self._reported_at = None, "", -inf

    def on_report(self, now: float, *, restarted: bool = False) -> bool:
        """Update with a report of the part at ``now``; return whether earlier commands must be dropped.

        ``restarted`` is True if the report shows that the part has restarted.
        """
        before, self._reported_at = self._reported_at, now
        return before > -inf and self.on_return(now, now - before, restarted=restarted)

    def on_return(self, now: float, absence: float, *, name: str = "it", restarted: bool = False) -> bool:
        """Update with a reconnect at ``now`` after ``absence`` seconds; return whether to drop earlier commands.

        They are dropped after a restart (``restarted``) or a long disconnect. ``name`` is the part, or one of its
        servos, in the reason of a latch.
        """
        if not (restarted or absence > self._policy.decide_after):
            return False
        self.reconnected_at = now
        if absence > self._policy.latch_after:
            self.latch(f"{name} was away for {absence:.0f} s")
        return True

    def is_silent(self, now: float) -> bool:
        """Return whether the last report is so old at ``now`` that the part must report again before it moves."""
        return -inf < self._reported_at < now - self._policy.decide_after

    def is_from_before(self, requested_at: float) -> bool:
        """Return whether a command at the time ``requested_at`` is from before the last reconnect."""
        return self.reconnected_at is not None and requested_at < self.reconnected_at

    def require_unlatched(self, part: str) -> None:
        """Raise DeviceFault while latched; ``part`` is the name in the message."""
        if self.latched:
            raise DeviceFault(f"{part}: stopped: {self.latched}", hint=f"check it, then enable the {part}")

    def latch(self, reason: str, *, replace: bool = False) -> None:
        """Latch the part with a reason; ``replace`` overwrites an earlier reason."""
        self.latched = reason if replace else self.latched or reason

    def enable(self) -> None:
        """Release the latch."""
        self.latched = ""


class LatchingPart:
    """Mixin for parts that can be latched: implements ``drivers.api.Latchable`` by their ``ReconnectTracker``."""

    _reconnect: ReconnectTracker

    @property
    def latched(self) -> str:
        """Reason of the latch; empty if not latched."""
        return self._reconnect.latched

    def enable(self) -> None:
        """Release the latch after a long absence."""
        self._reconnect.enable()
