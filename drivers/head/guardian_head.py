"""Head of two hobby servos behind an actuator guardian: a sketch on an Arduino, or a process on a Raspberry Pi."""

from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from enum import Enum
from math import inf
from threading import RLock
from typing import Final

from drivers.api import (
    HEAD_ACCELERATION,
    DeviceStatus,
    HeadPose,
    Health,
    Quality,
    Reading,
    ReconnectPolicy,
    StatusCallback,
    ignore,
)
from drivers.clock import Clock
from drivers.errors import NotConnected
from drivers.head.angle_store import ServoAngleStore
from drivers.head.axis import CENTRE_DEGREES, SERVO_LAG, ServoAxis, next_degrees
from drivers.head.pantilt import STRAIGHT_AHEAD, PanTiltMotion, ProfiledHead
from drivers.transport import guardian_wire
from drivers.transport.lines import LineFinder
from drivers.transport.link import SerialLink
from drivers.transport.loop import guard_callback
from drivers.transport.reconnect import LatchingPart, ReconnectTracker

REQUEST_INTERVAL = 0.05
"""Seconds between two requests for a report."""

MAX_REPORT_AGE = 0.07
"""Maximum age of the guardian's last report in seconds at which setpoints are still sent.

A restart of the guardian can stay unnoticed for this time.
"""

OFFLINE_TIMEOUT = 0.5
"""Seconds without a report after which the guardian counts as offline."""


class GuardianState(Enum):
    """State of the guardian behind a port.

    UNMET and GREETING: it has not reported on this connection yet; in GREETING a report is still awaited.
    """

    UNMET, GREETING, ONLINE, SILENT = range(4)


class GuardianEvent(Enum):
    """Event on the port of a guardian: it was opened, a report has come, or none has come for ``OFFLINE_TIMEOUT``."""

    CONNECT, REPORT, TIMEOUT = range(3)


TRANSITIONS: Final = {
    **{(state, GuardianEvent.CONNECT): GuardianState.GREETING for state in GuardianState},
    **{(state, GuardianEvent.REPORT): GuardianState.ONLINE for state in GuardianState},
    (GuardianState.GREETING, GuardianEvent.TIMEOUT): GuardianState.UNMET,
    (GuardianState.ONLINE, GuardianEvent.TIMEOUT): GuardianState.SILENT,
}
"""Next state by state and event. Any other pair leads to UNMET, in which no setpoints are sent."""


