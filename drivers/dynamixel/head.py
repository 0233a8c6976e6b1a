"""A head of two Dynamixel servos on the arm's bus: leads them on a thread of its own."""

from drivers.api import DeviceStatus, Joints, ignore
from drivers.joints_head import PERIOD, JointsHead
from drivers.loop import Loop, MakeLoop, ThreadLoop


class DynamixelHead(JointsHead[Joints]):
    """A ``JointsHead`` that steps itself while it is open. The arm's driver, which owns the bus, is opened besides."""

    make_loop: MakeLoop = ThreadLoop
    """Makes what steps it."""
    _loop: Loop | None = None
    _fault = ""

    def open(self) -> None:
        """Use the joints as soon as they are there; does nothing while it is open."""
        super().open()
        if self._loop is None:
            self._loop = self.make_loop(f"{self.name} joints", self._turn, ignore)
        self._loop.start()

    def close(self) -> None:
        """Take no step any more, and hold. Safe from any state, more than once."""
        if self._loop is not None:
            self._loop.end()
        super().close()

    def _turn(self) -> float:
        try:
            self.step()
        except BaseException as error:  # SystemExit too: without this thread the head would not even brake
            if (fault := f"{type(error).__name__}: {error}") != self._fault:
                self._fault = fault
                self._report(DeviceStatus(self.name, "fault", fault))
        return PERIOD
