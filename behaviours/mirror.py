"""Leaves in which joints follow others that somebody moves by hand; the driver's own loop leads them."""

import math
from abc import abstractmethod
from collections.abc import Collection, Mapping

from py_trees.common import Status

from behaviours.joint_motion import LONGEST_STEP, ON_ARM, RUN_IN
from behaviours.joint_ranges import JointRanges, degrees
from behaviours.leaf import Leaf, argument
from drivers.api import Coupling, JointLimits

LIMP = 1.0
"""Seconds for which a follower may be limp: whoever is led is stiff, unless it has shut down."""

LEADING_TOLERANCE = math.radians(5)
"""Within this angle of where it belongs a follower may be led at full speed; farther away it comes slowly."""


class _Led(Leaf):
    """Makes leaders limp and lets followers follow them, until it is halted; then all are as stiff as they were.

    Whatever comes between (a pause holds every joint), it begins anew; so it does after a lost bus, when the driver
    itself has brought the followers over slowly and leads them again.
    """

    needs = frozenset({"arm"})
    drives = frozenset({"arm"})
    ends = frozenset({"failure"})
    on: str = ON_ARM
    _couplings: tuple[Coupling, ...] = ()
    _stiff: tuple[str, ...] = ()  # the leaders that were not limp before
    _at: Mapping[str, float] = {}  # where the joints are, by the readings of this tick
    _following = False
    _seen_at: float | None = None
    _stiff_at = 0.0  # when all that is led was stiff

    @abstractmethod
    def couplings(self, reach: JointRanges) -> tuple[Coupling, ...]:
        """Return who is to follow whom."""

    def initialise(self) -> None:
        self._couplings, self._stiff = (), ()
        self._following, self._seen_at = False, None

    def update(self) -> Status:
        if joint_violations := self.joint_violations(self.robot.reach):
            return self.fail("; ".join(joint_violations))
        couplings = self.couplings(self.robot.reach)
        states = self.robot.arm.states()
        joints = dict.fromkeys(joint for each in couplings for joint in (each.leader, each.follower))
        felt = {joint: state for joint in joints if (state := states[joint].value) is not None and states[joint].good}
        if silent := [joint for joint in joints if joint not in felt]:
            self._following = False
            return self.wait(f"waiting for {', '.join(silent)} to report")
        self._at = {joint: state.position for joint, state in felt.items()}
        stiff = tuple(dict.fromkeys(each.leader for each in couplings if felt[each.leader].torque))
        if not self._couplings:
            self._couplings, self._stiff = couplings, stiff
        now = self.run.now()
        held = self._seen_at is None or now - self._seen_at > LONGEST_STEP
        self._seen_at = now
        limp = [each.follower for each in couplings if not felt[each.follower].torque]
        if held or not limp or not self.leading:
            self._stiff_at = now
        elif now - self._stiff_at > LIMP:
            return self.fail(f"{', '.join(limp)} {'is' if len(limp) == 1 else 'are'} limp, and cannot follow")
        self._lead(stiff, anew=held)
        return self.wait(self.state())

    def _lead(self, stiff: tuple[str, ...], *, anew: bool) -> None:
        """Make the leaders limp that are ``stiff``, and let the others follow, unless they do."""
        if stiff:
            self.robot.arm.relax(stiff)
        if stiff or anew:
            self._following = False
        if not self._following:
            self._following = self.begin()

    def begin(self) -> bool:
        """Let the joints follow; return False where that has to wait."""
        self.robot.arm.follow(self._couplings)
        return True

    @property
    def leading(self) -> bool:
        """True once the followers have begun to move."""
        return True

    @abstractmethod
    def state(self) -> str:
        """Say what is going on."""

    def terminate(self, new_status: Status) -> None:
        del new_status
        if self._couplings:
            followers = [each.follower for each in self._couplings]
            self.robot.arm.hold((*followers, *self._stiff))  # which also ends what leads them


