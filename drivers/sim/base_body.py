"""Simulated Kobuki base on the floor: true pose, collisions, sensors and current draw."""

from collections.abc import Iterable, Sequence
from math import cos, degrees, inf, remainder, sin, tau

from drivers.api import BASE_RADIUS, ZERO_VELOCITY, DockSignals, Pose2D, Sides, Velocity
from drivers.sim.battery import Battery
from drivers.sim.wheels import Encoders, GyroDrift, SimulatedWheels
from drivers.sim.world_objects import NO_SIGNALS, BackupLimit, Ground, OpenFloor

# What a simulated base draws: its motors by what they have to do, and all the rest of it.
#
# All figures are our assumption, but for the limit at which the base tells of an overload.

IDLE_CURRENT = 0.4
"""Amperes that the base draws at rest."""

OVERLOAD_CURRENT = 3.0
"""Amperes from which on the base reports a motor overload (vendor)."""

STALL_CURRENT = 3.5
"""Amperes of a motor at full power."""

_FRICTION_CURRENT = 0.15  # amperes, for a wheel that turns at all
_CURRENT_PER_SPEED = 0.3  # amperes more for each m/s of the rim
_CURRENT_PER_SLIP = 30.0  # amperes more for each metre that a wheel has slipped: its controller pushes ever harder


def motor_current(speed: float, slip_distance: float = 0.0) -> float:
    """Return the amperes of a motor whose wheel turns at ``speed`` (m/s at its rim).

    ``slip_distance`` is the metres that the wheel has turned since a solid object stopped the base.
    """
    if speed == 0.0:
        return 0.0
    return min(_FRICTION_CURRENT + _CURRENT_PER_SPEED * abs(speed) + _CURRENT_PER_SLIP * slip_distance, STALL_CURRENT)


BODY_COMMAND_TIMEOUT = 0.4
"""Seconds without a command after which the base stops.

The vendor documents no such limit; this is our assumption. It is longer than the timeout of the driver, so that the
simulated base does not hide a driver that fails to stop.
"""

ENCODER_STEP = 0.0000852920905
"""Metres of wheel travel per encoder tick of a Kobuki."""

MAX_STEP = 0.025
"""Seconds between two collision checks: 18 mm at full speed."""

TIME_TOLERANCE = 1e-6
"""Seconds below which two times count as equal: they differ by rounding errors."""

_BISECTION_STEPS = 6
"""Steps of the search for the place of a collision: an error of 0.3 mm at full speed."""

_BUMPER_CENTRE_ANGLE, _BUMPER_SIDE_ANGLE = 25.0, 90.0
"""Degrees from straight ahead up to which the centre, and the side, of the bumper is pressed; the rear has no bumper.
"""

_CLIFF_LEFT, _CLIFF_CENTRE, _CLIFF_RIGHT = (0.087, 0.136), (0.156, 0.0), (0.087, -0.136)
"""Positions of the cliff sensors, in metres forward and left, from the vendor's robot description."""

_WHEEL_LEFT, _WHEEL_RIGHT = (0.0, 0.115), (0.0, -0.115)
"""Positions of the wheels, in metres forward and left, from the vendor's robot description."""

NO_SIDES = Sides()
_BOTH_SIDES = Sides(left=True, right=True)


