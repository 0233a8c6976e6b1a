"""Leaves in which joints follow other joints that a person moves by hand, in the driver's loop or at each tick."""

import math
from abc import abstractmethod
from collections.abc import Collection, Mapping

from py_trees.common import Status

from behaviours.joint_motion import (
    ARM_ARGUMENT,
    MAX_STEP_TIME,
    RUN_IN_SPEED,
    JointMirror,
    ReportWait,
    has_range,
    range_coupling,
)
from behaviours.joint_ranges import JointRanges, degrees_text
from behaviours.leaf import Leaf, argument
from drivers.api import Coupling, Joints, JointState

LIMP_TIMEOUT = 1.0
"""Seconds for which a follower may be limp before the leaf fails: a servo that has shut down is limp."""

LEADING_TOLERANCE = math.radians(5)
"""Angle in radians from its goal within which a follower follows at full speed; farther away it approaches slowly."""

GOAL_TIME = 0.1
"""Seconds of each move that a tick sends to a follower of another arm: two ticks, for an even motion."""


class _LeaderFollowerLeaf(Leaf):
    """Base class of leaves that make leaders limp and let followers follow them, until halted.

    A halt restores the torque of the leaders. A pause holds all joints; afterwards the followers approach slowly again.
    If the servo bus was disconnected, the driver itself lets them approach slowly and then follow. If leaders and
    followers are on different arms, no driver has both, so each tick sends the goals.
    """

    needs = frozenset({"arm"})
    drives = frozenset({"arm"})
    ends = frozenset({"failure"})
    on: str = ARM_ARGUMENT
    leader_arm: str | None = argument("arm", "arm of the leaders, if it is another arm than `on`", default=None)
    _couplings: tuple[Coupling, ...] = ()
    _stiff: tuple[str, ...] = ()  # the leaders that were not limp before
    _leading_arm: Joints
    _mirroring: JointMirror | None = None  # where two arms are led by ticks
    _at: Mapping[Coupling, tuple[float, float]] = {}  # where leader and follower are, by the readings of this tick
    _following = False
    _seen_at: float | None = None
    _stiff_at = 0.0  # when all that is led was stiff
    _waits: tuple[ReportWait, ReportWait]  # for followers, and for leaders of another arm

    @abstractmethod
    def couplings(self, reach: JointRanges) -> tuple[Coupling, ...]:
        """Return the pairs of leader and follower joints; ``reach`` has the joints of the robot with their limits."""

    def initialise(self) -> None:
        self._couplings, self._stiff = (), ()
        self._following, self._seen_at = False, None
        self._mirroring = None
        self._waits = ReportWait(), ReportWait()
        self._leading_arm = (
            self.robot.arm
            if self.other_leader_arm is None
            else self.robot.with_named_parts({"arm": self.other_leader_arm}).arm
        )

    @property
    def other_leader_arm(self) -> str | None:
        """Arm of the leaders if it differs from the followers' arm, else None."""
        return None if self.leader_arm == self.on else self.leader_arm

    def update(self) -> Status:
        reach = self.robot.joint_ranges
        if joint_violations := self.joint_violations(reach):
            return self.fail("; ".join(joint_violations))
        couplings = self.couplings(reach)
        follower_states = _known_states(self.robot.arm)
        leader_states = follower_states if self.other_leader_arm is None else _known_states(self._leading_arm)
        if silent := self._silent_joints(couplings, leader_states, follower_states):
            self._following = False
            if trouble := self._wait_timeout_reason(silent):
                return self.fail(trouble)
            return self.wait(f"waiting for {', '.join(silent)} to report")
        if blocked := [
            follower_states[each.follower].blocked for each in couplings if follower_states[each.follower].blocked
        ]:
            return self.fail("; ".join(blocked))
        self._at = {
            each: (leader_states[each.leader].position, follower_states[each.follower].position) for each in couplings
        }
        stiff = tuple(dict.fromkeys(each.leader for each in couplings if leader_states[each.leader].torque))
        if not self._couplings:
            self._couplings, self._stiff = couplings, stiff
            if self.other_leader_arm is not None:
                self._mirroring = JointMirror(self._leading_arm, self.robot.arm, couplings, time=GOAL_TIME)
        now = self.run.now()
        held = self._seen_at is None or now - self._seen_at > MAX_STEP_TIME
        self._seen_at = now
        limp = [each.follower for each in couplings if not follower_states[each.follower].torque]
        if held or not limp or not self.is_leading:
            self._stiff_at = now
        elif now - self._stiff_at > LIMP_TIMEOUT:
            return self.fail(f"{', '.join(limp)} {'is' if len(limp) == 1 else 'are'} limp, and cannot follow")
        self._start_following(stiff, restart=held)
        if self._following and self._mirroring is not None:
            self._mirroring.step(now)
        return self.wait(self.state_text())

    def _wait_timeout_reason(self, silent: list[str]) -> str:
        """Return the reason if ``silent`` joints have not reported in time, else an empty text."""
        mark = "" if self.other_leader_arm is None else f"{self.other_leader_arm}."
        followers = [name for name in silent if not mark or not name.startswith(mark)]
        leaders = [name for name in silent if name not in followers]
        for arm, wait, names in zip(
            (self.robot.arm, self._leading_arm), self._waits, (followers, leaders), strict=True
        ):
            if names and (trouble := wait.timeout_reason(arm, names, self.run.now())):
                return trouble
        return ""

    def _silent_joints(
        self,
        couplings: tuple[Coupling, ...],
        leader_states: Mapping[str, JointState],
        follower_states: Mapping[str, JointState],
    ) -> list[str]:
        """Return the joints of ``couplings`` that are not in the given states, because they do not report.

        Leaders of another arm are prefixed with the name of the arm.
        """
        of = "" if self.other_leader_arm is None else f"{self.other_leader_arm}."
        silent = []
        for each in couplings:
            silent += [] if each.leader in leader_states else [f"{of}{each.leader}"]
            silent += [] if each.follower in follower_states else [each.follower]
        return list(dict.fromkeys(silent))

    def _start_following(self, stiff: tuple[str, ...], *, restart: bool) -> None:
        """Make the leaders in ``stiff`` limp, and start the followers unless they follow already.

        With ``restart``, or if a leader was stiff, following starts again, with a slow approach.
        """
        if stiff:
            self._leading_arm.relax(stiff)
        if stiff or restart:
            self._following = False
        if not self._following:
            self._following = self.begin()

    def begin(self) -> bool:
        """Start the followers; return False if they cannot start yet."""
        if self._mirroring is None:
            self.robot.arm.follow(self._couplings)
        else:
            self._mirroring.pause()  # brought over slowly
        return True

    @property
    def is_leading(self) -> bool:
        """True after the followers have begun to move."""
        return True

    @abstractmethod
    def state_text(self) -> str:
        """Return the present activity of the leaf as text, such as which joints follow."""

    def terminate(self, new_status: Status) -> None:
        del new_status
        if not self._couplings:
            return
        followers = tuple(each.follower for each in self._couplings)
        if self.other_leader_arm is None:
            self.robot.arm.hold((*followers, *self._stiff))  # which also ends what leads them
            return
        self.robot.arm.hold(followers)
        if self._stiff:
            self._leading_arm.hold(self._stiff)


