"""Motion of two axes to a pose, shared by all heads.

A driver passes the time and gets the angles to send. Goals, trims and stops may come from any thread.
"""

from collections.abc import Callable, Iterable
from dataclasses import field
from math import copysign, isfinite, radians, sqrt
from threading import Lock
from typing import Generic, Protocol, Self, TypeVar, runtime_checkable

from drivers.api import HEAD_ACCELERATION, HeadLimits, HeadPose
from drivers.api.fast_dataclass import dataclass
from drivers.clock import Clock
from drivers.errors import BadRequest
from drivers.transport.history import ValueHistory
from drivers.transport.loop import guard_callback

# Motion profile, for drivers of servos without one of their own.

MAX_STEP = 0.1
"""Maximum seconds of one step of a motion: a delayed thread must not cause a jump."""


@dataclass(slots=True)
class MotionProfile:
    """Trapezoidal profile: fastest motion to the goal within ``speed`` (rad/s) and ``acceleration`` (rad/s^2).

    The phases are computed exactly for the elapsed time, so the result does not depend on the step; a new goal is
    accepted in motion, without a jump of the angle. ``position`` in radians, ``velocity`` in rad/s; initially at rest.
    ``braking_direction`` is the direction of motion (1 or -1) at the last ``brake``, and 0 after a new goal.
    """

    position: float
    speed: float
    acceleration: float
    velocity: float = 0.0
    goal: float = field(init=False)
    stamp: float = 0.0
    braking_direction: float = 0.0

    def __post_init__(self) -> None:
        self.goal = self.position

    def set_goal(self, goal: float, now: float) -> None:
        """Start moving to ``goal`` at time ``now``, from the current position."""
        self.advance(now)
        self.goal, self.braking_direction = goal, 0.0

    def brake(self, now: float) -> None:
        """Brake within the acceleration, from time ``now`` on."""
        self.advance(now)
        way = self.velocity or self.goal - self.position
        self.goal, self.braking_direction = (
            self._stopping_position(),
            copysign(1.0, way) if way else self.braking_direction,
        )

    def advance(self, now: float) -> float:
        """Advance to time ``now`` and return the position. A time in the past changes nothing."""
        left = now - self.stamp
        if left <= 0.0:
            return self.position
        self.stamp = now
        if self.position == self.goal and self.velocity == 0.0:
            return self.position
        left = min(left, MAX_STEP)
        for seconds, acceleration in self._phases():
            step = min(seconds, left)
            self.position += (self.velocity + acceleration * step / 2) * step
            self.velocity += acceleration * step
            left -= step
            if step < seconds:
                return self.position
        self.position, self.velocity = self.goal, 0.0
        return self.position

    @property
    def heading(self) -> float:
        """Position to which the axis moves now: the goal, or the stopping position if it must turn back to the goal."""
        standstill = self._stopping_position()
        return standstill if (self.goal - standstill) * self.velocity < 0 else self.goal

    def set_position(self, position: float, now: float) -> None:
        """Continue from ``position`` (radians) at time ``now``, at rest; the goal stays."""
        self.position, self.velocity, self.stamp, self.braking_direction = position, 0.0, now, 0.0

    def shift(self, angle: float) -> None:
        """Add ``angle`` (radians) to ``position`` after a change of the trim; neither the axis nor the goal moves."""
        self.position += angle

    def halt(self) -> None:
        """Stop at the current position at once."""
        self.goal, self.velocity = self.position, 0.0

    def _stopping_position(self) -> float:
        """Return the position after braking from now on."""
        return self.position + self.velocity * abs(self.velocity) / (2 * self.acceleration)

    def _phases(self) -> tuple[tuple[float, float], tuple[float, float], tuple[float, float]]:
        """Return the three phases until rest at the goal, each as seconds and acceleration (rad/s^2).

        The axis changes its speed, keeps it, and brakes. If braking at once would overshoot the goal, the motion turns
        back.
        """
        ahead = copysign(1.0, self.goal - self._stopping_position())
        way, begin = ahead * (self.goal - self.position), ahead * self.velocity
        peak = min(self.speed, sqrt(max(0.0, self.acceleration * way + begin**2 / 2)))
        gain, loss = (peak - begin) / self.acceleration, peak / self.acceleration
        even = (
            way - (peak + begin) / 2 * abs(gain) - peak / 2 * loss
        )  # negative if the maximum speed was reduced during the motion
        return (
            (abs(gain), copysign(self.acceleration, ahead * gain)),
            (max(0.0, even / peak) if peak > 0 else 0.0, 0.0),
            (loss, -ahead * self.acceleration),
        )


