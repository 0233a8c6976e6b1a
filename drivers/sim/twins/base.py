"""The twin of a Kobuki: the real driver's rules and odometry over a simulated body, in one thread."""

from collections.abc import Callable
from math import degrees, inf, isfinite
from random import Random

from drivers.api import (
    BaseState,
    Health,
    Notice,
    Pose2D,
    Quality,
    Reading,
    Report,
    Sides,
    Velocity,
    unheard,
    unreported,
)
from drivers.clock import Clock
from drivers.errors import BadRequest, NotConnected
from drivers.guard import guarded
from drivers.history import History
from drivers.kobuki.commands import BaseControl
from drivers.kobuki.driver import SILENT_AFTER, STALE_AFTER
from drivers.kobuki.feedback import Core, Inertia
from drivers.kobuki.helm import Helm
from drivers.kobuki.limits import Limits, permitted
from drivers.kobuki.odometry import Odometry
from drivers.kobuki.senses import EMPTY_VOLTAGE, FULL_VOLTAGE, compare
from drivers.sim.body import NOTHING, Body, either
from drivers.sim.twins.plug import Plug

Contacts = tuple[Sides, Sides, Sides, frozenset[int]]
"""Bumper, cliff, wheel drop and buttons."""


class BaseTwin:
    """A ``drivers.api.Base`` made of arithmetic. ``step`` is to be called every ``PERIOD``; for one thread.

    Limits as for ``KobukiBase``, and kept by the same code. Its pose is odometry, as the real one's: the encoders of
    ``body`` and a gyro, each report of which errs by ``gyro_noise`` rad/s (standard deviation). ``dropouts`` is the
    share 0..1 of reports that get lost. What is left to chance is drawn from ``seed``.
    ``changed`` is called whenever a contact or button changes. Raises ValueError for values that make no sense.
    """

    PERIOD = 0.02

    def __init__(
        self,
        clock: Clock,
        *,
        max_linear: float = 0.5,
        max_angular: float = 1.9,
        linear_acceleration: float = 0.5,
        angular_acceleration: float = 3.5,
        report: Report = unreported,
        changed: Callable[[], None] = unheard,
        name: str = "base",
        body: Body | None = None,
        gyro_noise: float = 0.0,
        dropouts: float = 0.0,
        seed: int = 0,
    ) -> None:
        if not (0 <= dropouts <= 1 and 0 <= gyro_noise < inf):
            raise ValueError(f"{name}: {dropouts=}, {gyro_noise=}: out of range")
        self.name = name
        self.body = body or Body()
        self.plug = Plug(name, report, back=self._connected)
        self._clock = clock
        self._report = guarded(report)
        self._changed = guarded(changed)
        self._helm = Helm(Limits(max_linear, max_angular, linear_acceleration, angular_acceleration))
        self._odometry = Odometry()
        self._headings = History()
        self._random = Random(f"{seed} {name}")  # noqa: S311 - chance, not a secret
        self._gyro_noise = gyro_noise
        self._dropouts = dropouts
        self._gyro_error = 0.0  # radians that the noise has added up to
        self._pressed: tuple[Sides, Sides, frozenset[int]] = (NOTHING, NOTHING, frozenset())  # by hand
        self._battery = 100.0
        self._contacts: Contacts = (NOTHING, NOTHING, NOTHING, frozenset())  # of the newest report
        self._felt: BaseState | None = None  # the state when they last changed; None before the first report
        self._latest: BaseState | None = None  # of the newest report, made when somebody asks
        self._heard_at = -inf
        self._silent = False
        self._frames = 0

    # --- what behaviours ask ------------------------------------------------------------------------------------------

    def drive(self, velocity: Velocity) -> Velocity:
        """Drive so for ``COMMAND_LIFE`` at most; return what was accepted: limited, and what the touch permits.

        Raises BadRequest for a value that is not finite, and NotConnected when no reports arrive.
        """
        if not (isfinite(velocity.linear) and isfinite(velocity.angular)):
            raise BadRequest(
                f"{self.name}: cannot drive at {velocity.linear} m/s, {velocity.angular} rad/s",
                hint="both must be finite numbers",
            )
        now = self._clock.now()
        if not self._hears(now):
            self.stop()
            self.plug.require()
            detail, hint = self._silence()
            raise NotConnected(detail, hint=hint)
        return permitted(self._helm.steer(velocity, now), self._felt)

    def stop(self) -> None:
        """Stand still now, without any ramp. Safe from any state, more than once; does not raise when offline."""
        self._helm.halt()
        if self.plug.online:
            self.body.command(0.0, 0.0, self._clock.now())

    def state(self) -> Reading[BaseState]:
        """The newest report; stale when it is older than the real driver's limit."""
        now = self._clock.now()
        if self._felt is None:
            return Reading(None, now, Quality.NONE)
        if self._latest is None:
            self._latest = self._state()
        fresh = now - self._heard_at <= STALE_AFTER
        return Reading(self._latest, self._heard_at, Quality.GOOD if fresh else Quality.STALE)

    def heading_at(self, stamp: float) -> float | None:
        """The heading in radians at a past time (the last 3 s), interpolated; None when that is not known."""
        found = self._headings.at(stamp)
        return found[0] if found else None

    # --- life ---------------------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Be there at once, unless it is unplugged."""
        self.plug.open()

    def rest(self) -> None:
        """Stand still: the only rest of a base."""
        self.stop()

    def close(self) -> None:
        """Stand still, and hear nothing any more. Safe from any state, more than once."""
        self.stop()
        self.plug.close()

    def health(self) -> Health:
        """Say whether reports arrive."""
        health = self.plug.health({"frames": self._frames})
        if health.online and not self._hears(self._clock.now()):
            return Health(False, *self._silence(), health.counters)
        return health

    def step(self) -> None:
        """Let the body roll on to now, report, and renew the command, as the real one does 50 times a second."""
        now = self._clock.now()
        self.body.advance(now)
        if not self.plug.online:
            return
        if not (self._dropouts and self._random.random() < self._dropouts):
            self._hear(now)
        elif not (self._silent or self._hears(now)):
            self._silent = True
            self._report(Notice(self.name, "offline", *self._silence()))
        velocity = self._helm.velocity(now, self._felt if self._hears(now) else None)
        self.body.command(*BaseControl.of(velocity.linear, velocity.angular).velocity, now)

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

    def drain(self, percent: float) -> None:
        """Leave ``percent`` (0..100) of the battery. Raises ValueError for another value."""
        if not 0 <= percent <= 100:
            raise ValueError(f"{self.name}: a battery cannot hold {percent} percent")
        self._battery = percent
        self._latest = None

    # --- the inside ---------------------------------------------------------------------------------------------------

    def _connected(self) -> None:
        """Begin anew: nothing of before is in force, but the pose goes on from where it was."""
        self._helm.halt()
        self._odometry.anchor()
        self._silent = False
        now = self._clock.now()
        self.body.advance(now)
        self._hear(now)

    def _hear(self, now: float) -> None:
        """Take one report of the body."""
        left, right = self.body.encoders
        noise = self._random.gauss(0.0, self._gyro_noise) if self._gyro_noise else 0.0
        self._gyro_error += noise * self.PERIOD
        heading = round(100 * degrees(self.body.pose.heading + self._gyro_error))
        rate = round(100 * degrees(self.body.velocity.angular + noise))
        core = Core(time_ms=round(1000 * now), left_encoder=left, right_encoder=right)
        self._odometry.update(core, Inertia(heading, rate), now)
        self._headings.add(now, (self._odometry.pose.heading,))
        self._heard_at = now
        self._latest = None
        self._frames += 1
        self._feel()

    def _feel(self) -> None:
        """Tell what has changed of contacts and buttons, and that the base is back if it was silent."""
        if self._silent:
            self._silent = False
            self._report(Notice(self.name, "online", f"{self.name}: the base reports again"))
        bumper, cliff, buttons = self._pressed
        body = self.body
        contacts = (either(bumper, body.bumper), either(cliff, body.cliff), body.wheel_drop, buttons)
        if contacts == self._contacts and self._felt is not None:
            return
        self._contacts = contacts
        before, self._felt = self._felt, self._state()
        change = compare(before, self._felt)
        for fault in change.faults:
            self._report(Notice(self.name, "fault", fault, "stand the base on the floor, away from the edge"))
        if change.felt:
            self._changed()

    def _state(self) -> BaseState:
        """Return the state as of the newest report."""
        bumper, cliff, wheel_drop, buttons = self._contacts
        return BaseState(
            pose=self._odometry.pose,
            velocity=self._odometry.velocity,
            bumper=bumper,
            cliff=cliff,
            wheel_drop=wheel_drop,
            buttons=buttons,
            battery_voltage=EMPTY_VOLTAGE + (self._battery - 5) / 95 * (FULL_VOLTAGE - EMPTY_VOLTAGE),
            battery_percent=self._battery,
        )

    def _hears(self, now: float) -> bool:
        return self.plug.online and now - self._heard_at <= SILENT_AFTER

    def _silence(self) -> tuple[str, str]:
        """Say what is the matter with a base that is there but does not report, and what to try."""
        return f"{self.name}: connected but silent: too many reports are lost", "lower the dropouts of the world"
