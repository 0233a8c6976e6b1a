"""Python programs in processes of their own, each forked from a program that has imported what most of them need.

So a start takes the processor for a twentieth of the time. All else is as with ``subprocess``: the process has a
working directory, environment, streams and signals of its own, and comes to its end as any other. Where the start
itself is what is tested, or another environment, it is left to ``subprocess``.

As a program it takes orders from a socket, whose number it is given, until that is closed.
"""

import atexit
import gc
import json
import os
import runpy
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from functools import cache
from pathlib import Path
from subprocess import DEVNULL, PIPE
from types import TracebackType
from typing import IO, Any, NoReturn, Self

IMPORTED = (
    "behaviours.driving.motion",
    "drivers.arduino.driver",
    "drivers.kobuki.driver",
    "drivers.kobuki.virtual",
    "drivers.arduino.virtual",
    "drivers.servos.virtual.servo",
    "drivers.virtual.terminal",
    "missions.assembly.simulation",
    "missions.cli.root",
    "missions.cli.run",
    "missions.plugins.studio.command",
    "missions.plugins.records.recording.recorder",
    "missions.plugins.studio.web_server",
    "uvicorn.protocols.http.h11_impl",
    "uvicorn.protocols.websockets.websockets_sansio_impl",
)
"""What is imported already; whatever else a process needs, it imports itself."""

ROOT = Path(__file__).parents[1]


class Forked:
    """A process that runs a module as ``python -m`` does. It is used as a ``Popen`` whose streams are of text."""

    def __init__(
        self,
        module: str,
        *words: str,
        folder: Path | None = None,
        stdin: int | None = None,
        stdout: int | None = None,
        stderr: int | None = None,
        leader: bool = False,
    ) -> None:
        self.args = (module, *words)
        self.returncode: int | None = None
        order = {"words": self.args, "folder": str(folder or Path.cwd()), "env": dict(os.environ), "leader": leader}
        with ExitStack() as theirs:
            self.stdin, first = _end(stdin, 0, theirs)
            self.stdout, second = _end(stdout, 1, theirs)
            self.stderr, third = _end(stderr, 2, theirs)
            self._status, told = os.pipe()
            theirs.callback(os.close, told)
            self.pid = _asked(order, (first, second, third, told))

    def poll(self) -> int | None:
        """Return the exit code once it has ended; minus the signal's number where one has ended it."""
        with suppress(subprocess.TimeoutExpired):
            self.wait(0.0)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Wait until it has ended, and return what ``poll`` does. Raises TimeoutExpired after so many seconds."""
        if self.returncode is None:
            if not select.select([self._status], [], [], timeout)[0]:
                raise subprocess.TimeoutExpired(self.args, timeout or 0.0)
            self.returncode = int(os.read(self._status, 16))
            os.close(self._status)
        return self.returncode

    def send_signal(self, number: int) -> None:
        """Send it a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def terminate(self) -> None:
        """Ask it to end."""
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        """End it."""
        self.send_signal(signal.SIGKILL)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for stream in (self.stdout, self.stderr, self.stdin):
            if stream is not None:
                stream.close()
        self.wait()


def _end(asked: int | None, number: int, theirs: ExitStack) -> tuple[IO[str] | None, int]:
    """Return our end of the stream of this number where it is a pipe, and the end of the process."""
    if asked is None:
        return None, number
    if asked == DEVNULL:
        nowhere = os.open(os.devnull, os.O_RDWR)
        theirs.callback(os.close, nowhere)
        return None, nowhere
    if asked != PIPE:
        return None, asked
    reader, writer = os.pipe()
    ours, its = (reader, writer) if number else (writer, reader)
    theirs.callback(os.close, its)
    return os.fdopen(ours, "r" if number else "w", encoding="utf-8"), its


def _asked(order: dict[str, Any], streams: Sequence[int]) -> int:
    """Have a process forked; return its ID."""
    for attempt in range(2):
        orders = _program()
        with suppress(BrokenPipeError, ConnectionResetError):
            socket.send_fds(orders, [json.dumps(order).encode() + b"\n"], streams)
            if pid := orders.recv(16):
                return int(pid)
        # A hang-up or a kill of the group of a test may have met the program, too: that is no fault of this test.
        print(f"tests.forked has ended (attempt {attempt + 1})", file=sys.stderr)  # noqa: T201
        _program.cache_clear()
    raise ChildProcessError("tests.forked ends at once: run python -m tests.forked 0")


@cache
def _program() -> socket.socket:
    """Start the program, once in a process of the tests; return the socket that takes orders."""
    ours, theirs = socket.socketpair()
    with theirs:
        command = [sys.executable, "-m", "tests.forked", str(theirs.fileno())]
        one_thread = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}  # it is forked: there must be no other
        process = subprocess.Popen(
            command, cwd=ROOT, env=one_thread, stdin=PIPE, stdout=PIPE, pass_fds=[theirs.fileno()]
        )

    @atexit.register
    def end() -> None:
        ours.close()
        process.communicate()

    return ours


def main(orders: socket.socket) -> None:
    """Fork a process for each order; in such a process, carry the order out."""
    for name in IMPORTED:
        __import__(name)
    gc.freeze()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for those that it has forked, which are in its group
    told, tell = os.pipe()
    os.set_blocking(tell, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(tell)
    running: dict[int, int] = {}
    while True:
        ready = select.select([orders.fileno(), told], [], [])[0]
        if told in ready:
            os.read(told, 1 << 10)
            _tell_of_ended(running)
        if orders.fileno() in ready:
            data, streams = b"", list[int]()
            while not data.endswith(b"\n"):
                piece, found, _, _ = socket.recv_fds(orders, 1 << 20, 4)
                if not piece:
                    return
                data, streams = data + piece, streams + found
            process = os.fork()
            if process == 0:
                orders.detach()
                carry_out(json.loads(data), streams)
            running[process] = streams.pop()
            for stream in streams:
                os.close(stream)
            orders.sendall(str(process).encode())


def _tell_of_ended(running: dict[int, int]) -> None:
    """Tell the exit code of each process that has ended."""
    while running:
        process, status = os.waitpid(-1, os.WNOHANG)
        if process == 0:
            return
        with suppress(BrokenPipeError):  # nobody waits for it
            os.write(running[process], str(os.waitstatus_to_exitcode(status)).encode())
        os.close(running.pop(process))


def carry_out(order: dict[str, Any], streams: Sequence[int]) -> NoReturn:
    """Become the process that is ordered."""
    signal.set_wakeup_fd(-1)
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if order["leader"]:
        os.setsid()
    for number, stream in enumerate(streams[:3]):
        os.dup2(stream, number)
    os.closerange(3, os.sysconf("SC_OPEN_MAX"))
    sys.stdin, sys.stdout = os.fdopen(0, closefd=False), os.fdopen(1, "w", closefd=False)
    sys.stderr = os.fdopen(2, "w", buffering=1, errors="backslashreplace", closefd=False)
    os.environ.clear()
    os.environ.update(order["env"])
    os.chdir(order["folder"])
    sys.path[0] = order["folder"]
    module, *sys.argv[1:] = order["words"]
    runpy.run_module(module, run_name="__main__", alter_sys=True)
    sys.exit()


if __name__ == "__main__":
    main(socket.socket(fileno=int(sys.argv[1])))
