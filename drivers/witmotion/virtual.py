"""A virtual IMU of WitMotion's: it reports that the robot stands upright, a hundred times a second once it is told."""

from drivers.sim.context import SimContext
from drivers.virtual.device import VirtualDevice
from drivers.witmotion import wire
from drivers.witmotion.declared import WitMotionKeys

DEFAULT_INTERVAL, CONFIGURED_INTERVAL = 0.1, 0.01
"""Seconds from one report to the next."""


class VirtualWitMotion:
    """A ``drivers.virtual.terminal.WireDevice``. ``report`` is what it tells."""

    def __init__(self, baud: int = 115_200) -> None:
        self.baud = baud
        self.report = wire.WitMotionReport((0.0, 0.0, 9.81), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        self.interval = DEFAULT_INTERVAL
        self._received = b""
        self._unlocked = False
        self._due = 0.0

    def feed(self, data: bytes, now: float) -> bytes:
        """Hear what it is told; it answers nothing."""
        del now
        self._received = (self._received + data)[-3 * len(wire.UNLOCK) :]
        self._unlocked = self._unlocked or wire.UNLOCK in self._received
        if self._unlocked and wire.HUNDRED_HERTZ in self._received:
            self.interval = CONFIGURED_INTERVAL
        return b""

    def poll(self, now: float) -> bytes:
        """Report what is due by now; what nobody took for long is not made up for."""
        if now < self._due:
            return b""
        self._due = max(self._due + self.interval, now)
        return wire.pack(self.report)


def imu(keys: WitMotionKeys, stage: SimContext) -> VirtualDevice:  # noqa: ARG001 - all makers are called with both
    """Return a virtual IMU on a robot that stands upright."""
    return VirtualDevice(VirtualWitMotion(keys.baud), "imu")
