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
    Away,
    DeviceStatus,
    HeadPose,
    Health,
    Quality,
    Reading,
    Report,
    ignore,
)
from drivers.clock import Clock
from drivers.errors import NotConnected
from drivers.head.axis import MIDDLE, TRAILING, ServoAxis, next_degrees
from drivers.head.memory import Memory
from drivers.head.pantilt import AHEAD, LedHead, PanTilt
from drivers.transport import guardian_wire
from drivers.transport.lines import LineFinder
from drivers.transport.link import Link
from drivers.transport.loop import guarded
from drivers.transport.reconnect import Absence, Enabling

ASKING = 0.05
"""Seconds between two questions."""

SURE = 0.07
"""Seconds after the newest answer for which it goes on: as far as a keeper that begins anew may have led its servos
without our knowing it."""

SILENT_AFTER = 0.5
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


class KeeperHead(LedHead[ServoAxis], Enabling):
    """A ``drivers.api.Head`` on a link that it owns, led in whole degrees as ``drivers.arduino.driver.ArduinoHead``.

    The keeper tells where its servos were sent last, and whether it has begun anew. Where it has sent them nowhere yet,
    they stand where we left them, or ``remembered`` says; else nobody knows where: that is told, and nothing is sent
    before somebody asks for it.
    ``why`` says why nobody answers, where that is known, and ``cure`` is what to try then.
    """

    TRAILS = TRAILING

    def __init__(
        self,
        link: Link,
        clock: Clock,
        *,
        pan: ServoAxis,
        tilt: ServoAxis,
        speed: float,
        acceleration: float = HEAD_ACCELERATION,
        away: Away | None = None,
        report: Report = ignore,
        changed: Callable[[], None] = ignore,
        start: HeadPose = AHEAD,
        name: str = "head",
        remembered: Memory | None = None,
        why: Callable[[], str] = str,
        cure: str = "look at its power and its cable",
    ) -> None:
        self.name = name
        way = PanTilt(name, pan, tilt, speed=speed, acceleration=acceleration, start=start)
        super().__init__(clock, way, changed)
        self._link = link
        self._report = guarded(report)
        self._why, self._cure = why, cure
        self._remembered = remembered
        self._absence = Absence(away)
        self._lock = RLock()  # over what is sent, whoever sends it
        self._lines = LineFinder()
        self._counters: Counter[str] = Counter({"reports": 0, "malformed": 0})
        self._state = GuardianState.UNMET
        self._boot: int | None = None  # of the newest keeper that answered, on whichever connection
        self._sent: tuple[int, int] | None = None
        self._told: tuple[int, int] | None = None  # where they were, by the newest answer that said so
        self._newest: Reading[HeadPose] | None = None
        self._heard_at = self._asked_at = self._connected_at = -inf

    # --- what behaviours ask -----------------------------------------------------------------------------------------

    def look(self, target: HeadPose) -> HeadPose:
        """Start moving to ``target``; return the pose accepted after clamping, in radians.

        Raises BadRequest if it is not finite, NotConnected while no keeper answers, DeviceFault while it is latched.
        """
        self._way.check(target)
        health = self.health()
        if not health.online:
            raise NotConnected(health.detail, hint=health.hint)
        self._absence.require(self.name)
        accepted = self.limits.clamp(target)
        pan, tilt = self._way.axes  # its way ends where the servos will stand
        self._way.look(HeadPose(pan.nearest(accepted.pan), tilt.nearest(accepted.tilt)), self._now())
        self._settled = False
        with suppress(NotConnected):
            self._step()
        return accepted

    def pose(self) -> Reading[HeadPose]:
        """Where the servos were sent last; stale while no keeper answers, and none before one did."""
        newest = self._newest
        if newest is None:
            return Reading(None, self._clock.now(), Quality.NONE)
        return newest if self._online else replace(newest, quality=Quality.STALE)

    # --- life --------------------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Start looking for the keeper."""
        self._absence.begin()
        self._link.open(self)

    def close(self) -> None:
        """Hold at once, and let the keeper go."""
        self._hold()
        self._link.close()
        if self._remembered is not None:
            self._remembered.close()

    def health(self) -> Health:
        """Say whether a keeper answers, and the figures of its wire."""
        link, returned = self._link.health(), self._absence.returned
        counters = {**link.counters, **self._counters}
        if not link.online:
            return Health(False, link.detail, link.hint, counters, returned)
        if self._online:
            return Health(True, counters=counters, returned=returned)
        return Health(False, self._silence(), self._cure, counters, returned)

    # --- the link's thread: see drivers.transport.link.Talker --------------------------------------------------------

    def connected(self) -> None:
        """Ask who is there. DTR stays on when the port is closed, so that the next program does not reset a board."""
        self._link.set_dtr(on=True)
        self._hold()
        self._lines = LineFinder()
        self._handle(GuardianEvent.CONNECT)
        self._connected_at = self._clock.now()
        self._ask(self._connected_at)

    def received(self, data: bytes) -> None:
        """Take the keeper's answers."""
        for line in self._lines.feed(data):
            try:
                found = guardian_wire.read(line)
            except ValueError:
                self._counters["malformed"] += 1
                continue
            if isinstance(found, guardian_wire.Report):
                self._hear(found)

    def pulse(self) -> None:
        """Ask again, lead the servos on, and notice silence."""
        now = self._clock.now()
        if now - self._asked_at >= ASKING:
            self._ask(now)
        self._step()
        waits = self._state in (GuardianState.GREETING, GuardianState.ONLINE)
        if waits and now - max(self._connected_at, self._heard_at) > SILENT_AFTER:
            self._handle(GuardianEvent.TIMEOUT)
            self._hold()
            self._report(DeviceStatus(self.name, "offline", self._silence(), self._cure))

    def ending(self) -> None:
        """Remember where the servos are left; silence is what a keeper rests by."""
        if self._remembered is not None and self._sent is not None:
            self._remembered.keep(dict(enumerate(self._sent)))

    # --- the inside --------------------------------------------------------------------------------------------------

    def _ask(self, now: float) -> None:
        self._asked_at = now
        self._link.write(guardian_wire.ASK)

    def _hear(self, found: guardian_wire.Report) -> None:
        """Take one answer."""
        now = self._clock.now()
        self._counters["reports"] += 1
        with self._lock:
            before, was_met = self._state, self._met
            anew = self._boot is not None and found.boot != self._boot
            self._handle(GuardianEvent.REPORT)
            if anew or not was_met:
                self._boot = found.boot
                self._settle(found, now, anew=anew)
            elif (found.first, found.second) != self._sent and guardian_wire.UNKNOWN not in (found.first, found.second):
                self._settled = False  # the last degree was lost on its way, or it is still on it
            if guardian_wire.UNKNOWN not in (found.first, found.second):
                self._told = (found.first, found.second)
            if self._absence.heard(now, anew=anew):
                self._hold()
            self._heard_at = now
        if before in (GuardianState.UNMET, GuardianState.SILENT):
            self._report(DeviceStatus(self.name, "online", f"{self._link.port}: the servos are there again"))

    def _settle(self, found: guardian_wire.Report, now: float, *, anew: bool) -> None:
        """Go on from where the servos stand; stay there, but for the first time."""
        axes, told = self._way.axes, (found.first, found.second)
        left = self._remembered.take() if self._remembered is not None and self._told is None else {}
        unknown = guardian_wire.UNKNOWN in told and not {0, 1} <= left.keys()
        middle = tuple(MIDDLE if axis.start is None else axis.start for axis in axes)  # the least far from any place
        guess = self._told or tuple(left.get(number, at) for number, at in enumerate(middle))
        first, second = (old if new == guardian_wire.UNKNOWN else new for new, old in zip(told, guess, strict=True))
        self._sent = (first, second)
        pan, tilt = (axis.to_radians(degree) for axis, degree in zip(axes, self._sent, strict=True))
        if self._began or unknown:
            self._way.let_go(pan=pan, tilt=tilt, now=now)
        else:
            self._way.place(HeadPose(pan, tilt), now)
        self._settled = self._began or unknown
        self._began = True
        self._tell(HeadPose(pan, tilt), now)
        if unknown:
            what = "its servos have got no pulse yet, and nobody knows where they stand: the first movement may leap"
            self._report(DeviceStatus(self.name, "fault", what, "keep clear of it at its first movement"))
        if anew:
            self._report(DeviceStatus(self.name, "fault", "who holds its servos has begun anew", self._cure))

    def _step(self) -> None:
        """Lead both servos on, while it is sure that somebody hears it. Raises NotConnected."""
        with self._lock:
            now, boot, sent = self._clock.now(), self._boot, self._sent
            if boot is None or sent is None or not self._met:
                return
            if not self._sure(now):
                self._way.hold(now)
                return
            if self._settled:
                self._tell_again(now)
                return
            self._settled = self._way.still
            steps = self._way.advance(now)
            first, second = next_degrees(self._way, steps, sent)
            if (first, second) != sent or self._settled:
                self._asked_at = now
                self._link.write(guardian_wire.go(boot, first, second) + guardian_wire.ASK)
            self._sent = (first, second)
            pan, tilt = (step.axis.to_radians(degree) for step, degree in zip(steps, self._sent, strict=True))
            self._tell(HeadPose(pan, tilt), now)

    def _tell(self, pose: HeadPose, now: float) -> None:
        turned = self._newest is None or pose != self._newest.value
        self._newest = Reading(pose, now, Quality.GOOD)
        self._history.add(now, (pose.pan, pose.tilt))
        if turned:
            self._changed()

    def _tell_again(self, now: float) -> None:
        if self._newest is not None and self._newest.value is not None:
            self._tell(self._newest.value, now)

    def _hold(self) -> None:
        """Give up the goal: the servos stay at the degrees sent last."""
        if self._newest is not None and self._newest.value is not None:
            sent = self._newest.value
            self._way.let_go(pan=sent.pan, tilt=sent.tilt, now=self._clock.now())

    def _now(self) -> float:
        """Return the time, until which nothing has moved if nobody is there to hear it."""
        now = self._clock.now()
        if not self._sure(now):
            self._way.hold(now, 0.0)
        return now

    def _handle(self, event: GuardianEvent) -> None:
        self._state = TRANSITIONS.get((self._state, event), GuardianState.UNMET)

    @property
    def _met(self) -> bool:
        """Whether the guardian has answered on this connection."""
        return self._state in (GuardianState.ONLINE, GuardianState.SILENT)

    def _sure(self, now: float) -> bool:
        return self._met and now - self._heard_at <= SURE

    @property
    def _online(self) -> bool:
        now = self._clock.now()
        return self._link.online and self._met and now - self._heard_at <= SILENT_AFTER

    def _silence(self) -> str:
        return f"{self.name}: {self._link.port}: {self._why() or 'open, but nobody who holds its servos answers'}"
