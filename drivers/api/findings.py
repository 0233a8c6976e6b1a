"""What a check-up finds: of the machine, or of a device of the robot that its driver looks at."""

from collections.abc import Callable, Iterable
from typing import Any, Literal

from drivers.api.driver import Site
from drivers.api.quick import dataclass

Verdict = Literal["ok", "warning", "wrong"]


@dataclass(frozen=True, slots=True)
class Finding:
    """A line of a check-up: ``about`` which thing, ``what`` was found, and the ``cure`` where that is no good.

    In a cure ``ROBOT`` and ``PORT`` stand for the robot and the port that it is about; two blanks part a command from
    words on it.
    """

    about: str
    what: str
    verdict: Verdict = "ok"
    cure: str = ""


def warning(about: str, what: str, cure: str) -> Finding:
    """Return what may do harm, or will."""
    return Finding(about, what, "warning", cure)


def wrong(about: str, what: str, cure: str) -> Finding:
    """Return what keeps the robot from working."""
    return Finding(about, what, "wrong", cure)


Checkup = Callable[[Any, Site], Iterable[Finding]]
"""Looks at a device at rest: called with the keys of its section and a ``Site``, whose port is there and free.

It opens the device by itself, only reads, and closes it whatever happens: nothing moves, nothing is written. What it
raises of ``DriverError`` is told as wrong, with its hint.
"""