class BaseBody:
    """Simulated base: a disc on two ``wheels`` on the floor ``ground``. All methods take the time; not thread-safe.

    The body never enters a solid object: it stops in front of it while its wheels slip, so the encoders go on counting.
    With a wheel over an edge, or while ``lifted`` is True, it does not move until ``wheels.pose`` puts it down
    elsewhere. It is ``docked`` while its contacts touch the dock of the ground; ``force_docked`` docks it anywhere.
    ``bumper``, ``cliff``, ``wheel_drop`` and ``docked`` are updated by ``advance``. ``backup_limit`` is the limit of a
    Create 3 for driving backwards, or None. While ``e_stop`` is True the base ignores all velocities; while
    ``reversed`` is True its wheels turn the other way. The default battery never discharges.
    """

    def __init__(
        self, *, wheels: SimulatedWheels | None = None, ground: Ground | None = None, battery: Battery | None = None
    ) -> None:
        self.wheels = wheels or SimulatedWheels()
        self.battery = battery or Battery()
        self.lifted = self.docked = self.force_docked = self.e_stop = self.reversed = False
        self.speed_factor = 1.0
        """Share of the commanded speed that the base reaches: less than 1 uphill, more downhill."""
        self.wheel_encoders = Encoders(self.wheels)
        self.gyro_drift = GyroDrift()
        self.backup_limit: BackupLimit | None = None
        self.bumper = self.cliff = NO_SIDES
        self._ground = ground or OpenFloor()
        self._dock = self._ground.dock
        self._simulates_power = self._dock is not None or self.battery.drain > 0.0
        self._wheel_drop = NO_SIDES  # which wheels have no floor
        self._floor_sensor_pose: Pose2D | None = None
        self._contact_travel: tuple[float, float] | None = (
            None  # what the wheels had rolled when something came to hold it up
        )
        self._now: float | None = None
        self._setpoint_time = inf
        self._setpoint = (0.0, 0.0)

    @property
    def pose(self) -> Pose2D:
        """True pose of the base, in the world frame."""
        return self.wheels.pose

    @property
    def velocity(self) -> Velocity:
        """True velocity of the base: a solid object in the way stops it, but lets it turn."""
        if self.lifted or self._wheel_drop:
            return ZERO_VELOCITY
        velocity = self.wheels.velocity
        return Velocity(0.0, velocity.angular) if self._contact_travel is not None else velocity

    @property
    def wheel_drop(self) -> Sides:
        """Wheels that hang in the air; ``centre`` is never set."""
        return _BOTH_SIDES if self.lifted else self._wheel_drop

    @property
    def encoders(self) -> tuple[int, int]:
        """Counts of the left and the right wheel encoder; forward is positive."""
        left, right = self.wheel_encoders.travel
        return round(left / ENCODER_STEP), round(right / ENCODER_STEP)

    @property
    def currents(self) -> tuple[float, float]:
        """Amperes of the left and the right motor."""
        (left_speed, right_speed), (left, right) = self.wheels.speeds, (self.wheels.left, self.wheels.right)
        held = self._contact_travel or (left, right)
        found = motor_current(left_speed, abs(left - held[0])), motor_current(right_speed, abs(right - held[1]))
        if not self.wheels.blocked:
            return found
        left_stalls, right_stalls = self.wheels.stalled
        return STALL_CURRENT if left_stalls else found[0], STALL_CURRENT if right_stalls else found[1]

    @property
    def overcurrent(self) -> Sides:
        """Overloaded motors; ``centre`` is never set."""
        if self._contact_travel is None and not self.wheels.blocked:
            return NO_SIDES
        left, right = (amperes >= OVERLOAD_CURRENT for amperes in self.currents)
        return Sides(left=left, right=right) if left or right else NO_SIDES

    def dock_signals(self) -> DockSignals:
        """Return the beams of the dock that the receivers of the base get."""
        if self._dock is None or self._now is None:
            return NO_SIGNALS
        now, ground = self._now, self._ground
        return self._dock.signals(self.pose, lambda eye, point: ground.is_visible(eye, point, now))

    def command(self, linear: float, angular: float, now: float) -> None:
        """Command ``linear`` m/s and ``angular`` rad/s at time ``now``, for ``BODY_COMMAND_TIMEOUT`` seconds."""
        self.advance(now)
        self._setpoint_time, self._setpoint = now, (linear, angular)
        self._command_wheels(now)

    def advance(self, now: float) -> Pose2D:
        """Move until time ``now`` and return the true pose. Does nothing unless time has increased."""
        if self._now is not None and now - self._now < TIME_TOLERANCE:
            return self.wheels.pose
        deadline = self._setpoint_time + BODY_COMMAND_TIMEOUT
        if now > deadline:
            self._roll(deadline)
            self.wheels.command(0.0, 0.0, deadline)
            self._setpoint_time = inf
        self._roll(now)
        if self._simulates_power or self.force_docked or self.docked:
            self._draw_current(now)
        return self.wheels.pose

    def _command_wheels(self, now: float) -> None:
        """Send the setpoint to the wheels, changed by ``e_stop``, ``reversed``, the slope and the backup limit."""
        linear, angular = (0.0, 0.0) if self.e_stop else self._setpoint
        share = -self.speed_factor if self.reversed else self.speed_factor
        linear, angular = share * linear, share * angular
        if self.backup_limit is not None and self.backup_limit.is_reached:
            linear = max(linear, 0.0)
        self.wheels.command(linear, angular, now)

    def _roll(self, now: float) -> None:
        if self._now is None:
            self._now = now
            self._move(now)
        while self._now < now:
            self._now = min(now, self._now + MAX_STEP) if self.wheels.is_turning else now
            self._move(self._now)

    def _draw_current(self, now: float) -> None:
        """Discharge the battery, or charge it at the dock."""
        dock = None if self.wheel_drop else self._dock
        self.docked = self.force_docked or (dock is not None and dock.has_contact(self.wheels.pose, BASE_RADIUS))
        self.battery.advance(now, IDLE_CURRENT + sum(self.currents), docked=self.docked)

    def _move(self, now: float) -> None:
        """Make one step of the base, up to the first contact."""
        before, rolled = self.wheels.pose, self.wheels.left + self.wheels.right
        if before is not self._floor_sensor_pose:
            self._update_floor_sensors(before)  # it was put down here
        after = self.wheels.advance(now)
        if self.backup_limit is not None:
            self._limit_backing(self.backup_limit, (self.wheels.left + self.wheels.right - rolled) / 2, now)
        held, self._contact_travel = self._contact_travel, None
        if self.lifted or self._wheel_drop:
            after = before
        touched = self._contact_directions(after, now)
        if touched and _drives_into(touched, before, after):
            self._contact_travel = held or (self.wheels.left, self.wheels.right)
            after = self._find_contact_pose(before, after, now)
            touched = self._contact_directions(after, now)
        self.wheels.pose = after
        if after is not self._floor_sensor_pose:
            self._update_floor_sensors(after)
        self.bumper = _bumper_sides(touched, after.heading) if touched else NO_SIDES

    def _limit_backing(self, limit: BackupLimit, way: float, now: float) -> None:
        """Add ``way``, the metres driven, to the backup limit, and stop the base once it has reached the limit."""
        before = limit.is_reached
        if self.lifted:
            limit.on_lift()
        elif way:
            limit.on_travel(way)
        if limit.is_reached and not before and self._setpoint_time < inf:
            self._command_wheels(now)

    def _contact_directions(self, pose: Pose2D, now: float) -> Sequence[float]:
        """Return the directions in which a base at ``pose`` touches solid objects, in radians in the world frame."""
        return self._ground.contact_directions(pose.x, pose.y, BASE_RADIUS, now)

    def _find_contact_pose(self, before: Pose2D, after: Pose2D, now: float) -> Pose2D:
        """Return the pose between ``before`` and ``after`` at which the base just touches the obstacle."""
        free, stopped = 0.0, 1.0
        if _drives_into(self._contact_directions(before, now), before, after):
            stopped = 0.0
        for _ in range(_BISECTION_STEPS if stopped else 0):
            middle = (free + stopped) / 2
            if _drives_into(self._contact_directions(_interpolate(before, after, middle), now), before, after):
                stopped = middle
            else:
                free = middle
        return _interpolate(before, after, stopped)

    def _update_floor_sensors(self, pose: Pose2D) -> None:
        """Update cliff sensors and wheel drop for ``pose``."""
        self._floor_sensor_pose = pose
        c, s = cos(pose.heading), sin(pose.heading)

        def gap(spot: tuple[float, float]) -> bool:
            return not self._ground.has_floor(pose.x + spot[0] * c - spot[1] * s, pose.y + spot[0] * s + spot[1] * c)

        left, centre, right = gap(_CLIFF_LEFT), gap(_CLIFF_CENTRE), gap(_CLIFF_RIGHT)
        self.cliff = Sides(left, centre, right) if left or centre or right else NO_SIDES
        left, right = gap(_WHEEL_LEFT), gap(_WHEEL_RIGHT)
        self._wheel_drop = Sides(left=left, right=right) if left or right else NO_SIDES


