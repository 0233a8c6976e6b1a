"""The half of an arm that is the same for the real one and its twin: what it is told, and what it tells.

Goals are kept within the limits of their joints, and those that were not are told. Followers are led by their leaders
in the driver's own loop: each goal goes out in the round that read its leader.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from math import degrees, inf
from typing import Literal

from drivers.api import Away, Coupling, DeviceStatus, JointLimits, Report
from drivers.api.joints import Following, joint_called
from drivers.clock import Clock
from drivers.joints.progress import HINT
from drivers.joints.refusals import narrowed
from drivers.servos.bus import Bus
from drivers.servos.joint import Joint
from drivers.servos.telling import Telling
from drivers.servos.torque import go
from drivers.transport.loop import guarded
from drivers.transport.reconnect import Absence, Enabling

EPISODE = 10.0
"""Seconds without a goal beyond the limits of a joint after which the next one is worth a word again."""


class Clamping:
    """The limits of ``joints`` as goals meet them. Safe between threads, but for a notice told twice."""

    def __init__(self, name: str, joints: Mapping[str, Joint], report: Report) -> None:
        self._name = name
        self._joints = joints
        self._report = report
        self._clamped_at: dict[str, float] = {}

    def accept(self, goals: Mapping[str, float], now: float) -> dict[str, float]:
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
                    self._tell(joint, goal, now)
        return accepted

    def _tell(self, joint: Joint, goal: float, now: float) -> None:
        before = self._clamped_at.get(joint.name, -inf)
        self._clamped_at[joint.name] = now
        if now - before < EPISODE:
            return
        limits = joint.limits
        what = f"the goal of {joint.name} was clamped to {degrees(joint.clamp(goal)):.1f} deg: {degrees(goal):.1f} deg"
        span = f"{degrees(limits.lower):.1f}..{degrees(limits.upper):.1f} deg"
        hint = f"{joint.name} may go {span}: change what is asked of it, or its limits in the robot file"
        self._report(DeviceStatus(self._name, "fault", f"{what} is beyond its limits", hint))


class CommandedJoints(Enabling, ABC):
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
        away: Away | None,
        report: Report,
        changed: Callable[[], None],
        name: str,
    ) -> None:
        self.name = name
        self._joints = joints
        self._limits = {joint: described.limits for joint, described in joints.items()}
        self._clock = clock
        self._absence = Absence(away)
        self._stiff_at_rest = at_rest == "hold"
        self._report = guarded(report)
        self._changed = guarded(changed)
        self._telling = Telling(self.name, joints, self._report)
        self._clamping = Clamping(self.name, joints, self._report)
        self.watched = True
        """False where nobody is to look whether joints get where they are sent, such as those that carry a walker."""
        for joint, described in joints.items():
            described.progress.title = f"joint {joint_called(self.name, joint)}"

    @property
    def described(self) -> Mapping[str, Joint]:
        """The joints with the servos behind them."""
        return self._joints

    @property
    def limits(self) -> Mapping[str, JointLimits]:
        """The joints by name, in the order of the robot file."""
        return self._limits

    def curb(self, limits: Mapping[str, JointLimits]) -> Mapping[str, JointLimits]:
        """See ``drivers.api.Curbed``: of the named joints, from the next goal of each on. What stands beyond stays."""
        found = narrowed(self.name, limits, {name: joint.widest for name, joint in self._joints.items()})
        for name, narrower in found.items():
            self._joints[name].limits = narrower
        self._limits = {**self._limits, **found}
        return self._limits

    def hold(self, joints: Collection[str] | None = None) -> None:
        """Let the named joints (None: all) stand still and stiff where they are now, and follow no more.

        Safe from any state; does not raise when offline. Joints that do not confirm it are told, and held once they are
        back. Raises BadRequest for an unknown joint.
        """
        self._command(self._joints if joints is None else joints, stiff=True)

    def relax(self, joints: Collection[str] | None = None) -> None:
        """Switch the torque of the named joints (None: all) off, and let them follow no more. Safe as ``hold``."""
        self._command(self._joints if joints is None else joints, stiff=False)

    def _permit(self, goals: Mapping[str, float], now: float) -> None:
        """Raise DeviceFault for a joint that is blocked on its way there."""
        for name, goal in goals.items():
            self._joints[name].progress.permit(goal, now)

    def _look(self, joints: Iterable[Joint]) -> list[Joint]:
        """Compare where joints are sent with where they were read; return those that are given up, and tell of them."""
        given_up = []
        for joint in joints if self.watched else ():
            state = joint.reading.value
            if state is None or not joint.torque or joint.shut:
                joint.progress.hold(None)
            elif said := joint.progress.look(state.position, state.load, joint.reading.stamp):
                if joint.progress.runs_away:
                    self._tell_runaway(said)
                else:
                    self._report(DeviceStatus(self.name, "fault", said, HINT))
                given_up += [joint] if joint.progress.blocked else []
        return given_up

    def _tell_runaway(self, said: str) -> None:
        """Report a joint that runs away, and what this arm does about it."""
        self._report(DeviceStatus(self.name, "fault", f"{said}: its torque is switched off", HINT))

    @abstractmethod
    def _command(self, names: Collection[str], *, stiff: bool) -> None:
        """Hold or relax, and tell of the joints that did not confirm it."""


UNHEARD = 0.25
"""Seconds without a reading of a leader after which it is worth a word that its follower stands still."""


class Leading:
    """The couplings of an arm. Whoever calls it holds the driver's lock."""

    def __init__(self, bus: Bus, joints: Mapping[str, Joint], clamping: Clamping, telling: Telling) -> None:
        self._bus = bus
        self._joints = joints
        self._clamping = clamping
        self._telling = telling
        self._following = Following()
        self._unheard: set[str] = set()

    @property
    def joints(self) -> frozenset[str]:
        """Those that lead or follow."""
        couplings = self._following.couplings
        return frozenset(name for coupling in couplings for name in (coupling.leader, coupling.follower))

    def begin(self, couplings: Sequence[Coupling]) -> list[str]:
        """Replace the couplings; return the joints that follow no more."""
        freed = self._following.freed_by(couplings)
        self._following = Following(couplings)
        self._unheard.clear()
        return freed

    def end(self, joints: Collection[str]) -> None:
        """Let those of ``joints`` that follow do so no more."""
        self._following.end(joints)

    def pause(self) -> None:
        """Take note that none was led for a while: the followers are brought over slowly before they go on."""
        self._following.pause()

    def lead(self, *, since: float, now: float) -> None:
        """Send every follower where it belongs whose leader was read ``since``. Raises NotConnected."""
        couplings = self._following.couplings
        if not couplings:
            return
        positions = {}
        for name in {name for coupling in couplings for name in (coupling.leader, coupling.follower)}:
            reading = self._joints[name].reading
            if reading.value is not None and reading.stamp >= since:
                positions[name] = reading.value.position
        goals = self._clamping.accept(self._following.goals(positions), now)
        if goals:
            followers = [self._joints[name] for name in goals]
            go(self._bus, followers, goals, self._following.speeds(goals, positions, now), now)
            self._following.pause([joint.name for joint in followers if joint.left_out])
        self._complain(couplings, now)

    def _complain(self, couplings: Sequence[Coupling], now: float) -> None:
        """Tell, once, of followers that stand still because nothing is heard of their leader."""
        for coupling in couplings:
            silent = now - self._joints[coupling.leader].reading.stamp > UNHEARD
            if silent and coupling.follower not in self._unheard:
                self._telling.unled(self._joints[coupling.follower], self._joints[coupling.leader])
            (self._unheard.add if silent else self._unheard.discard)(coupling.follower)