class Mirror(_Led):
    """Let one arm copy another that is moved by hand, joint by joint.

    The first joint of the one leads the first of the other, and so on. The leaders become limp; the followers come
    slowly to where they belong, then follow at once. Running until it is halted; it never succeeds. In the end the
    followers stay where they are, and the leaders are as stiff as before. Fails before anything moves when the arm
    lacks a joint, or the two have not as many; and when a follower has shut down.
    """

    word = "mirror"
    leader: tuple[str, ...] = argument("joints", "which are moved by hand: a group, a joint, or a list")
    follower: tuple[str, ...] = argument("joints", "which copy them, in the same order")
    scale: float = argument(
        "number", "how much farther they go; -1 is the other way round", default=1.0, low=-5, high=5
    )
    offset: float = argument("angle", "what is added", default=0.0, low=-math.pi, high=math.pi)
    scales: Mapping[str, float] = argument(
        "number", "a scale of its own for some of the followers", default={}, by_joint=True, low=-5, high=5
    )
    offsets: Mapping[str, float] = argument(
        "angle", "an offset of its own for some of the followers", default={}, by_joint=True, low=-math.pi, high=math.pi
    )

    def joint_violations(self, reach: JointRanges) -> list[str]:
        if unknown := reach.unknown((*self.leader, *self.follower)):
            return unknown
        leaders, followers = reach.named(self.leader), reach.named(self.follower)
        wrong = [f"'{joint}' cannot both lead and follow" for joint in leaders if joint in followers]
        if len(leaders) != len(followers):
            wrong.append(f"{_count(leaders)} cannot lead {_count(followers)}")
        strange = dict.fromkeys(joint for joint in (*self.scales, *self.offsets) if joint not in followers)
        return [*wrong, *(f"'{joint}' has a scale or an offset, and does not follow" for joint in strange)]

    def couplings(self, reach: JointRanges) -> tuple[Coupling, ...]:
        pairs = zip(reach.named(self.leader), reach.named(self.follower), strict=True)
        return tuple(
            Coupling(leader, joint, self.scales.get(joint, self.scale), self.offsets.get(joint, self.offset))
            for leader, joint in pairs
        )

    def begin(self) -> bool:
        """Bring the followers slowly to where they belong, then let them follow."""
        arm = self.robot.arm
        goals = {
            each.follower: _within(each.scale * self._at[each.leader] + each.offset, arm.limits[each.follower])
            for each in self._couplings
        }
        if any(abs(self._at[joint] - goal) > LEADING_TOLERANCE for joint, goal in goals.items()):
            arm.move(goals, speeds={joint: min(RUN_IN, arm.limits[joint].speed) for joint in goals})
            return False
        return super().begin()

    def state(self) -> str:
        followers = ", ".join(each.follower for each in self._couplings)
        return f"{followers} {'follow' if self._following else 'come to where they belong'}"


class FollowJoint(_Led):
    """Let one joint follow another that is moved by hand, once that has been turned far enough.

    The leading joint becomes limp. Running until it is halted; it never succeeds. In the end the follower stays where
    it is, and the leader is as stiff as before. Fails before anything moves when the arm lacks one of the two, and when
    the follower has shut down.
    """

    word = "follow_joint"
    leader: str = argument("joint", "which is moved by hand")
    follower: str = argument("joint", "which follows it")
    past: float = argument(
        "angle", "how far the leader is to be turned, either way, before it begins", default=0.0, low=0.0
    )
    scale: float = argument(
        "number", "how much farther it goes; -1 is the other way round", default=1.0, low=-5, high=5
    )
    offset: float = argument("angle", "what is added", default=0.0, low=-math.pi, high=math.pi)
    _origin: float | None = None  # where the leader was in the beginning
    _turned = 0.0
    _passed = False

    def initialise(self) -> None:
        super().initialise()
        self._origin, self._turned, self._passed = None, 0.0, False

    def joint_violations(self, reach: JointRanges) -> list[str]:
        alike = [f"'{self.leader}' cannot both lead and follow"] if self.leader == self.follower else []
        return reach.lacking((self.leader, self.follower)) + alike

    def couplings(self, reach: JointRanges) -> tuple[Coupling, ...]:
        del reach
        return (Coupling(self.leader, self.follower, self.scale, self.offset),)

    def begin(self) -> bool:
        """Let it follow once its leader was turned far enough; one that had begun before goes on at once."""
        at = self._at[self.leader]
        if self._origin is None:
            self._origin = at
        self._turned = abs(at - self._origin)
        self._passed = self._passed or self._turned >= self.past
        return self._passed and super().begin()

    @property
    def leading(self) -> bool:
        """True once the leader has passed the threshold."""
        return self._passed

    def state(self) -> str:
        if self._passed:
            return f"{self.follower} follows {self.leader}"
        return f"{self.leader} is turned by {degrees(self._turned)}, waiting for {degrees(self.past)}"


def _within(goal: float, limits: JointLimits) -> float:
    return min(max(goal, limits.lower), limits.upper)


def _count(joints: Collection[str]) -> str:
    return "1 joint" if len(joints) == 1 else f"{len(joints)} joints"
