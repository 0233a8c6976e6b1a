"""Simulated base: uses the arbitration and reflexes of the drivers with a simulated body. Single-threaded."""

from collections.abc import Collection
from dataclasses import replace
from math import degrees, inf, radians
from random import Random
from typing import Any, Protocol, Unpack

from drivers.api import (
    ZERO_VELOCITY,
    BaseState,
    DeviceStatus,
    Health,
    Lamp,
    Odometers,
    Pose2D,
    Quality,
    Reading,
    Sides,
    Tune,
    Velocity,
)
from drivers.api.sections import BaseKeys
from drivers.base.arbitrated import ArbitratedBase, BaseSettings, settings_of
from drivers.base.gyro_bias import GyroBias
from drivers.base.limits import LIGHTS, check_light, check_tone
from drivers.base.motion_fault import BACKUP_LIMIT
from drivers.base.progress_monitor import Instruments
from drivers.base.reckoning import GyroOdometry, Reckoning, TwoWheels
from drivers.clock import Clock
from drivers.errors import NotConnected
from drivers.sim.base_body import ENCODER_STEP, NO_SIDES, BaseBody, merge_sides
from drivers.sim.context import SimContext
from drivers.sim.plug import SimulatedPlug
from drivers.sim.wheels import DelayLine
from drivers.sim.world_objects import NO_SIGNALS

# Sounder and lights of a simulated base: they note the commands.


class PanelTwin:
    """Simulated sounder and lights of the base ``name``. Not thread-safe.

    ``played`` lists the requested tunes and tones; a tone is its frequency in hertz and its seconds. ``colours`` are
    the current colours of the lights by number.
    """

    def __init__(self, name: str, plug: SimulatedPlug) -> None:
        self.name = name
        self.played: list[Tune | tuple[float, float]] = []
        self.colours: dict[int, Lamp] = dict.fromkeys(LIGHTS, Lamp.OFF)
        self._plug = plug

    def play(self, tune: Tune) -> None:
        """Add a tune to ``played``. Raises NotConnected."""
        self._plug.check_online()
        self.played.append(tune)

    def tone(self, frequency: float, seconds: float) -> None:
        """Add a tone of ``frequency`` Hz to ``played``. Raises BadRequest, NotConnected."""
        check_tone(self.name, frequency, seconds)
        self._plug.check_online()
        self.played.append((frequency, seconds))

    def light(self, number: int, colour: Lamp) -> None:
        """Switch light 1 or 2. Raises BadRequest for another number, NotConnected."""
        check_light(self.name, number)
        self._plug.check_online()
        self.colours[number] = colour


Contacts = tuple[Sides, Sides, Sides, frozenset[str], frozenset[int], bool]
"""Contacts of a simulated base: bumper, cliff, wheel drop, hazards, pressed buttons, and whether it is docked."""

NO_CONTACTS: Contacts = (NO_SIDES, NO_SIDES, NO_SIDES, frozenset(), frozenset(), False)
ORIGIN = Pose2D(0.0, 0.0, 0.0)

STEP_INTERVAL = 0.02
"""Seconds between two reports of a simulated base."""

STALE_AFTER, OFFLINE_AFTER = 0.1, 0.25
"""Seconds without a report after which the state is stale, and the base offline."""

MAX_REPORT_GAP = 1.0
"""Seconds without a report after which the motion since the last report is not counted."""

_AT_BACKUP_LIMIT = frozenset({BACKUP_LIMIT})


class TwinOdometry(Protocol):
    """Odometry of a simulated base: its pose as its encoders and gyro measure it, with their errors."""

    instruments: Instruments

    @property
    def pose(self) -> Pose2D:
        """Pose of the simulated base by odometry."""
        ...

    def send(self, velocity: Velocity, now: float) -> Velocity:
        """Store the velocity sent to the base; return the velocity that its motors follow."""
        ...

    def measure(self, body: BaseBody, late: DelayLine[Any], now: float, random: Random) -> None:
        """Measure the motion of ``body`` at ``now``, and put the result into the queue ``late``.

        The pose is updated with the results that this queue has delayed long enough. ``random`` draws the errors.
        """
        ...

    def pause(self) -> None:
        """Keep the pose until the next measurement: the connection was lost."""
        ...

    def complete(self, state: BaseState) -> BaseState:
        """Return ``state`` with the pose, velocity and odometers of this odometry."""
        ...


