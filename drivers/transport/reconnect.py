"""How long a part that moves was away, and what follows from that when it is back. Its time is handed in."""

from math import inf

from drivers.api import ReconnectPolicy
from drivers.errors import DeviceFault


class ReconnectTracker:
    """Told whenever the part is heard; not safe between threads.

    ``reconnected_at`` is when it was last back from an absence after which nothing of before goes on, None if there was none;
    ``latched`` says why it stays at rest until it is enabled, and is empty while it need not.
    """

    def __init__(self, policy: ReconnectPolicy | None = None) -> None:
        self.reconnected_at: float | None = None
        self.latched = ""
        self._policy = policy or ReconnectPolicy()
        self._reported_at = -inf

    @property
    def min_absence(self) -> float:
        """Seconds from which on it counts as having been away."""
        return self._policy.decide_after

    def restart(self) -> None:
        """Begin anew: what is heard next is the first of it."""
        self.reconnected_at, self.latched, self._reported_at = None, "", -inf

    def on_report(self, now: float, *, restarted: bool = False) -> bool:
        """Note that it is there at ``now`` seconds, and may have started ``anew``; say if nothing of before goes on."""
        before, self._reported_at = self._reported_at, now
        return before > -inf and self.on_return(now, now - before, restarted=restarted)

    def on_return(self, now: float, absence: float, *, name: str = "it", restarted: bool = False) -> bool:
        """Note that it, or one servo of it (``who``), is back at ``now`` after ``lasted`` seconds; say as ``on_report``."""
        if not (restarted or absence > self._policy.decide_after):
            return False
        self.reconnected_at = now
        if absence > self._policy.latch_after:
            self.latch(f"{name} was away for {absence:.0f} s")
        return True

    def is_silent(self, now: float) -> bool:
        """Whether it was silent for so long by ``now`` that it is to be heard again before anything moves."""
        return -inf < self._reported_at < now - self._policy.decide_after

    def is_from_before(self, requested_at: float) -> bool:
        """Whether what was ``asked`` at that time is from before its last return."""
        return self.reconnected_at is not None and requested_at < self.reconnected_at

    def require_unlatched(self, part: str) -> None:
        """Raise DeviceFault while it is latched; ``who`` is the part."""
        if self.latched:
            raise DeviceFault(f"{part}: stopped: {self.latched}", hint=f"look at it, then enable the {part}")

    def latch(self, reason: str, *, replace: bool = False) -> None:
        """Let it rest until it is enabled; a ``graver`` reason is told in place of one that was there."""
        self.latched = reason if replace else self.latched or reason

    def enable(self) -> None:
        """Let it be moved again."""
        self.latched = ""


class LatchingPart:
    """A ``drivers.api.Latchable`` part, by its ``_reconnect``."""

    _reconnect: ReconnectTracker

    @property
    def latched(self) -> str:
        """Why it moves no more until it is enabled; empty while it does."""
        return self._reconnect.latched

    def enable(self) -> None:
        """Let it move again, after it was away for long."""
        self._reconnect.enable()
