"""A deadline for a talk with a server: a time-out for each read alone lets one go on for ever that sends little."""

import socket
from contextlib import suppress
from threading import Lock, Timer
from types import TracebackType
from typing import Self


class Deadline:
    """While it is entered, cuts the sockets that it ``ends`` when ``seconds`` have passed; then it is ``over``."""

    def __init__(self, seconds: float) -> None:
        self.over = False
        self._lock = Lock()
        self._sockets: list[socket.socket] = []
        self._timer = Timer(seconds, self._cut)
        self._timer.daemon = True

    def __enter__(self) -> Self:
        self._timer.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._timer.cancel()
        self._timer.join()
        for each in self._sockets:
            each.close()

    def ends(self, connection: socket.socket) -> None:
        """Cut this one too, whatever is wrapped around it later; at once where the time is over."""
        with self._lock:
            self._sockets.append(connection.dup())
        if self.over:
            self._cut()

    def _cut(self) -> None:
        with self._lock:
            self.over = True
            for each in self._sockets:
                with suppress(OSError):  # it has ended
                    each.shutdown(socket.SHUT_RDWR)
