"""Board of the Rodney head: one serial link for up to two pan/tilt devices and a pair of wheel encoders."""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from enum import Enum, auto
from threading import RLock
from typing import Final, Protocol

from drivers.api import DeviceStatus, Health, Quality, Reading, ReconnectPolicy, StatusCallback, ignore
from drivers.api.fast_dataclass import dataclass
from drivers.arduino import wire
from drivers.arduino.session import BootState, RosserialSession
from drivers.clock import Clock
from drivers.errors import NotConnected
from drivers.head.angle_store import ServoAngleStore
from drivers.transport.link import SerialLink
from drivers.transport.loop import guard_callback
from drivers.transport.reconnect import ReconnectTracker

IDLE_POLL_INTERVAL = 0.1
"""Seconds between two polls of the link without setpoints to send; encoder messages are more frequent."""

STALE_AFTER = 0.5
"""Seconds after which an encoder measurement is stale; the sketch sends one every 50 ms."""


class ServoKnowledge(Enum):
    """Source from which the current servo angles of a board are known."""

    NONE = auto()  # the board has not answered yet
    FROM_SKETCH = auto()  # it was reset: the start angles of its sketch
    FROM_MEMORY = auto()  # it has been running: the last angles of this program, or of an earlier one
    LOST = auto()  # a reset is possible: the board is latched


TRANSITIONS: Final = {
    **{(state, BootState.UNCHANGED): state for state in ServoKnowledge},
    **{(state, BootState.UNKNOWN): ServoKnowledge.LOST for state in ServoKnowledge},
    **{(state, BootState.RESET): ServoKnowledge.FROM_SKETCH for state in ServoKnowledge},
    (ServoKnowledge.NONE, BootState.UNCHANGED): ServoKnowledge.FROM_MEMORY,
    (ServoKnowledge.NONE, BootState.UNKNOWN): ServoKnowledge.FROM_MEMORY,
}


@dataclass(frozen=True, slots=True)
class WheelRates:
    """Turn rates of the left and the right wheel in rad/s, forward positive."""

    left: float
    right: float


class BoardDevice(Protocol):
    """Pan/tilt device on the board. Only one method runs at a time, mostly on the link's thread."""

    @property
    def servos(self) -> frozenset[int]:
        """Numbers of the device's servos."""
        ...

    def set_angles(self, degrees: Mapping[int, int], *, has_encoders: bool, known: bool) -> Mapping[int, int]:
        """Set the current servo angles to ``degrees``, by servo number; return the angles of all servos of the device.

        A servo that is not in ``degrees`` has the start angle of the sketch; ``has_encoders`` selects the sketch with
        encoders. If the angles are not ``known``, but assumed, the device does not move until it is commanded.
        """
        ...

    def drop_goal(self) -> None:
        """Drop the goal, because the board is offline, or because earlier commands must not be continued."""
        ...

    def pause_until(self, now: float) -> bool:
        """Let the motion stand still until time ``now``, because the board may not be sent setpoints at present.

        Returns whether setpoints wait to be sent.
        """
        ...

    def next_angles(self, now: float) -> list[wire.ServoAngle]:
        """Return the setpoints to send at time ``now``, and record them as sent."""
        ...


