"""The twin of a Kobuki: the real driver's rules and odometry over a simulated body, in one thread."""

from collections.abc import Collection
from dataclasses import replace
from math import degrees, inf
from random import Random
from typing import Any, Protocol, Unpack

from drivers.api import (
    STILL,
    BaseState,
    DeviceStatus,
    Health,
    Lamp,
    Pose2D,
    Quality,
    Reading,
    Sides,
    Tune,
    Velocity,
)
from drivers.base.arbitrated import ArbitratedBase, BaseSettings
from drivers.base.changes import BACKUP_LIMIT
from drivers.base.progress_monitor import Instruments
from drivers.base.requests import LIGHTS, check_light, check_tone
from drivers.clock import Clock
from drivers.errors import NotConnected
from drivers.kobuki.commands import BaseControl
from drivers.kobuki.driver import OFFLINE_AFTER, STALE_AFTER
from drivers.kobuki.feedback import Core, Inertia
from drivers.kobuki.odometry import Odometry
from drivers.sim.body import NOTHING, Body, either
from drivers.sim.plug import Plug
from drivers.sim.things import NO_SIGNALS
from drivers.sim.wheels import DelayLine

# Sounder and lights of a simulated base: they note the commands.


class PanelTwin:
    """``drivers.api.Sounds`` and ``drivers.api.Lights`` of the base ``name``. For one thread.

    ``played`` are the requested tunes and tones (hertz, seconds), ``colours`` are those of the lights.
    """

    def __init__(self, name: str, plug: Plug) -> None:
        self.name = name
        self.played: list[Tune | tuple[float, float]] = []
        self.colours: dict[int, Lamp] = dict.fromkeys(LIGHTS, Lamp.OFF)
        self._plug = plug

    def play(self, tune: Tune) -> None:
        """Note a tune. Raises NotConnected."""
        self._plug.require()
        self.played.append(tune)

    def tone(self, frequency: float, seconds: float) -> None:
        """Note a tone. Raises BadRequest, NotConnected."""
        check_tone(self.name, frequency, seconds)
        self._plug.require()
        self.played.append((frequency, seconds))

    def light(self, number: int, colour: Lamp) -> None:
        """Switch light 1 or 2. Raises BadRequest for another, NotConnected."""
        check_light(self.name, number)
        self._plug.require()
        self.colours[number] = colour


Contacts = tuple[Sides, Sides, Sides, frozenset[str], frozenset[int], bool]
"""Bumper, cliff, wheel drop, other hazards, buttons, and whether it stands on the contacts of its dock."""

_AT_BACKUP_LIMIT = frozenset({BACKUP_LIMIT})


class Course(Protocol):
    """What adds up a way, by whatever is known of it."""

    @property
    def pose(self) -> Pose2D:
        """Where the base is."""
        ...

    @property
    def velocity(self) -> Velocity:
        """How it moves."""
        ...


