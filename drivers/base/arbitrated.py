"""Commands of a base: arbitration between sources, latch and reports, the same for drivers, twins and legs."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from threading import RLock
from typing import Protocol, TypedDict, Unpack

from drivers.api import (
    BaseLimits,
    BaseState,
    DeviceStatus,
    DockBeam,
    Imu,
    Legs,
    Lights,
    Pose2D,
    Ranger,
    Reading,
    ReconnectPolicy,
    Reflexes,
    Sounds,
    Source,
    StatusCallback,
    Steering,
    SteeringCallback,
    Velocity,
    ignore,
)
from drivers.api.sections import BaseKeys
from drivers.base.limits import VelocityLimits, check, require
from drivers.base.motion_fault import MotionFault, compare
from drivers.base.progress_monitor import Instruments, ProgressMonitor
from drivers.base.velocity_multiplexer import VelocityMultiplexer
from drivers.clock import Clock
from drivers.errors import NotConnected
from drivers.transport.history import ValueHistory
from drivers.transport.loop import guard_callback

NEAR_BEAMS = DockBeam.NEAR_LEFT | DockBeam.NEAR_CENTRE | DockBeam.NEAR_RIGHT


class BaseSettings(TypedDict, total=False):
    """Settings of a base: speed limits (m/s, rad/s), acceleration limits (m/s^2, rad/s^2) and callbacks.

    Braking is 1.2 times as hard as the acceleration limits. ``away`` is the reconnect policy. ``guard`` is the base's
    section of the robot file, from which the range guard takes its settings. ``report`` receives each status of the
    base. ``changed`` is called when a contact, a hazard or a button changes, ``steered`` when the source or the
    velocity of the base changes.
    """

    max_linear: float
    max_angular: float
    linear_acceleration: float
    angular_acceleration: float
    reflexes: Reflexes | None
    away: ReconnectPolicy | None
    guard: BaseKeys | None
    report: StatusCallback
    changed: Callable[[], None]
    steered: SteeringCallback


class BaseCallbacks(Protocol):
    """Callbacks that a base calls.

    ``drivers.api.driver.DriverContext`` and ``drivers.sim.context.SimContext`` implement this protocol.
    """

    @property
    def report(self) -> StatusCallback:
        """Callback that receives each status of the base, such as a fault or a disconnect."""
        ...

    @property
    def on_change(self) -> Callable[[], None]:
        """Callback without arguments that the base calls when a contact, a hazard or a button changes."""
        ...

    @property
    def on_steering(self) -> SteeringCallback:
        """Callback that receives source, setpoint and permitted velocity of the base when one of them changes."""
        ...


def settings_of(keys: BaseKeys, callbacks: BaseCallbacks) -> BaseSettings:
    """Return the settings of a base: limits from ``keys``, its section of a robot file, and the given ``callbacks``."""
    return BaseSettings(
        max_linear=keys.max_speed,
        max_angular=keys.max_turn,
        linear_acceleration=keys.acceleration,
        angular_acceleration=keys.turn_acceleration,
        reflexes=keys.reflexes,
        away=keys.away,
        guard=keys,
        report=callbacks.report,
        changed=callbacks.on_change,
        steered=callbacks.on_steering,
    )


class ArbitratedBase(ABC):
    """Base class of drivers and twins of bases: a ``drivers.api.Base`` whose commands pass a velocity multiplexer.

    A subclass adds the actuators and the measured state. Commands are thread-safe. ``instruments`` names the sensors
    that measure the motion, for messages. The constructor raises ValueError if a speed or acceleration limit is not
    positive.
    """

    name = "base"
    sounds: Sounds | None = None
    lights: Lights | None = None
    legs: Legs | None = None
    has_witnesses = True
    """Whether a range finder and an IMU of the robot can check the reported motion of this base."""

    def __init__(self, clock: Clock, instruments: Instruments | None = None, **settings: Unpack[BaseSettings]) -> None:
        self._clock = clock
        self._report = guard_callback(settings.get("report", ignore))
        self._changed = guard_callback(settings.get("changed", ignore))
        self._steered = guard_callback(settings.get("steered", ignore))
        limits = VelocityLimits(
            settings.get("max_linear", 0.5),
            settings.get("max_angular", 1.9),
            settings.get("linear_acceleration", 0.5),
            settings.get("angular_acceleration", 3.5),
        )
        self._limits = limits.as_base_limits
        monitor = ProgressMonitor(instruments)
        self._mux = VelocityMultiplexer(limits, settings.get("reflexes"), settings.get("away"), monitor)
        self._reported_fault: MotionFault | None = None
        self._reported_steering = self._mux.steering
        self._guard_keys = settings.get("guard")
        self._poses = ValueHistory()  # heading, x and y
        self._silent = False
        # Held from the selection of a command until it is written: no older command may follow the zero of a stop.
        self._lock = RLock()

    @property
    def limits(self) -> BaseLimits:
        """Limits of speed and acceleration in force."""
        return self._limits

    def restrict_limits(self, limits: BaseLimits) -> BaseLimits:
        """Restrict the maximum speeds; a faster base slows down by its ramp. See ``drivers.api.Limitable``."""
        with self._lock:
            self._limits = self._mux.restrict_limits(limits.speed, limits.turn)
        return self._limits

    def guard_by(self, ranger: Ranger, blind: Sequence[tuple[float, float]] = ()) -> None:
        """Limit every velocity of the base by the scans of ``ranger``, so that it stops before obstacles.

        ``blind`` are the sectors that the range finder does not see, each two bearings in radians. See
        ``drivers.api.Guardable``.
        """
        keys = self._guard_keys or BaseKeys()
        if isinstance(keys.range_guard, str):
            return
        # Imported here: they need numpy, a robot without a range finder does not.
        from drivers.base.footprint import outline_of  # noqa: PLC0415
        from drivers.base.range_guard import RangeGuard  # noqa: PLC0415

        self._mux.guard = RangeGuard(
            ranger,
            keys.range_guard,
            outline_of(keys.footprint),
            self._poses,
            reaction=keys.reaction,
            near_dock=self._near_dock,
            report=self._report,
            blind=tuple(blind),
        )

    def compare_with(self, *, ranger: Ranger | None = None, imu: Imu | None = None) -> None:
        """Compare the odometry with the scans of ``ranger`` and the yaw of ``imu``, to detect motion faults.

        A sensor that is None is not used. See ``drivers.api.WitnessedBase``.
        """
        if not self.has_witnesses:
            return
        # Imported here: they need numpy, a robot without either does not.
        from drivers.base.footprint import outline_of  # noqa: PLC0415
        from drivers.base.witnesses import ImuWitness, ScanWitness  # noqa: PLC0415

        witnesses, keys = self._mux.monitor.witnesses, self._guard_keys or BaseKeys()
        witnesses += [] if ranger is None else [ScanWitness(ranger, outline_of(keys.footprint))]
        witnesses += [] if imu is None else [ImuWitness(imu)]

    def drive(self, velocity: Velocity, *, source: Source = Source.MISSION) -> Velocity:
        """Request a velocity for ``COMMAND_TIMEOUT``; return it as reduced by the limits and reflexes.

        The base approaches it within its acceleration limits. Raises BadRequest for a value that is not finite and for
        ``Source.SAFETY``, DeviceFault while the base is latched, and NotConnected while no reports arrive. A base
        without reports is also stopped.
        """
        check(self.name, velocity, source)
        now = self._clock.now()
        if (error := self._offline_error(now)) is not None:
            self.stop()
            raise error
        with self._lock:
            require(self.name, self._mux.latched)
            return self._mux.request(velocity, now, self._last_state, source)

    def stop(self, *, source: Source | None = None) -> None:
        """Drop the setpoint of ``source``, or of all sources if None, and stop without a ramp.

        Another source that commands the base goes on. Safe from any state, more than once; does not raise when offline.
        """
        with self._lock:
            if self._mux.stop(source):
                self._send_stop()

    def latch(self, reason: str) -> None:
        """Stop, and refuse commands until ``enable``. The first reason is kept. Safe from any state, more than once."""
        with self._lock:
            self._mux.latch(reason)
            self.stop()

    def enable(self) -> None:
        """Release the latch. Setpoints from before are dropped."""
        with self._lock:
            self._mux.enable()

    @property
    def latched(self) -> str:
        """Reason for which the base is latched; empty if it is not."""
        return self._mux.latched

    def steering(self) -> Steering:
        """Return the steering of the last control cycle: source in command, setpoint, permitted velocity."""
        return self._mux.steering

    def heading_at(self, stamp: float) -> float | None:
        """Return the interpolated heading in radians at a time in the last 3 s; None if it is unknown."""
        found = self._poses.at(stamp)
        return found[0] if found else None

    def rest(self) -> None:
        """Stop the base."""
        self.stop()

    # --- for subclasses -----------------------------------------------------------------------------------------------

    @abstractmethod
    def state(self) -> Reading[BaseState]:
        """Return the last reported state."""

    @property
    @abstractmethod
    def _last_state(self) -> BaseState | None:
        """Last reported state of the base, by which the reflexes judge a new command; None before the first report."""

    @abstractmethod
    def _offline_error(self, now: float) -> NotConnected | None:
        """Return the error for a command that arrives now; None while the base is online."""

    @abstractmethod
    def _send_stop(self) -> None:
        """Stop the actuators, if they can be reached. Does not raise NotConnected."""

    @contextmanager
    def _stopping_on_error(self) -> Iterator[None]:
        """Context that stops the actuators if an exception other than NotConnected occurs in it, and raises it again.

        Setpoints are dropped. Without this the base would go on with its last velocity.
        """
        try:
            yield
        except NotConnected:
            raise
        except BaseException:  # SystemExit too, as drivers.transport.link takes it
            self._mux.stop()
            self._send_stop()
            raise

    def _remember(self, stamp: float, pose: Pose2D) -> None:
        """Add a pose that was measured at ``stamp`` to the pose history of the base."""
        self._poses.add(stamp, (pose.heading, pose.x, pose.y))

    def _near_dock(self) -> bool:
        """Return whether the base receives the near beams of its dock, or is docked."""
        state = self.state().value
        if state is None:
            return False
        dock = state.dock
        return state.docked or bool((dock.left | dock.centre | dock.right) & NEAR_BEAMS)

    def _report_steering(self, steering: Steering) -> None:
        """Report a changed steering to the callback, and a new motion fault as a status of the base."""
        fault = self._mux.fault
        if fault is not self._reported_fault and fault is not None:
            self._reported_fault = fault
            self._report(DeviceStatus(self.name, "fault", f"{self.name}: {fault.reason}", fault.hint))
        if steering != self._reported_steering:
            self._reported_steering = steering
            self._steered(steering)

    def _report_online(self, message: str) -> None:
        """Report that the base is online again, if it was reported offline before."""
        if self._silent:
            self._silent = False
            self._report(DeviceStatus(self.name, "online", message))

    def _report_changes(self, before: BaseState | None, states: Iterable[BaseState]) -> None:
        """Report hazards that are new in one of ``states`` as faults; report changed contacts and buttons once.

        ``before`` is the state before the first of ``states``, or None. Contacts and buttons are reported to the
        callback ``changed`` of the settings.
        """
        changed = False
        for state in states:
            change = compare(before, state)
            changed = changed or change.inputs_changed
            for fault, hint in change.faults:
                self._report(DeviceStatus(self.name, "fault", fault, hint))
            before = state
        if changed:
            self._changed()