class GyroTwinOdometry:
    """Simulated odometry of two wheel encoders, ``track`` metres apart, and a gyro.

    The rate of the gyro has an error of the standard deviation ``gyro_noise`` rad/s. Raises ValueError for a negative
    noise.
    """

    instruments = Instruments("encoders", "gyro")

    def __init__(self, gyro_noise: float = 0.0, track: float = 0.23) -> None:
        if not 0 <= gyro_noise < inf:
            raise ValueError(f"base: {gyro_noise=}: out of range")
        self._odometry = GyroOdometry(track)
        self._noise = gyro_noise
        self._error = 0.0  # radians that the noise has added up to
        self._last: tuple[int, int, int, int, int, float] | None = None

    @property
    def pose(self) -> Pose2D:
        return self._odometry.pose

    def send(self, velocity: Velocity, now: float) -> Velocity:
        del now
        self._odometry.commanded = velocity != ZERO_VELOCITY
        return velocity

    def measure(self, body: BaseBody, late: DelayLine[Any], now: float, random: Random) -> None:
        """Measure ``body`` with encoders and gyro, rounded to the units of a base's reports.

        The units are encoder ticks, hundredths of a degree (per second) and milliseconds.
        """
        left, right = body.encoders
        noise = random.gauss(0.0, self._noise) if self._noise else 0.0
        self._error += noise * STEP_INTERVAL
        heading = round(100 * degrees(body.pose.heading + self._error + body.gyro_drift.error(now)))
        rate = round(100 * degrees(body.velocity.angular + noise + body.gyro_drift.rate))
        late.put(now, (round(1000 * now), left, right, heading, rate))
        for report in late.pop_due(now):
            self._take(report, now)

    def _take(self, report: tuple[int, int, int, int, int], now: float) -> None:
        time_ms, left, right, heading, rate = report
        last, self._last = self._last, (time_ms, left, right, heading, rate, now)
        if last is None:
            return
        seconds = (time_ms - last[0]) / 1000
        if max(seconds, now - last[5]) > MAX_REPORT_GAP:
            self._odometry.velocity = ZERO_VELOCITY
            return
        travel = ENCODER_STEP * (left - last[1]), ENCODER_STEP * (right - last[2])
        self._odometry.add(*travel, radians((heading - last[3]) / 100), radians(rate / 100), seconds)

    def pause(self) -> None:
        self._last, self._odometry.velocity = None, ZERO_VELOCITY

    def complete(self, state: BaseState) -> BaseState:
        odometry = self._odometry
        return replace(
            state,
            pose=odometry.pose,
            velocity=odometry.velocity,
            settling=odometry.bias.settling,
            odometers=odometry.odometers,
        )