class BaseTwin(ArbitratedBase):
    """A ``drivers.api.Base`` made of arithmetic. ``step`` is to be called every ``PERIOD``; for one thread.

    Limits as for ``KobukiBase``, and kept by the same code. Its pose is odometry, as the real one's: the encoders of
    ``body`` and a gyro, each report of which errs by ``gyro_noise`` rad/s (standard deviation). ``dropouts`` is the
    share 0..1 of reports that get lost. What is left to chance is drawn from ``seed``.
    ``capabilities`` are the optional ones that it has.
    ``changed`` is called whenever a contact, a hazard or a button changes, ``steered`` with each change of who commands
    or of what came of it.
    Raises ValueError for values that make no sense.
    """

    PERIOD = 0.02
    instruments = Instruments("encoders", "gyro")

    def __init__(
        self,
        clock: Clock,
        *,
        body: Body | None = None,
        gyro_noise: float = 0.0,
        dropouts: float = 0.0,
        seed: int = 0,
        capabilities: Collection[str] = ("sounds", "lights"),
        **settings: Unpack[BaseSettings],
    ) -> None:
        if not (0 <= dropouts <= 1 and 0 <= gyro_noise < inf):
            raise ValueError(f"{self.name}: {dropouts=}, {gyro_noise=}: out of range")
        super().__init__(clock, self.instruments, **settings)
        self.plug = Plug(self.name, self._report, back=self._connected)
        self.panel = PanelTwin(self.name, self.plug)
        if "sounds" in capabilities:
            self.sounds = self.panel
        if "lights" in capabilities:
            self.lights = self.panel
        self.body = body or Body()
        self._odometry = Odometry()
        self._random = Random(f"{seed} {self.name}")  # noqa: S311 - chance, not a secret
        self._gyro_noise = gyro_noise
        self._dropouts = dropouts
        self.late: DelayLine[Any] = DelayLine()
        """Delays what is measured of its motion."""
        self._gyro_error = 0.0  # radians that the noise has added up to
        self._pressed: tuple[Sides, Sides, frozenset[int]] = (NOTHING, NOTHING, frozenset())  # by hand
        self._contacts: Contacts = (NOTHING, NOTHING, NOTHING, frozenset(), frozenset(), False)  # of the newest report
        self._signals = NO_SIGNALS  # of the dock, likewise
        self._felt: BaseState | None = None  # the state when they last changed; None before the first report
        self._latest: BaseState | None = None  # of the newest report, made when somebody asks
        self._heard_at = -inf
        self._frames = 0

    # --- what behaviours ask ------------------------------------------------------------------------------------------

    def state(self) -> Reading[BaseState]:
        """The newest report; stale when it is older than the real driver's limit."""
        now = self._clock.now()
        if self._felt is None:
            return Reading(None, now, Quality.NONE)
        if self._latest is None:
            self._latest = self._state()
        fresh = now - self._heard_at <= STALE_AFTER
        return Reading(self._latest, self._heard_at, Quality.GOOD if fresh else Quality.STALE)

    # --- life ---------------------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Be there at once, unless it is unplugged."""
        self._mux.absence.begin()
        self.plug.open()

    def close(self) -> None:
        """Stand still, and hear nothing any more. Safe from any state, more than once."""
        self.stop()
        self.plug.close()

    def health(self) -> Health:
        """Say whether reports arrive."""
        health = replace(self.plug.health({"frames": self._frames}), returned=self._mux.absence.returned)
        if health.online and not self._hears(self._clock.now()):
            detail, hint = self._silence()
            return replace(health, online=False, detail=detail, hint=hint)
        return health

    def step(self) -> None:
        """Let the body roll on to now, report, and renew the command, as the real one does 50 times a second."""
        now = self._clock.now()
        self.body.advance(now)
        if not self.plug.online:
            return
        with self._stopping_on_error():
            self._renew(now)

    def _renew(self, now: float) -> None:
        if not (self._dropouts and self._random.random() < self._dropouts):
            self._hear(now)
        elif not (self._silent or self._hears(now)):
            self._silent = True
            self._report(DeviceStatus(self.name, "offline", *self._silence()))
        felt = self._feels(now)
        if felt is not None:
            self._mux.on_state(felt, now)
        velocity = self._mux.next_velocity(now, felt)
        self._obey(velocity, now)
        self._report_steering(self._mux.steering)

    # --- the hand of whoever tests a mission --------------------------------------------------------------------------

    def true_pose(self, now: float) -> Pose2D:
        """Where it really is at time ``now``, in the world's frame."""
        return self.body.advance(now)

    def press(self, bumper: Sides = NOTHING, *, cliff: Sides = NOTHING, buttons: frozenset[int] = frozenset()) -> None:
        """Make it feel this from the next report on, beside what the ground gives; without arguments, let go."""
        self._pressed = (bumper, cliff, buttons)

    def lift(self, *, up: bool = True) -> None:
        """Take it off the floor, or put it down where it was: in the air both wheels drop and drive nothing."""
        self.body.lifted = up

    def feed(self, *, on: bool = True) -> None:
        """Have its contacts fed as a dock does, wherever it stands, or no more."""
        self.body.fed = on

    def drain(self, percent: float) -> None:
        """Leave ``percent`` (0..100) of the battery. Raises ValueError for another value."""
        if not 0 <= percent <= 100:
            raise ValueError(f"{self.name}: a battery cannot hold {percent} percent")
        self.body.battery.percent = percent
        self._latest = None

    # --- the inside ---------------------------------------------------------------------------------------------------

    def _connected(self) -> None:
        """Begin anew: nothing of before is in force, but the pose goes on from where it was."""
        self._mux.stop()
        self._anchor()
        self._silent = False
        now = self._clock.now()
        self.body.advance(now)
        self._hear(now)

    @property
    def _course(self) -> Course:
        """Where it believes to be, and to move."""
        return self._odometry

    def _anchor(self) -> None:
        """Go on from where it was, whatever way it has made unheard."""
        self._odometry.anchor()

    def _hear(self, now: float) -> None:
        """Take one report of the body."""
        self._measure(now)
        self._remember(now, self._course.pose)
        self._heard_at = now
        self._mux.on_report(now)
        self._latest = None
        self._frames += 1
        self._feel()

    def _measure(self, now: float) -> None:
        """Take what encoders, gyro and infrared receivers say."""
        left, right = self.body.encoders
        noise = self._random.gauss(0.0, self._gyro_noise) if self._gyro_noise else 0.0
        self._gyro_error += noise * self.PERIOD
        gyro = self.body.gyro
        heading = round(100 * degrees(self.body.pose.heading + self._gyro_error + gyro.error(now)))
        rate = round(100 * degrees(self.body.velocity.angular + noise + gyro.rate))
        core = Core(time_ms=round(1000 * now), left_encoder=left, right_encoder=right)
        self.late.put(now, (core, Inertia(heading, rate)))
        for core, inertia in self.late.due(now):
            self._odometry.update(core, inertia, now)
        self._signals = self.body.signals()

    def _touches(self) -> Contacts:
        """Return what it touches now."""
        bumper, cliff, buttons = self._pressed
        body = self.body
        hazards = _AT_BACKUP_LIMIT if body.backup_limit is not None and body.backup_limit.reached else frozenset()
        return either(bumper, body.bumper), either(cliff, body.cliff), body.wheel_drop, hazards, buttons, body.docked

    def _obey(self, velocity: Velocity, now: float) -> None:
        """Tell the body how to move, as the wire would."""
        self._odometry.commanded = velocity != STILL
        self.body.command(*BaseControl.of(velocity.linear, velocity.angular).velocity, now)

    def _feel(self) -> None:
        """Tell what has changed of contacts and buttons, and that the base is back if it was silent."""
        self._report_online(f"{self.name}: the base reports again")
        contacts = self._touches()
        if contacts == self._contacts and self._felt is not None:
            return
        self._contacts = contacts
        before, self._felt = self._felt, self._state()
        self._report_changes(before, (self._felt,))

    def _state(self) -> BaseState:
        """Return the state as of the newest report."""
        bumper, cliff, wheel_drop, hazards, buttons, docked = self._contacts
        battery = self.body.battery
        return BaseState(
            pose=self._course.pose,
            velocity=self._course.velocity,
            bumper=bumper,
            cliff=cliff,
            wheel_drop=wheel_drop,
            hazards=hazards,
            buttons=buttons,
            battery_voltage=battery.voltage,
            battery_percent=battery.told,
            charging=battery.charging,
            docked=docked,
            dock=self._signals,
            overcurrent=self.body.overcurrent,
            settling=self._odometry.bias.settling,
            odometers=self._odometry.odometers,
        )

    def _feels(self, now: float) -> BaseState | None:
        """Return what the reflexes go by: what it touches, and where that is while it matters."""
        if not self._hears(now):
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
        if self._hears(now):
            return None
        if not self.plug.online:
            return self.plug.absent()
        detail, hint = self._silence()
        return NotConnected(detail, hint=hint)

    def _send_stop(self) -> None:
        if self.plug.online:
            self._obey(STILL, self._clock.now())

    def _hears(self, now: float) -> bool:
        return self.plug.online and now - self._heard_at <= OFFLINE_AFTER

    def _silence(self) -> tuple[str, str]:
        """Say what is the matter with a base that is there but does not report, and what to try."""
        return f"{self.name}: connected but silent: too many reports are lost", "lower the dropouts of the world"
