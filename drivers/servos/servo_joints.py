"""Common part of the arm driver and its simulated device: limits, progress, following, hold and relax.

Goals are clamped to the limits of their joints, with a notice. The driver's own loop reads the joints, and sends each
follower its goal as soon as its leader was read.
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
"""Seconds without a clamped goal of a joint after which its next clamped goal is reported again."""


class GoalLimiter:
    """Clamps goals to the limits of ``joints``. Thread-safe, but a notice may be reported twice."""

    def __init__(self, name: str, joints: Mapping[str, Joint], report: StatusCallback) -> None:
        self._name = name
        self._joints = joints
        self._report = report
        self._clamped_at: dict[str, float] = {}

    def clamp_goals(self, goals: Mapping[str, float], now: float) -> dict[str, float]:
        """Return ``goals`` (rad) clamped to the limits of their joints; report a clamped goal.

        It is not reported if another goal of the same joint was clamped within ``CLAMP_REPORT_INTERVAL``.
        """
        accepted = {}
        for name, goal in goals.items():
            joint = self._joints[name]
            limits = joint.limits
            if limits.lower <= goal <= limits.upper:
                accepted[name] = goal
            else:
                accepted[name] = joint.clamp(goal)
                if abs(accepted[name] - goal) > joint.model.tick / 2:  # less is rounding
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
        hint = f"{joint.name} may go {span}: change the goal, or its limits in the robot file"
        self._report(DeviceStatus(self._name, "fault", f"{what} is beyond its limits", hint))


class ServoJoints(LatchingPart, ABC):
    """Named joints that can be held and relaxed. Subclasses drive real servos on a bus, or simulated ones.

    ``at_rest`` says whether the arm holds or relaxes at rest; ``away`` is its reconnect policy. ``report`` receives
    notices; ``changed`` is called after every round of readings.
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
        """Whether progress towards goals is checked; False for joints that carry a walking robot."""
        for joint, described in joints.items():
            described.progress.title = f"joint {qualified_joint_name(self.name, joint)}"

    @property
    def joints(self) -> Mapping[str, Joint]:
        """Joints with their servos, by name."""
        return self._joints

    @property
    def limits(self) -> Mapping[str, JointLimits]:
        """Current limits by joint, in the order of the robot file."""
        return self._limits

    def restrict_limits(self, limits: Mapping[str, JointLimits]) -> Mapping[str, JointLimits]:
        """Restrict the limits of the named joints, from their next goals on; see ``drivers.api.Limitable``.

        A joint that is beyond its new limits stays there.
        """
        found = narrow_limits(
            self.name, limits, {name: joint.configured_limits for name, joint in self._joints.items()}
        )
        for name, narrower in found.items():
            self._joints[name].limits = narrower
        self._limits = {**self._limits, **found}
        return self._limits

    def hold(self, joints: Collection[str] | None = None) -> None:
        """Stop the named joints (None: all) at their current position with torque on, and end their following.

        Safe from any state; does not raise when offline. Joints whose servo does not confirm it are reported, and held
        once the servo answers again. Raises BadRequest for an unknown joint.
        """
        self._hold_or_relax_and_report(self._joints if joints is None else joints, stiff=True)

    def relax(self, joints: Collection[str] | None = None) -> None:
        """Switch the torque of the named joints (None: all) off, and end their following. Safe as ``hold``."""
        self._hold_or_relax_and_report(self._joints if joints is None else joints, stiff=False)

    def _refuse_blocked(self, goals: Mapping[str, float], now: float) -> None:
        """Raise DeviceFault for a joint that is blocked in the direction of its goal."""
        for name, goal in goals.items():
            self._joints[name].progress.permit(goal, now)

    def _check_progress(self, joints: Iterable[Joint]) -> list[Joint]:
        """Compare setpoints with readings; report faults, and return the joints that are blocked."""
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
        self._report(DeviceStatus(self.name, "fault", f"{finding}: its torque is switched off", HINT))

    @abstractmethod
    def _hold_or_relax_and_report(self, names: Collection[str], *, stiff: bool) -> None:
        """Hold or relax joints, and report those whose servo does not confirm it."""


LEADER_TIMEOUT = 0.25
"""Seconds without a reading of a leader after which its stopped follower is reported."""


class JointCouplings:
    """Couplings of leading and following joints. The caller holds the driver's lock."""

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
        """Names of the joints that lead or follow."""
        couplings = self._following.couplings
        return frozenset(name for coupling in couplings for name in (coupling.leader, coupling.follower))

    def replace(self, couplings: Sequence[Coupling]) -> list[str]:
        """Replace the couplings; return the joints that no longer follow."""
        freed = self._following.followers_without(couplings)
        self._following = ActiveCouplings(couplings)
        self._reported_followers.clear()
        return freed

    def release(self, joints: Collection[str]) -> None:
        """Stop ``joints`` from following."""
        self._following.release(joints)

    def pause(self) -> None:
        """Record a pause: followers then approach slowly before they follow at full speed again."""
        self._following.mark_paused()

    def update_followers(self, *, since: float, now: float) -> None:
        """Send new goals to followers whose leader was read at or after time ``since``. Raises NotConnected."""
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
        """Report, once, the followers that stand still because their leader sends no readings."""
        for coupling in couplings:
            silent = now - self._joints[coupling.leader].reading.stamp > LEADER_TIMEOUT
            if silent and coupling.follower not in self._reported_followers:
                self._reporter.report_silent_leader(self._joints[coupling.follower], self._joints[coupling.leader])
            (self._reported_followers.add if silent else self._reported_followers.discard)(coupling.follower)
