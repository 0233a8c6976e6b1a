"""Commands that run out of memory: said so, with what to do, whichever error it came as."""

import errno
import resource

import click

ENOUGH_MEMORY = 1_000_000_000
"""Bytes of address space with which every command works: simulation and cameras take 0.6 GB."""

SIGNS = (
    "failed to map segment",
    "cannot allocate memory",
    "insufficient memory",
    "can't start new thread",
    "unable to allocate",
    "failed to allocate",
)
"""Parts of the messages of libraries that have run out of memory, in small letters."""


class OutOfMemoryError(Exception):
    """A command has run out of memory; the message says what failed."""


def shortage(error: BaseException) -> str:
    """Return what failed for lack of memory: this error, or one that has led to it; nothing where none did."""
    seen: list[BaseException] = []
    at: BaseException | None = error
    while at is not None and at not in seen:
        seen.append(at)
        if isinstance(at, MemoryError) or (isinstance(at, OSError) and at.errno == errno.ENOMEM):
            return str(at) or "no memory is left"
        for line in _words(at).splitlines():
            if any(sign in line.lower() for sign in SIGNS):
                return line.strip()[-200:]
        at = at.__cause__ or at.__context__
    return ""


def _words(error: BaseException) -> str:
    """Return the message of an error; nothing where it cannot be read, or may be for lack of processes."""
    try:
        words = str(error)
    except Exception:  # of somebody else's
        return ""
    return "" if "start new thread" in words and limit() is None else words


def limit() -> int | None:
    """Return the bytes of memory that this process may take, as ``ulimit -v`` and ``-d`` say; None for any number."""
    found = [resource.getrlimit(each)[0] for each in (resource.RLIMIT_AS, resource.RLIMIT_DATA)]
    return min((each for each in found if each != resource.RLIM_INFINITY), default=None)


def tell_of_limit() -> None:
    """Warn of a limit that is low: libraries in C may end the process without a word when they run into it."""
    allowed = limit()
    if allowed is not None and allowed < ENOUGH_MEMORY:
        said = f"mission: memory is limited to {allowed / 1e6:.0f} MB, so this may run out of memory"
        click.echo(f"{said}\n  try: {advice(allowed)}", err=True)


def advice(allowed: int | None) -> str:
    """Return what to do about a lack of memory, where so many bytes are ``allowed``."""
    if allowed is not None:
        return f"ulimit -v unlimited; ulimit -d unlimited  (in this shell; now {allowed // 1024} kB)"
    return "free -m  (what is left), and end what takes it"
