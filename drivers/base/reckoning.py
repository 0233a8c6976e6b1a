"""Pose of a base from velocities: odometry if they are measured, dead reckoning if they are the commanded ones."""

from math import cos, inf, sin

from drivers.api import ZERO_VELOCITY, BaseState, Odometers, Pose2D, Velocity
from drivers.base.gyro_bias import GyroBias

MIN_TURN = 1e-9
"""Smallest turn in radians for which a path counts as an arc, and not as straight."""


class Reckoning:
    """Pose of a base by integrating its velocity along arcs. Not thread-safe."""

    def __init__(self) -> None:
        self.pose = Pose2D(0.0, 0.0, 0.0)
        self.velocity = ZERO_VELOCITY
        self._stamp: float | None = None

    def advance(self, now: float, velocity: Velocity | None = None) -> None:
        """Integrate the current velocity until ``now`` (seconds); then replace it by ``velocity`` unless None."""
        if self._stamp is not None and now > self._stamp:
            self._roll(now - self._stamp)
        self._stamp = now
        if velocity is not None:
            self.velocity = velocity

    def pause(self) -> None:
        """Keep the pose until the next ``advance``: the motion until then is unknown."""
        self._stamp, self.velocity = None, ZERO_VELOCITY

    def _roll(self, seconds: float) -> None:
        way, turn = self.velocity.linear * seconds, self.velocity.angular * seconds
        if way == turn == 0.0:
            return
        chord = way if abs(turn) < MIN_TURN else way * sin(turn / 2) / (turn / 2)
        x, y, heading = self.pose.x, self.pose.y, self.pose.heading
        along = heading + turn / 2
        self.pose = Pose2D(x + chord * cos(along), y + chord * sin(along), heading + turn)


class GyroOdometry:
    """Odometry of a base from two wheel encoders and a gyro. Not thread-safe.

    Distances come from the wheels, ``track`` metres apart, and headings from the gyro after removing its bias. Set the
    attribute ``commanded`` to True while the velocity last sent to the base is not zero.
    """

    def __init__(self, track: float) -> None:
        self.pose = Pose2D(0.0, 0.0, 0.0)
        self.velocity = ZERO_VELOCITY
        self.commanded = False
        self.bias = GyroBias()
        self.odometers = Odometers(0.0, 0.0, 0.0, 0.0)
        self._track = track

    def add(self, left: float, right: float, turn: float, rate: float, seconds: float) -> None:
        """Add the motion between two reports: travel of both wheels (m), turn (rad) and turn rate (rad/s) of the gyro.

        ``seconds`` is the time between the reports, by the clock of the base.
        """
        before = self.odometers
        counted, gyro = (before.left + left, before.right + right), (before.gyro or 0.0) + turn
        self.odometers = Odometers(*counted, (counted[1] - counted[0]) / self._track, gyro)
        travel, still = (left + right) / 2, left == right == 0.0 and not self.commanded
        turn, rate = self.bias.correct(turn, rate, seconds, still=still)
        along = self.pose.heading + turn / 2  # the chord of the arc
        x, y = self.pose.x + travel * cos(along), self.pose.y + travel * sin(along)
        self.pose = Pose2D(x, y, self.pose.heading + turn)
        if seconds > 0:
            self.velocity = Velocity(travel / seconds, rate)


class TwoWheels:
    """Kinematics of a base with two driven wheels (or wheel pairs), ``track`` metres apart.

    ``fastest`` is the maximum speed of a wheel in m/s. Raises ValueError if a value is not positive.
    """

    def __init__(self, track: float, fastest: float) -> None:
        if not (track > 0 and fastest > 0):
            raise ValueError(f"base: {track=}, {fastest=}: out of range")
        self.track, self.fastest = track, fastest

    def within(self, velocity: Velocity) -> Velocity:
        """Return ``velocity``, reduced until no wheel exceeds its maximum speed; the base stays on the same arc."""
        excess = max(1.0, *(abs(speed) / self.fastest for speed in self.rims(velocity)))
        return velocity if excess == 1.0 else Velocity(velocity.linear / excess, velocity.angular / excess)

    def rims(self, velocity: Velocity) -> tuple[float, float]:
        """Return the speeds of the left and the right wheel in m/s at which the base has ``velocity``."""
        half = velocity.angular * self.track / 2
        return velocity.linear - half, velocity.linear + half

    def velocity(self, left: float, right: float) -> Velocity:
        """Return the velocity of a base from its wheel speeds in m/s."""
        return Velocity((left + right) / 2, (right - left) / self.track)


class WheelOdometry:
    """Odometry of a base that reports its wheel speeds, or reports no motion at all. Not thread-safe.

    ``measured`` is False for a base without encoders: its pose is dead reckoning from the velocities that were sent.
    """

    def __init__(self, wheels: TwoWheels, *, measured: bool) -> None:
        self.wheels = wheels
        self.measured = measured
        self._reckoning = Reckoning()
        self._odometers = Odometers(0.0, 0.0, 0.0)
        self._reported_at = -inf

    def pause(self) -> None:
        """Keep the pose until the next report: the connection was lost."""
        self._reckoning.pause()
        self._reported_at = -inf

    def send(self, velocity: Velocity, now: float) -> tuple[float, float]:
        """Store a velocity that is sent to the base; return the speeds of its left and right wheel in m/s.

        Wheel speeds above the maximum are reduced, both in proportion.
        """
        velocity = self.wheels.within(velocity)
        if not self.measured:
            self._reckoning.advance(now, velocity)
        return self.wheels.rims(velocity)

    def report(
        self, now: float, speeds: tuple[float, float] | None, *, volts: float = 0.0, percent: float = 100.0
    ) -> BaseState:
        """Return the state of the base after a report at ``now``.

        ``speeds`` are the measured speeds of the left and right wheel in m/s, None if they are not measured.
        """
        odometers = None if speeds is None else self._count(now)
        self._reckoning.advance(now, None if speeds is None else self.wheels.velocity(*speeds))
        return BaseState(
            self._reckoning.pose,
            self._reckoning.velocity,
            battery_voltage=volts,
            battery_percent=percent,
            reckoned=not self.measured,
            odometers=odometers,
        )

    def _count(self, now: float) -> Odometers:
        """Return the travel of both wheels at ``now``, assuming the speeds of the last report since then."""
        left, right = self.wheels.rims(self._reckoning.velocity)
        seconds = max(now - self._reported_at, 0.0) if self._reported_at > -inf else 0.0
        before, self._reported_at = self._odometers, now
        left, right = before.left + left * seconds, before.right + right * seconds
        self._odometers = Odometers(left, right, (right - left) / self.wheels.track)
        return self._odometers