STRAIGHT_AHEAD = HeadPose(0.0, 0.0)

MAX_CATCH_UP = 0.02
"""Maximum seconds of motion that a head makes up for in one step, after a pause in which nothing was sent."""

MAX_TRIM = radians(45)
"""Maximum trim in radians, as in the Rodney project's node."""


@runtime_checkable
class Trimmable(Protocol):
    """Head whose trims can be changed while it runs, and that can skip its start movement."""

    def skip_start_move(self) -> None:
        """Do not move to the start pose at the first connection. Call it before ``open``."""
        ...

    def trim(self, *, pan: float | None = None, tilt: float | None = None) -> tuple[float, float]:
        """Set the given trims, in radians of the motor; return both. Raises BadRequest for more than 45 degrees."""
        ...


class HeadAxis(Protocol):
    """Mounting of one axis of a head. ``trim`` (radians) corrects a skewed mounting, in the direction of the motor."""

    @property
    def trim(self) -> float:
        """Offset that is added to the motor's angle, in radians."""
        ...

    @property
    def sign(self) -> int:
        """-1 if the motor turns the other way than the head, else 1."""
        ...

    @property
    def is_measured(self) -> bool:
        """Whether the motor reports its angle."""
        ...

    @property
    def range(self) -> tuple[float, float]:
        """Range of the head's angle in radians that is permitted and reachable."""
        ...

    def with_trim(self, trim: float) -> Self:
        """Return the same axis with another trim (radians).

        Raises ValueError for more than 45 degrees, or a trim that leaves an empty range.
        """
        ...


A = TypeVar("A", bound=HeadAxis)


@dataclass(frozen=True, slots=True)
class AxisStep(Generic[A]):
    """Step of an axis: its ``angle`` now, and its current target ``heading``, in radians of the head.

    ``braking_direction`` is the direction of motion (1 or -1) at the last brake, and 0 after a new goal.
    """

    axis: A
    angle: float
    heading: float
    braking_direction: float


