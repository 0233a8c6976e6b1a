"""Common types of all devices: readings, health, status reports, reconnect policy, and life cycle."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import field
from enum import StrEnum
from typing import Annotated, Generic, Protocol, TypeVar, runtime_checkable

from drivers.api.fast_dataclass import dataclass
from drivers.api.keys import KeyDiagnostic, key, keys
from drivers.api.marks import UNSAMPLED, command, direct

T = TypeVar("T")


class Quality(StrEnum):
    """Validity of a reading: good (recent), stale (older than the device's own limit), or none (never measured)."""

    GOOD = "good"
    STALE = "stale"  # measured, but longer ago than the device's own limit
    NONE = "none"  # never measured


@dataclass(frozen=True, slots=True)
class Reading(Generic[T]):
    """Measured value with its time (on the driver's clock) and its quality.

    ``value`` is None exactly when ``quality`` is ``Quality.NONE``: a missed reply never looks like a number.
    """

    value: T | None
    stamp: float
    quality: Quality

    @property
    def good(self) -> bool:
        """True if the reading has a value that is fresh."""
        return self.quality is Quality.GOOD


@dataclass(frozen=True, slots=True)
class Health:
    """Connection state of a device, with the counters of its wire.

    ``detail`` describes a problem in a few words ("/dev/kobuki: no such device"), ``hint`` is the next command to type;
    both are empty without a problem. ``counters`` are totals since ``open``: frames, misses, checksum errors and so on.
    ``reconnected_at`` is the time (driver's clock) of the last reconnect after an absence so long that earlier commands
    are dropped, see ``ReconnectPolicy``; None if there was none.
    """

    online: bool
    detail: str = ""
    hint: str = ""
    counters: Mapping[str, int] = field(default_factory=dict)
    reconnected_at: float | None = None


@keys
class ReconnectPolicy:
    """Reconnect policy of an actuator: when to require a new command, when to latch.

    After more than ``decide_after`` seconds offline, the part stays at rest until a new command. After more than
    ``latch_after`` seconds it stays at rest until a person enables it: a bystander may believe by then that it is dead.
    After a restart of the device a new command is required, too, however short the absence was.
    """

    decide_after: float = key(
        "duration",
        default=1.0,
        low=0.1,
        word="decide_after",
        help="After a longer absence it rests until a new command of the mission.",
    )
    latch_after: float = key(
        "duration",
        default=5.0,
        low=0.1,
        word="latch_after",
        help="After a longer absence it is latched until a person enables it.",
    )

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield an error if ``latch_after`` is below ``decide_after``."""
        if self.latch_after < self.decide_after:
            message = f"'latch_after' ({self.latch_after:g} s) is below 'decide_after' ({self.decide_after:g} s)"
            yield KeyDiagnostic(message, ("latch_after",), ("decide_after",))


@dataclass(frozen=True, slots=True)
class DeviceStatus:
    """Status that a device reports by itself; ``kind`` is ``offline``, ``online`` or ``fault``."""

    device: str
    kind: str
    message: str
    hint: str = ""


StatusCallback = Callable[[DeviceStatus], None]
"""Receives the status of a device, mostly on the driver's own thread; must return at once.

An exception is logged once and suppressed: it must not harm the driver.
"""


def ignore(*_args: object) -> None:
    """Do nothing: the default callback."""


class Device(Protocol):
    """Common protocol of all devices."""

    @property
    @direct
    def name(self) -> str:
        """Name of the part in the robot file: ``base``, ``head``, ``arm``, ``camera``, ``voice``."""
        ...

    @direct
    def open(self) -> None:
        """Start the threads and the search for the hardware; returns at once, with or without hardware."""
        ...

    @command("before")
    def rest(self) -> None:
        """Bring every actuator to the state of rest that the robot file sets. Safe from any state, more than once."""
        ...

    @direct
    def close(self) -> None:
        """Bring the actuators to rest, end the threads and release the port. Safe from any state, more than once."""
        ...

    def health(self) -> Annotated[Health, UNSAMPLED]:
        """Return whether the hardware is online, and the counters of its wire."""
        ...


L = TypeVar("L")


@runtime_checkable
class Limitable(Protocol[L]):
    """Part whose limits can be narrowed at run time, within those of its robot file."""

    @property
    def limits(self) -> L:
        """Limits of the part that are in force."""
        ...

    def restrict_limits(self, limits: L) -> L:
        """Set ``limits``, clamped to those of the robot file; return the limits in force.

        Callable from any thread. Raises BadRequest for an empty range.
        """
        ...


@runtime_checkable
class Latchable(Protocol):
    """Actuator that can be latched, until a person enables it; see ``ReconnectPolicy``."""

    @property
    def latched(self) -> str:
        """Reason of the latch; empty if not latched."""
        ...

    def enable(self) -> None:
        """Release the latch, at the request of a person who has checked the part."""
        ...
