"""Terminal of a view, and its restoration even after a crash of the view."""

import os
import select
import signal
import sys
import tempfile
import termios
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from importlib.util import find_spec
from typing import Any, BinaryIO, TextIO

WRITE_TIMEOUT = 1.0
"""Seconds to wait until a terminal accepts the escape sequences that restore it; after that they are not sent."""

RESTORE_SEQUENCE = (
    b"\x1b[?2026l"  # what is drawn shows at once again
    b"\x1b[?1000l\x1b[?1003l\x1b[?1015l\x1b[?1006l\x1b[?1016l"  # the mouse
    b"\x1b[?2004l\x1b[?2048l\x1b[?1004l"  # no reports of pasted text, of sizes, of the focus
    b"\x1b[<u"  # keys as they were
    b"\x1b[?1049l\x1b[?7h\x1b[0m\x1b[?25h"  # the screen of before, its lines wrapped, its colours, and its cursor
)
"""Escape sequences that undo everything that a view may have switched on; terminals ignore unknown ones."""


def view_error(out: TextIO) -> str:
    """Return the reason, with a hint, why ``out`` cannot show a view; empty if it can."""
    if find_spec("textual") is None:
        return "--view needs textual, which is not installed\n  try: pip install 'missiontree[view]'"
    if not (sys.stdin.isatty() and out.isatty()):
        return "--view needs a terminal\n  try: leave it out, and read the lines; over SSH: ssh -t"
    if os.environ.get("TERM", "dumb") == "dumb":
        return (
            "--view needs a terminal that can place its text, and TERM says that this one cannot\n  try: leave it out"
        )
    return ""


class TerminalSnapshot:
    """Settings of the terminal behind two descriptors, for ``restore``."""

    def __init__(self, keys: int, screen: int) -> None:
        self._keys = keys
        self._screen = screen
        self._settings: list[Any] | None = None

    def save(self) -> None:
        """Save the current settings. Does nothing if the terminal has gone."""
        with suppress(termios.error):
            self._settings = termios.tcgetattr(self._keys)

    def restore(self, *, view_has_left: bool) -> None:
        """Restore the saved settings, and drop unread keys. If ``view_has_left``, the screen is already restored.

        Safe more than once, and if the terminal has gone.
        """
        if self._settings is None:
            return
        # A process in the background would be stopped for this, and leave its robot alone.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTTOU})
        try:
            with suppress(OSError, termios.error):
                if not view_has_left and select.select([], [self._screen], [], WRITE_TIMEOUT)[1]:
                    os.write(self._screen, RESTORE_SEQUENCE)
                termios.tcflush(self._keys, termios.TCIFLUSH)
                termios.tcsetattr(self._keys, termios.TCSANOW, self._settings)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def hold_output() -> Iterator[None]:
    """Hold back all output of this process, of C libraries too, to the terminal until the end of the context."""
    terminals = [number for number in (1, 2) if os.isatty(number)]
    with tempfile.TemporaryFile() as aside, ExitStack() as undo:
        if terminals:
            undo.callback(_copy_to_terminal, aside, terminals[-1])
        for number in terminals:
            before = os.dup(number)
            undo.callback(os.close, before)
            undo.callback(os.dup2, before, number)
            undo.callback(_flush)
            _flush()
            os.dup2(aside.fileno(), number)
        yield


def _flush() -> None:
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()


def _copy_to_terminal(aside: BinaryIO, terminal: int) -> None:
    aside.seek(0)
    with suppress(OSError):
        while data := aside.read(1 << 16):
            os.write(terminal, data)
