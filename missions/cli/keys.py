"""Single key presses from a terminal; works over SSH and restores the terminal."""

import os
import re
import select
import signal
import termios
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType, TracebackType
from typing import Any, Self

ESCAPE_TIMEOUT = 0.2
"""Seconds to wait for the rest of an arrow key's three bytes, which arrive one by one over a slow connection."""

_ARROWS = {"A": "up", "B": "down", "C": "right", "D": "left"}
_CURSOR = re.compile(r"(\d{1,5});(\d{1,5})R", re.ASCII)
"""Pattern of the cursor position that a terminal reports, row;columnR, after the escape sequence ``ESC [``."""

_KEY_NAMES = {"\r": "enter", "\n": "enter", "\x1b": "escape", "\x04": "end", "": "end"}


class KeyReader:
    """Context manager that reads keys from the terminal with the file ``descriptor``.

    Ctrl-Z is disabled inside the context, since a suspended process would leave the terminal without echo.
    ``on_cursor_position`` is called with row and column when the terminal reports its cursor.
    """

    def __init__(self, descriptor: int, on_cursor_position: Callable[[int, int], object] | None = None) -> None:
        self._descriptor, self._on_cursor_position = descriptor, on_cursor_position
        self._terminal: list[Any] = []

    def __enter__(self) -> Self:
        self._terminal = termios.tcgetattr(self._descriptor)
        tty.setcbreak(self._descriptor)
        settings = termios.tcgetattr(self._descriptor)
        settings[6][termios.VSUSP] = b"\0"  # disable Ctrl-Z
        termios.tcsetattr(self._descriptor, termios.TCSANOW, settings)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with suppress(termios.error):  # the terminal may be closed
            termios.tcsetattr(self._descriptor, termios.TCSANOW, self._terminal)

    def read(self, timeout: float) -> str:
        """Return a key: a character, "up", "down", "left", "right", "enter", "escape", or "end" at end of input.

        Return an empty text if no key was pressed within ``timeout`` seconds.
        """
        while self._has_input(timeout):
            key = self._read_byte()
            if key != "\x1b" or not self._has_input(ESCAPE_TIMEOUT):
                return _KEY_NAMES.get(key, key)
            if self._read_byte() not in ("[", "O"):
                return "escape"
            # Parameters, such as those of Shift, are between the bracket and the letter. An incomplete sequence must
            # not block the caller.
            text = ""
            while (not text or text[-1].isdigit() or text[-1] == ";") and self._has_input(ESCAPE_TIMEOUT):
                text += self._read_byte() or "?"
            if (place := _CURSOR.fullmatch(text)) is None:
                return _ARROWS.get(text[-1:], "other")
            if self._on_cursor_position is not None:
                self._on_cursor_position(int(place[1]), int(place[2]))
            timeout = 0.0  # keys pressed meanwhile are already in the buffer
        return ""

    def _has_input(self, timeout: float) -> bool:
        return bool(select.select([self._descriptor], [], [], timeout)[0])

    def _read_byte(self) -> str:
        try:
            return os.read(self._descriptor, 1).decode("latin-1")
        except OSError:  # the terminal is closed
            return ""


@contextmanager
def interruptible() -> Iterator[None]:
    """Raise KeyboardInterrupt on SIGTERM and SIGHUP, as on Ctrl-C, so that open devices are closed.

    Only the first signal raises: kernel and shell may both send one, and a second must not interrupt the closing.
    """
    before = {number: signal.signal(number, _interrupt) for number in (signal.SIGTERM, signal.SIGHUP)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _interrupt(number: int, frame: FrameType | None) -> None:
    del number, frame
    for each in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(each, signal.SIG_IGN)
    raise KeyboardInterrupt
