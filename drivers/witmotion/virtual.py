"""A virtual IMU of WitMotion's: it reports that the robot stands upright, a hundred times a second once it is told."""

from drivers.sim.stage import Stage
from drivers.virtual.plugged import Plugged
from drivers.witmotion import wire
from drivers.witmotion.declared import WitMotionKeys

AS_IT_COMES, TOLD = 0.1, 0.01
"""Seconds from one report to the next."""


class VirtualWitMotion:
    """A ``drivers.virtual.terminal.WireDevice``. ``report`` is what it tells."""

    def __init__(self, baud: int = 115_200) -> None:
        self.baud = baud
        self.report = wire.Report((0.0, 0.0, 9.81), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        self.period = AS_IT_COMES
        self._heard = b""
        self._unlocked = False
        self._due = 0.0

    def feed(self, data: bytes, now: float) -> bytes:
        """Hear what it is told; it answers nothing."""
        del now
        self._heard = (self._heard + data)[-3 * len(wire.UNLOCK) :]
        self._unlocked = self._unlocked or wire.UNLOCK in self._heard
        if self._unlocked and wire.HUNDRED_HERTZ in self._heard:
            self.period = TOLD
        return b""

    def poll(self, now: float) -> bytes:
        """Report what is due by now; what nobody took for long is not made up for."""
        if now < self._due:
            return b""
        self._due = max(self._due + self.period, now)
        return wire.pack(self.report)


def imu(keys: WitMotionKeys, stage: Stage) -> Plugged:  # noqa: ARG001 - all makers are called with both
    """Return a virtual IMU on a robot that stands upright."""
    return Plugged(VirtualWitMotion(keys.baud), "imu")
