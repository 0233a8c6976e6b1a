"""How far off a target is, in two ways: where it will be when a command acts, or as the newest picture shows it."""

import math
from typing import Protocol

from behaviours.tracking.foresight import Foresight
from behaviours.tracking.lag import Turning
from drivers.api import HeadPose
from drivers.api.quick import dataclass
from perception.api import Percept


@dataclass(frozen=True, slots=True)
class Offset:
    """How far left and down of the aim a target is (radians), and two rates (rad/s) that go with it."""

    left: float = 0.0
    down: float = 0.0
    left_rate: float = 0.0
    down_rate: float = 0.0


class View(Protocol):
    """A way to see a target."""

    def off(self, target: Percept, *, time: float, base: Turning, aim: HeadPose) -> Offset:
        """Return how far off the target is at ``time``, when the base stands as ``base`` says and the aim is ``aim``.

        ``aim`` is in the robot's frame, radians.
        """
        ...


class Expected:
    """Where a target will be, as far as that can be foreseen. The rates are its own, as seen from a base that turns.

    ``acceleration`` (rad/s^2) is what head or base are able to.
    """

    def __init__(self, acceleration: float) -> None:
        self._acceleration = acceleration
        self._id: int | None = None
        self._yaw = self._pitch = Foresight(acceleration)

    def off(self, target: Percept, *, time: float, base: Turning, aim: HeadPose) -> Offset:
        """Return how far it will be from the aim."""
        if target.id != self._id:
            self._id, self._yaw, self._pitch = target.id, Foresight(self._acceleration), Foresight(self._acceleration)
        ahead = time - target.stamp
        across = target.yaw - target.bearing, base.heading + aim.pan
        down = target.pitch - target.elevation, aim.tilt
        yaw, yaw_rate = self._yaw.foretell(target.stamp, target.yaw, target.yaw_rate, ahead, across)
        pitch, pitch_rate = self._pitch.foretell(target.stamp, target.pitch, target.pitch_rate, ahead, down)
        # The remainder takes the shorter way round to a target behind.
        bearing = math.remainder(yaw - base.heading, math.tau)
        return Offset(bearing - aim.pan, pitch - aim.tilt, yaw_rate - base.rate, pitch_rate)


class Shown:
    """The offset that pictures show, with nothing foreseen: how far off the camera's axis it was in the newest of them.

    The rates are how fast that changes from picture to picture.
    """

    def __init__(self) -> None:
        self._newest: tuple[int, float, Offset] | None = None

    def off(self, target: Percept, *, time: float, base: Turning, aim: HeadPose) -> Offset:
        """Return how far it was from the camera's axis."""
        del time, base, aim
        found = Offset(target.bearing, target.elevation)
        if self._newest is not None:
            number, stamp, before = self._newest
            if number == target.id and stamp == target.stamp:
                return before
            since = target.stamp - stamp
            if number == target.id and since > 0:
                rates = (found.left - before.left) / since, (found.down - before.down) / since
                found = Offset(found.left, found.down, *rates)
        self._newest = target.id, target.stamp, found
        return found
