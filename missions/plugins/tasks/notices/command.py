"""Notices to a program of the user's, as JSON on its standard input."""

import os
import signal
import subprocess
import tempfile
from contextlib import suppress
from threading import Event

from config.notices import CommandNotice
from drivers.clock import SystemClock
from missions.plugins.tasks.notice import DeliveryError, Notice

TIMEOUT = 30.0
"""Seconds that the program has."""

POLL_INTERVAL = 0.05
"""Seconds from one look whether it has ended to the next."""

MAX_ERROR_BYTES = 200
"""Bytes of what it says on its standard error that are told."""


class CommandChannel:
    """Starts the program for each notice; it has taken the notice when it ends with exit code 0."""

    def __init__(self, config: CommandNotice, timeout: float = TIMEOUT) -> None:
        self._command, self._timeout = config.command, timeout
        self._given_up = Event()

    def __call__(self, notice: Notice) -> None:
        """Run it once. Raises NotTaken for another exit code, and a program that is not there or takes too long."""
        name = self._command[0]
        # Files, not pipes: what the program leaves running could hold a pipe open for ever.
        with tempfile.TemporaryFile() as words, tempfile.TemporaryFile() as told:
            told.write(notice.as_json().encode() + b"\n")
            told.seek(0)
            try:
                process = subprocess.Popen(  # noqa: S603 - the user's own program, from the robot file
                    self._command, stdin=told, stdout=subprocess.DEVNULL, stderr=words, start_new_session=True
                )
            except (OSError, ValueError) as error:
                raise DeliveryError(f"{name}: cannot be started: {error}") from error
            try:
                code = self._wait_exit_code(process)
            finally:
                _kill(process)
            words.seek(max(0, words.seek(0, os.SEEK_END) - MAX_ERROR_BYTES))
            said = words.read().decode(errors="replace").strip()
        if code != 0:
            raise DeliveryError(f"{name}: ended with exit code {code}" + (f": {said}" if said else ""))

    def abandon_halt(self) -> None:
        """Kill the program that runs, if one does, with all that it has started. From any thread, once and for all."""
        self._given_up.set()

    def _wait_exit_code(self, process: "subprocess.Popen[bytes]") -> int:
        """Wait for the end of the program; return its exit code."""
        clock = SystemClock()
        while (code := process.poll()) is None:
            if clock.now() > self._timeout:
                raise DeliveryError(f"{self._command[0]}: did not end within {self._timeout:g} s")
            if self._given_up.wait(POLL_INTERVAL):
                raise DeliveryError(f"{self._command[0]}: had not ended when the server did")
        return code


def _kill(process: "subprocess.Popen[bytes]") -> None:
    """Kill a program, and those that it has started; nothing where it has ended."""
    if process.poll() is None:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
