"""Programs of others that speak: run once for each text, silenced with all that they have started."""

import os
import shlex
import signal
from collections.abc import Sequence
from contextlib import suppress
from subprocess import DEVNULL, PIPE, Popen, TimeoutExpired

from drivers.api.quick import dataclass
from drivers.clock import Clock
from drivers.errors import DeviceFault, NoReply
from drivers.pipe import last_words
from drivers.voice.cut import Cut

LINGERING = 0.2
"""Seconds for which a program's pipes are still read when it has ended: what it has started may hold them for ever."""


@dataclass(frozen=True, slots=True)
class Ran:
    """What a program that has ended wrote, if that was wanted, and the last line of its complaints."""

    output: bytes
    complaint: str


def run(
    name: str, command: Sequence[str], text: str, cut: Cut, clock: Clock, *, limit: float, wanted: bool = False
) -> Ran | None:
    """Run ``command`` for ``name``, ``text`` on its standard input; what it writes is kept if that is ``wanted``.

    Returns None when it was broken off. Raises DeviceFault when it cannot be run, or fails, and NoReply when it has not
    ended after ``limit`` seconds.
    """
    hint = f"echo hello | {shlex.join(command)}" + (" > hello.raw" if wanted else "")
    try:
        process = Popen(  # noqa: S603 - no shell, and what is said goes in through stdin
            command,
            stdin=PIPE,
            stdout=PIPE if wanted else DEVNULL,
            stderr=PIPE,
            start_new_session=True,  # so that programs which it starts fall silent with it
        )
    except OSError as error:
        raise DeviceFault(f"{name}: {command[0]}: {error}", hint=hint) from error
    with cut.then(lambda: _kill(process)):
        ran = _read(process, text.encode("utf-8", "replace"), clock, clock.now() + limit)
    if cut.made:
        return None
    if ran is None:
        raise NoReply(f"{name}: {command[0]}: has not ended after {limit:.0f} s", hint=hint)
    if process.returncode != 0:
        raise DeviceFault(f"{name}: {command[0]}: ended with {process.returncode}: {ran.complaint}", hint=hint)
    return ran


def _read(process: "Popen[bytes]", text: bytes, clock: Clock, until: float) -> Ran | None:
    """Return what a program says until it ends; None for one that had to be killed, since it did not in time."""
    given: bytes | None = text
    output: bytes | None
    complaint: bytes | None
    ended = killed = False
    while True:
        try:
            output, complaint = process.communicate(given, timeout=LINGERING)
            break
        except TimeoutExpired as late:
            given, output, complaint = None, late.output, late.stderr
        if ended:  # and was given the time to say its last
            break
        ended = process.poll() is not None
        if not ended and clock.now() > until:
            _kill(process)
            ended = killed = True
    process.poll()
    for pipe in (process.stdin, process.stdout, process.stderr):
        if pipe is not None:
            pipe.close()
    return None if killed else Ran(output or b"", last_words(complaint or b""))


def _kill(process: "Popen[bytes]") -> None:
    """Kill a program and whatever it started, unless it has been waited for and its number may be another's."""
    if process.returncode is None:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
