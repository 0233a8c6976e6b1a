"""Virtual devices for simulation: each has a port for the real driver, and its true state for the simulated world."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, Protocol, TypeVar

from drivers.api import HeadPose, Pose2D
from drivers.virtual.terminal import WireDevice

T = TypeVar("T")


class VirtualPort(Protocol):
    """Port of virtual devices: a ``drivers.virtual.terminal.PseudoTerminal``, or a replacement."""

    @property
    def path(self) -> str:
        """Path at which a driver opens the port."""
        ...

    def open(self) -> None:
        """Plug the devices in."""
        ...

    def close(self) -> None:
        """Unplug the devices for good. Safe more than once."""
        ...

    def unplug(self) -> None:
        """Unplug the devices, so that the port disappears."""
        ...

    def replug(self) -> None:
        """Plug the devices in again."""
        ...

    def call_paused(self, question: Callable[[], T]) -> T:
        """Return the result of ``question``, which is called while the devices are paused."""
        ...


@dataclass(frozen=True, slots=True)
class VirtualDevice:
    """Virtual device on the wire: ``device`` with a port of the name ``port_name``.

    ``device`` is None for a part that another device simulates. ``port`` is its port if that is not a pseudo-terminal.
    A base has ``pose``, which returns its true pose at a time, a head has ``head_pose``; ``state`` returns the true
    state as plain values. These functions are called while the device is paused.
    """

    device: WireDevice | None
    port_name: str = ""
    pose: Callable[[float], Pose2D] | None = None
    head_pose: Callable[[float], HeadPose] | None = None
    state: Callable[[float], object] | None = None
    port: VirtualPort | None = None


class WireBase(WireDevice, Protocol):
    """Virtual base with a simulated ``body``."""

    body: Any

    def pose(self, now: float) -> Pose2D:
        """Return the true pose of the base."""
        ...


def make_virtual_base(device: WireBase, wire: str) -> VirtualDevice:
    """Return a virtual base with the port name ``wire``; its state is its true pose and velocity."""

    def state(now: float) -> object:
        return asdict(device.pose(now)) | asdict(device.body.velocity)

    return VirtualDevice(device, wire, pose=device.pose, state=state)