class GuardianHead(ProfiledHead[ServoAxis], LatchingPart):
    """Head on its own link, moved in whole degrees as ``drivers.arduino.driver.ArduinoHead``: a ``drivers.api.Head``.

    The guardian reports the last setpoints of its servos, and whether it has restarted. If it has no setpoints yet, the
    servos have the last angles of this program, or those in ``angle_store``. Without either, the angles are unknown:
    this is reported, and nothing is sent before a command. ``offline_reason`` returns why the guardian does not reply,
    if that is known, and ``hint`` is the fix.
    """

    LAG = SERVO_LAG

    def __init__(
        self,
        link: SerialLink,
        clock: Clock,
        *,
        pan: ServoAxis,
        tilt: ServoAxis,
        speed: float,
        acceleration: float = HEAD_ACCELERATION,
        away: ReconnectPolicy | None = None,
        report: StatusCallback = ignore,
        changed: Callable[[], None] = ignore,
        start: HeadPose = STRAIGHT_AHEAD,
        name: str = "head",
        angle_store: ServoAngleStore | None = None,
        offline_reason: Callable[[], str] = str,
        hint: str = "check its power and cable",
    ) -> None:
        self.name = name
        way = PanTiltMotion(name, pan, tilt, speed=speed, acceleration=acceleration, start=start)
        super().__init__(clock, way, changed)
        self._link = link
        self._report = guard_callback(report)
        self._get_offline_reason, self._hint = offline_reason, hint
        self._angle_store = angle_store
        self._reconnect = ReconnectTracker(away)
        self._lock = RLock()  # held while setpoints are computed and sent, on any thread
        self._lines = LineFinder()
        self._counters: Counter[str] = Counter({"reports": 0, "malformed": 0})
        self._state = GuardianState.UNMET
        self._boot: int | None = None  # boot number of the last guardian that replied, on any connection
        self._sent: tuple[int, int] | None = None
        self._reported_angles: tuple[int, int] | None = None  # last reported angles
        self._last_pose: Reading[HeadPose] | None = None
        self._reported_at = self._requested_at = self._connected_at = -inf

    # --- what behaviours ask -----------------------------------------------------------------------------------------

    def look(self, target: HeadPose) -> HeadPose:
        """Start moving to ``target``; return the pose accepted after clamping, in radians.

        Raises BadRequest if it is not finite, NotConnected while the guardian is offline, DeviceFault while latched.
        """
        self._motion.check(target)
        health = self.health()
        if not health.online:
            raise NotConnected(health.detail, hint=health.hint)
        self._reconnect.require_unlatched(self.name)
        accepted = self.limits.clamp(target)
        pan, tilt = self._motion.axes  # the motion ends at whole degrees of the servos
        self._motion.look(
            HeadPose(pan.nearest_angle(accepted.pan), tilt.nearest_angle(accepted.tilt)), self._sync_time()
        )
        self._is_settled = False
        with suppress(NotConnected):
            self._step()
        return accepted

    def pose(self) -> Reading[HeadPose]:
        """Pose of the last setpoints; stale while the guardian is offline, and none before its first report."""
        newest = self._last_pose
        if newest is None:
            return Reading(None, self._clock.now(), Quality.NONE)
        return newest if self._is_online else replace(newest, quality=Quality.STALE)

    # --- life --------------------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Start the search for the guardian."""
        self._reconnect.restart()
        self._link.open(self)

    def close(self) -> None:
        """Hold at once, and release the guardian."""
        self._hold()
        self._link.close()
        if self._angle_store is not None:
            self._angle_store.close()

    def health(self) -> Health:
        """Return whether the guardian reports, and the counters of its wire."""
        link, returned = self._link.health(), self._reconnect.reconnected_at
        counters = {**link.counters, **self._counters}
        if not link.online:
            return Health(False, link.detail, link.hint, counters, returned)
        if self._is_online:
            return Health(True, counters=counters, reconnected_at=returned)
        return Health(False, self._offline_text(), self._hint, counters, returned)

    # --- the link's thread: see drivers.transport.link.LinkHandler ---------------------------------------------------

    def on_connected(self) -> None:
        """Request a report. DTR stays on when the port is closed, so that the next program does not reset a board."""
        self._link.set_dtr(on=True)
        self._hold()
        self._lines = LineFinder()
        self._handle(GuardianEvent.CONNECT)
        self._connected_at = self._clock.now()
        self._send_request(self._connected_at)

    def on_data(self, data: bytes) -> None:
        """Handle reports of the guardian."""
        for line in self._lines.feed(data):
            try:
                message = guardian_wire.parse_line(line)
            except ValueError:
                self._counters["malformed"] += 1
                continue
            if isinstance(message, guardian_wire.GuardianReport):
                self._on_report(message)

    def on_poll(self) -> None:
        """Request a report if that is due, send the next setpoints, and detect a guardian that no longer reports."""
        now = self._clock.now()
        if now - self._requested_at >= REQUEST_INTERVAL:
            self._send_request(now)
        self._step()
        waits = self._state in (GuardianState.GREETING, GuardianState.ONLINE)
        if waits and now - max(self._connected_at, self._reported_at) > OFFLINE_TIMEOUT:
            self._handle(GuardianEvent.TIMEOUT)
            self._hold()
            self._report(DeviceStatus(self.name, "offline", self._offline_text(), self._hint))

    def on_closing(self) -> None:
        """Store the servo angles; the guardian stops the servos by itself after a silence."""
        if self._angle_store is not None and self._sent is not None:
            self._angle_store.save(dict(enumerate(self._sent)))

    # --- the inside --------------------------------------------------------------------------------------------------

    def _send_request(self, now: float) -> None:
        self._requested_at = now
        self._link.write(guardian_wire.REPORT_REQUEST)

    def _on_report(self, report: guardian_wire.GuardianReport) -> None:
        now = self._clock.now()
        self._counters["reports"] += 1
        with self._lock:
            before, was_met = self._state, self._has_report
            restarted = self._boot is not None and report.boot != self._boot
            self._handle(GuardianEvent.REPORT)
            if restarted or not was_met:
                self._boot = report.boot
                self._apply_report(report, now, restarted=restarted)
            elif (report.first, report.second) != self._sent and guardian_wire.UNKNOWN_ANGLE not in (
                report.first,
                report.second,
            ):
                self._is_settled = False  # the last setpoint was lost, or is still on the wire
            if guardian_wire.UNKNOWN_ANGLE not in (report.first, report.second):
                self._reported_angles = (report.first, report.second)
            if self._reconnect.on_report(now, restarted=restarted):
                self._hold()
            self._reported_at = now
        if before in (GuardianState.UNMET, GuardianState.SILENT):
            self._report(DeviceStatus(self.name, "online", f"{self._link.port}: the servos are online again"))

    def _apply_report(self, report: guardian_wire.GuardianReport, now: float, *, restarted: bool) -> None:
        """Continue from the reported servo angles; move to the start pose the first time that they are known."""
        axes, reported = self._motion.axes, (report.first, report.second)
        stored = self._angle_store.pop() if self._angle_store is not None and self._reported_angles is None else {}
        unknown = guardian_wire.UNKNOWN_ANGLE in reported and not {0, 1} <= stored.keys()
        middle = tuple(
            CENTRE_DEGREES if axis.start is None else axis.start for axis in axes
        )  # the smallest maximum distance from the real angle
        guess = self._reported_angles or tuple(stored.get(number, at) for number, at in enumerate(middle))
        first, second = (
            old if new == guardian_wire.UNKNOWN_ANGLE else new for new, old in zip(reported, guess, strict=True)
        )
        self._sent = (first, second)
        pan, tilt = (axis.to_radians(degree) for axis, degree in zip(axes, self._sent, strict=True))
        if self._has_start or unknown:
            self._motion.drop_goal(pan=pan, tilt=tilt, now=now)
        else:
            self._motion.set_position(HeadPose(pan, tilt), now)
        self._is_settled = self._has_start or unknown
        self._has_start = True
        self._record_pose(HeadPose(pan, tilt), now)
        if unknown:
            message = "its servo angles are unknown, since no pulse was sent yet: the first movement may leap"
            self._report(DeviceStatus(self.name, "fault", message, "keep clear of it at its first movement"))
        if restarted:
            self._report(DeviceStatus(self.name, "fault", "the servo controller has restarted", self._hint))

    def _step(self) -> None:
        """Send the next setpoints while the last report is fresh. Raises NotConnected."""
        with self._lock:
            now, boot, sent = self._clock.now(), self._boot, self._sent
            if boot is None or sent is None or not self._has_report:
                return
            if not self._is_fresh(now):
                self._motion.pause_until(now)
                return
            if self._is_settled:
                self._record_last_pose(now)
                return
            self._is_settled = self._motion.is_still
            steps = self._motion.advance(now)
            first, second = next_degrees(self._motion, steps, sent)
            if (first, second) != sent or self._is_settled:
                self._requested_at = now
                self._link.write(guardian_wire.pack_command(boot, first, second) + guardian_wire.REPORT_REQUEST)
            self._sent = (first, second)
            pan, tilt = (step.axis.to_radians(degree) for step, degree in zip(steps, self._sent, strict=True))
            self._record_pose(HeadPose(pan, tilt), now)

    def _record_pose(self, pose: HeadPose, now: float) -> None:
        turned = self._last_pose is None or pose != self._last_pose.value
        self._last_pose = Reading(pose, now, Quality.GOOD)
        self._history.add(now, (pose.pan, pose.tilt))
        if turned:
            self._changed()

    def _record_last_pose(self, now: float) -> None:
        if self._last_pose is not None and self._last_pose.value is not None:
            self._record_pose(self._last_pose.value, now)

    def _hold(self) -> None:
        """Drop the goal: the servos hold the last setpoints."""
        if self._last_pose is not None and self._last_pose.value is not None:
            sent = self._last_pose.value
            self._motion.drop_goal(pan=sent.pan, tilt=sent.tilt, now=self._clock.now())

    def _sync_time(self) -> float:
        """Return the current time.

        If the last report is too old for setpoints, the motion profile skips the time until now, and does not catch up.
        """
        now = self._clock.now()
        if not self._is_fresh(now):
            self._motion.pause_until(now, 0.0)
        return now

    def _handle(self, event: GuardianEvent) -> None:
        self._state = TRANSITIONS.get((self._state, event), GuardianState.UNMET)

    @property
    def _has_report(self) -> bool:
        """Whether the guardian has reported on this connection."""
        return self._state in (GuardianState.ONLINE, GuardianState.SILENT)

    def _is_fresh(self, now: float) -> bool:
        return self._has_report and now - self._reported_at <= MAX_REPORT_AGE

    @property
    def _is_online(self) -> bool:
        now = self._clock.now()
        return self._link.online and self._has_report and now - self._reported_at <= OFFLINE_TIMEOUT

    def _offline_text(self) -> str:
        reason = self._get_offline_reason() or "open, but no reply from the servo controller"
        return f"{self.name}: {self._link.port}: {reason}"
