"""Which of the messages that arrive count: each once, in their order, and none that was long under way."""

from drivers.ros2.wire import Attachment

LATE = 0.5
"""Seconds by which a message may have been under way for longer than the quickest of its sender."""

JUMPED = 1.0
"""Seconds of nothing but late messages after which the sender's clock is taken to have been set."""

DRIFT = 2e-4
"""Seconds a second by which two clocks drift apart at most."""

RECENT = 1.0
"""Seconds for which a sender counts as one that is there after it was heard."""

_SENDERS = 16
"""Senders on one topic that are told apart at most."""


class _Sender:
    """What is known of a sender."""

    def __init__(self, number: int, shift: float, now: float) -> None:
        self.number, self.shift, self.heard_at = number, shift, now
        self.late_since: float | None = None


class Sieve:
    """Says of each message of one topic whether it counts; ``late`` and ``doubled`` count those that do not.

    ``count`` is the number of all. Not safe between threads: Zenoh calls a subscriber from one at a time.
    """

    def __init__(self) -> None:
        self.late = self.doubled = self.count = 0
        self._senders: dict[bytes, _Sender] = {}

    def senders(self, now: float) -> int:
        """Return how many were heard of late."""
        return sum(now - each.heard_at < RECENT for each in list(self._senders.values()))

    def passes(self, told: Attachment, now: float) -> bool:
        """Whether a message with this attachment counts that has arrived at time ``now``."""
        self.count += 1
        shift = now - told.sent / 1e9  # two clocks: only differences count
        known = self._senders.get(told.gid)
        if known is None:
            if len(self._senders) >= _SENDERS:
                self._senders.pop(next(iter(self._senders)))
            self._senders[told.gid] = _Sender(told.number, shift, now)
            return True
        if told.number <= known.number:
            self.doubled += 1
            return False
        # Its clock may be slower than ours: then the quickest of long ago is no measure any more.
        known.shift += DRIFT * max(now - known.heard_at, 0.0)
        known.number, known.heard_at = told.number, now
        if shift - known.shift > LATE and told.sent > 0:  # else it does not know the time
            if known.late_since is None:
                known.late_since = now
            if now - known.late_since < JUMPED:
                self.late += 1
                return False
            known.shift = shift
        known.shift, known.late_since = min(known.shift, shift), None
        return True