class PanTiltMotion(Generic[A]):
    """Motion of both axes of a head to its goal.

    ``speed`` (rad/s) and ``acceleration`` (rad/s^2) hold for each axis. Initially the motion is at rest at ``start``,
    which is its first goal. Raises ValueError unless both are positive and finite. Thread-safe.
    """

    def __init__(
        self,
        name: str,
        pan: A,
        tilt: A,
        *,
        speed: float,
        acceleration: float = HEAD_ACCELERATION,
        start: HeadPose = STRAIGHT_AHEAD,
    ) -> None:
        if not (speed > 0 and isfinite(speed)):
            raise ValueError(f"{name}: a speed of {speed} rad/s is not positive")
        if not (acceleration > 0 and isfinite(acceleration)):
            raise ValueError(f"{name}: an acceleration of {acceleration} rad/s^2 is not positive")
        self._name = name
        self._axes = (pan, tilt)
        self._speed = self._max_speed = speed
        self._acceleration = acceleration
        self._lock = Lock()  # over axes and profiles, which the caller and the driver's thread both use
        self._limits = self._limits_now()
        begin = self._limits.clamp(start)
        self._profiles = (MotionProfile(begin.pan, speed, acceleration), MotionProfile(begin.tilt, speed, acceleration))

    @property
    def axes(self) -> tuple[A, A]:
        """Pan and tilt axes, with their current trims."""
        return self._axes

    @property
    def limits(self) -> HeadLimits:
        """Range, maximum speed and acceleration of the head; a trim may reduce the range."""
        return self._limits

    def _limits_now(self) -> HeadLimits:
        pan, tilt = self._axes
        return HeadLimits(
            pan.range, tilt.range, self._speed, self._acceleration, measured=pan.is_measured and tilt.is_measured
        )

    @property
    def is_still(self) -> bool:
        """True while both axes are at rest at their goals."""
        pan, tilt = self._profiles
        return pan.position == pan.goal and tilt.position == tilt.goal and pan.velocity == tilt.velocity == 0.0

    def check(self, target: HeadPose) -> None:
        """Raise BadRequest for a pose that is not finite."""
        if not (isfinite(target.pan) and isfinite(target.tilt)):
            raise BadRequest(
                f"{self._name}: look at {target}: not a finite number", hint="check the computation of the goal"
            )

    def look(self, target: HeadPose, now: float) -> HeadPose:
        """Start moving to ``target`` (radians) at time ``now``; return the pose accepted after clamping."""
        with self._lock:
            accepted = self.limits.clamp(target)
            pan, tilt = self._profiles
            pan.set_goal(accepted.pan, now)
            tilt.set_goal(accepted.tilt, now)
        return accepted

    def brake(self, now: float) -> None:
        """Brake both axes within their acceleration, from time ``now`` on."""
        with self._lock:
            for profile in self._profiles:
                profile.brake(now)

    def halt(self) -> None:
        """Stop both axes at once at the last setpoint, when the motors cannot be reached any more."""
        with self._lock:
            for profile in self._profiles:
                profile.halt()

    def set_position(self, pose: HeadPose, now: float) -> None:
        """Continue from ``pose`` at time ``now``, at rest; the goal stays."""
        with self._lock:
            for profile, angle in zip(self._profiles, (pose.pan, pose.tilt), strict=True):
                profile.set_position(angle, now)

    def pause_until(self, now: float, catch_up: float = MAX_CATCH_UP) -> None:
        """Skip the time until ``now``, in which nothing was sent; the axes make up for ``catch_up`` seconds of it."""
        with self._lock:
            for profile in self._profiles:
                profile.stamp = max(profile.stamp, now - catch_up)

    def drop_goal(self, *, pan: float | None = None, tilt: float | None = None, now: float) -> None:
        """Stop each axis for which an angle is given, at rest at this angle (radians), and drop its goal."""
        with self._lock:
            for profile, angle in zip(self._profiles, (pan, tilt), strict=True):
                if angle is not None:
                    profile.set_position(angle, now)
                    profile.halt()

    def settle_at(self, angles: Iterable[float | None]) -> None:
        """Continue from ``angles`` (pan, tilt; radians) on each axis that is at rest after a brake; None: no change."""
        with self._lock:
            for profile, angle in zip(self._profiles, angles, strict=True):
                if angle is not None and profile.braking_direction and profile.position == profile.goal:
                    profile.set_position(angle, profile.stamp)
                    profile.halt()

    def restrict_speed(self, speed: float, now: float) -> HeadLimits:
        """Set the maximum speed (rad/s), up to the initial one; return the limits in force.

        Raises BadRequest unless it is positive.
        """
        if not speed > 0:
            raise BadRequest(f"{self._name}: a speed of {speed} rad/s is not positive")
        with self._lock:
            self._speed = min(speed, self._max_speed)
            for profile in self._profiles:
                profile.advance(now)
                profile.speed = self._speed
            self._limits = self._limits_now()
        return self._limits

    def advance(self, now: float) -> tuple[AxisStep[A], AxisStep[A]]:
        """Advance to time ``now``; return the steps of pan and tilt."""
        with self._lock:
            (pan_axis, tilt_axis), (pan, tilt) = self._axes, self._profiles
            return (
                AxisStep(pan_axis, pan.advance(now), pan.heading, pan.braking_direction),
                AxisStep(tilt_axis, tilt.advance(now), tilt.heading, tilt.braking_direction),
            )

    def trim(self, *, pan: float | None = None, tilt: float | None = None, now: float) -> tuple[float, float]:
        """Set the given trims (radians); return both. The head moves over smoothly, as to a new goal.

        Raises BadRequest for more than ``MAX_TRIM``, or a trim that leaves an empty range; then nothing changes.
        """
        with self._lock:
            axes = [self._with_trim(axis, trim) for axis, trim in zip(self._axes, (pan, tilt), strict=True)]
            for profile, old, new in zip(self._profiles, self._axes, axes, strict=True):
                profile.advance(now)
                # The motor stays; only the angle of the head that belongs to its position has changed.
                profile.shift(-new.sign * (new.trim - old.trim))
                profile.set_goal(min(max(profile.goal, new.range[0]), new.range[1]), now)
            self._axes = (axes[0], axes[1])
            self._limits = self._limits_now()
        return axes[0].trim, axes[1].trim

    def _with_trim(self, axis: A, trim: float | None) -> A:
        if trim is None:
            return axis
        try:
            return axis.with_trim(trim)
        except ValueError as error:
            raise BadRequest(f"{self._name}: {error}", hint="mount the horn again, nearer to the middle") from error


