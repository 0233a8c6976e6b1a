"""A base that is steered by several, the same for the real Kobuki and its twin: commands, latch, and what it tells."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from threading import RLock
from typing import Protocol, TypedDict, Unpack

from drivers.api import (
    Away,
    BaseLimits,
    BaseState,
    DeviceStatus,
    DockBeam,
    Imu,
    Pose2D,
    Ranger,
    Reading,
    Reflexes,
    Report,
    Source,
    Steered,
    Steering,
    Velocity,
    ignore,
)
from drivers.api.gait import GaitKeys
from drivers.api.sections import BaseKeys
from drivers.base.changes import compare
from drivers.base.limits import Limits
from drivers.base.motion_fault import MotionFault
from drivers.base.progress_monitor import Instruments, ProgressMonitor
from drivers.base.requests import check, require
from drivers.base.velocity_multiplexer import VelocityMultiplexer
from drivers.clock import Clock
from drivers.errors import BadRequest, NotConnected
from drivers.transport.guard import guarded
from drivers.transport.history import History

NEAR_BEAMS = DockBeam.NEAR_LEFT | DockBeam.NEAR_CENTRE | DockBeam.NEAR_RIGHT


class Settings(TypedDict, total=False):
    """Speeds in m/s and rad/s, accelerations in m/s^2 and rad/s^2 (braking is 1.2 times as hard); and who is told.

    ``changed`` is called whenever a contact, a hazard or a button changes, ``steered`` with each change of who commands
    or of what came of it.
    ``guard`` are the keys of its section, for its range guard.
    """

    max_linear: float
    max_angular: float
    linear_acceleration: float
    angular_acceleration: float
    reflexes: Reflexes | None
    away: Away | None
    guard: BaseKeys | None
    report: Report
    changed: Callable[[], None]
    steered: Steered


class Told(Protocol):
    """Who is told by a driver or a twin: a ``Site``, a ``Stage``."""

    @property
    def report(self) -> Report:
        """Told how the base is."""
        ...

    @property
    def changed(self) -> Callable[[], None]:
        """Told that a contact, a hazard or a button has changed."""
        ...

    @property
    def steered(self) -> Steered:
        """Told who commands."""
        ...


def settings_of(keys: BaseKeys, told: Told) -> Settings:
    """Return the settings of a base on two wheels, by its section of a robot file."""
    return Settings(
        max_linear=keys.max_speed,
        max_angular=keys.max_turn,
        linear_acceleration=keys.acceleration,
        angular_acceleration=keys.turn_acceleration,
        reflexes=keys.reflexes,
        away=keys.away,
        guard=keys,
        report=told.report,
        changed=told.changed,
        steered=told.steered,
    )


class SteeredBase(ABC):
    """The half of a ``drivers.api.Base`` that commands go to. A subclass adds its wire or its body.

    Commands are safe between threads. Raises ValueError for a limit that is not positive.
    """

    name = "base"
    instruments = Instruments()
    """What measures its motion, in words."""
    comparable = True
    """Whether range finder and IMU can tell of its motion."""

    def __init__(self, clock: Clock, **settings: Unpack[Settings]) -> None:
        self._clock = clock
        self._report = guarded(settings.get("report", ignore))
        self._changed = guarded(settings.get("changed", ignore))
        self._steered = guarded(settings.get("steered", ignore))
        limits = Limits(
            settings.get("max_linear", 0.5),
            settings.get("max_angular", 1.9),
            settings.get("linear_acceleration", 0.5),
            settings.get("angular_acceleration", 3.5),
        )
        self._limits = limits.told
        monitor = ProgressMonitor(self.instruments)
        self._mux = VelocityMultiplexer(limits, settings.get("reflexes"), settings.get("away"), monitor)
        self._told_fault: MotionFault | None = None
        self._told = self._mux.steering
        self._guard_keys = settings.get("guard")
        self._poses = History()  # heading, x and y
        self._silent = False
        # Held from the choice of a command until it is written, so that no older one can follow the zero of a stop.
        self._lock = RLock()

    @property
    def limits(self) -> BaseLimits:
        """How fast it goes, and how quickly that changes."""
        return self._limits

    def curb(self, limits: BaseLimits) -> BaseLimits:
        """See ``drivers.api.Curbed``: of its speeds, at once and by its ramp."""
        with self._lock:
            self._limits = self._mux.curb(limits.speed, limits.turn)
        return self._limits

    def guard_by(self, ranger: Ranger, blind: Sequence[tuple[float, float]] = ()) -> None:
        """See ``drivers.api.Guardable``."""
        keys = self._guard_keys or BaseKeys()
        if isinstance(keys.range_guard, str):
            return
        # They import numpy, which a robot without a range finder does not need.
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
        """See ``drivers.api.Witnessed``."""
        if not self.comparable:
            return
        # They import numpy, which a robot without either does not need.
        from drivers.base.footprint import outline_of  # noqa: PLC0415
        from drivers.base.witnesses import ImuWitness, ScanWitness  # noqa: PLC0415

        witnesses, keys = self._mux.monitor.witnesses, self._guard_keys or BaseKeys()
        witnesses += [] if ranger is None else [ScanWitness(ranger, outline_of(keys.footprint))]
        witnesses += [] if imu is None else [ImuWitness(imu)]

    def drive(self, velocity: Velocity, *, source: Source = Source.MISSION) -> Velocity:
        """Drive so for ``COMMAND_LIFE`` at most; return what is in force of it: limited, and what reflexes permit.

        The base gets there by its acceleration limits. Raises BadRequest for a value that is not finite and for
        ``Source.SAFETY``, DeviceFault while it is latched, and NotConnected when no reports arrive: it does not drive
        blind, and stands still.
        """
        check(self.name, velocity, source)
        now = self._clock.now()
        if (silence := self._unheard(now)) is not None:
            self.stop()
            raise silence
        with self._lock:
            require(self.name, self._mux.latched)
            return self._mux.steer(velocity, now, self._newest, source)

    def perform(self, act: str, gait: GaitKeys | None = None) -> float:  # noqa: ARG002 - it has no legs for that
        """Raise BadRequest: it goes on wheels."""
        raise BadRequest(f"{self.name}: it has no legs to {act} with", hint="this needs a base of `driver: legs`")

    def stop(self, *, source: Source | None = None) -> None:
        """Stand still now, without any ramp: forget what ``source`` commands, or anybody (None).

        Safe from any state, more than once; does not raise when offline.
        """
        with self._lock:
            if self._mux.halt(source):
                self._stand()

    def latch(self, reason: str) -> None:
        """Stand still until ``enable``, whoever commands. Safe from any state, more than once."""
        with self._lock:
            self._mux.latch(reason)
            self.stop()

    def enable(self) -> None:
        """End a latched stop; nothing of before is in force then."""
        with self._lock:
            self._mux.enable()

    @property
    def latched(self) -> str:
        """Why it is latched; empty while it is not."""
        return self._mux.latched

    def steering(self) -> Steering:
        """Return who commands it, and what came of that, as of the last renewal."""
        return self._mux.steering

    def heading_at(self, stamp: float) -> float | None:
        """The heading in radians at a past time (the last 3 s), interpolated; None when that is not known."""
        found = self._poses.at(stamp)
        return found[0] if found else None

    def rest(self) -> None:
        """Stand still: the only rest of a base."""
        self.stop()

    # --- what the subclass adds, and what it calls --------------------------------------------------------------------

    @abstractmethod
    def state(self) -> Reading[BaseState]:
        """Return the newest report of the base."""

    @property
    @abstractmethod
    def _newest(self) -> BaseState | None:
        """The newest state, for the reflexes; None before the first."""

    @abstractmethod
    def _unheard(self, now: float) -> NotConnected | None:
        """Say why no command can be taken; None while reports arrive."""

    @abstractmethod
    def _stand(self) -> None:
        """Tell the wheels to stand, where anybody is there to be told. Does not raise NotConnected."""

    @contextmanager
    def _standing_on_error(self) -> Iterator[None]:
        """Tell the wheels to stand if a renewal fails, for else the last speed goes on; the error is raised again."""
        try:
            yield
        except NotConnected:
            raise
        except BaseException:  # SystemExit too, as drivers.transport.link takes it
            self._stand()
            raise

    def _remember(self, stamp: float, pose: Pose2D) -> None:
        """Remember where the base was at ``stamp``."""
        self._poses.add(stamp, (pose.heading, pose.x, pose.y))

    def _near_dock(self) -> bool:
        """Whether it hears the near beams of its dock, or is on it."""
        state = self.state().value
        if state is None:
            return False
        dock = state.dock
        return state.docked or bool((dock.left | dock.centre | dock.right) & NEAR_BEAMS)

    def _tell_steering(self, steering: Steering) -> None:
        """Tell who commands, and why the base was stopped, if that is new."""
        fault = self._mux.fault
        if fault is not self._told_fault and fault is not None:
            self._told_fault = fault
            self._report(DeviceStatus(self.name, "fault", f"{self.name}: {fault.reason}", fault.hint))
        if steering != self._told:
            self._told = steering
            self._steered(steering)

    def _tell_return(self, what: str) -> None:
        """Tell that the base is back, if it was silent."""
        if self._silent:
            self._silent = False
            self._report(DeviceStatus(self.name, "online", what))

    def _tell(self, before: BaseState | None, states: Iterable[BaseState]) -> None:
        """Tell what has changed of contacts, buttons and hazards, from state to state."""
        felt = False
        for state in states:
            change = compare(before, state)
            felt = felt or change.felt
            for fault, hint in change.faults:
                self._report(DeviceStatus(self.name, "fault", fault, hint))
            before = state
        if felt:
            self._changed()