def merge_sides(first: Sides, second: Sides) -> Sides:
    """Return the sides that are set in either argument."""
    if not first:
        return second
    return Sides(first.left or second.left, first.centre or second.centre, first.right or second.right)


def _interpolate(before: Pose2D, after: Pose2D, share: float) -> Pose2D:
    """Return the position a ``share`` (0..1) of the way from ``before`` to ``after``, with the heading of ``after``.

    A base that touches an obstacle can still turn, because it is a disc.
    """
    return Pose2D(before.x + share * (after.x - before.x), before.y + share * (after.y - before.y), after.heading)


def _drives_into(touched: Iterable[float], before: Pose2D, after: Pose2D) -> bool:
    """Return whether the move from ``before`` to ``after`` leads towards an obstacle in a direction of ``touched``.

    A move along the obstacle, or away from it, does not. Directions are in radians in the world frame.
    """
    x, y = after.x - before.x, after.y - before.y
    return any(x * cos(direction) + y * sin(direction) > 1e-9 for direction in touched)


def _bumper_sides(touched: Iterable[float], heading: float) -> Sides:
    """Return the parts of the bumper that contacts in the ``touched`` directions press."""
    angles = [degrees(remainder(direction - heading, tau)) for direction in touched]
    left = any(_BUMPER_CENTRE_ANGLE < angle <= _BUMPER_SIDE_ANGLE for angle in angles)
    centre = any(abs(angle) <= _BUMPER_CENTRE_ANGLE for angle in angles)
    right = any(-_BUMPER_SIDE_ANGLE <= angle < -_BUMPER_CENTRE_ANGLE for angle in angles)
    return Sides(left, centre, right) if left or centre or right else NO_SIDES
