"""Who ends a run that nothing of Python can end: a leaf is stuck in C, which keeps the interpreter for itself."""

import os
import sys
from contextlib import suppress
from pathlib import Path
from subprocess import DEVNULL, Popen
from types import TracebackType
from typing import Self

from missions.executive.signals import FAREWELL, Signals

SILENCE = 5.0
"""Seconds without a heartbeat, after a signal that ends a run, until its process is killed (exit code 137).

By then everything that moves is at rest by itself: the base after 0.5 s without a command, servos at their goals.
"""

WORKER = Path(__file__).with_name("lifeline_worker.py")


class Lifeline:
    """While it is entered, a process of its own kills this one that got one of ``signals`` and does not ``beat``."""

    def __init__(self, signals: Signals, silence: float = SILENCE) -> None:
        self._signals = signals
        self._silence = silence
        self._heart: int | None = None
        self._worker: Popen[bytes] | None = None

    def beat(self) -> None:
        """Show that Python runs; from any thread."""
        with suppress(OSError):
            if self._heart is not None:
                os.write(self._heart, b".")

    def __enter__(self) -> Self:
        signals = self._signals.number
        if signals is None:
            return self
        end, heart = os.pipe()
        for number in (end, heart):
            os.set_blocking(number, False)
        words = (os.getpid(), signals, end, self._silence, ",".join(str(int(number)) for number in FAREWELL))
        try:
            self._worker = Popen(  # noqa: S603 - ours
                (sys.executable, "-I", "-S", str(WORKER), *map(str, words)),
                stdin=DEVNULL, stdout=DEVNULL, stderr=DEVNULL,
                pass_fds=(signals, end), start_new_session=True,
            )  # fmt: skip
        finally:
            os.close(end)
        self._heart = heart
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        heart, self._heart = self._heart, None
        if heart is not None:
            os.close(heart)
        if self._worker is not None:
            self._worker.kill()
            self._worker.wait()