class WheelTwinOdometry:
    """Simulated odometry of measured wheel speeds, or dead reckoning from the sent velocities if ``reckoned``.

    With ``gyro`` the turns are measured by a gyro. ``wheels`` has the maximum wheel speed, to which velocities are
    reduced.
    """

    instruments = Instruments("encoders", "encoders")

    def __init__(self, wheels: TwoWheels, *, reckoned: bool, gyro: bool = False) -> None:
        self._wheels, self._reckoned, self._gyro = wheels, reckoned, gyro
        self._bias = GyroBias(encoders=False)
        self._commanded = False
        self._reckoning = Reckoning()
        self._odometers: Odometers | None = None

    @property
    def pose(self) -> Pose2D:
        return self._reckoning.pose

    def send(self, velocity: Velocity, now: float) -> Velocity:
        self._commanded = velocity != ZERO_VELOCITY
        given = self._wheels.within(velocity)
        if self._reckoned:
            self._reckoning.advance(now, given)
        return given

    def measure(self, body: BaseBody, late: DelayLine[Any], now: float, random: Random) -> None:
        """Measure the speeds of the wheels of ``body``. Wheels that slip are measured as if the base moved."""
        del random
        if self._reckoned:
            self._reckoning.advance(now)
            return
        left, right = body.wheel_encoders.speeds
        drift = body.gyro_drift.rate if self._gyro else 0.0
        late.put(now, (now, Velocity((left + right) / 2, (right - left) / body.wheels.separation + drift)))
        for at, rolls in late.pop_due(now):
            self._reckoning.advance(at, self._correct_gyro(rolls) if self._gyro else rolls)
        if not self._gyro:  # which sends a fused pose alone
            left, right = body.wheel_encoders.travel
            self._odometers = Odometers(left, right, (right - left) / body.wheels.separation)

    def _correct_gyro(self, rolls: Velocity) -> Velocity:
        """Return a measured velocity after removing the bias of the gyro."""
        still = not self._commanded and rolls.linear == 0.0
        turn, _ = self._bias.correct(rolls.angular * STEP_INTERVAL, rolls.angular, STEP_INTERVAL, still=still)
        return Velocity(rolls.linear, turn / STEP_INTERVAL)

    def pause(self) -> None:
        self._reckoning.pause()

    def complete(self, state: BaseState) -> BaseState:
        return replace(
            state,
            pose=self._reckoning.pose,
            velocity=self._reckoning.velocity,
            reckoned=self._reckoned,
            settling=self._bias.settling,
            odometers=self._odometers,
        )


