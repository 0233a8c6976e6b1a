"""The head's driver: turns goals into small steps of two hobby servos, sent to an Arduino with the Rodney sketch."""

import math
from collections import Counter
from collections.abc import Callable
from threading import Lock

from drivers.api import HeadLimits, HeadPose, Health, Quality, Reading, Report, unheard, unreported
from drivers.arduino import wire
from drivers.arduino.axis import ServoAxis
from drivers.arduino.session import Session
from drivers.clock import Clock
from drivers.errors import BadRequest, NotConnected
from drivers.guard import guarded
from drivers.history import History
from drivers.link import Link
from drivers.profile import Ramp

AHEAD = HeadPose(0.0, 0.0)


class ArduinoHead:
    """A ``drivers.api.Head`` of two hobby servos on a board that speaks rosserial.

    The servos tell nothing and turn as fast as they can, so the driver leads them: from the angle commanded last it
    goes to the goal at ``speed`` (rad/s, each axis for itself), and sends an axis whenever its whole degree changes.
    The pose is what was sent, hence in whole degrees; a servo lags behind it by a few hundredths of a second.

    Opening the port resets most boards: the first word waits ``boot_delay`` seconds (0 on a pseudo-terminal).
    The sketch sends its servos to positions of its own when it starts. From there the head goes, at ``speed``, to the
    pose that was commanded last, at first ``start``; a goal does not survive the loss of the connection. A board is
    taken to have started anew on the first connection, on every one if ``boot_delay`` is not 0, and when it was silent.
    After ``close`` the board keeps its servos where they are.
    ``changed`` is called from the link's thread whenever the pose has changed.
    """

    def __init__(
        self,
        link: Link,
        clock: Clock,
        *,
        pan: ServoAxis,
        tilt: ServoAxis,
        speed: float,
        boot_delay: float = 2.0,
        report: Report = unreported,
        changed: Callable[[], None] = unheard,
        name: str = "head",
        start: HeadPose = AHEAD,
    ) -> None:
        if not 0 < speed < math.inf:
            raise ValueError(f"{name}: a speed of {speed} rad/s gets it nowhere")
        if pan.index == tilt.index:
            raise ValueError(f"{name}: pan and tilt are both servo {pan.index}")
        self.name = name
        self.limits = HeadLimits(pan=pan.range, tilt=tilt.range, speed=speed)
        self._link = link
        self._clock = clock
        self._axes = (pan, tilt)
        self._boot_delay = boot_delay
        self._report = guarded(report)
        self._changed = guarded(changed)
        begin = self.limits.clamp(start)
        self._lock = Lock()  # over the ramps, which both the caller and the link's thread move
        self._ramps = (Ramp(begin.pan, speed), Ramp(begin.tilt, speed))
        self._session: Session | None = None
        self._past: Counter[str] = Counter()
        self._sent: tuple[int | None, int | None] = (None, None)  # degrees, on this connection
        self._newest: Reading[HeadPose] | None = None
        self._history = History()

    # --- what behaviours ask ------------------------------------------------------------------------------------------

    def look(self, target: HeadPose) -> HeadPose:
        """Start moving to ``target``; return the pose accepted after clamping, in radians.

        Raises BadRequest if it is not finite, NotConnected until the board has said that it takes angles.
        """
        if not (math.isfinite(target.pan) and math.isfinite(target.tilt)):
            raise BadRequest(f"{self.name}: look at {target}: not a finite number", hint="check what computed the goal")
        if not self._ready:
            health = self.health()
            raise NotConnected(health.detail, hint=health.hint)
        accepted = self.limits.clamp(target)
        with self._lock:
            now = self._clock.now()
            for ramp, goal in zip(self._ramps, (accepted.pan, accepted.tilt), strict=True):
                ramp.aim(goal, now)
        return accepted

    def pose(self) -> Reading[HeadPose]:
        """Where the servos were sent last; stale while the board is not there, and none before it first was."""
        newest = self._newest
        if newest is None:
            return Reading(None, self._clock.now(), Quality.NONE)
        if self._ready:
            return newest
        return Reading(newest.value, newest.stamp, Quality.STALE)

    def pose_at(self, stamp: float) -> HeadPose | None:
        """Where the servos had been sent at a past time, interpolated; None when that is not known."""
        values = self._history.at(stamp)
        return None if values is None else HeadPose(*values)

    def stop(self) -> None:
        """Hold at the angles commanded last."""
        with self._lock:
            for ramp in self._ramps:
                ramp.halt()

    # --- life ---------------------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Start looking for the board."""
        self._link.open(self)

    def rest(self) -> None:
        """Hold: hobby servos know no other rest."""
        self.stop()

    def close(self) -> None:
        """Hold, tell the board to stop sending, and release the port."""
        try:
            self.rest()
        finally:
            self._link.close()

    def health(self) -> Health:
        """Say whether the board takes angles, and what it is waiting for if not."""
        port, session = self._link.health(), self._session
        counters = Counter(self._past)
        if session is not None:
            counters.update(session.counters())
        figures = {**port.counters, **counters}
        if not port.online or session is None:
            return Health(False, port.detail, port.hint, figures)
        if session.topic is not None:
            return Health(True, counters=figures)
        detail, hint = session.trouble()
        return Health(False, f"{self.name}: {self._link.port}: open, {detail}", hint, figures)

    @property
    def _ready(self) -> bool:
        session = self._session
        return self._link.online and session is not None and session.topic is not None

    # --- the link's thread: see drivers.link.Talker -------------------------------------------------------------------

    def connected(self) -> None:
        """Begin a session with a board that is booting."""
        self._forget()
        before, boot = self._session, self._boot_delay
        if before is not None:
            self._past.update(before.counters())
        restarted = boot > 0 or before is None or before.restarted
        self._session = Session(
            self.name, wire.SERVO, self._link, self._clock, self._report, boot_delay=boot, restarted=restarted
        )

    def received(self, data: bytes) -> None:
        """Pass the board's bytes on."""
        if self._session is not None:
            self._session.received(data)

    def pulse(self) -> None:
        """Move on: send each axis whose whole degree has changed."""
        session = self._session
        if session is None:
            return
        session.pulse()
        if session.topic is None:
            self._forget()
            return
        now = self._clock.now()
        if session.restarted:
            session.restarted = False
            self._lead_on(now)
        with self._lock:
            angles = [ramp.advance(now) for ramp in self._ramps]
        pan, tilt = (axis.to_degrees(angle) for axis, angle in zip(self._axes, angles, strict=True))
        self._send(session.topic, (pan, tilt))
        pose = HeadPose(self._axes[0].to_radians(pan), self._axes[1].to_radians(tilt))
        turned = self._newest is None or pose != self._newest.value
        self._newest = Reading(pose, now, Quality.GOOD)
        self._history.add(now, (pose.pan, pose.tilt))
        if turned:
            self._changed()

    def ending(self) -> None:
        """Tell the board to stop sending."""
        self._link.write(wire.STOP_SENDING)

    def _lead_on(self, now: float) -> None:
        """Go on from where a sketch that has just started has put its servos: they would leap if led from elsewhere."""
        with self._lock:
            for ramp, axis in zip(self._ramps, self._axes, strict=True):
                ramp.place(axis.to_radians(axis.awake), now)
        self._sent = (None, None)

    def _forget(self) -> None:
        """Give up the goal, and send both axes anew once the board is there."""
        self.stop()
        self._sent = (None, None)

    def _send(self, topic: int, degrees: tuple[int, int]) -> None:
        steps = zip(self._axes, degrees, self._sent, strict=True)
        frames = [
            wire.Frame(topic, wire.ServoAngle(axis.index, new).pack()).pack() for axis, new, old in steps if new != old
        ]
        if frames:
            self._link.write(b"".join(frames))
            self._sent = degrees
