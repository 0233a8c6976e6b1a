"""Programs of others that speak: run once for each text, silenced with all that they have started."""

import os
import shlex
import signal
from collections.abc import Sequence
from contextlib import suppress
from subprocess import DEVNULL, PIPE, Popen

from drivers.errors import DeviceFault
from drivers.voice.cut import Cut

LONGEST_COMPLAINT = 200
"""Characters of a program's last words that are passed on."""


def run(name: str, command: Sequence[str], text: str, cut: Cut, *, wanted: bool = False) -> bytes | None:
    """Run ``command`` for ``name``, ``text`` on its standard input; return what it writes, if that is ``wanted``.

    Returns None when it was broken off. Raises DeviceFault when it cannot be run, or fails.
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
        output, complaint = process.communicate(text.encode("utf-8", "replace"))
    if cut.made:
        return None
    if process.returncode != 0:
        words = complaint.decode("utf-8", "replace").strip()[-LONGEST_COMPLAINT:]
        raise DeviceFault(f"{name}: {command[0]}: ended with {process.returncode}: {words}", hint=hint)
    return output or b""


def _kill(process: "Popen[bytes]") -> None:
    """Kill a program and whatever it started, unless it has been waited for and its number may be another's."""
    if process.returncode is None:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