class BaseTwin(ArbitratedBase):
    """Simulated base: a ``drivers.api.Base`` with a ``body`` and an ``odometry``. Not thread-safe.

    Call ``step`` every ``STEP_INTERVAL``. With ``feels=False`` the base has no contact sensors, with ``gauge=False`` no
    battery voltage. ``dropouts`` is the share 0..1 of lost reports, drawn from ``seed``. ``capabilities`` are the
    optional ones that the base has: "sounds", "lights". Arbitration, limits and reflexes are those of the drivers.
    Raises ValueError for values out of range.
    """

    STEP_INTERVAL = STEP_INTERVAL

    def __init__(
        self,
        clock: Clock,
        *,
        odometry: TwinOdometry | None = None,
        body: BaseBody | None = None,
        feels: bool = True,
        gauge: bool = True,
        gyro_noise: float = 0.0,
        dropouts: float = 0.0,
        seed: int = 0,
        capabilities: Collection[str] = ("sounds", "lights"),
        **settings: Unpack[BaseSettings],
    ) -> None:
        if not 0 <= dropouts <= 1:
            raise ValueError(f"{self.name}: {dropouts=}: out of range")
        self._odometry = odometry or GyroTwinOdometry(gyro_noise)
        super().__init__(clock, self._odometry.instruments, **settings)
        self.plug = SimulatedPlug(self.name, self._report, on_online=self._connected)
        self.panel = PanelTwin(self.name, self.plug)
        if "sounds" in capabilities:
            self.sounds = self.panel
        if "lights" in capabilities:
            self.lights = self.panel
        self.body = body or BaseBody()
        self._feels, self._gauge = feels, gauge
        self._random = Random(f"{seed} {self.name}")  # noqa: S311 - chance, not a secret
        self._dropouts = dropouts
        self.late: DelayLine[Any] = DelayLine()
        """Queue that delays the measurements of the base's motion."""
        self._pressed: tuple[Sides, Sides, frozenset[int]] = (NO_SIDES, NO_SIDES, frozenset())  # by hand
        self._contacts: Contacts = NO_CONTACTS  # of the newest report
        self._signals = NO_SIGNALS  # of the dock, likewise
        self._felt: BaseState | None = None  # the state when they last changed; None before the first report
        self._latest: BaseState | None = None  # of the last report, made on demand
        self._heard_at = -inf
        self._frames = 0

    # --- what behaviours ask ------------------------------------------------------------------------------------------

    def state(self) -> Reading[BaseState]:
        """Latest report; stale after the time limit of the real driver."""
        now = self._clock.now()
        if self._felt is None:
            return Reading(None, now, Quality.NONE)
        if self._latest is None:
            self._latest = self._state()
        fresh = now - self._heard_at <= STALE_AFTER
        return Reading(self._latest, self._heard_at, Quality.GOOD if fresh else Quality.STALE)

    # --- life ---------------------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Connect at once, unless unplugged."""
        self._mux.absence.restart()
        self.plug.open()

    def close(self) -> None:
        """Stop, and disconnect. Safe from any state, more than once."""
        self.stop()
        self.plug.close()

    def health(self) -> Health:
        """Return whether reports arrive."""
        health = replace(self.plug.health({"frames": self._frames}), reconnected_at=self._mux.absence.reconnected_at)
        if health.online and not self._is_reporting(self._clock.now()):
            detail, hint = self._offline_reason()
            return replace(health, online=False, detail=detail, hint=hint)
        return health

    def step(self) -> None:
        """Advance the simulated body to the current time, report, and send the velocity again.

        A real base does so 50 times a second.
        """
        now = self._clock.now()
        self.body.advance(now)
        if not self.plug.online:
            return
        with self._stopping_on_error():
            self._renew(now)

    def _renew(self, now: float) -> None:
        if not (self._dropouts and self._random.random() < self._dropouts):
            self._on_report(now)
        elif not (self._silent or self._is_reporting(now)):
            self._silent = True
            self._report(DeviceStatus(self.name, "offline", *self._offline_reason()))
        felt = self._reflex_state(now)
        if felt is not None:
            self._mux.on_state(felt, now)
        velocity = self._mux.next_velocity(now, felt)
        self._move_body(velocity, now)
        self._report_steering(self._mux.steering)

    # --- the hand of whoever tests a mission --------------------------------------------------------------------------

    def true_pose(self, now: float) -> Pose2D:
        """Return the true pose of the base at time ``now``, in the world's frame."""
        return self.body.advance(now)

    def press(
        self, bumper: Sides = NO_SIDES, *, cliff: Sides = NO_SIDES, buttons: frozenset[int] = frozenset()
    ) -> None:
        """Set contacts and buttons as if pressed by hand, from the next report on.

        They are added to the contacts of the simulated body. Arguments that are left out are released.
        """
        self._pressed = (bumper, cliff, buttons)

    def lift(self, *, up: bool = True) -> None:
        """Lift the base, or put it down at the same place. In the air both wheel drops are active."""
        self.body.lifted = up

    def set_power(self, *, on: bool = True) -> None:
        """Switch the power on the contacts of the dock on or off, wherever the base is."""
        self.body.force_docked = on

    def drain(self, percent: float) -> None:
        """Set the battery to ``percent`` (0..100). Raises ValueError for another value."""
        if not 0 <= percent <= 100:
            raise ValueError(f"{self.name}: a battery cannot hold {percent} percent")
        self.body.battery.percent = percent
        self._latest = None

    # --- the inside ---------------------------------------------------------------------------------------------------

    def _connected(self) -> None:
        """Drop earlier setpoints, since the base has connected; the pose is kept."""
        self._mux.stop()
        self._odometry.pause()
        self._silent = False
        now = self._clock.now()
        self.body.advance(now)
        self._on_report(now)

    def _on_report(self, now: float) -> None:
        self._odometry.measure(self.body, self.late, now, self._random)
        if self._feels:
            self._signals = self.body.dock_signals()
        self._remember(now, self._odometry.pose)
        self._heard_at = now
        self._mux.on_report(now)
        self._latest = None
        self._frames += 1
        self._report_state_changes()

    def _touches(self) -> Contacts:
        """Return the current contacts of the base: those set by hand and those of the body; none without sensors."""
        if not self._feels:
            return NO_CONTACTS
        bumper, cliff, buttons = self._pressed
        body = self.body
        hazards = _AT_BACKUP_LIMIT if body.backup_limit is not None and body.backup_limit.is_reached else frozenset()
        return (
            merge_sides(bumper, body.bumper),
            merge_sides(cliff, body.cliff),
            body.wheel_drop,
            hazards,
            buttons,
            body.docked,
        )

    def _move_body(self, velocity: Velocity, now: float) -> None:
        given = self._odometry.send(velocity, now)
        self.body.command(given.linear, given.angular, now)

    def _report_state_changes(self) -> None:
        """Report changed contacts and buttons, and that a base that was offline is online again."""
        self._report_online(f"{self.name}: the base reports again")
        contacts = self._touches()
        if contacts == self._contacts and self._felt is not None:
            return
        self._contacts = contacts
        before, self._felt = self._felt, self._state()
        self._report_changes(before, (self._felt,))

    def _state(self) -> BaseState:
        bumper, cliff, wheel_drop, hazards, buttons, docked = self._contacts
        battery = self.body.battery
        state = BaseState(
            ORIGIN,
            ZERO_VELOCITY,
            bumper=bumper,
            cliff=cliff,
            wheel_drop=wheel_drop,
            hazards=hazards,
            buttons=buttons,
            battery_voltage=battery.voltage if self._gauge else 0.0,
            battery_percent=battery.reported_percent if self._gauge else 100.0,
            charging=battery.is_charging and self._gauge,
            docked=docked,
            dock=self._signals,
            overcurrent=self.body.overcurrent,
        )
        return self._odometry.complete(state)

    def _reflex_state(self, now: float) -> BaseState | None:
        """Return the state for the reflexes, with the current pose only if they need it; None without reports."""
        if not self._is_reporting(now):
            return None
        if not (self._mux.needs_pose or self._mux.request_pending):
            return self._felt
        if self._latest is None:
            self._latest = self._state()
        return self._latest

    @property
    def _last_state(self) -> BaseState | None:
        return self._felt

    def _offline_error(self, now: float) -> NotConnected | None:
        if self._is_reporting(now):
            return None
        if not self.plug.online:
            return self.plug.offline_error()
        detail, hint = self._offline_reason()
        return NotConnected(detail, hint=hint)

    def _send_stop(self) -> None:
        if self.plug.online:
            self._move_body(ZERO_VELOCITY, self._clock.now())

    def _is_reporting(self, now: float) -> bool:
        return self.plug.online and now - self._heard_at <= OFFLINE_AFTER

    def _offline_reason(self) -> tuple[str, str]:
        """Return the reason why a base that is plugged in does not report, and a hint."""
        return f"{self.name}: connected but silent: too many reports are lost", "lower the dropouts of the world"


def make(keys: BaseKeys, context: SimContext, odometry: TwinOdometry | None = None) -> BaseTwin:
    """Return the simulated base of any brand with contact sensors, for its section ``keys`` of a robot file."""
    return BaseTwin(
        context.clock,
        odometry=odometry or GyroTwinOdometry(context.physics.gyro_noise),
        body=context.make_body(),
        dropouts=context.physics.dropouts,
        seed=context.seed,
        capabilities=keys.capabilities,
        **settings_of(keys, context),
    )


def make_wheel_base(
    keys: BaseKeys, context: SimContext, odometry: WheelTwinOdometry, *, gauge: bool = True
) -> BaseTwin:
    """Return the simulated base without contact sensors, for its section ``keys`` of a robot file.

    ``gauge`` is False for a base that does not measure its battery voltage.
    """
    return BaseTwin(
        context.clock,
        odometry=odometry,
        body=context.make_body(),
        feels=False,
        gauge=gauge,
        dropouts=context.physics.dropouts,
        seed=context.seed,
        capabilities=keys.capabilities,
        **settings_of(keys, context),
    )
