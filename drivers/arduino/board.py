"""The board of the Rodney head: one wire, and up to two pan/tilt devices and a pair of wheel encoders behind it."""

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
"""Seconds from one look at the wire to the next while nothing is to be sent; a sketch with encoders tells of them more
often than that."""

STALE_AFTER = 0.5
"""Seconds after which what the encoders measured is stale: the sketch says it every 50 ms."""


class ServoKnowledge(Enum):
    """How a ``ArduinoBoard`` knows where its servos stand."""

    NONE = auto()  # the board has not answered yet
    FROM_SKETCH = auto()  # it has reset: they stand where its sketch puts them
    FROM_MEMORY = auto()  # it has been running: they stand where this program, or one before, left them
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
    """How fast the wheels turn, in rad/s, forward positive."""

    left: float
    right: float


class BoardDevice(Protocol):
    """A pan/tilt device on the board. One of the three is called at a time, mostly from the link's thread."""

    @property
    def servos(self) -> frozenset[int]:
        """The numbers of its servos."""
        ...

    def set_angles(self, degrees: Mapping[int, int], *, has_encoders: bool, known: bool) -> Mapping[int, int]:
        """Set the angles of its servos to these ``degrees``, by their numbers, else to where the sketch puts them.

        ``later`` selects the sketch with encoders. Unless they are ``known``, it stays until it is commanded. Returns
        the angles.
        """
        ...

    def drop_goal(self) -> None:
        """Nobody hears commands at present, or what was commanded before is not to go on."""
        ...

    def pause_until(self, now: float) -> bool:
        """At time ``now`` nothing may be sent: stand still; say whether there is something to be sent."""
        ...

    def next_angles(self, now: float) -> list[wire.ServoAngle]:
        """Return what is to be sent at time ``now``; it will be."""
        ...


