"""Range guard of a base: a safety zone that slows or stops the base before obstacles that its range finder sees.

The guard checks the area that the base covers until it has stopped, along the commanded arc: during its reaction time
and its stop distance. If an obstacle is in it, both speeds are reduced in proportion, so that the base stays on the
arc. An obstacle nearer than the configured gap forbids only motion towards it, so that the base can turn or back off. A
moving obstacle may come from any direction, at its measured speed. The clock is not read: times are arguments. Not
thread-safe.
"""

from collections.abc import Callable
from math import atan2, ceil, cos, degrees, inf, sin, sqrt
from typing import TYPE_CHECKING

import numpy as np

from drivers.api import ZERO_VELOCITY, DeviceStatus, Ranger, RangeScan, StatusCallback, Velocity
from drivers.api.measures import length_text
from drivers.api.steering import MIN_GAP, OBSTACLE_REASON, OUT_OF_SIGHT_REASON, SCANS_LATE_REASON, SCANS_MISSING_REASON
from drivers.base.footprint import BaseOutline, Floats, PathPoses
from drivers.base.limits import VelocityLimits
from drivers.base.seen_points import Placed, SeenPoints, flaw_of
from drivers.transport.history import ValueHistory

if TYPE_CHECKING:
    from drivers.api.steering import RangeGuardKeys

LATE_AFTER, MISSING_AFTER = 0.5, 2.0
"""Age in seconds of the newest scan, from its middle, from which on it is late, and missing."""

BLIND_SPEED = 0.1
"""Maximum speed in m/s of any point of the base while scans are late, or in a direction without scans."""

RENEWAL_INTERVAL = 0.04
"""Seconds until the range guard checks the velocity again."""

SPACING, MAX_STATIONS = 0.02, 48
"""Distance in metres between checked places of the path, and their maximum number."""

NOISE, GRAZING = 0.005, 0.15
"""Metres by which noise may make a wall beside the base appear nearer, and metres of path to which this applies. Such
a wall may be nearer than the gap, down to ``MIN_GAP``."""

OWN_PARTS = 0.02
"""Depth in metres inside the outline of the base beyond which a scanned point belongs to the robot itself."""

START_SPEED, MIN_SPEED = 0.03, 0.008
"""Permitted speed in m/s at which a stopped base starts, and below which it stops."""

DOCKING_SPEED = 0.06
"""Maximum forward speed in m/s, commanded and current, at which a base may touch its dock.

The base must receive the near beams of the dock.
"""

SHARES = (1.0, 0.85, 0.7, 0.55, 0.42, 0.32, 0.24, 0.18, 0.13, 0.09, 0.06, 0.04, 0.0)
"""Shares of the commanded speed that the range guard tries, in this order, if an obstacle moves."""

ROUNDING = 1e-4
REPORT_INTERVAL = 10.0


