"""View process of a run, and the thread that communicates with it; a tick waits for neither."""

import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from threading import Event, Thread

from missions.plugins.view.terminal import TerminalSnapshot, hold_output
from missions.trees.feed import Json, ViewFeed

SEND_INTERVAL = 0.1
"""Shortest interval between two messages to the view process, in seconds."""

EXIT_TIMEOUT = 5.0
"""Seconds for the view process to restore the terminal and exit; then it is killed."""

_READ_SIZE = 1 << 16


class Viewer:
    """Shows a ``feed`` on the terminal with the descriptors ``keys`` and ``screen``, from ``open`` to ``close``.

    ``first_message`` is sent before all others. While ``is_showing``, the viewer owns the terminal, and other output of
    this process to it is held back. ``exit_cause`` is the reason if the view ended before ``close``.
    """

    def __init__(self, feed: ViewFeed, first_message: Json, *, keys: int = 0, screen: int = 1) -> None:
        self.exit_cause = ""
        self._feed = feed
        self._first_message = first_message
        self._terminal = TerminalSnapshot(keys, screen)
        self._keys, self._screen = keys, screen
        self._socket: socket.socket | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._thread: Thread | None = None
        self._closing, self._done = Event(), Event()
        self._undo = ExitStack()

    @property
    def is_showing(self) -> bool:
        """True until the terminal is restored."""
        return not self._done.is_set()

    def open(self) -> None:
        """Start the view process, and the thread that communicates with it."""
        self._terminal.save()
        ours, theirs = socket.socketpair()
        ours.setblocking(False)
        paths = [str(Path(__file__).parents[3]), os.environ.get("PYTHONPATH", "")]
        with theirs, _block_sigint():
            self._process = subprocess.Popen(  # noqa: S603 - our own program
                [sys.executable, "-P", "-m", "missions.plugins.view", str(theirs.fileno())],
                stdin=self._keys,
                stdout=self._screen,
                stderr=self._screen,
                pass_fds=[theirs.fileno()],
                env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
            )
        self._socket = ours
        self._undo.enter_context(hold_output())
        self._thread = Thread(target=self._run, name="view", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the view process, and restore the terminal. Safe from any state, more than once."""
        self._closing.set()
        if self._thread is not None:
            self._thread.join()
        self._done.set()

    # --- the thread ---------------------------------------------------------------------------------------------------

    def _run(self) -> None:
        ours, process = self._socket, self._process
        if ours is None or process is None:
            return
        try:
            self._exchange_messages(ours)
        finally:
            ours.close()  # the viewer ends when the socket closes
            code = _wait_for_exit(process)
            self._terminal.restore(view_has_left=code == 0)
            self._undo.close()
            if not self._closing.is_set():
                self.exit_cause = _describe_exit(code)
                self._feed.on_view_lost()
            self._done.set()

    def _exchange_messages(self, ours: socket.socket) -> None:
        """Send changes of the run to the view process and execute its commands, until one side closes the socket."""
        left, heard = _encode_message(self._first_message), b""
        with suppress(ConnectionError):
            while not self._closing.wait(SEND_INTERVAL):
                left = _send_part(ours, left or _encode_message(self._feed.take_changes()))
                with suppress(BlockingIOError):
                    data = ours.recv(_READ_SIZE)
                    if not data:
                        return
                    *lines, heard = (heard + data).split(b"\n")
                    for line in lines:
                        self._feed.execute(_decode_message(line))


def _send_part(ours: socket.socket, data: bytes) -> bytes:
    """Send as much as fits; return the rest. A slow viewer gets later changes in one message."""
    with suppress(BlockingIOError):
        while data:
            data = data[ours.send(data[:_READ_SIZE]) :]
    return data


def _encode_message(message: Json) -> bytes:
    return json.dumps(message, ensure_ascii=False).encode("utf-8", "replace") + b"\n"


def _decode_message(line: bytes) -> Mapping[str, object]:
    """Return a message of the viewer; empty for invalid data."""
    with suppress(ValueError):
        message = json.loads(line)
        if isinstance(message, dict):
            return message
    return {}


@contextmanager
def _block_sigint() -> Iterator[None]:
    """Block SIGINT in child processes started in this context: Ctrl-C is for the run, even while a view is loading."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _wait_for_exit(process: "subprocess.Popen[bytes]") -> int:
    """Wait for the view process to end, and kill it after ``EXIT_TIMEOUT``; return its exit code."""
    try:
        return process.wait(EXIT_TIMEOUT)
    except subprocess.TimeoutExpired:
        process.kill()
        return process.wait()


def _describe_exit(code: int) -> str:
    if code >= 0:
        return f"exit code {code}"
    with suppress(ValueError):
        return f"killed by {signal.Signals(-code).name}"
    return f"killed by signal {-code}"
