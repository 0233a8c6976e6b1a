"""How long a part that moves was away, and what follows from that when it is back. Its time is handed in."""

from math import inf

from drivers.api import Away
from drivers.errors import DeviceFault


class Absence:
    """Told whenever the part is heard; not safe between threads.

    ``returned`` is when it was last back from an absence after which nothing of before goes on, None if there was none;
    ``latched`` says why it stays at rest until it is enabled, and is empty while it need not.
    """

    def __init__(self, away: Away | None = None) -> None:
        self.returned: float | None = None
        self.latched = ""
        self._away = away or Away()
        self._heard_at = -inf

    @property
    def shortest(self) -> float:
        """Seconds from which on it counts as having been away."""
        return self._away.decide

    def begin(self) -> None:
        """Begin anew: what is heard next is the first of it."""
        self.returned, self.latched, self._heard_at = None, "", -inf

    def heard(self, now: float, *, anew: bool = False) -> bool:
        """Note that it is there at ``now`` seconds, and may have started ``anew``; say if nothing of before goes on."""
        before, self._heard_at = self._heard_at, now
        return before > -inf and self.back(now, now - before, anew=anew)

    def back(self, now: float, lasted: float, *, who: str = "it", anew: bool = False) -> bool:
        """Note that it, or one servo of it (``who``), is back at ``now`` after ``lasted`` seconds; say as ``heard``."""
        if not (anew or lasted > self._away.decide):
            return False
        self.returned = now
        if lasted > self._away.latch:
            self.latch(f"{who} was away for {lasted:.0f} s")
        return True

    def unheard(self, now: float) -> bool:
        """Whether it was silent for so long by ``now`` that it is to be heard again before anything moves."""
        return -inf < self._heard_at < now - self._away.decide

    def before_return(self, asked: float) -> bool:
        """Whether what was ``asked`` at that time is from before its last return."""
        return self.returned is not None and asked < self.returned

    def require(self, who: str) -> None:
        """Raise DeviceFault while it is latched; ``who`` is the part."""
        if self.latched:
            raise DeviceFault(f"{who}: stopped: {self.latched}", hint=f"look at it, then enable the {who}")

    def latch(self, reason: str, *, graver: bool = False) -> None:
        """Let it rest until it is enabled; a ``graver`` reason is told in place of one that was there."""
        self.latched = reason if graver else self.latched or reason

    def enable(self) -> None:
        """Let it be moved again."""
        self.latched = ""


class Enabling:
    """A ``drivers.api.Latching`` part, by its ``_absence``."""

    _absence: Absence

    @property
    def latched(self) -> str:
        """Why it moves no more until it is enabled; empty while it does."""
        return self._absence.latched

    def enable(self) -> None:
        """Let it move again, after it was away for long."""
        self._absence.enable()
