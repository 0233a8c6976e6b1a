"""What all devices have in common: readings, health, notices, and how they begin and end."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import field
from enum import StrEnum
from typing import Annotated, Generic, Protocol, TypeVar, runtime_checkable

from drivers.api.fast_dataclass import dataclass
from drivers.api.keys import KeyDiagnostic, key, keys
from drivers.api.marks import UNSAMPLED, command, direct

T = TypeVar("T")


class Quality(StrEnum):
    """How far a reading can be trusted."""

    GOOD = "good"
    STALE = "stale"  # measured, but longer ago than the device's own limit
    NONE = "none"  # never measured


@dataclass(frozen=True, slots=True)
class Reading(Generic[T]):
    """A measured value, when it was measured (on the driver's clock), and how good it is.

    ``value`` is None exactly when ``quality`` is ``Quality.NONE``: a missed reply never looks like a number.
    """

    value: T | None
    stamp: float
    quality: Quality

    @property
    def good(self) -> bool:
        """True when the value is there and fresh."""
        return self.quality is Quality.GOOD


@dataclass(frozen=True, slots=True)
class Health:
    """Whether a device is there, and the figures of its wire.

    ``detail`` says in a few words what is the matter ("/dev/kobuki: no such device"), ``hint`` what to type next;
    both are empty when all is well. ``counters`` are totals since ``open``: frames, misses, checksum errors and so on.
    ``reconnected_at`` is when it was last back (on the driver's clock) from an absence so long that nothing that was decided
    before is to move it any more, see ``ReconnectPolicy``; None if there was none.
    """

    online: bool
    detail: str = ""
    hint: str = ""
    counters: Mapping[str, int] = field(default_factory=dict)
    reconnected_at: float | None = None


@keys
class ReconnectPolicy:
    """What a part that moves does when it is back: after how many seconds away it stays at rest, and for how long.

    After more than ``decide_after`` until somebody decides anew, after more than ``latch_after`` until somebody enables it: who
    stands beside it by then may believe that it is dead. A part that has started anew was away for ``decide_after`` at least.
    """

    decide_after: float = key(
        "duration",
        default=1.0,
        low=0.1,
        word="decide_after",
        help="Away for longer, it stays at rest until the mission decides anew what it is to do.",
    )
    latch_after: float = key(
        "duration",
        default=5.0,
        low=0.1,
        word="latch_after",
        help="Away for longer, it stays at rest until somebody enables it.",
    )

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield what does not go together."""
        if self.latch_after < self.decide_after:
            message = f"'latch_after' ({self.latch_after:g} s) is below 'decide_after' ({self.decide_after:g} s)"
            yield KeyDiagnostic(message, ("latch_after",), ("decide_after",))


@dataclass(frozen=True, slots=True)
class DeviceStatus:
    """The status that a device tells of itself unasked: ``kind`` is ``offline``, ``online`` or ``fault``."""

    device: str
    kind: str
    message: str
    hint: str = ""


StatusCallback = Callable[[DeviceStatus], None]
"""Where a driver sends its status; called mostly from the driver's own thread, must return at once.

What it raises is logged once and goes no further: a driver that reports must not come to harm by it.
"""


def ignore(*_args: object) -> None:
    """Do nothing: a callback of which nobody wants to be told."""


class Device(Protocol):
    """What all devices have in common."""

    @property
    @direct
    def name(self) -> str:
        """The part of the robot that it is: ``base``, ``head``, ``arm``, ``camera``, ``voice``."""
        ...

    @direct
    def open(self) -> None:
        """Start looking for the hardware, and start the threads; returns at once, hardware or not."""
        ...

    @command("before")
    def rest(self) -> None:
        """Bring every actuator to the rest that the robot file asks for. Safe from any state, more than once."""
        ...

    @direct
    def close(self) -> None:
        """Rest, then end the threads and release the port. Safe from any state, more than once."""
        ...

    def health(self) -> Annotated[Health, UNSAMPLED]:
        """Say whether the hardware is there."""
        ...


L = TypeVar("L")


@runtime_checkable
class Limitable(Protocol[L]):
    """A part that keeps within narrower limits than its robot file's while it runs, as all of ours can."""

    @property
    def limits(self) -> L:
        """Those that hold."""
        ...

    def restrict_limits(self, limits: L) -> L:
        """Keep within ``limits`` from now on, where they are narrower than the file's; return those that hold.

        From any thread. Raises BadRequest for limits that leave nothing.
        """
        ...


@runtime_checkable
class Latchable(Protocol):
    """A part that moves, and may stand still until somebody enables it: see ``ReconnectPolicy``."""

    @property
    def latched(self) -> str:
        """Why it is latched; empty while it is not."""
        ...

    def enable(self) -> None:
        """Let it move again: for a person to ask for, who has looked at it."""
        ...
