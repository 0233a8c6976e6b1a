"""The half of an arm that is the same for the real one and its twin: what it is told, and what it tells.

Goals are kept within the limits of their joints, and those that were not are told. Followers are led by their leaders
in the driver's own loop: each goal goes out in the round that read its leader.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from math import degrees, inf
from typing import Literal

from drivers.api import Coupling, DeviceStatus, JointLimits, ReconnectPolicy, StatusCallback
from drivers.api.joints import ActiveCouplings, qualified_joint_name
from drivers.clock import Clock
from drivers.joints.progress import HINT
from drivers.joints.request_checks import narrow_limits
from drivers.servos.bus import ServoBus
from drivers.servos.joint import Joint
from drivers.servos.status_report import ServoReporter
from drivers.servos.torque import start_motion
from drivers.transport.loop import guard_callback
from drivers.transport.reconnect import LatchingPart, ReconnectTracker

CLAMP_REPORT_INTERVAL = 10.0
"""Seconds without a goal beyond the limits of a joint after which the next one is worth a word again."""


class GoalLimiter:
    """The limits of ``coupled_joints`` as goals meet them. Safe between threads, but for a notice told twice."""

    def __init__(self, name: str, joints: Mapping[str, Joint], report: StatusCallback) -> None:
        self._name = name
        self._joints = joints
        self._report = report
        self._clamped_at: dict[str, float] = {}

    def clamp_goals(self, goals: Mapping[str, float], now: float) -> dict[str, float]:
        """Return the nearest ``goals`` (rad) within the limits; tell, once an episode, of those that are others."""
        accepted = {}
        for name, goal in goals.items():
            joint = self._joints[name]
            limits = joint.limits
            if limits.lower <= goal <= limits.upper:
                accepted[name] = goal
            else:
                accepted[name] = joint.clamp(goal)
                if abs(accepted[name] - goal) > joint.model.tick / 2:  # less is rounding, and moves nothing
                    self._report_clamp(joint, goal, now)
        return accepted

    def _report_clamp(self, joint: Joint, goal: float, now: float) -> None:
        before = self._clamped_at.get(joint.name, -inf)
        self._clamped_at[joint.name] = now
        if now - before < CLAMP_REPORT_INTERVAL:
            return
        limits = joint.limits
        what = f"the goal of {joint.name} was clamped to {degrees(joint.clamp(goal)):.1f} deg: {degrees(goal):.1f} deg"
        span = f"{degrees(limits.lower):.1f}..{degrees(limits.upper):.1f} deg"
        hint = f"{joint.name} may go {span}: change what is asked of it, or its limits in the robot file"
        self._report(DeviceStatus(self._name, "fault", f"{what} is beyond its limits", hint))


class ServoJoints(LatchingPart, ABC):
    """Named joints that are held and relaxed. A subclass has the bus, or the bodies, of their servos.

    ``at_rest`` says what rest means for this arm: stiff where it is, or without torque; ``away`` what of before goes on
    when it is back. ``report`` hears what the servos tell, ``changed`` is called after every round of readings.
    """

    def __init__(
        self,
        joints: Mapping[str, Joint],
        clock: Clock,
        *,
        at_rest: Literal["hold", "relax"],
        away: ReconnectPolicy | None,
        report: StatusCallback,
        changed: Callable[[], None],
        name: str,
    ) -> None:
        self.name = name
        self._joints = joints
        self._limits = {joint: described.limits for joint, described in joints.items()}
        self._clock = clock
        self._reconnect = ReconnectTracker(away)
        self._stiff_at_rest = at_rest == "hold"
        self._report = guard_callback(report)
        self._changed = guard_callback(changed)
        self._reporter = ServoReporter(self.name, joints, self._report)
        self._goal_limiter = GoalLimiter(self.name, joints, self._report)
        self.monitors_progress = True
        """False where nobody is to look whether joints get where they are sent, such as those that carry a walker."""
        for joint, described in joints.items():
            described.progress.title = f"joint {qualified_joint_name(self.name, joint)}"

    @property
    def joints(self) -> Mapping[str, Joint]:
        """The joints with the servos behind them."""
        return self._joints

    @property
    def limits(self) -> Mapping[str, JointLimits]:
        """The joints by name, in the order of the robot file."""
        return self._limits

    def restrict_limits(self, limits: Mapping[str, JointLimits]) -> Mapping[str, JointLimits]:
        """See ``drivers.api.Limitable``: of the named joints, from the next goal of each on. What stands beyond stays."""
        found = narrow_limits(
            self.name, limits, {name: joint.configured_limits for name, joint in self._joints.items()}
        )
        for name, narrower in found.items():
            self._joints[name].limits = narrower
        self._limits = {**self._limits, **found}
        return self._limits

    def hold(self, joints: Collection[str] | None = None) -> None:
        """Let the named joints (None: all) stand still and stiff where they are now, and follow no more.

        Safe from any state; does not raise when offline. Joints that do not confirm it are told, and held once they are
        back. Raises BadRequest for an unknown joint.
        """
        self._hold_or_relax_and_report(self._joints if joints is None else joints, stiff=True)

    def relax(self, joints: Collection[str] | None = None) -> None:
        """Switch the torque of the named joints (None: all) off, and let them follow no more. Safe as ``hold``."""
        self._hold_or_relax_and_report(self._joints if joints is None else joints, stiff=False)

    def _refuse_blocked(self, goals: Mapping[str, float], now: float) -> None:
        """Raise DeviceFault for a joint that is blocked on its way there."""
        for name, goal in goals.items():
            self._joints[name].progress.permit(goal, now)

    def _check_progress(self, joints: Iterable[Joint]) -> list[Joint]:
        """Compare where joints are sent with where they were read; return those that are given up, and tell of them."""
        given_up = []
        for joint in joints if self.monitors_progress else ():
            state = joint.reading.value
            if state is None or not joint.torque or joint.is_shut_down:
                joint.progress.hold(None)
            elif said := joint.progress.update(state.position, state.load, joint.reading.stamp):
                if joint.progress.runs_away:
                    self._report_runaway(said)
                else:
                    self._report(DeviceStatus(self.name, "fault", said, HINT))
                given_up += [joint] if joint.progress.blocked else []
        return given_up

    def _report_runaway(self, finding: str) -> None:
        """Report a joint that runs away, and what this arm does about it."""
        self._report(DeviceStatus(self.name, "fault", f"{finding}: its torque is switched off", HINT))

    @abstractmethod
    def _hold_or_relax_and_report(self, names: Collection[str], *, stiff: bool) -> None:
        """Hold or relax, and tell of the joints that did not confirm it."""


LEADER_TIMEOUT = 0.25
"""Seconds without a reading of a leader after which it is worth a word that its follower stands still."""


class JointCouplings:
    """The couplings of an arm. Whoever calls it holds the driver's lock."""

    def __init__(
        self, bus: ServoBus, joints: Mapping[str, Joint], goal_limiter: GoalLimiter, reporter: ServoReporter
    ) -> None:
        self._bus = bus
        self._joints = joints
        self._goal_limiter = goal_limiter
        self._reporter = reporter
        self._following = ActiveCouplings()
        self._reported_followers: set[str] = set()

    @property
    def coupled_joints(self) -> frozenset[str]:
        """Those that lead or follow."""
        couplings = self._following.couplings
        return frozenset(name for coupling in couplings for name in (coupling.leader, coupling.follower))

    def replace(self, couplings: Sequence[Coupling]) -> list[str]:
        """Replace the couplings; return the joints that follow no more."""
        freed = self._following.followers_without(couplings)
        self._following = ActiveCouplings(couplings)
        self._reported_followers.clear()
        return freed

    def release(self, joints: Collection[str]) -> None:
        """Let those of ``coupled_joints`` that follow do so no more."""
        self._following.release(joints)

    def pause(self) -> None:
        """Take note that none was led for a while: the followers are brought over slowly before they go on."""
        self._following.mark_paused()

    def update_followers(self, *, since: float, now: float) -> None:
        """Send every follower where it belongs whose leader was read ``since``. Raises NotConnected."""
        couplings = self._following.couplings
        if not couplings:
            return
        positions = {}
        for name in {name for coupling in couplings for name in (coupling.leader, coupling.follower)}:
            reading = self._joints[name].reading
            if reading.value is not None and reading.stamp >= since:
                positions[name] = reading.value.position
        goals = self._goal_limiter.clamp_goals(self._following.goals(positions), now)
        if goals:
            followers = [self._joints[name] for name in goals]
            start_motion(self._bus, followers, goals, self._following.speeds(goals, positions, now), now)
            self._following.mark_paused([joint.name for joint in followers if joint.excluded_from_move])
        self._report_silent_leaders(couplings, now)

    def _report_silent_leaders(self, couplings: Sequence[Coupling], now: float) -> None:
        """Tell, once, of followers that stand still because nothing is heard of their leader."""
        for coupling in couplings:
            silent = now - self._joints[coupling.leader].reading.stamp > LEADER_TIMEOUT
            if silent and coupling.follower not in self._reported_followers:
                self._reporter.report_silent_leader(self._joints[coupling.follower], self._joints[coupling.leader])
            (self._reported_followers.add if silent else self._reported_followers.discard)(coupling.follower)