# Common part of all heads: commands and queries that need no hardware.


class ProfiledHead(Generic[A]):
    """Base class of heads that follow a motion profile: all of ``drivers.api.Head`` except the hardware.

    A subclass sends the angles of ``motion`` to its servos, or simulates them, and calls ``changed`` with each change
    of its pose.
    """

    name = "head"

    LAG = 0.0
    """Seconds by which the servos lag behind the recorded poses."""

    def __init__(self, clock: Clock, motion: PanTiltMotion[A], changed: Callable[[], None]) -> None:
        self._clock = clock
        self._motion = motion
        self._changed = guard_callback(changed)
        self._history = ValueHistory()
        self._has_start = False  # it has moved to its start pose, or skips that
        self._is_settled = False  # it is at rest, and all setpoints are sent

    @property
    def limits(self) -> HeadLimits:
        """Range, maximum speed and acceleration of the head."""
        return self._motion.limits

    def pose_at(self, stamp: float) -> HeadPose | None:
        """Pose of the servos at a past time, interpolated; None if unknown."""
        values = self._history.at(stamp - self.LAG)
        return None if values is None else HeadPose(*values)

    def stop(self) -> None:
        """Brake the head within its acceleration, and hold."""
        self._motion.brake(self._sync_time())
        self._is_settled = False

    def trim(self, *, pan: float | None = None, tilt: float | None = None) -> tuple[float, float]:
        """Set the given trims, in radians of the servo; return both.

        Raises BadRequest for more than 45 degrees. Callable from any thread, online or offline.
        """
        self._is_settled = False
        return self._motion.trim(pan=pan, tilt=tilt, now=self._sync_time())

    def restrict_limits(self, limits: HeadLimits) -> HeadLimits:
        """Restrict the maximum speed, at once and within the acceleration; see ``drivers.api.Limitable``."""
        return self._motion.restrict_speed(limits.speed, self._sync_time())

    def skip_start_move(self) -> None:
        """Do not move to the start pose at the first connection. Call it before ``open``."""
        self._has_start = True

    def rest(self) -> None:
        """Stop the head and hold it.

        Hobby servos cannot be relaxed; the joints of an arm are relaxed by the arm.
        """
        self.stop()

    def _sync_time(self) -> float:
        """Return the current time; a subclass may pause the motion first."""
        return self._clock.now()
