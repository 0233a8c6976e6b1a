"""The line between a person's keyboard and this program: whether it may be long, and how late it is."""

import os
import termios
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event

from drivers.clock import Clock
from missions.hands.teleop.line_delay import LineDelay

RELAYS: Mapping[str, str] = {"TMUX": "tmux", "STY": "screen", "ZELLIJ": "zellij"}
"""Variables by which programs name themselves that answer for a terminal, wherever that is."""

RELAY_PROGRAMS = ("tmux", "screen", "zellij", "mosh-server")
REMOTE_PROGRAMS = ("sshd", "dropbear", "telnetd", "in.telnetd", "ttyd", "gotty")
REMOTE_VARIABLES = ("SSH_CONNECTION", "SSH_TTY")

LAST_ANSWERS = 0.6
"""Seconds for which answers are waited for in the end: the shell would take those that come later for keys."""


@contextmanager
def line_to(
    descriptor: int, clock: Clock, *, unknown_is_good: bool = False
) -> Iterator[tuple[LineDelay, Callable[[Callable[[float], str]], None]]]:
    """Give the delay of the terminal behind ``descriptor``, and a function that waits for its last answers.

    ``unknown_is_good`` lets keys drive also where the delay cannot be known.
    """
    programs = [*ancestors(os.getpid())]
    relay = _relay(programs)
    remote = bool(relay) or any(map(os.environ.get, REMOTE_VARIABLES)) or _any(programs, REMOTE_PROGRAMS)
    terminal = os.open(os.ttyname(descriptor), os.O_WRONLY | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)

    def write(text: str) -> None:
        with suppress(OSError):  # a line that takes nothing does not answer: that is what is measured
            os.write(terminal, text.encode("ascii"))

    def size() -> tuple[int, int]:
        with suppress(OSError):
            columns, rows = os.get_terminal_size(descriptor)
            if columns > 0 and rows > 0:
                return columns, rows
        return 80, 24

    line = LineDelay(write, clock, size, remote=remote, relay=relay, unknown_is_good=unknown_is_good)

    def settle(typed: Callable[[float], str]) -> None:
        until = clock.now() + LAST_ANSWERS
        while line.waiting and clock.now() < until:
            if typed(0.05) == "end":
                Event().wait(0.05)  # the terminal has gone, or Ctrl-D was pressed
        with suppress(termios.error):
            termios.tcflush(descriptor, termios.TCIFLUSH)

    try:
        yield line, settle
    finally:
        os.close(terminal)


def ancestors(process: int, folder: Path = Path("/proc")) -> Iterator[str]:
    """Yield the names of the programs that have started a process, the nearest first; none where there is no /proc."""
    while process > 1:
        try:
            text = (folder / str(process) / "stat").read_text(encoding="utf-8", errors="replace")
            name, _, rest = text.partition("(")[2].rpartition(")")
            process = int(rest.split()[1])
        except (OSError, ValueError, IndexError):
            return
        yield name


def _relay(programs: list[str]) -> str:
    """Return the name of a program that answers for the terminal; empty where there is none."""
    found = next((name for variable, name in RELAYS.items() if os.environ.get(variable)), "")
    return found or next((each for each in RELAY_PROGRAMS if _any(programs, (each,))), "")


def _any(programs: list[str], names: tuple[str, ...]) -> bool:
    return any(program.lower().startswith(names) for program in programs)
