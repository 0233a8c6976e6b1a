"""Reconnect tracking of an actuator: detects absences, and applies its reconnect policy. Times are arguments."""

from math import inf

from drivers.api import ReconnectPolicy
from drivers.errors import DeviceFault


class ReconnectTracker:
    """Tracks the absences of a part, and latches it after a long one. Not thread-safe.

    ``reconnected_at`` is the time of the last reconnect after which earlier commands are dropped, None if there was
    none; ``latched`` is the reason of the latch, or empty.
    """

    def __init__(self, policy: ReconnectPolicy | None = None) -> None:
        self.reconnected_at: float | None = None
        self.latched = ""
        self._policy = policy or ReconnectPolicy()
        self._reported_at = -inf

    @property
    def min_absence(self) -> float:
        """Shortest absence in seconds after which earlier commands are dropped."""
        return self._policy.decide_after

    def restart(self) -> None:
        """Reset the state: the next report is the first one."""
        self.reconnected_at, self.latched, self._reported_at = None, "", -inf

    def on_report(self, now: float, *, restarted: bool = False) -> bool:
        """Note that the part is online at ``now``, maybe ``restarted``; return whether to drop earlier commands."""
        before, self._reported_at = self._reported_at, now
        return before > -inf and self.on_return(now, now - before, restarted=restarted)

    def on_return(self, now: float, absence: float, *, name: str = "it", restarted: bool = False) -> bool:
        """Note that the part, or the servo ``name`` of it, is back at ``now`` after ``absence`` seconds.

        Return whether to drop earlier commands: after a restart, or a long absence.
        """
        if not (restarted or absence > self._policy.decide_after):
            return False
        self.reconnected_at = now
        if absence > self._policy.latch_after:
            self.latch(f"{name} was away for {absence:.0f} s")
        return True

    def is_silent(self, now: float) -> bool:
        """Return whether the part was silent for so long by ``now`` that it must report before it moves."""
        return -inf < self._reported_at < now - self._policy.decide_after

    def is_from_before(self, requested_at: float) -> bool:
        """Return whether a command at ``requested_at`` is from before the last reconnect."""
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
    """Mixin that implements ``drivers.api.Latchable`` by the part's ``_reconnect``, a ``ReconnectTracker``."""

    _reconnect: ReconnectTracker

    @property
    def latched(self) -> str:
        """Reason of the latch; empty if not latched."""
        return self._reconnect.latched

    def enable(self) -> None:
        """Release the latch after a long absence."""
        self._reconnect.enable()
