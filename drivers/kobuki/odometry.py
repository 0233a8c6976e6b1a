"""Where the base is: distance from the wheels' encoders, heading from the gyro. Frames and signs as in REP 105, 103."""

from math import cos, radians, sin

from drivers.api import STILL, Pose2D, Velocity
from drivers.kobuki.feedback import METRES_PER_TICK, Core, Inertia

GAP = 1.0
"""Seconds without a report after which the encoders' difference means nothing: the base may have been switched off
and on, and its counters begin anew; after 4 s at full speed they would also have wrapped unseen."""


class Odometry:
    """Adds up the reports of the base. The pose starts at zero with the first report, whatever the gyro says then."""

    def __init__(self) -> None:
        self.pose = Pose2D(0.0, 0.0, 0.0)
        self.velocity = STILL
        self._last: tuple[Core, Inertia, float] | None = None

    def anchor(self) -> None:
        """Take the next report as where the base is already: for one that may have counted anew meanwhile."""
        self._last = None
        self.velocity = STILL

    def update(self, core: Core, inertia: Inertia, now: float) -> None:
        """Move on by the difference to the report before; ``now`` in seconds is when this one came."""
        last, self._last = self._last, (core, inertia, now)
        if last is None:
            return
        core_before, inertia_before, before = last
        # By the base's own clock: the computer may be given several reports at once.
        elapsed = ((core.time_ms - core_before.time_ms) & 0xFFFF) / 1000
        if max(elapsed, now - before) > GAP:
            self.velocity = STILL
            return
        travel = (
            METRES_PER_TICK
            / 2
            * (
                _wrap(core.left_encoder - core_before.left_encoder, 0x10000)
                + _wrap(core.right_encoder - core_before.right_encoder, 0x10000)
            )
        )
        self._move(travel, radians(_wrap(inertia.heading_cdeg - inertia_before.heading_cdeg, 36000) / 100))
        if elapsed > 0:
            self.velocity = Velocity(travel / elapsed, inertia.rate)

    def _move(self, travel: float, turn: float) -> None:
        """Go ``travel`` metres along the mean heading of a turn by ``turn`` radians: a chord of the arc."""
        along = self.pose.heading + turn / 2
        self.pose = Pose2D(
            x=self.pose.x + travel * cos(along),
            y=self.pose.y + travel * sin(along),
            heading=self.pose.heading + turn,
        )


def _wrap(difference: int, period: int) -> int:
    """Return the difference of two counters that wrap at ``period``, as the shorter way round."""
    return (difference + period // 2) % period - period // 2
