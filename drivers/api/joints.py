"""Protocol of named joints, gestures, and couplings of joints that follow other joints."""

from collections.abc import Collection, Mapping, Sequence
from math import inf, radians
from typing import Literal, Protocol

from drivers.api.device import Device, Reading
from drivers.api.fast_dataclass import dataclass
from drivers.api.marks import command, fixed


@dataclass(frozen=True, slots=True)
class JointLimits:
    """Range (radians) and maximum speed (rad/s) of a joint."""

    lower: float
    upper: float
    speed: float

    def clamp(self, position: float) -> float:
        """Return the nearest position (radians) within the limits."""
        return min(max(position, self.lower), self.upper)


@dataclass(frozen=True, slots=True)
class JointState:
    """State of one joint.

    ``position`` and ``goal`` in radians, ``velocity`` in rad/s, ``load`` in -1..1 of the stall torque, ``voltage`` in
    volts, ``temperature`` in degrees Celsius. ``blocked`` is the reason for which the driver gave the goal up and holds
    the joint.
    """

    position: float
    velocity: float
    goal: float | None
    load: float
    voltage: float
    temperature: float
    moving: bool
    torque: bool
    blocked: str = ""

    @property
    def error(self) -> float | None:
        """Distance from the goal, ``position - goal`` in radians; None without a goal."""
        return None if self.goal is None else self.position - self.goal


@dataclass(frozen=True, slots=True)
class Coupling:
    """Coupling of two joints: ``follower`` goes to ``scale * leader + offset``, in radians.

    A negative ``scale`` mirrors.
    """

    leader: str
    follower: str
    scale: float = 1.0
    offset: float = 0.0


def _clamp_goals(joints: "Joints", goals: Mapping[str, float], _: object) -> Mapping[str, float]:
    """Return the goals of the joints, clamped to their limits."""
    limits = joints.limits
    return {name: limits[name].clamp(goal) for name, goal in goals.items()}


class Joints(Device, Protocol):
    """Named joints with position control: an arm, a leg, a neck."""

    @property
    @fixed
    def limits(self) -> Mapping[str, JointLimits]:
        """Limits of the joints by name, in the order of the robot file."""
        ...

    @command("after", moves=True, converters={"goals": dict, "speeds": dict}, default_reply=_clamp_goals)
    def move(self, goals: Mapping[str, float], *, speeds: Mapping[str, float] | None = None) -> Mapping[str, float]:
        """Start moving the named joints to ``goals`` (radians), all in one packet; return the goals after clamping.

        ``speeds`` in rad/s, by name; other joints move at their maximum speed. Raises BadRequest for an unknown joint
        or a value that is not finite, DeviceFault for a joint that is blocked.
        """
        ...

    def states(self) -> Mapping[str, Reading[JointState]]:
        """Latest state of each joint."""
        ...

    @command("before", converters={"joints": tuple})
    def hold(self, joints: Collection[str] | None = None) -> None:
        """Stop the named joints (None: all) at their current positions, with torque on.

        Safe from any state; does not raise when offline. Raises BadRequest for an unknown joint.
        """
        ...

    @command("before", releases=True)
    def rest(self) -> None:
        """Hold or relax all joints, as the robot file sets. Safe from any state, more than once."""
        ...

    @command("before", converters={"joints": tuple}, releases=True)
    def relax(self, joints: Collection[str] | None = None) -> None:
        """Switch the torque of the named joints (None: all) off. Safe from any state, and raises as ``hold``."""
        ...

    @command("after", moves=bool, converters={"couplings": tuple})  # () moves nothing
    def follow(self, couplings: Sequence[Coupling]) -> None:
        """Let followers copy the positions of their leaders from now on, until the next call of ``follow``.

        An empty sequence ends all couplings, and the followers stop. A move, hold or relax of a follower ends its
        coupling. Leaders are not commanded: switch their torque off first. Raises BadRequest for an unknown joint, for
        one that follows two joints, and for one that both leads and follows; NotConnected.
        """
        ...

    @command("after", moves=True, default_reply=lambda _: ())
    def recover(self) -> tuple[str, ...]:
        """Switch the torque of servos that have shut down on again; return the names of their joints.

        The joints stay at their current positions. To be requested by a person who has removed the cause of the
        shutdown. Raises NotConnected.
        """
        ...


