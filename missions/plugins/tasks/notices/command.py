"""Notice channel: a user's program, with the notice as JSON on its standard input."""

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
"""Maximum run time of the user's program for one notice, in seconds."""

POLL_INTERVAL = 0.05
"""Seconds between two checks whether the user's program has ended."""

MAX_ERROR_BYTES = 200
"""Maximum bytes of the user's program's standard error that an error message quotes."""


class CommandChannel:
    """Starts the user's program for each notice; exit code 0 means delivered."""

    def __init__(self, config: CommandNotice, timeout: float = TIMEOUT) -> None:
        self._command, self._timeout = config.command, timeout
        self._given_up = Event()

    def __call__(self, notice: Notice) -> None:
        """Run the program once. Raises DeliveryError if it cannot start, fails or takes too long."""
        name = self._command[0]
        # Files, not pipes: a background process of the program could hold a pipe open for ever.
        with tempfile.TemporaryFile() as words, tempfile.TemporaryFile() as errors:
            errors.write(notice.as_json().encode() + b"\n")
            errors.seek(0)
            try:
                process = subprocess.Popen(  # noqa: S603 - the user's own program, from the robot file
                    self._command, stdin=errors, stdout=subprocess.DEVNULL, stderr=words, start_new_session=True
                )
            except (OSError, ValueError) as error:
                raise DeliveryError(f"{name}: cannot be started: {error}") from error
            try:
                code = self._wait_exit_code(process)
            finally:
                _kill(process)
            words.seek(max(0, words.seek(0, os.SEEK_END) - MAX_ERROR_BYTES))
            error_text = words.read().decode(errors="replace").strip()
        if code != 0:
            raise DeliveryError(f"{name}: ended with exit code {code}" + (f": {error_text}" if error_text else ""))

    def abort(self) -> None:
        """Kill the running program with its children, and refuse later notices. Thread-safe."""
        self._given_up.set()

    def _wait_exit_code(self, process: "subprocess.Popen[bytes]") -> int:
        clock = SystemClock()
        while (code := process.poll()) is None:
            if clock.now() > self._timeout:
                raise DeliveryError(f"{self._command[0]}: did not end within {self._timeout:g} s")
            if self._given_up.wait(POLL_INTERVAL):
                raise DeliveryError(f"{self._command[0]}: was still running when the server ended")
        return code


def _kill(process: "subprocess.Popen[bytes]") -> None:
    """Kill a program and its process group, unless it has ended."""
    if process.poll() is None:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
