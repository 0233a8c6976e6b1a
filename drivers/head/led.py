"""The half of a head that leads two axes to where it is told: what all heads obey and answer alike."""

from collections.abc import Callable
from typing import Generic

from drivers.api import HeadLimits, HeadPose
from drivers.clock import Clock
from drivers.head.pantilt import A, PanTilt
from drivers.transport.guard import guarded
from drivers.transport.history import History


class LedHead(Generic[A]):
    """The part of a ``drivers.api.Head`` that is the same on all: it leads the axes of ``way``, a step at a time.

    A subclass has the wire, or the bodies, of its servos, and calls ``changed`` whenever its pose has changed.
    """

    name = "head"

    TRAILS = 0.0
    """Seconds by which its servos are behind the poses that it notes."""

    def __init__(self, clock: Clock, way: PanTilt[A], changed: Callable[[], None]) -> None:
        self._clock = clock
        self._way = way
        self._changed = guarded(changed)
        self._history = History()
        self._began = False  # it has gone for its start, or is not to
        self._settled = False  # it stands, and nothing is left to be sent

    @property
    def limits(self) -> HeadLimits:
        """How far, how fast and how hard it turns."""
        return self._way.limits

    def pose_at(self, stamp: float) -> HeadPose | None:
        """Where the servos stood at a past time, interpolated; None when that is not known."""
        values = self._history.at(stamp - self.TRAILS)
        return None if values is None else HeadPose(*values)

    def stop(self) -> None:
        """Brake, within its acceleration, and hold."""
        self._way.brake(self._now())
        self._settled = False

    def trim(self, *, pan: float | None = None, tilt: float | None = None) -> tuple[float, float]:
        """Set the trims that are given, in radians of the servo, while it runs; return both.

        Raises BadRequest for more than 45 degrees. May be called from any thread, connected or not.
        """
        self._settled = False
        return self._way.trim(pan=pan, tilt=tilt, now=self._now())

    def curb(self, limits: HeadLimits) -> HeadLimits:
        """See ``drivers.api.Curbed``: of its speed, at once and within its acceleration."""
        return self._way.curb(limits.speed, self._now())

    def stay(self) -> None:
        """Go nowhere when its servos are there. To be called before ``open``."""
        self._began = True

    def rest(self) -> None:
        """Hold: hobby servos know no other rest, and what rest means for the torque of joints is up to the arm."""
        self.stop()

    def _now(self) -> float:
        """Return the time, until which it has moved as far as it could."""
        return self._clock.now()
