"""The signals that end a process, turned into a request to stop that is heard even while the main thread hangs."""

import _signal  # type: ignore[import-not-found]
import signal
import socket
import threading
from collections.abc import Callable
from contextlib import ExitStack
from types import FrameType, TracebackType
from typing import Self

FAREWELL = {
    signal.SIGINT: "Ctrl-C",
    signal.SIGTERM: "SIGTERM",
    signal.SIGHUP: "the terminal was closed",
    signal.SIGQUIT: "Ctrl-\\",
    # A suspended process would leave the robot to itself, with the last command that it was given.
    signal.SIGTSTP: "Ctrl-Z",
}
"""The signals that end a run safely."""


class Signals:
    """While it is entered, a signal calls ``stop`` with a word for it, and ``heard`` gives that word to any thread.

    Python's handlers run on the main thread, between two of its instructions: not while that is stuck in C. The number
    of a signal is written into a socket at once, wherever the main thread is; that is what ``heard`` looks at, and
    never takes out, since another process does so too (``lifeline``). Off the main thread, signals are not ours to
    take, and nothing is ever heard.
    """

    def __init__(self, stop: Callable[[str], None]) -> None:
        self._stop = stop
        self._word: str | None = None
        self._reader: socket.socket | None = None
        self._writer: socket.socket
        self._lock = threading.Lock()
        self._undo = ExitStack()

    def __enter__(self) -> Self:
        if threading.current_thread() is not threading.main_thread():
            return self
        reader, writer = socket.socketpair()
        for end in (reader, writer):
            end.setblocking(False)
            self._undo.callback(end.close)
        self._undo.callback(signal.set_wakeup_fd, signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False))
        for number in FAREWELL:
            self._undo.callback(signal.signal, number, signal.signal(number, self._request))
        self._reader, self._writer = reader, writer
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._lock:
            self._reader = None
        self._undo.close()

    @property
    def number(self) -> int | None:
        """The file descriptor of the socket; None off the main thread, and while it is not entered."""
        return None if self._reader is None else self._reader.fileno()

    def heard(self) -> str | None:
        """Return the word for the first signal that came, None while there was none. From any thread."""
        with self._lock:
            if self._word is None and self._reader is not None:
                try:
                    numbers = self._reader.recv(4096, socket.MSG_PEEK)
                except BlockingIOError:
                    numbers = b""
                self._word = next((FAREWELL[signal.Signals(n)] for n in numbers if n in FAREWELL), None)
            return self._word

    def retake(self) -> list[str]:
        """Take back the signals that a behaviour has taken or ignores; return their names. On the main thread."""
        if self._reader is None:
            return []
        # signal.getsignal asks the same, and then tries to make an Enum's member of each: 40 times as long.
        taken = [number for number in FAREWELL if _signal.getsignal(number) != self._request]
        for number in taken:
            signal.signal(number, self._request)
        if taken:
            signal.set_wakeup_fd(self._writer.fileno(), warn_on_full_buffer=False)
        return [number.name for number in taken]

    def _request(self, number: int, frame: FrameType | None) -> None:
        del frame
        self._stop(FAREWELL[signal.Signals(number)])
