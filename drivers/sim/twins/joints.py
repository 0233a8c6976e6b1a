"""The twin of an arm of Dynamixel servos: the real driver's joints and rules, in one thread and without a bus."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import inf, isfinite
from typing import Literal

from drivers.api import Health, JointLimits, JointState, Notice, Quality, Reading, Report, unheard, unreported
from drivers.clock import Clock
from drivers.dynamixel.driver import FRESH
from drivers.dynamixel.driver import PERIOD as ROUND
from drivers.dynamixel.joint import JointSpec, check
from drivers.errors import BadRequest
from drivers.guard import guarded
from drivers.sim.twins.plug import Plug
from drivers.sim.twins.servo import TEMPERATURE, VOLTAGE, ServoTwin

REMEDY = "free the joint, then switch the arm's power off and on"


class JointsTwin:
    """A ``drivers.api.Joints`` made of arithmetic. ``step`` is to be called every ``PERIOD``; for one thread.

    ``joints`` and ``at_rest`` as for ``DynamixelJoints``. All joints stand at 0, limp, until somebody moves or holds
    them. Unplugged, the servos keep their goals; plugged in again, those that are meant to be stiff hold where they
    are. ``changed`` is called with every ``step``: there are new readings.
    Raises BadRequest for joints that cannot be, all faults in one message.
    """

    PERIOD = ROUND

    def __init__(
        self,
        joints: Mapping[str, JointSpec],
        clock: Clock,
        *,
        at_rest: Literal["hold", "relax"] = "hold",
        report: Report = unreported,
        changed: Callable[[], None] = unheard,
        name: str = "arm",
    ) -> None:
        check(name, dict(joints))
        self.name = name
        self.plug = Plug(name, report, back=self._connected, gone=self._gone)
        self._servos = {joint: ServoTwin(joint, spec) for joint, spec in joints.items()}
        self._limits = {joint: servo.joint.limits for joint, servo in self._servos.items()}
        self._clock = clock
        self._stiff_at_rest = at_rest == "hold"
        self._report = guarded(report)
        self._changed = guarded(changed)
        self._read_at = -inf
        self._readings: Mapping[str, Reading[JointState]] = {}

    # --- what behaviours ask ------------------------------------------------------------------------------------------

    @property
    def limits(self) -> Mapping[str, JointLimits]:
        """The joints by name, in the order of the robot file."""
        return self._limits

    def move(self, goals: Mapping[str, float], *, speeds: Mapping[str, float] | None = None) -> Mapping[str, float]:
        """Start moving the named joints to ``goals`` (radians); return the goals after clamping.

        Joints whose servo has shut down are left out, with a notice. Raises BadRequest for an unknown joint or a value
        that is not finite, NotConnected when the arm is unplugged.
        """
        speeds = speeds or {}
        self._reject(goals, speeds)
        self.plug.require()
        now = self._clock.now()
        accepted = {name: self._servos[name].joint.clamp(goal) for name, goal in goals.items()}
        for name, goal in accepted.items():
            servo = self._servos[name]
            if servo.joint.shut:
                if not servo.joint.left_out:
                    self._tell(f"a move left {servo.joint.title} out: it has shut down")
            else:
                servo.joint.wanted = True
                servo.go(goal, speeds.get(name, self._limits[name].speed), now)
            servo.joint.left_out = servo.joint.shut
        self._read_at = -inf
        return accepted

    def states(self) -> Mapping[str, Reading[JointState]]:
        """The state of each joint now; as last seen, and soon stale, while the arm is unplugged."""
        now = self._clock.now()
        if self.plug.online:
            if self._read_at != now:
                self._read(now)
            return self._readings
        if not self._readings:
            return {name: Reading(None, now, Quality.NONE) for name in self._servos}
        quality = Quality.GOOD if now - self._read_at <= FRESH else Quality.STALE
        return {name: replace(reading, quality=quality) for name, reading in self._readings.items()}

    def hold(self) -> None:
        """Stand still and stiff where it is now. Safe from any state; does not raise when offline."""
        self._settle(stiff=True)

    def relax(self) -> None:
        """Switch the torque off. Safe from any state; does not raise when offline."""
        self._settle(stiff=False)

    def recover(self) -> tuple[str, ...]:
        """Make servos that have shut down stiff again where they stand; return the names of the joints.

        Raises NotConnected.
        """
        self.plug.require()
        shut = [servo for servo in self._servos.values() if servo.joint.shut]
        for servo in shut:
            servo.joint.shut, servo.joint.wanted = False, True
            servo.hold(self._clock.now())
        self._read_at = -inf
        return tuple(servo.joint.name for servo in shut)

    # --- life ---------------------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Be there at once, unless it is unplugged."""
        self.plug.open()

    def rest(self) -> None:
        """Hold or relax, as the robot file asks; tell it if that cannot be. Never raises."""
        if not self.plug.connections:
            return  # it was never there: nothing was moved
        self._settle(stiff=self._stiff_at_rest)
        if not self.plug.online:
            what = "held" if self._stiff_at_rest else "relaxed"
            names = ", ".join(servo.joint.title for servo in self._servos.values())
            self._tell(f"could not be {what}: {names}", "switch their power off by hand")

    def close(self) -> None:
        """Bring the arm to rest, and let it go. Safe from any state, more than once."""
        self.rest()
        self.plug.close()

    def health(self) -> Health:
        """Say whether the arm is there, and which servos have shut down."""
        health = self.plug.health({})
        shut = [servo.joint.title for servo in self._servos.values() if servo.joint.shut]
        if not health.online or not shut:
            return health
        return replace(health, detail=f"{self.name}: {', '.join(shut)} has shut down", hint=REMEDY)

    def step(self) -> None:
        """Tell that there are new readings; what they are is worked out when somebody asks."""
        if self.plug.online:
            self._changed()

    # --- the hand of whoever tests a mission --------------------------------------------------------------------------

    def true_angle(self, joint: str, now: float) -> float:
        """Where ``joint`` really is at time ``now``, in radians."""
        return self._servos[joint].angle(now)

    def overload(self, joint: str) -> None:
        """Let the servo of ``joint`` shut itself down for an overload. Raises BadRequest for an unknown joint."""
        self._reject({joint: 0.0}, {})
        servo = self._servos[joint]
        if servo.joint.shut:
            return
        servo.shut_down(self._clock.now())
        self._read_at = -inf
        if self.plug.online:
            self._tell(
                f"{servo.joint.title} reports overload ({VOLTAGE:.1f} V, {TEMPERATURE:.0f} °C, load +0%)",
                "free the joint, or take the load off it",
            )
            self._tell_shut(servo)

    # --- the inside ---------------------------------------------------------------------------------------------------

    def _connected(self) -> None:
        """Give every servo the torque that was last asked for, where it stands; as found if nobody asked."""
        now = self._clock.now()
        for servo in self._servos.values():
            if servo.joint.shut:
                self._tell_shut(servo)
            elif servo.joint.wanted is False:
                servo.relax(now)
            elif servo.joint.wanted:
                servo.hold(now)
        self._read(now)

    def _gone(self) -> None:
        """Keep what is seen last."""
        self._read(self._clock.now())

    def _read(self, now: float) -> None:
        self._readings = {name: Reading(servo.state(now), now, Quality.GOOD) for name, servo in self._servos.items()}
        self._read_at = now

    def _settle(self, *, stiff: bool) -> None:
        now = self._clock.now()
        for servo in self._servos.values():
            servo.joint.wanted = stiff
            if self.plug.online:
                servo.hold(now) if stiff else servo.relax(now)
                self._read_at = -inf

    def _reject(self, goals: Mapping[str, float], speeds: Mapping[str, float]) -> None:
        """Raise BadRequest with all that is wrong with a move."""
        unknown = sorted((goals.keys() | speeds.keys()) - self._servos.keys())
        wrong = [f"no joint {name!r} (there are {', '.join(self._servos)})" for name in unknown]
        for what, values in (("goal", goals), ("speed", speeds)):
            wrong += [
                f"{name}: a {what} of {value} is not finite" for name, value in values.items() if not isfinite(value)
            ]
        if wrong:
            raise BadRequest(f"{self.name}: {'; '.join(wrong)}")

    def _tell(self, what: str, hint: str = "") -> None:
        self._report(Notice(self.name, "fault", what, hint))

    def _tell_shut(self, servo: ServoTwin) -> None:
        self._tell(f"{servo.joint.title} has shut down: its torque limit is 0", REMEDY)
