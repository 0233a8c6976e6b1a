"""The spy behind each recorder, and the words in which a test says what it should have kept."""

from collections.abc import Callable
from typing import Any, ClassVar, TypeVar

from drivers.api import Device, Health, Quality, Reading
from drivers.api.marks import members
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


class Spy:
    """A part that keeps its commands: ``trouble`` is raised by every command that may raise, which is not kept.

    A command of the ``protocol`` that no method here is written for is kept as its name, or as a tuple of its name and
    arguments: ``("chirp", 0.5)``. A question or property that none is written for raises NotConnected until the test
    sets it.
    """

    protocol: ClassVar[type] = Device

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

    def __getattr__(self, name: str) -> Any:
        """Return a member of the protocol for which there is no method."""
        member = members(self.protocol).get(name)
        if member is None:
            raise AttributeError(f"{type(self).__name__} has no {name!r}")
        if member.command is not None:
            return lambda *given, **named: self._keep_call(name, *given, *named.values())
        unknown = NotConnected(f"{self.name}: no test has set its {name}", hint=f"set bench.{self.name}.{name}")
        if member.kind == "property":
            raise unknown
        return _raising(unknown)

    def _keep_call(self, name: str, *arguments: object) -> None:
        self.keep((name, *arguments) if arguments else name)


def _raising(error: NotConnected) -> Callable[..., object]:
    def ask(*_: object) -> object:
        raise error

    return ask
