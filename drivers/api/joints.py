"""What a behaviour sees of named joints, and how movements of them are written down."""

from collections.abc import Collection, Mapping, Sequence
from math import inf, radians
from typing import Literal, Protocol

from drivers.api.device import Device, Reading
from drivers.api.fast_dataclass import dataclass
from drivers.api.marks import command, fixed


@dataclass(frozen=True, slots=True)
class JointLimits:
    """How far (radians) and how fast (rad/s) a joint may go."""

    lower: float
    upper: float
    speed: float

    def clamp(self, position: float) -> float:
        """Return the nearest position (radians) within the limits."""
        return min(max(position, self.lower), self.upper)


@dataclass(frozen=True, slots=True)
class JointState:
    """What one joint feels.

    ``position`` and ``goal`` in radians, ``velocity`` in rad/s, ``load`` in -1..1 of the stall torque, ``voltage`` in
    volts, ``temperature`` in degrees Celsius. ``blocked`` says why its driver has given up its goal, and holds it.
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
        """How far beyond its goal it is, ``position - goal`` in radians; None while it has no goal."""
        return None if self.goal is None else self.position - self.goal


@dataclass(frozen=True, slots=True)
class Coupling:
    """One joint that another leads: ``follower`` goes to ``scale * leader + offset``, in radians.

    A negative ``scale`` mirrors.
    """

    leader: str
    follower: str
    scale: float = 1.0
    offset: float = 0.0


def _clamp_goals(joints: "Joints", goals: Mapping[str, float], _: object) -> Mapping[str, float]:
    """Return the goals after clamping."""
    limits = joints.limits
    return {name: limits[name].clamp(goal) for name, goal in goals.items()}


class Joints(Device, Protocol):
    """Named joints that take positions: an arm, a leg, a neck."""

    @property
    @fixed
    def limits(self) -> Mapping[str, JointLimits]:
        """The joints by name, in the order of the robot file."""
        ...

    @command("after", moves=True, converters={"goals": dict, "speeds": dict}, default_reply=_clamp_goals)
    def move(self, goals: Mapping[str, float], *, speeds: Mapping[str, float] | None = None) -> Mapping[str, float]:
        """Start moving the named joints to ``goals`` (radians), all in one packet; return the goals after clamping.

        ``speeds`` in rad/s, by name; a joint without one goes at its limit's speed.
        Raises BadRequest for an unknown joint or a value that is not finite, DeviceFault for a joint that is blocked.
        """
        ...

    def states(self) -> Mapping[str, Reading[JointState]]:
        """The newest state of each joint."""
        ...

    @command("before", converters={"joints": tuple})
    def hold(self, joints: Collection[str] | None = None) -> None:
        """Let the named joints (None: all) stand still and stiff where they are now.

        Safe from any state; does not raise when offline. Raises BadRequest for an unknown joint.
        """
        ...

    @command("before", converters={"joints": tuple})
    def relax(self, joints: Collection[str] | None = None) -> None:
        """Switch the torque of the named joints (None: all) off. Safe and raising as ``hold``."""
        ...

    @command("after", moves=bool, converters={"couplings": tuple})  # () moves nothing
    def follow(self, couplings: Sequence[Coupling]) -> None:
        """Let joints follow others from now on, in the driver's own loop; () ends it, and they stand where they are.

        A later ``follow`` replaces this one; a move, hold or relax of a follower ends what leads it. Leaders are not
        touched: make them limp first. Raises BadRequest for an unknown joint, one that follows twice, or that leads and
        follows; NotConnected.
        """
        ...

    @command("after", moves=True, default_reply=lambda _: ())
    def recover(self) -> tuple[str, ...]:
        """Make servos that have shut themselves down stiff again where they stand; return the names of the joints.

        For a person to ask for who has removed the cause. Raises NotConnected.
        """
        ...


Interpolation = Literal["minimum_jerk", "cubic", "linear"]
"""How a movement goes from keyframe to keyframe; see ``Gesture``."""


@dataclass(frozen=True, slots=True)
class Keyframe:
    """Where the named joints (radians) are to be at ``time`` seconds after the gesture began."""

    time: float
    positions: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Gesture:
    """A movement of the arm as keyframes in rising order of time, played with interpolation between them.

    ``minimum_jerk`` comes to rest at each keyframe, as a few poses want it; ``cubic`` goes through them without a halt,
    as a movement does that was recorded many times a second; ``linear`` goes straight from each to the next, as fast
    all the way, as a throw of the limbs needs it.
    """

    name: str
    summary: str
    keyframes: tuple[Keyframe, ...]
    interpolation: Interpolation = "minimum_jerk"


def qualified_joint_name(arm: str, joint: str) -> str:
    """Return what a joint is called among those of all arms: of a further arm, after its name: `right_arm.elbow`."""
    return joint if arm == "arm" else f"{arm}.{joint}"


# Joints that follow others: where the followers belong, given where the leaders are. Pure arithmetic.

MAX_APPROACH_SPEED = radians(50)
"""rad/s at most for a follower that is brought over to where it is led."""

FOLLOWING_TOLERANCE = radians(5)
"""Within this angle of where it is led a follower has come over, and goes as fast as it may from then on."""

MAX_FOLLOW_GAP = 0.25
"""Seconds without being led after which a follower is brought over anew: its leader may be anywhere by then.

