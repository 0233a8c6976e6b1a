"""Sending on a topic of ROS 2, and taking the first reply to a request."""

import secrets
from collections.abc import Callable
from threading import Lock
from typing import TYPE_CHECKING, Any

from drivers.errors import NotConnected
from drivers.ros2.wire import Entity

if TYPE_CHECKING:
    import zenoh


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
