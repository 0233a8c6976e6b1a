"""One arm that copies another on a wire of its own: whoever turns it decides when, after the leader was read."""

from collections.abc import Mapping, Sequence
from math import inf

from drivers.api import Coupling, JointLimits, Joints
from drivers.api.following import Following

SLOWEST = 0.1
"""rad/s: under load, slower orders do not move a small servo evenly."""


def spans(limits: JointLimits) -> bool:
    """Whether a joint has a range that it may lead another through."""
    return limits.upper > limits.lower


def by_range(leader: str, here: JointLimits, follower: str, there: JointLimits) -> Coupling:
    """Return what brings a joint as far through its range as the one that leads it, which ``spans`` one."""
    scale = (there.upper - there.lower) / (here.upper - here.lower)
    return Coupling(leader, follower, scale, there.lower - scale * here.lower)


class Mirroring:
    """Sends the joints of ``follower`` where those of ``leader`` stand, as ``couplings`` say.

    Followers are brought over slowly at first, and after a pause. A leader that is not heard of leads nobody: its
    followers come to rest by themselves. Whoever turns it seldom gives each way ``time`` (s) to be gone, so that it is
    gone evenly; else all go as fast as they may. For one thread.
    """

    def __init__(self, leader: Joints, follower: Joints, couplings: Sequence[Coupling], *, time: float = 0.0) -> None:
        self._leader = leader
        self._follower = follower
        self._time = time
        self._following = Following(couplings)

    def step(self, now: float) -> Mapping[str, float]:
        """Send the followers on; return the goals that they were sent (radians). Raises NotConnected, DeviceFault."""
        goals = self._following.goals(_places(self._leader))
        if not goals:
            return {}
        limits, at = self._follower.limits, _places(self._follower)
        goals = {joint: limits[joint].clamp(goal) for joint, goal in goals.items()}
        speeds = self._following.speeds(goals, at, now)
        if self._time:
            ways = {joint: abs(goal - at.get(joint, inf)) / self._time for joint, goal in goals.items()}
            even = {joint: max(speed, SLOWEST) for joint, speed in ways.items()}
            speeds = {joint: min(speeds.get(joint, inf), even[joint], limits[joint].speed) for joint in goals}
        return self._follower.move(goals, speeds=speeds)

    def pause(self) -> None:
        """Take note that the follower was away: its joints are brought over anew."""
        self._following.pause()


def _places(arm: Joints) -> dict[str, float]:
    """Return where joints stand that are heard of."""
    states = arm.states().items()
    return {joint: state.value.position for joint, state in states if state.good and state.value is not None}
