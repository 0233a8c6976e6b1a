"""Sending on a topic of ROS 2, and taking the first reply to a request."""

import secrets
from collections.abc import Callable
from threading import Lock
from typing import TYPE_CHECKING, Any

from drivers.errors import NotConnected
from drivers.ros2.wire import Attachment, Entity

if TYPE_CHECKING:
    import zenoh


# Which of the messages that arrive count: each once, in their order, and none that was long under way.

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


Replied = Callable[[bytes | None], None]
"""Told of the reply to a request; None once there will be none. Called from a thread of Zenoh's."""


class Publisher:
    """Sends on one topic, numbered and stamped unless to a bridge. ``entity`` is what its token tells of it."""

    def __init__(self, declared: Any, entity: Entity, attach: Callable[[int, bytes], bytes] | None) -> None:
        self._declared, self.entity, self._attach = declared, entity, attach
        self._behind: Any = None
        self._mirrors: Callable[[], bool] = bool
        self._lock = Lock()
        self._number = 0
        self._gid = new_gid()

    def mirror_to(self, declared: Any, wanted: Callable[[], bool]) -> None:
        """Send all messages there too while that is ``wanted``."""
        self._behind, self._mirrors = declared, wanted

    def send(self, payload: bytes) -> None:
        """Send a message; what cannot go out now is dropped, unless it waits. Raises NotConnected without a session."""
        from zenoh import ZError  # noqa: PLC0415 - an extra

        try:
            with self._lock:
                self._number += 1
                attached = None if self._attach is None else self._attach(self._number, self._gid)
                self._declared.put(payload, attachment=attached)
                if self._mirrors():
                    self._behind.put(payload)
        except ZError as error:
            raise NotConnected(f"ros2: {self.entity.name}: the session of Zenoh has gone: {error}") from error


class FirstReply:
    """Tells the first reply alone, and the end where none came."""

    def __init__(self, replied: Replied) -> None:
        self._replied: Replied | None = replied
        self._lock = Lock()

    def reply(self, reply: "zenoh.Reply") -> None:
        """Take a reply."""
        self._tell(bytes(reply.ok.payload) if reply.ok is not None else None)

    def end(self) -> None:
        """Take that no more replies come."""
        self._tell(None)

    def _tell(self, payload: bytes | None) -> None:
        with self._lock:
            replied, self._replied = self._replied, None
        if replied is not None:
            replied(payload)


def new_gid() -> bytes:
    """Return an identity of a sender or a caller that nobody else has."""
    return secrets.token_bytes(16)
