"""A pose from velocities: odometry where they are measured, dead reckoning where they are what a base was told."""

from math import cos, sin

from drivers.api import STILL, Pose2D, Velocity

STRAIGHT = 1e-9
"""Radians below which a way is straight."""


class Reckoning:
    """Adds up the way, in arcs. Its time is handed in; not safe between threads."""

    def __init__(self) -> None:
        self.pose = Pose2D(0.0, 0.0, 0.0)
        self.velocity = STILL
        self._stamp: float | None = None

    def advance(self, now: float, velocity: Velocity | None = None) -> None:
        """Go on until time ``now`` as fast as so far, and from then on at ``velocity``, if that is given."""
        if self._stamp is not None and now > self._stamp:
            self._roll(now - self._stamp)
        self._stamp = now
        if velocity is not None:
            self.velocity = velocity

    def pause(self) -> None:
        """Stand still where it is: nobody knows how it moves until ``advance`` is told again."""
        self._stamp, self.velocity = None, STILL

    def _roll(self, seconds: float) -> None:
        way, turn = self.velocity.linear * seconds, self.velocity.angular * seconds
        if way == turn == 0.0:
            return
        chord = way if abs(turn) < STRAIGHT else way * sin(turn / 2) / (turn / 2)
        x, y, heading = self.pose.x, self.pose.y, self.pose.heading
        along = heading + turn / 2
        self.pose = Pose2D(x + chord * cos(along), y + chord * sin(along), heading + turn)


class TwoWheels:
    """Two wheels, or two pairs of them, ``track`` metres apart, neither of which is told more than ``fastest`` m/s.

    Raises ValueError for values that are not positive.
    """

    def __init__(self, track: float, fastest: float) -> None:
        if not (track > 0 and fastest > 0):
            raise ValueError(f"base: {track=}, {fastest=}: out of range")
        self.track, self.fastest = track, fastest

    def within(self, velocity: Velocity) -> Velocity:
        """Return ``velocity``, slowed down as a whole until both wheels can follow."""
        excess = max(1.0, *(abs(speed) / self.fastest for speed in self.rims(velocity)))
        return velocity if excess == 1.0 else Velocity(velocity.linear / excess, velocity.angular / excess)

    def rims(self, velocity: Velocity) -> tuple[float, float]:
        """Return how fast the left and the right wheel are to turn, in m/s."""
        half = velocity.angular * self.track / 2
        return velocity.linear - half, velocity.linear + half

    def velocity(self, left: float, right: float) -> Velocity:
        """Return how a base moves whose wheels turn so fast (m/s)."""
        return Velocity((left + right) / 2, (right - left) / self.track)
