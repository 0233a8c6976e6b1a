"""Process that kills a run which does not react to a signal and shows no sign of life.

It is a separate process, since no Python code of the run executes while a C call holds the GIL. Usage:
``lifeline_worker.py PROCESS SIGNALS HEART SECONDS NUMBERS``. PROCESS is the process to kill; SIGNALS the socket with
the signals that it got, which is peeked at and never read; HEART the pipe of its heartbeats; SECONDS the timeout after
a signal; NUMBERS the numbers of the signals that end a run. Imports nothing of MissionTree.
"""

import os
import signal
import socket
import sys
import time
from contextlib import suppress

POLL_INTERVAL = 0.25
"""Seconds between two checks of signals and heartbeats."""


def main() -> None:
    """Watch until the heartbeat pipe is closed, or kill the run."""
    process, signals, heart = (int(word) for word in sys.argv[1:4])
    seconds, numbers = float(sys.argv[4]), frozenset(map(int, sys.argv[5].split(",")))
    last_signal_at: float | None = None
    with socket.socket(fileno=signals) as letters:
        while True:
            time.sleep(POLL_INTERVAL)
            now, beaten = time.monotonic(), b""
            with suppress(BlockingIOError):
                beaten = os.read(heart, 4096)
                if not beaten:
                    return
            with suppress(BlockingIOError):
                if last_signal_at is None and numbers & {*letters.recv(4096, socket.MSG_PEEK)}:
                    last_signal_at = now
            if last_signal_at is not None and beaten:
                last_signal_at = now
            if last_signal_at is not None and now - last_signal_at > seconds:
                with suppress(ProcessLookupError):
                    os.kill(process, signal.SIGKILL)
                return


if __name__ == "__main__":
    main()
