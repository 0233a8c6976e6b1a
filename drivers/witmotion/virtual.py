"""Virtual WitMotion IMU at wire level: reports an upright robot, 100 times per second once configured."""

from drivers.sim.context import SimContext
from drivers.virtual.device import VirtualDevice
from drivers.witmotion import wire
from drivers.witmotion.declared import WitMotionKeys

DEFAULT_INTERVAL, CONFIGURED_INTERVAL = 0.1, 0.01
"""Seconds between two reports."""


class VirtualWitMotion:
    """Virtual IMU: a ``drivers.virtual.terminal.WireDevice``. A test may set ``report``, the content of its reports."""

    def __init__(self, baud: int = 115_200) -> None:
        self.baud = baud
        self.report = wire.WitMotionReport((0.0, 0.0, 9.81), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        self.interval = DEFAULT_INTERVAL
        self._received = b""
        self._unlocked = False
        self._due = 0.0

    def feed(self, data: bytes, now: float) -> bytes:
        """Handle commands; there are no replies."""
        del now
        self._received = (self._received + data)[-3 * len(wire.UNLOCK) :]
        self._unlocked = self._unlocked or wire.UNLOCK in self._received
        if self._unlocked and wire.HUNDRED_HERTZ in self._received:
            self.interval = CONFIGURED_INTERVAL
        return b""

    def poll(self, now: float) -> bytes:
        """Return the report that is due at ``now``, if any. Missed reports are not sent later."""
        if now < self._due:
            return b""
        self._due = max(self._due + self.interval, now)
        return wire.pack(self.report)


def imu(keys: WitMotionKeys, context: SimContext) -> VirtualDevice:  # noqa: ARG001 - all makers are called with both
    """Return a virtual IMU on an upright robot."""
    return VirtualDevice(VirtualWitMotion(keys.baud), "imu")
