"""Publisher of a ROS 2 topic, filter of received messages, and first reply to a request."""

import secrets
from collections.abc import Callable
from threading import Lock
from typing import TYPE_CHECKING, Any

from drivers.errors import NotConnected
from drivers.ros2.wire import Attachment, Entity

if TYPE_CHECKING:
    import zenoh


# Filter of received messages: each once, in order, and none that was delayed for long.

MAX_LATENESS = 0.5
"""Maximum seconds by which the delay of a message exceeds the smallest delay of its sender; else it is rejected."""

CLOCK_JUMP_TIMEOUT = 1.0
"""Seconds in which all messages of a sender were late, after which its clock is assumed to have been set."""

MAX_CLOCK_DRIFT = 2e-4
"""Maximum drift between two clocks, in seconds per second."""

SENDER_TIMEOUT = 1.0
"""Seconds after its last message for which a sender counts as present."""

_MAX_SENDERS = 16
"""Maximum senders per topic that are distinguished."""


class _Sender:
    """State of one sender of a topic's messages."""

    def __init__(self, number: int, shift: float, now: float) -> None:
        self.number, self.clock_offset, self.last_received_at = number, shift, now
        self.late_since: float | None = None


class MessageFilter:
    """Filter of the messages of one topic: rejects duplicate, reordered and late messages.

    ``late_count`` and ``duplicate_count`` count the rejected messages, ``count`` all messages. Not thread-safe: Zenoh
    calls a subscriber from one thread at a time.
    """

    def __init__(self) -> None:
        self.late_count = self.duplicate_count = self.count = 0
        self._senders: dict[bytes, _Sender] = {}

    def sender_count(self, now: float) -> int:
        """Return the number of senders with recent messages."""
        return sum(now - each.last_received_at < SENDER_TIMEOUT for each in list(self._senders.values()))

    def accepts(self, attachment: Attachment, now: float) -> bool:
        """Return False if the message with this attachment, received at ``now``, must be rejected; else True."""
        self.count += 1
        shift = now - attachment.sent_at / 1e9  # two clocks: only differences count
        known = self._senders.get(attachment.gid)
        if known is None:
            if len(self._senders) >= _MAX_SENDERS:
                self._senders.pop(next(iter(self._senders)))
            self._senders[attachment.gid] = _Sender(attachment.number, shift, now)
            return True
        if attachment.number <= known.number:
            self.duplicate_count += 1
            return False
        # Its clock may be slower than ours: an old minimum no longer holds.
        known.clock_offset += MAX_CLOCK_DRIFT * max(now - known.last_received_at, 0.0)
        known.number, known.last_received_at = attachment.number, now
        if shift - known.clock_offset > MAX_LATENESS and attachment.sent_at > 0:  # else its clock is not set
            if known.late_since is None:
                known.late_since = now
            if now - known.late_since < CLOCK_JUMP_TIMEOUT:
                self.late_count += 1
                return False
            known.clock_offset = shift
        known.clock_offset, known.late_since = min(known.clock_offset, shift), None
        return True


ReplyHandler = Callable[[bytes | None], None]
"""Callback with the reply to a request; None if there will be none. Runs on a thread of Zenoh."""


class Publisher:
    """Publisher of one topic. Messages are numbered and stamped, except those to a bridge.

    ``entity`` is the entity that its liveliness token announces, ``attach`` makes the attachment of a message.
    """

    def __init__(self, declared: Any, entity: Entity, attach: Callable[[int, bytes], bytes] | None) -> None:
        self._declared, self.entity, self._attach = declared, entity, attach
        self._bridge_publisher: Any = None
        self._is_mirrored: Callable[[], bool] = bool
        self._lock = Lock()
        self._number = 0
        self._gid = new_gid()

    def mirror_to(self, declared: Any, is_active: Callable[[], bool]) -> None:
        """Also send all messages to the Zenoh publisher ``declared`` (of a bridge) while ``is_active`` returns True."""
        self._bridge_publisher, self._is_mirrored = declared, is_active

    def send(self, payload: bytes) -> None:
        """Send a message; it is dropped on congestion, unless the publisher blocks.

        Raises NotConnected without a session.
        """
        from zenoh import ZError  # noqa: PLC0415 - an extra

        try:
            with self._lock:
                self._number += 1
                attached = None if self._attach is None else self._attach(self._number, self._gid)
                self._declared.put(payload, attachment=attached)
                if self._is_mirrored():
                    self._bridge_publisher.put(payload)
        except ZError as error:
            raise NotConnected(f"ros2: {self.entity.name}: the session of Zenoh has gone: {error}") from error


class FirstReply:
    """Delivers only the first reply to a request, or None if the replies end without one."""

    def __init__(self, on_reply: ReplyHandler) -> None:
        self._on_reply: ReplyHandler | None = on_reply
        self._lock = Lock()

    def reply(self, reply: "zenoh.Reply") -> None:
        """Handle a reply."""
        self._deliver(bytes(reply.ok.payload) if reply.ok is not None else None)

    def finish(self) -> None:
        """Handle the end of the replies to the request."""
        self._deliver(None)

    def _deliver(self, payload: bytes | None) -> None:
        with self._lock:
            replied, self._on_reply = self._on_reply, None
        if replied is not None:
            replied(payload)


def new_gid() -> bytes:
    """Return a random id of 16 bytes for a publisher or the caller of a service."""
    return secrets.token_bytes(16)