class ArduinoBoard:
    """An Arduino or Teensy with a Rodney sketch, found again whenever it was lost: the talker of ``link``.

    Angles are sent only while it is sure that the board has not begun anew since its servos were known to stand where
    they do: see ``drivers.arduino.session``. One that does not answer at once when its port was opened is
    starting, and asked again after ``boot_delay`` seconds. One that does has been running: its servos stand where we
    left them, or ``remembered`` says; else that is not known, they are taken to stand where the sketch puts them, and
    stay there until they are commanded. An assumed angle is not remembered until it was sent. DTR stays on when the
    port is closed, so that the next program does not reset the board. After it was away ``away`` says what of before
    goes on. The port is open while any of its devices is.
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
        self._lock = RLock()  # over what the devices have sent, whoever makes them send it
        self._devices: tuple[BoardDevice, ...] = ()  # replaced whole: the link's thread walks through it
        self._session: RosserialSession | None = None
        self._past_counters: Counter[str] = Counter()
        self._reconnect = ReconnectTracker(away)
        self._angle_store = angle_store
        self._sent: dict[int, int] = {}  # the degrees that each servo was sent last, as far as that holds
        self._servo_count = 0  # how many it is to be known of
        self._assumed: set[int] = set()  # servos whose angles are a guess until they are sent one
        self._knowledge = ServoKnowledge.NONE
        self._has_unsaved_angles = False  # angles were sent since they were kept last
        self.first_boot_state: BootState | None = None
        """What the board had done when it was met first; None before that."""

    @property
    def latched(self) -> str:
        """Why nothing of it moves until it is enabled; empty while it may."""
        return self._reconnect.latched

    def enable(self) -> None:
        """Let its devices move again."""
        self._reconnect.enable()

    @property
    def is_ready(self) -> bool:
        """True while the board takes angles."""
        session = self._session
        return self._link.online and session is not None and session.topic is not None

    def open(self, device: BoardDevice) -> None:
        """Serve ``device``; the first one starts the search for the board."""
        if device not in self._devices:
            if not self._devices:
                self._reconnect.restart()
            self._devices += (device,)
        self._link.open(self)

    def close(self, device: BoardDevice) -> None:
        """Serve ``device`` no more; with the last one, tell the board to stop sending and release the port."""
        self._devices = tuple(each for each in self._devices if each is not device)
        if not self._devices:
            self._link.close()
            if self._angle_store is not None:
                self._angle_store.close()

    def send(self, device: BoardDevice) -> None:
        """Send what is due for ``device`` now, from whatever thread. Raises NotConnected when the port has gone."""
        with self._lock:
            session = self._session
            if session is not None and session.topic is not None and self.can_send:
                self._send(session, session.topic, (device,))
                return
        self._link.wake()

    @property
    def can_send(self) -> bool:
        """Whether angles may be sent now: it is sure that the board has not begun anew."""
        session = self._session
        return session is not None and session.boot_state is None and session.detector.is_fresh(self._clock.now())

    def require_ready(self) -> None:
        """Raise NotConnected, with what is missing and what to try, unless the board takes angles.

        Raises DeviceFault while it is latched.
        """
        if not self.is_ready:
            health = self.health()
            raise NotConnected(health.detail, hint=health.hint)
        self._reconnect.require_unlatched(self.name)

    def health(self) -> Health:
        """Say whether the board takes angles, and what it is waiting for if not."""
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
        """How fast the wheels turn, by the encoders of the later sketches; none with a sketch that has none."""
        session, now = self._session, self._clock.now()
        tacho = None if session is None else session.tacho
        if tacho is None or tacho.value is None:
            return Reading(None, now, Quality.NONE)
        rates = WheelRates(*(rpm * math.tau / 60 for rpm in (tacho.value.left, tacho.value.right)))
        fresh = self._link.online and now - tacho.stamp <= STALE_AFTER
        return Reading(rates, tacho.stamp, Quality.GOOD if fresh else Quality.STALE)

    # --- the link's thread: see drivers.transport.link.LinkHandler --------------------------------------------------------

    def on_connected(self) -> None:
        """Begin a session with a board that may be booting."""
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
        """Pass the board's bytes on."""
        if self._session is not None:
            self._session.on_data(data)

    def on_poll(self) -> float | None:
        """Let the session do what is due, and every device say what to send; doze while that is nothing."""
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
        """Tell the board to stop sending, and remember where it was left."""
        if self._knowledge is not ServoKnowledge.NONE:
            self._save_angles()
        self._link.write(wire.STOP_SENDING)

    def _save_angles(self) -> None:
        """Keep where the servos are, also for after a `kill -9`. For the link's thread: a disk may be slow."""
        self._has_unsaved_angles = False
        if self._angle_store is not None:
            if len(self._sent) == self._servo_count and not self._assumed:
                self._angle_store.save(self._sent)
            else:
                self._angle_store.delete()

    def _apply_boot_state(self, boot_state: BootState, session: RosserialSession) -> None:
        """Set the angles of the servos after an answer of the board, or latch where nobody knows them."""
        before, self._knowledge = self._knowledge, TRANSITIONS[self._knowledge, boot_state]
        if boot_state is BootState.UNCHANGED and before is not ServoKnowledge.NONE:
            return
        if self._knowledge is ServoKnowledge.LOST:
            unknown = "nobody knows whether its board has started anew, and where its servos stand"
            self._reconnect.latch(unknown, replace=True)
            self._drop_goals()
            self._sent = {}  # the next program is not to believe it
            self._save_angles()
            return
        left = self._angle_store.pop() if self._angle_store is not None and before is ServoKnowledge.NONE else {}
        known, self._sent = True, {}
        if self._knowledge is ServoKnowledge.FROM_MEMORY:
            self._sent = left
            known = self._angle_store is None or all(device.servos <= left.keys() for device in self._devices)
            if not known:
                what = (
                    "its board has been running, and nobody knows where its servos stand: the first movement may leap"
                )
                cure = "keep clear of it now; from then on let one program alone move it, and end that in good order"
                self._report(DeviceStatus(self.name, "fault", what, cure))
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
        """Send what is due, if it is sure that the board is the one that we know; else ask the board first.

        Say whether it rests: nothing is to be sent, and nothing was a moment ago.
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