class RangeGuard:
    """Reduces velocities for the obstacles in the scans of ``ranger``, for a base with this ``outline``.

    ``keys`` are its settings in the robot file. ``poses`` is the pose history of the base: heading, x and y.
    ``reaction`` is the time in seconds from a command to its effect. ``near_dock`` returns whether the base receives
    the near beams of its dock, or is docked. ``blind`` are the sectors that the range finder does not see. The
    attribute ``stops`` is True while the guard keeps the base at rest.
    """

    def __init__(
        self,
        ranger: Ranger,
        keys: "RangeGuardKeys",
        outline: BaseOutline,
        poses: ValueHistory,
        *,
        reaction: float,
        near_dock: Callable[[], bool],
        report: StatusCallback,
        blind: tuple[tuple[float, float], ...] = (),
    ) -> None:
        self.stops = False
        self._ranger, self._keys, self._outline, self._poses = ranger, keys, outline, poses
        self._reaction, self._near_dock, self._report = reaction, near_dock, report
        self._points = SeenPoints(ranger.place, blind)
        self._scan: RangeScan | None = None
        self._came_at = -inf
        self._failure = ""
        self._reported: dict[str, float] = {}

    def limit(
        self, going: Velocity, wanted: Velocity, limits: VelocityLimits, now: float, *, reflex: bool = False
    ) -> tuple[Velocity, str]:
        """Return the velocity that obstacles permit, and the reason for a reduction (empty if there is none).

        ``going`` is the velocity of the next cycle, ``wanted`` the setpoint that the ramp approaches. ``reflex`` is
        True during a back-off, which is permitted even without scans: it leads away from an obstacle.
        """
        age = self._update_points(now)
        if age > MISSING_AFTER and not reflex:
            self.stops = True
            return ZERO_VELOCITY, self._report_reason(f"{SCANS_MISSING_REASON}{self._failure}", now)
        reach = self._reach(going)
        if reach == 0.0:
            self.stops = False
            return going, ""
        # A stopped base starts again only if it can go on for a while: scans are noisy.
        least = min(START_SPEED, self._reach(wanted)) if self.stops else MIN_SPEED
        probe = _scaled(going, max(1.0, least / reach)) if self.stops else going
        share, why = self._allowed(probe, limits, now)
        share *= self._reach(probe) / reach
        if share * reach < least * (1.0 - 1e-9) and why:
            share = 0.0
        late = (
            SCANS_LATE_REASON if age > LATE_AFTER else OUT_OF_SIGHT_REASON if self._leaves_sight(going, limits) else ""
        )
        if late and share * reach > BLIND_SPEED:
            share, why = BLIND_SPEED / reach, self._report_reason(late, now) if late is SCANS_LATE_REASON else late
        if share >= 1.0:
            self.stops = False
            return going, ""
        if 0.0 < wanted.linear <= DOCKING_SPEED and 0.0 < going.linear <= DOCKING_SPEED and self._near_dock():
            self.stops = False
            return going, ""
        self.stops = share == 0.0
        return _scaled(going, share) if share else ZERO_VELOCITY, why

    def rest(self, now: float) -> None:
        """Read the scans while no source drives the base.

        So the guard knows obstacles that its range finder no longer sees when they are very near.
        """
        self.stops = False
        self._update_points(now)

    def _reach(self, velocity: Velocity) -> float:
        """Return an upper bound of the speed in m/s of all points of the outline at ``velocity``.

        It is 0 for a round base that turns on the spot, because its outline then stays in the same place.
        """
        if velocity.linear == 0.0 and self._outline.round:
            return 0.0
        return abs(velocity.linear) + abs(velocity.angular) * self._outline.radius

    def _update_points(self, now: float) -> float:
        """Read the newest scan; return its age in seconds, infinity if there is no valid one."""
        self._failure = ""
        try:
            scan = self._ranger.scan().value
        except Exception as error:  # of any kind: without scans the base stops
            self._failure = f": {str(error) or type(error).__name__}"
            return inf
        if scan is not None and scan is not self._scan:
            if flaw := flaw_of(scan):
                self._failure = f": {flaw}"
                return inf
            pose = self._poses.at(scan.stamp)
            if pose is not None:
                self._points.add(scan, _to_pose(pose), now)
                self._scan, self._came_at = scan, now
        if self._scan is None:
            return inf
        # Two clocks may differ: the age of a scan from the future counts from its arrival.
        return now - min(self._scan.stamp, self._came_at)

    def _allowed(self, going: Velocity, limits: VelocityLimits, now: float) -> tuple[float, str]:
        """Return the share of ``going`` (0 to 1) at which the base stops before all obstacles.

        The second result is the reason as text, such as the nearest obstacle; empty if the share is 1.
        """
        newest = self._poses.newest()
        if newest is None:
            return 0.0, SCANS_MISSING_REASON
        stamp, values = newest
        reaction = self._reaction + RENEWAL_INTERVAL + max(0.0, now - stamp)
        braking = max(abs(going.linear) / limits.linear_acceleration, abs(going.angular) / limits.angular_acceleration)
        reach = self._reach(going)
        length = max(reaction + braking / 2, GRAZING / reach)  # of the path, in seconds at full speed
        # Moving obstacles have moved on since the scan.
        age = 0.0 if self._scan is None else max(0.0, now - self._scan.stamp)
        found = self._near(_to_pose(values), going, length, age + reaction + braking)
        if found is None:
            return 1.0, ""
        x, y, speeds = found
        count = min(ceil(reach * length / SPACING), MAX_STATIONS)
        times = np.linspace(0.0, length, count + 1)
        clear = self._outline.clearance(x, y, _along(going, times))
        own = clear[:, 0] < -OWN_PARTS
        if own.any():
            x, y, speeds, clear = x[~own], y[~own], speeds[~own], clear[~own]
            if not len(x):
                return 1.0, ""
        now_clear = clear[:, :1]
        passed = min(self._keys.gap, float(now_clear.min())) - NOISE
        gap = np.where(clear.min(axis=1, keepdims=True) >= passed, max(MIN_GAP, passed), self._keys.gap)
        margin = clear - np.minimum(now_clear, gap)
        share, place = _share_until(margin, times, reaction, braking)
        if self._points.moving and share > 0.0:
            share, place = _share_among_moving(
                clear, now_clear, speeds, gap, times, reaction, braking, age, (share, place)
            )
        if share >= 1.0:
            return 1.0, ""
        return share, _words(float(now_clear[place, 0]), float(x[place]), float(y[place]))

    def _near(
        self, pose: Placed, going: Velocity, length: float, seconds: float
    ) -> tuple[Floats, Floats, Floats] | None:
        """Return positions and speeds of the points that the base may meet from ``pose`` on; None if there are none.

        The positions are in the frame of ``pose``. The base moves with ``going`` for ``length`` seconds, moving points
        move for ``seconds``.
        """
        points = self._points
        heading, x, y = pose
        dx, dy = points.x - x, points.y - y
        within = self._outline.radius + self._keys.gap + abs(going.linear) * length
        far = dx * dx + dy * dy
        if points.moving:
            near = np.flatnonzero(far <= (within + points.speeds * seconds) ** 2)
        else:
            near = np.flatnonzero(far <= within * within)
        if not len(near):
            return None
        dx, dy, c, s = dx[near], dy[near], cos(heading), sin(heading)
        return dx * c + dy * s, dy * c - dx * s, points.speeds[near]

    def _leaves_sight(self, going: Velocity, limits: VelocityLimits) -> bool:
        """Return whether the base would enter an area that its range finder does not see."""
        gaps = self._points.gaps
        if not gaps or self._keys.unseen == "free":
            return False
        length = self._reaction + RENEWAL_INTERVAL + abs(going.linear) / limits.linear_acceleration / 2
        path = _along(going, np.array([length]))
        rim, c, s = self._outline.rim, cos(float(path.heading[0])), sin(float(path.heading[0]))
        x = rim[:, 0] * c - rim[:, 1] * s + path.x[0]
        y = rim[:, 0] * s + rim[:, 1] * c + path.y[0]
        here = PathPoses(np.zeros(1), np.zeros(1), np.zeros(1))
        outside = self._outline.clearance(x, y, here)[:, 0] > 1e-3
        bearings = np.arctan2(y - self._points.place[1], x - self._points.place[0])[outside]
        return any((np.remainder(bearings - first, 2 * np.pi) < width).any() for first, width in gaps)

    def _report_reason(self, why: str, now: float) -> str:
        """Report that scans are late or missing, at most once in ``REPORT_INTERVAL``; return the reason ``why``."""
        if now - self._reported.get(why, -inf) >= REPORT_INTERVAL:
            self._reported[why] = now
            does = (
                "the base stands"
                if why.startswith(SCANS_MISSING_REASON)
                else f"the base goes {BLIND_SPEED:g} m/s at most"
            )
            hint = "check the range finder: mission doctor; without it: 'range_guard: off' in the robot file"
            self._report(DeviceStatus("base", "fault", f"{why}: {does}", hint))
        return why


