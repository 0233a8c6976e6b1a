"""Two axes on their way to a pose: what all heads share, whatever turns them.

A driver tells it the time and gets the angles to send. Goals, trims and stops may come from any thread.
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

# How a commanded angle gets to its goal: the motion profile of drivers whose servos know none of their own.

MAX_STEP = 0.1
"""Seconds that one step covers at most: a thread that was held up must not turn into a jump."""


@dataclass(slots=True)
class MotionProfile:
    """Goes to its goal in the shortest time that ``speed`` (rad/s) and ``acceleration`` (rad/s^2) allow.

    That is the trapezoidal profile: speed up, go on, brake. Its phases are worked out exactly for whatever time has
    passed, so it does not matter how often it is asked; a new goal is taken up in full motion, without a jerk of the
    angle. ``position`` in radians, ``velocity`` in rad/s; it starts at rest. ``braking_direction`` is which way it went (1 or -1)
    when it was told to brake, and 0 once it has a goal.
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
        """Start for ``goal`` at time ``now``, from where it has got to."""
        self.advance(now)
        self.goal, self.braking_direction = goal, 0.0

    def brake(self, now: float) -> None:
        """Come to rest as soon as the acceleration allows, from time ``now`` on."""
        self.advance(now)
        way = self.velocity or self.goal - self.position
        self.goal, self.braking_direction = (
            self._stopping_position(),
            copysign(1.0, way) if way else self.braking_direction,
        )

    def advance(self, now: float) -> float:
        """Move on until time ``now`` and return the position. Time that does not rise changes nothing."""
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
        """Where it is going now: to its goal, or, while it still goes the other way, to where it will have braked."""
        standstill = self._stopping_position()
        return standstill if (self.goal - standstill) * self.velocity < 0 else self.goal

    def set_position(self, position: float, now: float) -> None:
        """Go on from ``position`` (radians), where it turned out to stand at time ``now``; the goal stays."""
        self.position, self.velocity, self.stamp, self.braking_direction = position, 0.0, now, 0.0

    def shift(self, angle: float) -> None:
        """Call the present position by another number, ``angle`` (radians) greater; the goal's number stays."""
        self.position += angle

    def halt(self) -> None:
        """Stand still at the present position at once."""
        self.goal, self.velocity = self.position, 0.0

    def _stopping_position(self) -> float:
        """Where it would come to rest if it braked now."""
        return self.position + self.velocity * abs(self.velocity) / (2 * self.acceleration)

    def _phases(self) -> tuple[tuple[float, float], tuple[float, float], tuple[float, float]]:
        """Return the three phases from here to rest at the goal: how many seconds, with which acceleration (rad/s^2).

        Worked out as if the goal lay ahead: where it would overshoot, ahead is back. ``peak`` is the speed reached.
        """
        ahead = copysign(1.0, self.goal - self._stopping_position())
        way, begin = ahead * (self.goal - self.position), ahead * self.velocity
        peak = min(self.speed, sqrt(max(0.0, self.acceleration * way + begin**2 / 2)))
        gain, loss = (peak - begin) / self.acceleration, peak / self.acceleration
        even = way - (peak + begin) / 2 * abs(gain) - peak / 2 * loss  # it may be faster than it may go by now
        return (
            (abs(gain), copysign(self.acceleration, ahead * gain)),
            (max(0.0, even / peak) if peak > 0 else 0.0, 0.0),
            (loss, -ahead * self.acceleration),
        )


STRAIGHT_AHEAD = HeadPose(0.0, 0.0)

MAX_CATCH_UP = 0.02
"""Seconds of its way that a head makes up for at most in one step, after nothing might be sent for a while."""

MAX_TRIM = radians(45)
"""As far as the Rodney project's node lets a servo be trimmed."""


@runtime_checkable
class Trimmable(Protocol):
    """A head that can be put straight while it runs, and left where it stands, as all of ours can."""

    def skip_start_move(self) -> None:
        """Go nowhere when the hardware is there. To be called before ``open``."""
        ...

    def trim(self, *, pan: float | None = None, tilt: float | None = None) -> tuple[float, float]:
        """Set the trims that are given, in radians of the motor; return both. Raises BadRequest for over 45 degrees."""
        ...


