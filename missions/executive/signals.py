"""Signals that end a process, as stop requests that are noticed even while the main thread hangs.

If a leaf is stuck in C and holds the GIL, the lifeline ends the run.
"""

import _signal  # type: ignore[import-not-found]
import os
import signal
import socket
import sys
import threading
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from subprocess import DEVNULL, Popen
from types import FrameType, TracebackType
from typing import Self

STOP_SIGNALS = {
    signal.SIGINT: "Ctrl-C",
    signal.SIGTERM: "SIGTERM",
    signal.SIGHUP: "the terminal was closed",
    signal.SIGQUIT: "Ctrl-\\",
    # A suspended process would leave the robot unattended, with its last command.
    signal.SIGTSTP: "Ctrl-Z",
}
"""Signals that end a run safely, with their names for people."""


class SignalHandler:
    """Context manager: a signal calls ``stop`` with its name, and ``first_signal`` returns that name in any thread.

    Python runs signal handlers on the main thread between two instructions, so not while the main thread is stuck in C.
    The signal number is also written to a socket at once; ``first_signal`` and the lifeline process look there. If the
    context is entered in another thread than the main thread, no signals are handled. Without ``with_socket``, a signal
    is known only after its handler has run.
    """

    def __init__(self, stop: Callable[[str], None], *, with_socket: bool = True) -> None:
        self._stop = stop
        self.with_socket = with_socket
        self._is_entered = False
        self._word: str | None = None
        self._reader: socket.socket | None = None
        self._writer: socket.socket
        self._lock = threading.Lock()
        self._undo = ExitStack()

    def __enter__(self) -> Self:
        if threading.current_thread() is not threading.main_thread():
            return self
        if self.with_socket:
            self._reader, self._writer = socket.socketpair()
            for end in (self._reader, self._writer):
                end.setblocking(False)
                self._undo.callback(end.close)
            before = signal.set_wakeup_fd(self._writer.fileno(), warn_on_full_buffer=False)
            self._undo.callback(signal.set_wakeup_fd, before)
        for number in STOP_SIGNALS:
            self._undo.callback(signal.signal, number, signal.signal(number, self._request))
        self._is_entered = True
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._lock:
            self._reader = None
        self._is_entered = False
        self._undo.close()

    @property
    def socket_descriptor(self) -> int | None:
        """File descriptor of the socket; None off the main thread, and outside the context."""
        return None if self._reader is None else self._reader.fileno()

    def first_signal(self) -> str | None:
        """Return the name of the first signal, None if there was none. Thread-safe."""
        with self._lock:
            if self._word is None and self._reader is not None:
                try:
                    numbers = self._reader.recv(4096, socket.MSG_PEEK)
                except BlockingIOError:
                    numbers = b""
                self._word = next((STOP_SIGNALS[signal.Signals(n)] for n in numbers if n in STOP_SIGNALS), None)
            return self._word

    def reinstall(self) -> list[str]:
        """Reinstall handlers that a behaviour has replaced; return the names of their signals. For the main thread."""
        if not self._is_entered:
            return []
        # signal.getsignal takes 40 times as long, since it converts each value to an Enum.
        replaced = [number for number in STOP_SIGNALS if _signal.getsignal(number) != self._request]
        for number in replaced:
            signal.signal(number, self._request)
        if replaced and self.with_socket:
            signal.set_wakeup_fd(self._writer.fileno(), warn_on_full_buffer=False)
        return [number.name for number in replaced]

    def _request(self, number: int, frame: FrameType | None) -> None:
        del frame
        word = STOP_SIGNALS[signal.Signals(number)]
        if not self.with_socket:
            self._word = self._word or word
        self._stop(word)


HEARTBEAT_TIMEOUT = 5.0
"""Seconds without a heartbeat, after a signal, until the process is killed (exit code 137).

By then all actuators are at rest: the base after 0.5 s without a command, servos at their goals.
"""

WORKER_FILE = Path(__file__).with_name("lifeline_worker.py")


class Lifeline:
    """Context manager: a separate process kills this one if it got one of ``signals`` and does not ``beat``."""

    def __init__(self, signals: SignalHandler, timeout: float = HEARTBEAT_TIMEOUT) -> None:
        self._signals = signals
        self._timeout = timeout
        self._heartbeat_pipe: int | None = None
        self._worker: Popen[bytes] | None = None

    def beat(self) -> None:
        """Send a heartbeat, which shows the lifeline process that the run is alive. Thread-safe."""
        with suppress(OSError):
            if self._heartbeat_pipe is not None:
                os.write(self._heartbeat_pipe, b".")

    def __enter__(self) -> Self:
        signals = self._signals.socket_descriptor
        if signals is None:
            return self
        end, heart = os.pipe()
        for number in (end, heart):
            os.set_blocking(number, False)
        words = (os.getpid(), signals, end, self._timeout, ",".join(str(int(number)) for number in STOP_SIGNALS))
        try:
            self._worker = Popen(  # noqa: S603 - ours
                (sys.executable, "-I", "-S", str(WORKER_FILE), *map(str, words)),
                stdin=DEVNULL, stdout=DEVNULL, stderr=DEVNULL,
                pass_fds=(signals, end), start_new_session=True,
            )  # fmt: skip
        finally:
            os.close(end)
        self._heartbeat_pipe = heart
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        heart, self._heartbeat_pipe = self._heartbeat_pipe, None
        if heart is not None:
            os.close(heart)
        if self._worker is not None:
            self._worker.kill()
            self._worker.wait()
