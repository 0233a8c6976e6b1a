"""What all recorders have in common, and the words in which a test says what they should have kept."""

from typing import TypeVar

from drivers.api import (
    Health,
    Quality,
    Reading,
)
from drivers.clock import ManualClock
from drivers.errors import NotConnected

T = TypeVar("T")
C = TypeVar("C")

STOP, HOLD, RELAX, REST, CANCEL, RECOVER = "stop", "hold", "relax", "rest", "cancel", "recover"
LATCH, ENABLE = "latch", "enable"
"""The commands without a value, as recorders keep them; with joints, as a tuple: ``(HOLD, "elbow")``."""

GONE = NotConnected("the cable is out", hint="plug it in")


def good(value: T) -> Reading[T]:
    """Return a fresh reading."""
    return Reading(value, 0.0, Quality.GOOD)


def stale(value: T) -> Reading[T]:
    """Return a reading from too long ago."""
    return Reading(value, 0.0, Quality.STALE)


def none() -> Reading[T]:
    """Return the reading of what was never measured."""
    return Reading(None, 0.0, Quality.NONE)


class Recorder:
    """What all recorders have in common: ``trouble`` is raised by every command that may raise, which is not kept."""

    def __init__(self, name: str, clock: ManualClock) -> None:
        self.name = name
        self.clock = clock
        self.commands: list[object] = []
        self.times: list[float] = []
        self.trouble: Exception | None = None

    def keep(self, command: C) -> C:
        """Keep a command, or raise the trouble."""
        if self.trouble is not None:
            raise self.trouble
        return self.keep_anyway(command)

    def keep_anyway(self, command: C) -> C:
        """Keep a command that is safe in any state."""
        self.commands.append(command)
        self.times.append(self.clock.now())
        return command

    def open(self) -> None:
        """Do nothing."""

    def rest(self) -> None:
        """Keep that it was told to rest."""
        self.keep_anyway(REST)

    def close(self) -> None:
        """Do nothing."""

    def health(self) -> Health:
        """Say that it is there, unless it is in trouble."""
        return Health(self.trouble is None, str(self.trouble or ""))