def _to_pose(values: tuple[float, ...]) -> Placed:
    heading, x, y = values
    return heading, x, y


def _scaled(velocity: Velocity, share: float) -> Velocity:
    return velocity if share == 1.0 else Velocity(share * velocity.linear, share * velocity.angular)


def _along(velocity: Velocity, times: Floats) -> PathPoses:
    """Return the poses of a base at ``times`` (seconds) with a constant velocity."""
    turned = velocity.angular * times
    if abs(velocity.angular) < 1e-6:
        return PathPoses(velocity.linear * times, np.zeros(len(times)), turned)
    radius = velocity.linear / velocity.angular
    return PathPoses(radius * np.sin(turned), radius * (1.0 - np.cos(turned)), turned)


def _share_until(margin: Floats, times: Floats, reaction: float, braking: float) -> tuple[float, int]:
    """Return the share of the speed at which the base stops before all points, and the index of the nearest point.

    ``margin`` has for each point the distance in metres that is left at ``times`` (seconds) along the path; negative if
    the base has come too near. ``reaction`` is the reaction time in seconds, ``braking`` the seconds to stop from full
    speed.
    """
    least = margin.min(axis=0)
    used = np.flatnonzero(least < -ROUNDING)
    if not len(used):
        return 1.0, 0
    end = int(used[0])
    place = int(margin[:, end].argmin())
    if end == 0:
        return 0.0, place
    before, after = max(float(least[end - 1]), 0.0), float(least[end])
    free = float(times[end - 1]) + float(times[end] - times[end - 1]) * before / (before - after)
    # The base drives at the share s for the reaction time T, then brakes: s T + s^2 D / 2 is the free path.
    if braking < 1e-9:
        return min(1.0, free / reaction), place
    return min(1.0, (sqrt(reaction * reaction + 2 * braking * free) - reaction) / braking), place