class ArduinoBoard:
    """Arduino or Teensy with a Rodney sketch, which reconnects by itself: the handler of ``link``.

    Setpoints are sent only while it is certain that the board was not reset after its servo angles were last known: see
    ``drivers.arduino.session``. A board that does not reply when its port is opened is booting, and is probed again
    after ``boot_delay`` seconds. A board that replies has been running: its servos have the last angles of this
    program, or those in ``angle_store``. Without either, the start angles of the sketch are assumed, and the servos
    stay where they are until they are commanded; an assumed angle is stored only after it was sent. DTR stays on when
    the port is closed, so that the next program does not reset the board. ``away`` is the reconnect policy. The port is
    open while any device is open.
    """

    name = "head"

    def __init__(
        self,
        link: SerialLink,
        clock: Clock,
        *,
        boot_delay: float = 2.0,
        report: StatusCallback = ignore,
        away: ReconnectPolicy | None = None,
        angle_store: ServoAngleStore | None = None,
    ) -> None:
        self._link = link
        self._clock = clock
        self._boot_delay = boot_delay
        self._report = guard_callback(report)
        self._lock = RLock()  # held while setpoints are computed and sent, on any thread
        self._devices: tuple[BoardDevice, ...] = ()  # replaced, never modified: the link's thread iterates over it
        self._session: RosserialSession | None = None
        self._past_counters: Counter[str] = Counter()
        self._reconnect = ReconnectTracker(away)
        self._angle_store = angle_store
        self._sent: dict[int, int] = {}  # last setpoint of each servo, while it is valid
        self._servo_count = 0  # number of servos with known or assumed angles
        self._assumed: set[int] = set()  # servos whose angles are a guess until their first setpoint
        self._knowledge = ServoKnowledge.NONE
        self._has_unsaved_angles = False  # setpoints were sent since the last save
        self.first_boot_state: BootState | None = None
        """Boot state at the first reply; None before that."""

    @property
    def latched(self) -> str:
        """Reason of the latch; empty if not latched."""
        return self._reconnect.latched

    def enable(self) -> None:
        """Release the latch."""
        self._reconnect.enable()

    @property
    def is_ready(self) -> bool:
        """True while the board accepts setpoints."""
        session = self._session
        return self._link.online and session is not None and session.topic is not None

    def open(self, device: BoardDevice) -> None:
        """Add ``device``; the first one starts the search for the board."""
        if device not in self._devices:
            if not self._devices:
                self._reconnect.restart()
            self._devices += (device,)
        self._link.open(self)

    def close(self, device: BoardDevice) -> None:
        """Remove ``device``; with the last one, tell the board to stop sending and release the port."""
        self._devices = tuple(each for each in self._devices if each is not device)
        if not self._devices:
            self._link.close()
            if self._angle_store is not None:
                self._angle_store.close()

    def send(self, device: BoardDevice) -> None:
        """Send the due setpoints of ``device``, from any thread. Raises NotConnected if the port is gone."""
        with self._lock:
            session = self._session
            if session is not None and session.topic is not None and self.can_send:
                self._send(session, session.topic, (device,))
                return
        self._link.wake()

    @property
    def can_send(self) -> bool:
        """Whether setpoints may be sent now: it is certain that the board was not reset."""
        session = self._session
        return session is not None and session.boot_state is None and session.detector.is_fresh(self._clock.now())

    def require_ready(self) -> None:
        """Raise NotConnected, with a hint, unless the board accepts setpoints; DeviceFault while latched."""
        if not self.is_ready:
            health = self.health()
            raise NotConnected(health.detail, hint=health.hint)
        self._reconnect.require_unlatched(self.name)

    def health(self) -> Health:
        """Return whether the board accepts setpoints, and if not, the reason."""
        port, session = self._link.health(), self._session
        counters = Counter(self._past_counters)
        if session is not None:
            counters.update(session.counters())
        figures = {**port.counters, **counters}
        if not port.online or session is None:
            return Health(False, port.detail, port.hint, figures, self._reconnect.reconnected_at)
        if session.topic is not None:
            return Health(True, counters=figures, reconnected_at=self._reconnect.reconnected_at)
        detail, hint = session.offline_reason()
        where = f"{self.name}: {self._link.port}: open, {detail}"
        return Health(False, where, hint, figures, self._reconnect.reconnected_at)

    def wheels(self) -> Reading[WheelRates]:
        """Return the turn rates of the wheels; no value with a sketch without encoders."""
        session, now = self._session, self._clock.now()
        tacho = None if session is None else session.tacho
        if tacho is None or tacho.value is None:
            return Reading(None, now, Quality.NONE)
        rates = WheelRates(*(rpm * math.tau / 60 for rpm in (tacho.value.left, tacho.value.right)))
        fresh = self._link.online and now - tacho.stamp <= STALE_AFTER
        return Reading(rates, tacho.stamp, Quality.GOOD if fresh else Quality.STALE)

    # --- the link's thread: see drivers.transport.link.LinkHandler ---------------------------------------------------

    def on_connected(self) -> None:
        """Start a session with a board that may be booting."""
        self._link.set_dtr(on=True)
        self._drop_goals()
        before = self._session
        session = RosserialSession(
            self.name,
            wire.SERVO_TOPIC,
            self._link,
            self._clock,
            self._report,
            boot_delay=self._boot_delay,
            previous=None if before is None else before.detector,
        )
        if before is not None:
            self._past_counters.update(before.counters())
            session.tacho = replace(before.tacho)
        self._session = session

    def on_data(self, data: bytes) -> None:
        if self._session is not None:
            self._session.on_data(data)

    def on_poll(self) -> float | None:
        """Run the session and send due setpoints; return the seconds for which the next poll can wait.

        Returns None or 0 if the next poll must come after the link's usual interval.
        """
        session = self._session
        if session is None:
            return None
        session.poll()
        if session.topic is None:
            self._drop_goals()
            return None
        with self._lock:
            now, boot_state, session.boot_state = self._clock.now(), session.boot_state, None
            was_reset = boot_state is BootState.RESET
            if self._reconnect.on_report(now, restarted=was_reset) and not was_reset:
                self._drop_goals()
            if boot_state is not None:
                self._apply_boot_state(boot_state, session)
            rests = self._send(session, session.topic, self._devices)
            if self._has_unsaved_angles:
                self._save_angles()
            dozes = rests and not session.detector.probe_pending and not session.has_encoders
            session.detector.idle_period = min(IDLE_POLL_INTERVAL, self._reconnect.min_absence / 3) if dozes else 0.0
        return session.detector.idle_period

    def on_closing(self) -> None:
        """Tell the board to stop sending, and store the servo angles."""
        if self._knowledge is not ServoKnowledge.NONE:
            self._save_angles()
        self._link.write(wire.STOP_SENDING)

    def _save_angles(self) -> None:
        """Store the servo angles, so that they survive a `kill -9`. For the link's thread: a disk may be slow."""
        self._has_unsaved_angles = False
        if self._angle_store is not None:
            if len(self._sent) == self._servo_count and not self._assumed:
                self._angle_store.save(self._sent)
            else:
                self._angle_store.delete()

    def _apply_boot_state(self, boot_state: BootState, session: RosserialSession) -> None:
        """Set the servo angles of the devices after a reply of the board; latch the board if the angles are unknown."""
        before, self._knowledge = self._knowledge, TRANSITIONS[self._knowledge, boot_state]
        if boot_state is BootState.UNCHANGED and before is not ServoKnowledge.NONE:
            return
        if self._knowledge is ServoKnowledge.LOST:
            reason = "a reset of its board cannot be ruled out, so its servo angles are unknown"
            self._reconnect.latch(reason, replace=True)
            self._drop_goals()
            self._sent = {}  # the next program must not use it
            self._save_angles()
            return
        stored = self._angle_store.pop() if self._angle_store is not None and before is ServoKnowledge.NONE else {}
        known, self._sent = True, {}
        if self._knowledge is ServoKnowledge.FROM_MEMORY:
            self._sent = stored
            known = self._angle_store is None or all(device.servos <= stored.keys() for device in self._devices)
            if not known:
                message = "its board has been running with unknown servo angles: the first movement may leap"
                hint = "keep clear of it now; from then on move it with one program only, and end that cleanly"
                self._report(DeviceStatus(self.name, "fault", message, hint))
        self.first_boot_state = self.first_boot_state or boot_state
        self._sent = {
            index: angle
            for device in self._devices
            for index, angle in device.set_angles(self._sent, has_encoders=session.has_encoders, known=known).items()
        }
        self._servo_count = len(self._sent)
        self._assumed = set() if known else set(self._sent)
        self._save_angles()

    def _send(self, session: RosserialSession, topic: int, devices: tuple[BoardDevice, ...]) -> bool:
        """Send the due setpoints if a reset of the board is excluded; else probe the board if setpoints wait.

        Returns True if the link may be polled less often: no setpoint is waiting, so it need not be known whether the
        board was reset.
        """
        now = self._clock.now()
        if self._knowledge is ServoKnowledge.NONE:
            return False
        if not session.detector.is_fresh(now):
            waiting = [device.pause_until(now) for device in devices]
            if any(waiting):
                session.probe_if_needed()
            return not any(waiting)
        angles = [angle for device in devices for angle in device.next_angles(now)]
        if angles:
            self._sent.update((angle.index, angle.angle) for angle in angles)
            self._assumed.difference_update(angle.index for angle in angles)
            self._has_unsaved_angles = True
            session.detector.on_setpoints_sent(len(angles), now)
            self._write(topic, angles)
        return False

    def _write(self, topic: int, angles: list[wire.ServoAngle]) -> None:
        self._link.write(wire.NUDGE + b"".join(wire.RosserialFrame(topic, angle.pack()).pack() for angle in angles))

    def _drop_goals(self) -> None:
        with self._lock:
            for device in self._devices:
                device.drop_goal()
