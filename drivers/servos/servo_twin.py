"""One simulated servo of an arm: a shaft that turns, stiff, limp or shut down, in the angles of its joint."""

from math import copysign

from drivers.api import JointState
from drivers.servos.joint import Joint, JointSpec
from drivers.servos.legs import reach
from drivers.servos.models import MODELS
from drivers.sim.servo import FRICTION, Shaft

VOLTAGE = 12.0
"""Volts that it measures."""

TEMPERATURE = 35.0
"""Degrees Celsius that it measures."""

STALLED = 0.9
"""Share of the stall torque with which it pushes in vain."""

FAULTS = ("blocked", "frozen", "reversed", "silent", "pushed")
"""It does not turn; it reports an old angle; it turns the wrong way; it does not report; somebody holds it."""


class ServoTwin:
    """A servo and its ``joint``, whose torque, goal and shutdown it keeps. It starts limp, with the joint at 0.

    ``fault`` is one of ``FAULTS`` while it has one.
    """

    def __init__(self, name: str, spec: JointSpec) -> None:
        self.joint = Joint(name, spec, MODELS[spec.model], complaint="")
        self._shaft = Shaft(0.0, 0.0, 0.0)
        self._still: JointState | None = None  # what it feels for as long as it stands still
        self.fault = ""
        self._frozen: float | None = None  # where a frozen sensor says that it is

    def go(self, goal: float, speed: float, now: float) -> None:
        """Turn to ``goal`` (radians, within the limits) at ``speed`` (rad/s) or what the motor can, from ``now`` on."""
        joint, shaft = self.joint, self._shaft
        if joint.torque and goal == joint.goal and speed == joint.speed:
            return  # it is on its way already
        joint.goal, joint.torque, joint.speed, self._still = goal, True, speed, None
        shaft.advance(now)
        shaft.goal = joint.angle(joint.ticks(goal))
        wanted = joint.model.speed_ticks(min(max(speed, 0.0), joint.limits.speed)) * joint.model.speed_unit
        shaft.speed = min(wanted, joint.model.free_speed)

    def hold(self, now: float) -> None:
        """Be stiff where it stands; a servo that has shut down stays limp."""
        if not self.joint.shut:
            here = self.joint.angle(self.joint.nearest(self.joint.ticks(self.position(now))))
            self.go(here, self.joint.limits.speed, now)

    def fail(self, fault: str, now: float) -> None:
        """Have a fault from ``now`` on; none where it is empty."""
        shaft = self._shaft
        self._frozen = self.position(now) if fault == "frozen" else None
        shaft.grip = {"blocked": 0.0, "pushed": 0.0, "reversed": -1.0}.get(fault, 1.0)
        self.fault, self._still = fault, None
        self.joint.complaint = "does not answer" if fault == "silent" else ""

    def push(self, angle: float, now: float) -> None:
        """Let somebody hold the joint at ``angle`` (radians), stiff or not, until the fault ends."""
        self.fail("pushed", now)
        self._shaft.position = self.joint.angle(self.joint.ticks(angle))

    def exchange(self, angle: float, now: float) -> None:
        """Be another servo of the same kind, limp, with the joint at ``angle`` (radians)."""
        self._shaft.advance(now)
        self._shaft.position = self._shaft.goal = self.joint.angle(self.joint.ticks(angle))
        self._still = None

    def strand(self, now: float) -> None:
        """Go no farther than a real one is sent at a time: from ``now`` on it is not told any more."""
        here, far = self._shaft.advance(now), reach(self.joint, self.joint.speed)
        goal = min(max(self._shaft.goal, here - far), here + far)
        self.joint.sent = self.joint.ticks(goal)
        self._shaft.goal = self.joint.angle(self.joint.sent) if self.joint.torque else goal

    def relax(self, now: float) -> None:
        """Be limp."""
        self._shaft.goal = self._shaft.advance(now)
        self.joint.torque, self.joint.goal, self._still = False, None, None

    def turn_by_hand(self, angle: float, now: float) -> None:
        """Turn a limp joint to ``angle`` (radians), as far as its servo turns; a stiff one stays where it is."""
        if not self.joint.torque:
            self._shaft.advance(now)
            self._shaft.position = self._shaft.goal = self.joint.angle(self.joint.ticks(angle))
            self._still = None

    def shut_down(self, now: float) -> None:
        """Give up its torque for good, as at an overload; it still knows its goal."""
        goal = self.joint.goal
        self.relax(now)
        self.joint.goal, self.joint.shut = goal, True

    def angle(self, now: float) -> float:
        """Return where the joint really is at time ``now``, in radians."""
        return self._shaft.advance(now)

    def position(self, now: float) -> float:
        """Return where it feels that it is at time ``now``, in radians: in the steps of its sensor."""
        if self._frozen is not None:
            self._shaft.advance(now)
            return self._frozen
        return self.joint.angle(self.joint.ticks(self._shaft.advance(now)))

    def state(self, now: float) -> JointState:
        """Return what it feels at time ``now``."""
        joint, shaft = self.joint, self._shaft
        if self._still is not None and self._still.blocked == joint.progress.blocked:
            return self._still
        position = self.position(now)
        way = shaft.goal - shaft.position
        turns = bool(way) and not self.fault
        state = JointState(
            position=position,
            velocity=copysign(shaft.speed, way) if turns else 0.0,
            goal=joint.goal,
            load=copysign(FRICTION if shaft.grip else STALLED, way) if way else 0.0,
            voltage=VOLTAGE,
            temperature=TEMPERATURE,
            moving=turns,
            torque=joint.torque,
            blocked=joint.progress.blocked,
        )
        self._still = None if way or self.fault else state
        return state
