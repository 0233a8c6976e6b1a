"""The program that ends a run which was told to end, and shows no life.

It is a process of its own: in the other nothing of Python runs while a call into C keeps the interpreter for itself.
``lifeline_worker.py PROCESS SIGNALS HEART SECONDS NUMBERS``: the process to be ended; the socket into which its signals
are written, which is looked at and never read; the pipe of its heartbeats, whose end is ours too; how long it may be
silent once it has got one of the signals with these numbers. It imports nothing of ours.
"""

import os
import signal
import socket
import sys
import time
from contextlib import suppress

POLL_INTERVAL = 0.25
"""Seconds between two looks."""


def main() -> None:
    """Watch until the heart has ended, or has to be."""
    process, signals, heart = (int(word) for word in sys.argv[1:4])
    seconds, numbers = float(sys.argv[4]), frozenset(map(int, sys.argv[5].split(",")))
    heard: float | None = None
    with socket.socket(fileno=signals) as letters:
        while True:
            time.sleep(POLL_INTERVAL)
            now, beaten = time.monotonic(), b""
            with suppress(BlockingIOError):
                beaten = os.read(heart, 4096)
                if not beaten:
                    return
            with suppress(BlockingIOError):
                if heard is None and numbers & {*letters.recv(4096, socket.MSG_PEEK)}:
                    heard = now
            if heard is not None and beaten:
                heard = now
            if heard is not None and now - heard > seconds:
                with suppress(ProcessLookupError):
                    os.kill(process, signal.SIGKILL)
                return


if __name__ == "__main__":
    main()
