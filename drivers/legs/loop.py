"""A base that walks by itself: on a thread of its own, 100 times a second."""

from drivers.api import DeviceStatus, ignore
from drivers.legs.driver import LegsBase
from drivers.legs.engine import PERIOD
from drivers.loop import Loop, MakeLoop, ThreadLoop

RESTING = 0.02
"""Seconds from one look at the joints to the next while it stands."""

LAST_STEPS = 4.0
"""Seconds that a walk has to come to its end when the base is closed."""


class WalkingBase(LegsBase):
    """A ``LegsBase`` that steps itself while it is open."""

    make_loop: MakeLoop = ThreadLoop
    """Makes what steps it."""
    _loop: Loop | None = None
    _fault = ""

    def open(self) -> None:
        """Use the joints as soon as they are there; does nothing while it is open."""
        super().open()
        if self._loop is None:
            self._loop = self.make_loop(f"{self.name} legs", self._turn, ignore)
        self._loop.start()

    def close(self) -> None:
        """Let a walk come to its end, for ``LAST_STEPS`` at most; then take no step any more."""
        self.stop()
        if self._loop is not None:
            if self._loop.alive:
                self.stands.wait(LAST_STEPS)
            self._loop.end()
        super().close()

    def _turn(self) -> float:
        began = self._clock.now()
        try:
            self.step()
        except BaseException as error:  # SystemExit too: without this thread the walk would stop in mid-step
            if (fault := f"{type(error).__name__}: {error}") != self._fault:
                self._fault = fault
                self._report(DeviceStatus(self.name, "fault", fault))
        return max(0.0, (PERIOD if self.walking else RESTING) - (self._clock.now() - began))