def _share_among_moving(
    clear: Floats,
    now_clear: Floats,
    speeds: Floats,
    gap: Floats,
    times: Floats,
    reaction: float,
    braking: float,
    age: float,
    found: tuple[float, int],
) -> tuple[float, int]:
    """Return the share of the speed and the index of the nearest point, as ``_share_until`` does, for points that move.

    The points have the distances ``clear`` along the path and ``now_clear`` at its start, and must stay ``gap`` metres
    away. ``found`` is the result for resting points, ``age`` the age of the scan in seconds.
    """
    moves = np.flatnonzero(speeds)
    if not len(moves):
        return found
    clear, now_clear, gap, speeds = clear[moves], now_clear[moves], gap[moves], speeds[moves, None]
    share, place = found
    for tried in (found[0], *(each for each in SHARES if each < found[0])):
        if tried == 0.0:
            return 0.0, place
        covered = np.flatnonzero(times <= tried * reaction + tried * tried * braking / 2 + 1e-9)
        if covered[-1] + 1 < len(times):
            covered = np.append(covered, covered[-1] + 1)
        rest = np.maximum(times[covered] - tried * reaction, 0.0)
        spent = np.minimum(times[covered] / tried, reaction)
        if braking > 1e-9:
            spent = spent + braking * (tried - np.sqrt(np.maximum(tried * tried - 2 * rest / braking, 0.0)))
        margin = clear[:, covered] - np.minimum(now_clear, gap + speeds * (age + spent))
        worst = int(margin.min(axis=1).argmin())
        if margin[worst].min() >= -ROUNDING:
            return tried, place
        share, place = tried, int(moves[worst])
    return share, place


def _words(distance: float, x: float, y: float) -> str:
    """Return the text of an obstacle ``distance`` metres from the base, in the direction of ``x``, ``y``."""
    angle = degrees(atan2(y, x))
    side = "left" if angle > 0 else "right"
    if abs(angle) <= 30:
        where = "ahead"
    elif abs(angle) < 60:
        where = f"ahead on the {side}"
    elif abs(angle) <= 120:
        where = f"on the {side}"
    else:
        where = "behind" if abs(angle) >= 150 else f"behind on the {side}"
    step = 0.1 if distance > 0.1 else 0.02  # coarse, since each new text is an event
    return f"{OBSTACLE_REASON}, {length_text(step * round(max(distance, 0.0) / step))} {where}"