An arm that is read less often leads slowly all the time.
"""


class ActiveCouplings:
    """The couplings in force at present; none to begin with. For one thread at a time.

    A follower is brought over slowly at first, and again after a pause, so that none leaps.
    """

    def __init__(self, couplings: Sequence[Coupling] = ()) -> None:
        self._couplings = {coupling.follower: coupling for coupling in couplings}
        self._goal_set_at: dict[str, float] = {}
        self._caught_up: set[str] = set()  # those that were brought over

    def __bool__(self) -> bool:
        return bool(self._couplings)

    @property
    def couplings(self) -> tuple[Coupling, ...]:
        """Those in force."""
        return tuple(self._couplings.values())

    def followers_without(self, couplings: Sequence[Coupling]) -> list[str]:
        """Return the joints that would follow no more if ``couplings`` took the place of these."""
        kept = {coupling.follower for coupling in couplings}
        return [follower for follower in self._couplings if follower not in kept]

    def release(self, joints: Collection[str]) -> None:
        """Let those of ``joints`` that follow do so no more."""
        for joint in joints:
            self._couplings.pop(joint, None)

    def goals(self, positions: Mapping[str, float]) -> dict[str, float]:
        """Return where each follower belongs, in radians and without any limits.

        ``positions`` are those of the leaders that are known just now: a follower stays out whose leader is missing.
        """
        found = {}
        for follower, coupling in self._couplings.items():
            position = positions.get(coupling.leader)
            if position is not None:
                found[follower] = coupling.scale * position + coupling.offset
        return found

    def speeds(self, goals: Mapping[str, float], positions: Mapping[str, float], now: float) -> dict[str, float]:
        """Return the speed (rad/s) of those followers that are brought over; the others go as fast as they may.

        ``goals`` are where all are led at time ``now`` (rad, within their limits), ``positions`` where joints are, as
        far as that is known just now.
        """
        for follower, goal in goals.items():
            if now - self._goal_set_at.get(follower, -inf) > MAX_FOLLOW_GAP:
                self._caught_up.discard(follower)
            if abs(positions.get(follower, inf) - goal) <= FOLLOWING_TOLERANCE:
                self._caught_up.add(follower)
            self._goal_set_at[follower] = now
        return {follower: MAX_APPROACH_SPEED for follower in goals if follower not in self._caught_up}

    def mark_paused(self, followers: Collection[str] | None = None) -> None:
        """Take note that ``followers`` (None: all) did not follow: they are brought over anew."""
        for follower in self._couplings if followers is None else followers:
            self._goal_set_at.pop(follower, None)
