"""A head of two hobby servos in the hands of a keeper: a sketch of ours on an Arduino, or a process on a Pi."""

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
"""Seconds between two questions."""

MAX_REPORT_AGE = 0.07
"""Seconds after the newest answer for which it goes on: as far as a keeper that begins anew may have led its servos
without our knowing it."""

OFFLINE_TIMEOUT = 0.5
"""Seconds without an answer after which it counts as offline."""


class GuardianState(Enum):
    """State of the guardian behind a port; UNMET and GREETING: it has not answered on this connection."""

    UNMET, GREETING, ONLINE, SILENT = range(4)


class GuardianEvent(Enum):
    """Event on the port of a guardian."""

    CONNECT, REPORT, TIMEOUT = range(3)


TRANSITIONS: Final = {
    **{(state, GuardianEvent.CONNECT): GuardianState.GREETING for state in GuardianState},
    **{(state, GuardianEvent.REPORT): GuardianState.ONLINE for state in GuardianState},
    (GuardianState.GREETING, GuardianEvent.TIMEOUT): GuardianState.UNMET,
    (GuardianState.ONLINE, GuardianEvent.TIMEOUT): GuardianState.SILENT,
}
"""Any other pair leads to UNMET, in which the servos are sent nowhere."""


class GuardianHead(ProfiledHead[ServoAxis], LatchingPart):
    """A ``drivers.api.Head`` on a link that it owns, led in whole degrees as ``drivers.arduino.driver.ArduinoHead``.

    The keeper tells where its servos were sent last, and whether it has begun anew. Where it has sent them nowhere yet,
    they stand where we left them, or ``remembered`` says; else nobody knows where: that is told, and nothing is sent
    before somebody asks for it.
    ``why`` says why nobody answers, where that is known, and ``cure`` is what to try then.
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
        hint: str = "look at its power and its cable",
    ) -> None:
        self.name = name
        way = PanTiltMotion(name, pan, tilt, speed=speed, acceleration=acceleration, start=start)
        super().__init__(clock, way, changed)
        self._link = link
        self._report = guard_callback(report)
        self._get_offline_reason, self._hint = offline_reason, hint
        self._angle_store = angle_store
        self._reconnect = ReconnectTracker(away)
        self._lock = RLock()  # over what is sent, whoever sends it
        self._lines = LineFinder()
        self._counters: Counter[str] = Counter({"reports": 0, "malformed": 0})
        self._state = GuardianState.UNMET
        self._boot: int | None = None  # of the newest keeper that answered, on whichever connection
        self._sent: tuple[int, int] | None = None
        self._reported_angles: tuple[int, int] | None = None  # where they were, by the newest answer that said so
        self._last_pose: Reading[HeadPose] | None = None
        self._reported_at = self._requested_at = self._connected_at = -inf

    # --- what behaviours ask -----------------------------------------------------------------------------------------

    def look(self, target: HeadPose) -> HeadPose:
        """Start moving to ``target``; return the pose accepted after clamping, in radians.

        Raises BadRequest if it is not finite, NotConnected while no keeper answers, DeviceFault while it is latched.
        """
        self._motion.check(target)
        health = self.health()
        if not health.online:
            raise NotConnected(health.detail, hint=health.hint)
        self._reconnect.require_unlatched(self.name)
        accepted = self.limits.clamp(target)
        pan, tilt = self._motion.axes  # its way ends where the servos will stand
        self._motion.look(
            HeadPose(pan.nearest_angle(accepted.pan), tilt.nearest_angle(accepted.tilt)), self._sync_time()
        )
        self._is_settled = False
        with suppress(NotConnected):
            self._step()
        return accepted

    def pose(self) -> Reading[HeadPose]:
        """Where the servos were sent last; stale while no keeper answers, and none before one did."""
        newest = self._last_pose
        if newest is None:
            return Reading(None, self._clock.now(), Quality.NONE)
        return newest if self._is_online else replace(newest, quality=Quality.STALE)

    # --- life --------------------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Start looking for the keeper."""
        self._reconnect.restart()
        self._link.open(self)

    def close(self) -> None:
        """Hold at once, and let the keeper go."""
        self._hold()
        self._link.close()
        if self._angle_store is not None:
            self._angle_store.close()

    def health(self) -> Health:
        """Say whether a keeper answers, and the figures of its wire."""
        link, returned = self._link.health(), self._reconnect.reconnected_at
        counters = {**link.counters, **self._counters}
        if not link.online:
            return Health(False, link.detail, link.hint, counters, returned)
        if self._is_online:
            return Health(True, counters=counters, reconnected_at=returned)
        return Health(False, self._offline_text(), self._hint, counters, returned)

    # --- the link's thread: see drivers.transport.link.LinkHandler --------------------------------------------------------

    def on_connected(self) -> None:
        """Ask who is there. DTR stays on when the port is closed, so that the next program does not reset a board."""
        self._link.set_dtr(on=True)
        self._hold()
        self._lines = LineFinder()
        self._handle(GuardianEvent.CONNECT)
        self._connected_at = self._clock.now()
        self._send_request(self._connected_at)

    def on_data(self, data: bytes) -> None:
        """Take the keeper's answers."""
        for line in self._lines.feed(data):
            try:
                found = guardian_wire.parse_line(line)
            except ValueError:
                self._counters["malformed"] += 1
                continue
            if isinstance(found, guardian_wire.GuardianReport):
                self._on_report(found)

    def on_poll(self) -> None:
        """Ask again, lead the servos on, and notice silence."""
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
        """Remember where the servos are left; silence is what a keeper rests by."""
        if self._angle_store is not None and self._sent is not None:
            self._angle_store.save(dict(enumerate(self._sent)))

    # --- the inside --------------------------------------------------------------------------------------------------

    def _send_request(self, now: float) -> None:
        self._requested_at = now
        self._link.write(guardian_wire.REPORT_REQUEST)

    def _on_report(self, found: guardian_wire.GuardianReport) -> None:
        """Take one answer."""
        now = self._clock.now()
        self._counters["reports"] += 1
        with self._lock:
            before, was_met = self._state, self._has_report
            anew = self._boot is not None and found.boot != self._boot
            self._handle(GuardianEvent.REPORT)
            if anew or not was_met:
                self._boot = found.boot
                self._apply_report(found, now, anew=anew)
            elif (found.first, found.second) != self._sent and guardian_wire.UNKNOWN_ANGLE not in (
                found.first,
                found.second,
            ):
                self._is_settled = False  # the last degree was lost on its way, or it is still on it
            if guardian_wire.UNKNOWN_ANGLE not in (found.first, found.second):
                self._reported_angles = (found.first, found.second)
            if self._reconnect.on_report(now, restarted=anew):
                self._hold()
            self._reported_at = now
        if before in (GuardianState.UNMET, GuardianState.SILENT):
            self._report(DeviceStatus(self.name, "online", f"{self._link.port}: the servos are there again"))

    def _apply_report(self, found: guardian_wire.GuardianReport, now: float, *, anew: bool) -> None:
        """Go on from where the servos stand; stay there, but for the first time."""
        axes, told = self._motion.axes, (found.first, found.second)
        left = self._angle_store.pop() if self._angle_store is not None and self._reported_angles is None else {}
        unknown = guardian_wire.UNKNOWN_ANGLE in told and not {0, 1} <= left.keys()
        middle = tuple(
            CENTRE_DEGREES if axis.start is None else axis.start for axis in axes
        )  # the least far from any place
        guess = self._reported_angles or tuple(left.get(number, at) for number, at in enumerate(middle))
        first, second = (
            old if new == guardian_wire.UNKNOWN_ANGLE else new for new, old in zip(told, guess, strict=True)
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
            what = "its servos have got no pulse yet, and nobody knows where they stand: the first movement may leap"
            self._report(DeviceStatus(self.name, "fault", what, "keep clear of it at its first movement"))
        if anew:
            self._report(DeviceStatus(self.name, "fault", "who holds its servos has begun anew", self._hint))

    def _step(self) -> None:
        """Lead both servos on, while it is sure that somebody hears it. Raises NotConnected."""
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
        """Give up the goal: the servos stay at the degrees sent last."""
        if self._last_pose is not None and self._last_pose.value is not None:
            sent = self._last_pose.value
            self._motion.drop_goal(pan=sent.pan, tilt=sent.tilt, now=self._clock.now())

    def _sync_time(self) -> float:
        """Return the time, until which nothing has moved if nobody is there to hear it."""
        now = self._clock.now()
        if not self._is_fresh(now):
            self._motion.pause_until(now, 0.0)
        return now

    def _handle(self, event: GuardianEvent) -> None:
        self._state = TRANSITIONS.get((self._state, event), GuardianState.UNMET)

    @property
    def _has_report(self) -> bool:
        """Whether the guardian has answered on this connection."""
        return self._state in (GuardianState.ONLINE, GuardianState.SILENT)

    def _is_fresh(self, now: float) -> bool:
        return self._has_report and now - self._reported_at <= MAX_REPORT_AGE

    @property
    def _is_online(self) -> bool:
        now = self._clock.now()
        return self._link.online and self._has_report and now - self._reported_at <= OFFLINE_TIMEOUT

    def _offline_text(self) -> str:
        return f"{self.name}: {self._link.port}: {self._get_offline_reason() or 'open, but nobody who holds its servos answers'}"
