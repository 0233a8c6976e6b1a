"""From a link to a guardian: a process is started as a port is opened, and its pipes are the line."""

import json
import os
import select
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

from drivers.errors import NotConnected

COMMAND = (sys.executable, "-I", "-m", "drivers.pi_car.guardian")
"""The program, in Python's isolated mode; what it is to hold comes behind."""

ENDS = 1.0
"""Seconds that it is given to let all rest and end, once its standard input has ended."""


class Guarded:
    """Starts guardians that hold what ``told`` is about: a ``drivers.link.Dial``."""

    def __init__(self, told: Mapping[str, Any], command: Sequence[str] = COMMAND) -> None:
        self._command = (*command, json.dumps(told))

    def __call__(self, who: str, port: str, baud: int) -> "Guardian":  # noqa: ARG002 - a pipe has no rate
        """Start one. Raises NotConnected."""
        try:
            return Guardian(who, self._command)
        except OSError as error:
            raise NotConnected(f"{who}: {port}: {error}", hint="look at the memory and the processes") from error


class Guardian:
    """A ``drivers.link.Port`` that is a process. All but ``close`` raise OSError when it has ended."""

    def __init__(self, who: str, command: Sequence[str]) -> None:
        self._who = who
        self._process = subprocess.Popen(  # noqa: S603 - no shell; a program of ours
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0, start_new_session=True
        )
        if self._process.stdin is None or self._process.stdout is None:
            raise OSError("a process without pipes")
        self._in, self._out = self._process.stdin, self._process.stdout
        os.set_blocking(self._in.fileno(), False)
        os.set_blocking(self._out.fileno(), False)
        self._ended = False

    @property
    def pid(self) -> int:
        """Its number."""
        return self._process.pid

    def arrived(self, patience: float) -> bytes:
        """Return what it has said; wait up to ``patience`` seconds for the first byte."""
        if self._ended:
            raise OSError("the process that holds the pins has ended")
        if not select.select([self._out], [], [], patience)[0]:
            return b""
        data = os.read(self._out.fileno(), 4096)
        if not data:
            self._ended = True  # its last words are read first
        return data

    def write(self, data: bytes) -> None:
        """Send ``data`` whole."""
        if os.write(self._in.fileno(), data) != len(data):
            raise OSError("the process that holds the pins reads nothing")

    def set_dtr(self, *, on: bool) -> None:
        """Do nothing: a pipe has no such line."""

    def close(self) -> None:
        """Let it go: it lets all rest, and ends."""
        with suppress(OSError):
            self._in.close()
        try:
            self._process.wait(ENDS)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        with suppress(OSError):
            self._out.close()