Interpolation = Literal["minimum_jerk", "cubic", "linear"]
"""Interpolation between keyframes; see ``Gesture``."""


@dataclass(frozen=True, slots=True)
class Keyframe:
    """Positions of the named joints (radians) at ``time`` seconds after the start of the gesture."""

    time: float
    positions: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Gesture:
    """Movement of the arm: keyframes in rising order of time, with interpolation between them.

    ``minimum_jerk`` stops at each keyframe, for a few poses; ``cubic`` passes through them without a stop, for recorded
    movements; ``linear`` moves at constant speed between them, for throws.
    """

    name: str
    summary: str
    keyframes: tuple[Keyframe, ...]
    interpolation: Interpolation = "minimum_jerk"


def qualified_joint_name(arm: str, joint: str) -> str:
    """Return the name of a joint that is unique among all arms of a robot.

    Joints of an additional arm are prefixed with its name: `right_arm.elbow`.
    """
    return joint if arm == "arm" else f"{arm}.{joint}"


# Joints that follow others: goals of the followers from the positions of the leaders. Pure.

MAX_APPROACH_SPEED = radians(50)
"""Maximum speed in rad/s of a follower that has not caught up with its leader yet."""

FOLLOWING_TOLERANCE = radians(5)
"""Distance in radians from its goal within which a follower has caught up with its leader.

From then on, it moves at full speed.
"""

MAX_FOLLOW_GAP = 0.25
"""Seconds without a goal after which a follower must catch up slowly again: its leader may be anywhere by then.

If a leader's arm is read less often, its followers always move slowly.
"""


class ActiveCouplings:
    """Couplings of joints that are in force; initially none. Not thread-safe.

    A follower approaches its goal slowly at first, and again after a pause, so that it never leaps.
    """

    def __init__(self, couplings: Sequence[Coupling] = ()) -> None:
        self._couplings = {coupling.follower: coupling for coupling in couplings}
        self._goal_set_at: dict[str, float] = {}
        self._caught_up: set[str] = set()  # followers that have reached their leader once

    def __bool__(self) -> bool:
        return bool(self._couplings)

    @property
    def couplings(self) -> tuple[Coupling, ...]:
        """Couplings of joints that are in force."""
        return tuple(self._couplings.values())

    def followers_without(self, couplings: Sequence[Coupling]) -> list[str]:
        """Return the joints that would no longer follow if ``couplings`` replaced the current ones."""
        remaining = {coupling.follower for coupling in couplings}
        return [follower for follower in self._couplings if follower not in remaining]

    def release(self, joints: Collection[str]) -> None:
        """End the couplings of the followers ``joints``."""
        for joint in joints:
            self._couplings.pop(joint, None)

    def goals(self, positions: Mapping[str, float]) -> dict[str, float]:
        """Return the goal of each follower in radians, not limited.

        ``positions`` are the known positions of leaders (radians); a follower is left out if its leader's position is
        unknown.
        """
        goals = {}
        for follower, coupling in self._couplings.items():
            position = positions.get(coupling.leader)
            if position is not None:
                goals[follower] = coupling.scale * position + coupling.offset
        return goals

    def speeds(self, goals: Mapping[str, float], positions: Mapping[str, float], now: float) -> dict[str, float]:
        """Return the speed (rad/s) of each follower that has not caught up yet; the others may move at full speed.

        ``goals`` are those of all followers at time ``now`` (radians, within their limits), ``positions`` the known
        positions of joints.
        """
        for follower, goal in goals.items():
            if now - self._goal_set_at.get(follower, -inf) > MAX_FOLLOW_GAP:
                self._caught_up.discard(follower)
            if abs(positions.get(follower, inf) - goal) <= FOLLOWING_TOLERANCE:
                self._caught_up.add(follower)
            self._goal_set_at[follower] = now
        return {follower: MAX_APPROACH_SPEED for follower in goals if follower not in self._caught_up}

    def mark_paused(self, followers: Collection[str] | None = None) -> None:
        """Note that ``followers`` (None: all) were not moved: they must catch up slowly again."""
        for follower in self._couplings if followers is None else followers:
            self._goal_set_at.pop(follower, None)
