"""A virtual device as it is plugged in: what is on its wire, and what it truly does."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, Protocol, TypeVar

from drivers.api import HeadPose, Pose2D
from drivers.virtual.terminal import WireDevice

T = TypeVar("T")


class VirtualPort(Protocol):
    """Where virtual devices are plugged in: a ``drivers.virtual.terminal.PseudoTerminal``, or what does for it elsewhere."""

    @property
    def path(self) -> str:
        """Where they are to be found."""
        ...

    def open(self) -> None:
        """Plug in."""
        ...

    def close(self) -> None:
        """Unplug. Safe more than once."""
        ...

    def unplug(self) -> None:
        """Pull the plug."""
        ...

    def replug(self) -> None:
        """Put it in again."""
        ...

    def call_paused(self, question: Callable[[], T]) -> T:
        """Ask the devices something while they stand still."""
        ...


@dataclass(frozen=True, slots=True)
class VirtualDevice:
    """A ``device`` on a wire, whose pseudo-terminal is called after ``port_name``; None for a part on the wire of another.

    ``port`` is where it is plugged in, if that is no pseudo-terminal; its device is then its own.

    A base tells its true ``pose`` at a time, a head where it truly ``head_pose``, and each its ``state`` in plain values.
    All are called while the terminal waits: the device is theirs alone.
    """

    device: WireDevice | None
    port_name: str = ""
    pose: Callable[[float], Pose2D] | None = None
    head_pose: Callable[[float], HeadPose] | None = None
    state: Callable[[float], object] | None = None
    port: VirtualPort | None = None


class WireBase(WireDevice, Protocol):
    """A virtual base with a simulated ``body``."""

    body: Any

    def pose(self, now: float) -> Pose2D:
        """Return the true pose."""
        ...


def make_virtual_base(device: WireBase, wire: str) -> VirtualDevice:
    """Return a virtual base on a wire; its state are pose and velocity."""

    def state(now: float) -> object:
        return asdict(device.pose(now)) | asdict(device.body.velocity)

    return VirtualDevice(device, wire, pose=device.pose, state=state)