class Mirror(_LeaderFollowerLeaf):
    """Let one arm copy another arm that a person moves by hand, joint by joint.

    The first leader leads the first follower, and so on. The leaders become limp; the followers approach slowly, then
    follow at once. Running until it is halted; it never succeeds. In the end the followers stay where they are, and the
    leaders get back their torque. Fails before anything moves if an arm lacks a joint or if the numbers of leaders and
    followers differ. Fails later if a follower has shut down. With `leader_arm`, another arm of the robot leads; by
    default, joints of the same name then belong together.
    """

    tag = "mirror"
    example = "- mirror: {leader: left_arm, follower: right_arm}\n  timeout: 1 min"
    leader: tuple[str, ...] = argument(
        "joints", "joints moved by hand: a group, a joint, or a list; by default the names of the followers", default=()
    )
    follower: tuple[str, ...] = argument(
        "joints", "joints that copy them, in the same order; by default the names of the leaders", default=()
    )
    scale: float = argument(
        "number", "factor from the leader's angle to the follower's; -1 reverses it", default=1.0, low=-5, high=5
    )
    offset: float = argument("angle", "angle added to the follower's goal", default=0.0, low=-math.pi, high=math.pi)
    scales: Mapping[str, float] = argument(
        "number", "scale of single followers", default={}, by_joint=True, low=-5, high=5
    )
    offsets: Mapping[str, float] = argument(
        "angle", "offset of single followers", default={}, by_joint=True, low=-math.pi, high=math.pi
    )
    by_range: tuple[str, ...] = argument(
        "joints", "followers that map the leader's whole range to their own, instead of the same angle", default=()
    )

    def joint_violations(self, reach: JointRanges) -> list[str]:
        if self.other_leader_arm is None and not (self.leader and self.follower):
            return ["needs leader and follower, or a leader_arm other than the arm that it moves"]
        leading = reach.of_arm(self.other_leader_arm)
        if unknown := [*leading.unknown_names(self.leader), *reach.unknown_names((*self.follower, *self.by_range))]:
            return unknown
        leaders, followers = self._joints(reach)
        if lacking := [*leading.missing_joints(leaders), *reach.missing_joints(followers)]:
            return lacking
        both = followers if self.other_leader_arm is None else ()
        wrong = [f"'{joint}' cannot both lead and follow" for joint in leaders if joint in both]
        if not leaders:
            wrong.append(f"the {leading.name} has no joint with the name of a follower: name the leaders")
        if len(leaders) != len(followers):
            wrong.append(f"{_count(leaders)} cannot lead {_count(followers)}")
        strange = dict.fromkeys(joint for joint in (*self.scales, *self.offsets) if joint not in followers)
        ranged = reach.resolve(self.by_range) if self.by_range else ()
        wrong += [f"'{joint}' has a scale or an offset, and does not follow" for joint in strange]
        wrong += [f"'{joint}' goes by its range, and does not follow" for joint in ranged if joint not in followers]
        pairs = ((leader, joint) for leader, joint in zip(leaders, followers, strict=False) if joint in ranged)
        fixed = [(leader, joint) for leader, joint in pairs if not has_range(leading.joints[leader])]
        return [
            *wrong,
            *(f"'{joint}' cannot go by its range: '{leader}', which leads it, has none" for leader, joint in fixed),
        ]

    def _joints(self, reach: JointRanges) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return the names of leaders and followers; if only one of the two is given, both have the same names."""
        leading = reach.of_arm(self.other_leader_arm)
        leaders = leading.resolve(self.leader) if self.leader else ()
        followers = reach.resolve(self.follower) if self.follower else ()
        shared = tuple(joint for joint in reach.joints if joint in leading.joints)
        return leaders or followers or shared, followers or leaders or shared

    def couplings(self, reach: JointRanges) -> tuple[Coupling, ...]:
        leading, ranged = reach.of_arm(self.other_leader_arm), reach.resolve(self.by_range) if self.by_range else ()
        return tuple(
            range_coupling(leader, leading.joints[leader], joint, reach.joints[joint])
            if joint in ranged
            else Coupling(leader, joint, self.scales.get(joint, self.scale), self.offsets.get(joint, self.offset))
            for leader, joint in zip(*self._joints(reach), strict=True)
        )

    def begin(self) -> bool:
        """Move the followers slowly to their goals, then start following; return False on the way."""
        arm, goals, off = self.robot.arm, {}, 0.0
        for each in self._couplings:
            leader, at = self._at[each]
            goals[each.follower] = arm.limits[each.follower].clamp(each.scale * leader + each.offset)
            off = max(off, abs(at - goals[each.follower]))
        if off > LEADING_TOLERANCE:
            arm.move(goals, speeds={joint: min(RUN_IN_SPEED, arm.limits[joint].speed) for joint in goals})
            return False
        return super().begin()

    def state_text(self) -> str:
        followers = ", ".join(each.follower for each in self._couplings)
        return f"{followers} {'follow' if self._following else 'approach their goals'}"


class FollowJoint(_LeaderFollowerLeaf):
    """Let one joint follow another joint that a person moves by hand, after the leader has passed an angle.

    The leader becomes limp. Running until it is halted; it never succeeds. In the end the follower stays where it is,
    and the leader gets back its torque. Fails before anything moves if the arm lacks one of the joints, and later if
    the follower has shut down.
    """

    tag = "follow_joint"
    example = "- follow_joint: {leader: elbow, follower: wrist, past: 10 deg}\n  timeout: 1 min"
    leader: str = argument("joint", "joint moved by hand")
    follower: str = argument("joint", "joint that follows it")
    past: float = argument(
        "angle", "angle that the leader must be turned, either way, before the follower starts", default=0.0, low=0.0
    )
    scale: float = argument(
        "number", "factor from the leader's angle to the follower's; -1 reverses it", default=1.0, low=-5, high=5
    )
    offset: float = argument("angle", "angle added to the follower's goal", default=0.0, low=-math.pi, high=math.pi)
    _origin: float | None = None  # where the leader was in the beginning
    _turned = 0.0
    _passed = False

    def initialise(self) -> None:
        super().initialise()
        self._origin, self._turned, self._passed = None, 0.0, False

    def joint_violations(self, reach: JointRanges) -> list[str]:
        both = self.other_leader_arm is None and self.leader == self.follower
        alike = [f"'{self.leader}' cannot both lead and follow"] if both else []
        lacking = [
            *reach.of_arm(self.other_leader_arm).missing_joints((self.leader,)),
            *reach.missing_joints((self.follower,)),
        ]
        return list(dict.fromkeys(lacking)) + alike

    def couplings(self, reach: JointRanges) -> tuple[Coupling, ...]:
        del reach
        return (Coupling(self.leader, self.follower, self.scale, self.offset),)

    def begin(self) -> bool:
        """Start following once the leader has been turned far enough; return False before."""
        at, _ = self._at[self._couplings[0]]
        if self._origin is None:
            self._origin = at
        self._turned = abs(at - self._origin)
        self._passed = self._passed or self._turned >= self.past
        return self._passed and super().begin()

    @property
    def is_leading(self) -> bool:
        """True after the leader has passed the threshold."""
        return self._passed

    def state_text(self) -> str:
        if self._passed:
            return f"{self.follower} follows {self.leader}"
        return f"{self.leader} is turned by {degrees_text(self._turned)}, waiting for {degrees_text(self.past)}"


def _known_states(arm: Joints) -> dict[str, JointState]:
    """Return the states of the joints with a good reading."""
    readings = arm.states().items()
    return {joint: reading.value for joint, reading in readings if reading.value is not None and reading.good}


def _count(joints: Collection[str]) -> str:
    return "1 joint" if len(joints) == 1 else f"{len(joints)} joints"