class HeadAxis(Protocol):
    """How one axis is built in. ``trim`` (radians) corrects what sits askew, in the direction of the motor."""

    @property
    def trim(self) -> float:
        """What is added to the motor's angle, in radians."""
        ...

    @property
    def sign(self) -> int:
        """-1 where the motor turns the other way than the head, else 1."""
        ...

    @property
    def is_measured(self) -> bool:
        """Whether the motor reports its angle."""
        ...

    @property
    def range(self) -> tuple[float, float]:
        """The angles of the head (radians) that it may have and can reach, least and greatest."""
        ...

    def with_trim(self, trim: float) -> Self:
        """Return the same axis with another trim (radians). Raises ValueError for one that it cannot have."""
        ...


A = TypeVar("A", bound=HeadAxis)


@dataclass(frozen=True, slots=True)
class AxisStep(Generic[A]):
    """Where an axis is to be now, ``angle``, and where it is ``heading``, in radians of the head.

    ``braking_direction`` is which way it went (1 or -1) when it was told to brake, and 0 once it has a goal.
    """

    axis: A
    angle: float
    heading: float
    braking_direction: float


class PanTiltMotion(Generic[A]):
    """The goal of a head, and how far it has come.

    ``speed`` (rad/s) and ``acceleration`` (rad/s^2) are those of each axis. It begins at rest at ``start``, which is
    its first goal. Raises ValueError for values with which nothing would move.
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
            raise ValueError(f"{name}: a speed of {speed} rad/s gets it nowhere")
        if not (acceleration > 0 and isfinite(acceleration)):
            raise ValueError(f"{name}: an acceleration of {acceleration} rad/s^2 gets it nowhere")
        self._name = name
        self._axes = (pan, tilt)
        self._speed = self._max_speed = speed
        self._acceleration = acceleration
        self._lock = Lock()  # over the axes and the profiles, which the caller and the driver's thread both touch
        self._limits = self._limits_now()
        begin = self._limits.clamp(start)
        self._profiles = (MotionProfile(begin.pan, speed, acceleration), MotionProfile(begin.tilt, speed, acceleration))

    @property
    def axes(self) -> tuple[A, A]:
        """Pan and tilt, as they are trimmed now."""
        return self._axes

    @property
    def limits(self) -> HeadLimits:
        """How far, how fast and how hard it turns; a trim may take a little of the range."""
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
                f"{self._name}: look at {target}: not a finite number", hint="check what computed the goal"
            )

    def look(self, target: HeadPose, now: float) -> HeadPose:
        """Start for ``target`` at time ``now``; return the pose accepted after clamping."""
        with self._lock:
            accepted = self.limits.clamp(target)
            pan, tilt = self._profiles
            pan.set_goal(accepted.pan, now)
            tilt.set_goal(accepted.tilt, now)
        return accepted

    def brake(self, now: float) -> None:
        """Come to rest as soon as the acceleration allows."""
        with self._lock:
            for profile in self._profiles:
                profile.brake(now)

    def halt(self) -> None:
        """Stand still at once, where it was commanded last: for when nobody hears commands any more."""
        with self._lock:
            for profile in self._profiles:
                profile.halt()

    def set_position(self, pose: HeadPose, now: float) -> None:
        """Go on from ``pose``, where it turned out to stand at time ``now``; the goal stays."""
        with self._lock:
            for profile, angle in zip(self._profiles, (pose.pan, pose.tilt), strict=True):
                profile.set_position(angle, now)

    def pause_until(self, now: float, catch_up: float = MAX_CATCH_UP) -> None:
        """Let the time pass until ``now`` while nothing may be sent: so much of it (s) is made up for at most."""
        with self._lock:
            for profile in self._profiles:
                profile.stamp = max(profile.stamp, now - catch_up)

    def drop_goal(self, *, pan: float | None = None, tilt: float | None = None, now: float) -> None:
        """Give up the goal of each axis that is given: somebody has let go of it, and it stands at this angle."""
        with self._lock:
            for profile, angle in zip(self._profiles, (pan, tilt), strict=True):
                if angle is not None:
                    profile.set_position(angle, now)
                    profile.halt()

    def settle_at(self, angles: Iterable[float | None]) -> None:
        """Go on from each of these angles (pan, tilt; None for no change) once it rests there, stopped and not told."""
        with self._lock:
            for profile, angle in zip(self._profiles, angles, strict=True):
                if angle is not None and profile.braking_direction and profile.position == profile.goal:
                    profile.set_position(angle, profile.stamp)
                    profile.halt()

    def restrict_speed(self, speed: float, now: float) -> HeadLimits:
        """Turn no faster than so (rad/s), and no faster than it was made for; return the limits that hold."""
        if not speed > 0:
            raise BadRequest(f"{self._name}: a speed of {speed} rad/s gets it nowhere")
        with self._lock:
            self._speed = min(speed, self._max_speed)
            for profile in self._profiles:
                profile.advance(now)
                profile.speed = self._speed
            self._limits = self._limits_now()
        return self._limits

    def advance(self, now: float) -> tuple[AxisStep[A], AxisStep[A]]:
        """Move on until time ``now``; return where pan and tilt are to be."""
        with self._lock:
            (pan_axis, tilt_axis), (pan, tilt) = self._axes, self._profiles
            return (
                AxisStep(pan_axis, pan.advance(now), pan.heading, pan.braking_direction),
                AxisStep(tilt_axis, tilt.advance(now), tilt.heading, tilt.braking_direction),
            )

    def trim(self, *, pan: float | None = None, tilt: float | None = None, now: float) -> tuple[float, float]:
        """Set what is given (radians); return both trims. The head goes over to them as smoothly as to a new goal.

        Raises BadRequest for more than ``MAX_TRIM``, or a trim that leaves nothing of the range; nothing changes.
        """
        with self._lock:
            wanted = [self._with_trim(axis, trim) for axis, trim in zip(self._axes, (pan, tilt), strict=True)]
            for profile, old, new in zip(self._profiles, self._axes, wanted, strict=True):
                profile.advance(now)
                # The motor stands where it stood; what has changed is which angle of the head that is.
                profile.shift(-new.sign * (new.trim - old.trim))
                profile.set_goal(min(max(profile.goal, new.range[0]), new.range[1]), now)
            self._axes = (wanted[0], wanted[1])
            self._limits = self._limits_now()
        return wanted[0].trim, wanted[1].trim

    def _with_trim(self, axis: A, trim: float | None) -> A:
        if trim is None:
            return axis
        try:
            return axis.with_trim(trim)
        except ValueError as error:
            raise BadRequest(f"{self._name}: {error}", hint="mount the horn anew, nearer to the middle") from error


# The half of a head that leads two axes to where it is told: what all heads obey and answer alike.


class ProfiledHead(Generic[A]):
    """The part of a ``drivers.api.Head`` that is the same on all: it leads the axes of ``way``, a step at a time.

    A subclass has the wire, or the bodies, of its servos, and calls ``changed`` whenever its pose has changed.
    """

    name = "head"

    LAG = 0.0
    """Seconds by which its servos are behind the poses that it notes."""

    def __init__(self, clock: Clock, motion: PanTiltMotion[A], changed: Callable[[], None]) -> None:
        self._clock = clock
        self._motion = motion
        self._changed = guard_callback(changed)
        self._history = ValueHistory()
        self._has_start = False  # it has gone for its start, or is not to
        self._is_settled = False  # it stands, and nothing is left to be sent

    @property
    def limits(self) -> HeadLimits:
        """How far, how fast and how hard it turns."""
        return self._motion.limits

    def pose_at(self, stamp: float) -> HeadPose | None:
        """Where the servos stood at a past time, interpolated; None when that is not known."""
        values = self._history.at(stamp - self.LAG)
        return None if values is None else HeadPose(*values)

    def stop(self) -> None:
        """Brake, within its acceleration, and hold."""
        self._motion.brake(self._sync_time())
        self._is_settled = False

    def trim(self, *, pan: float | None = None, tilt: float | None = None) -> tuple[float, float]:
        """Set the trims that are given, in radians of the servo, while it runs; return both.

        Raises BadRequest for more than 45 degrees. May be called from any thread, connected or not.
        """
        self._is_settled = False
        return self._motion.trim(pan=pan, tilt=tilt, now=self._sync_time())

    def restrict_limits(self, limits: HeadLimits) -> HeadLimits:
        """See ``drivers.api.Limitable``: of its speed, at once and within its acceleration."""
        return self._motion.restrict_speed(limits.speed, self._sync_time())

    def skip_start_move(self) -> None:
        """Go nowhere when its servos are there. To be called before ``open``."""
        self._has_start = True

    def rest(self) -> None:
        """Hold: hobby servos know no other rest, and what rest means for the torque of joints is up to the arm."""
        self.stop()

    def _sync_time(self) -> float:
        """Return the time, until which it has moved as far as it could."""
        return self._clock.now()
