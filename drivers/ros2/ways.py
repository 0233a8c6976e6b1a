"""Joints as topics of ROS 2 have them: where each is, where it is sent, and what of that a controller is told."""

from collections.abc import Callable, Mapping
from math import degrees, inf, isnan, nan
from typing import Any

from drivers.api import DeviceStatus, JointLimits, JointState, Quality, Reading, Report
from drivers.api.quick import dataclass
from drivers.joints.progress import JointProgress
from drivers.joints.refusals import narrowed
from drivers.ros2 import wire
from drivers.ros2.declared import JOINT
from drivers.ros2.line import Channel
from drivers.ros2.types import types

STATE = "sensor_msgs/msg/JointState"
TRAJECTORY, ARRAY, SINGLE = (
    "trajectory_msgs/msg/JointTrajectory",
    "std_msgs/msg/Float64MultiArray",
    "std_msgs/msg/Float64",
)

LEG = 0.3
"""Seconds of its way that a joint is sent at most: who hears no more stands at the end of them."""

AT_ONCE = 0.05
"""Seconds in which a controller is to be where it is told to stay."""

SLOWEST = 0.01
"""rad/s: no joint is sent more slowly."""

FRESH = 0.3
"""Seconds after which where a joint was is stale."""

SILENT_AFTER = 0.4
"""Seconds without a word of a joint after which it counts as offline, and nothing is sent any farther."""

MOVING = 0.02
"""rad/s from which on a joint counts as moving."""

FAR = 1e6
"""Radians, and radians a second, that no joint reaches."""

STIFF, LIMP = "stays stiff: ROS 2 has no word for limp joints", "let its controller do it: `call_service`"
"""What is told where joints are to be limp."""

RUNAWAY = "ROS 2 has no word for torque off, so its motor goes on"
RUNAWAY_HINT = "switch the power of its motor off; then look at the signs of its motor, its sensor and its controller"
"""What is told of a joint that runs away."""

EPISODE = 10.0
"""Seconds without a goal beyond the limits of a joint after which the next one is worth a word again."""


@dataclass(frozen=True, slots=True)
class TopicJoint:
    """A joint: its name in ROS 2, its ``limits``, and 1 for ``direction``, or -1 where it turns the other way there."""

    there: str
    limits: JointLimits
    direction: int = 1


def channels_of(
    states: str, command: str, joints: Mapping[str, TopicJoint], full: Callable[[str], str] = wire.whole
) -> list[Channel]:
    """Return the channels of joints: their states, then their command, one for each where it has ``{joint}`` in it.

    ``full`` gives the full name of a topic.
    """
    names, kinds = [command], [TRAJECTORY, ARRAY]
    if JOINT in command:
        names, kinds = [command.replace(JOINT, joint.there) for joint in joints.values()], [SINGLE]
    commands = [Channel(full(name), tuple(kinds), sends=True) for name in names]
    return [Channel(full(states), (STATE,)), *commands]


@dataclass(frozen=True, slots=True)
class Way:
    """The way of a joint from ``start`` (radians), where it is at time ``since``, to ``goal`` at ``speed`` (rad/s)."""

    start: float
    since: float
    goal: float
    speed: float

    def position(self, now: float) -> float:
        """Return where it is to be at time ``now``."""
        reach = self.speed * max(now - self.since, 0.0)
        return self.start + min(max(self.goal - self.start, -reach), reach)

    def left(self, now: float) -> float:
        """Return the seconds that it needs from ``now`` on; 0 once it is there."""
        return max(self.since + abs(self.goal - self.start) / self.speed - now, 0.0)


def leg(ways: Mapping[str, Way], now: float) -> list[tuple[float, dict[str, float]]]:
    """Return the leg of all ways that begins at ``now``: seconds from then on, and where each joint is to be by then.

    One point for each joint that arrives within ``LEG``, and one for its end: between them all go straight on.
    """
    times = sorted({max(min(way.left(now), LEG), AT_ONCE) for way in ways.values()})
    return [(time, {name: way.position(now + time) for name, way in ways.items()}) for time in times]


def frames(kind: str, joints: Mapping[str, TopicJoint], ways: Mapping[str, Way], now: float, place: int = 0) -> bytes:
    """Return what a controller that listens to ``kind`` is told at ``now``, as frames of its channels.

    ``place`` is that of the kind among those of the channel.
    """
    if kind == TRAJECTORY:
        points = [
            {
                "positions": [joint.direction * places[name] for name, joint in joints.items()],
                "time_from_start": {"sec": 0, "nanosec": round(time * 1e9)},
            }
            for time, places in leg(ways, now)
        ]
        values = {"joint_names": [joint.there for joint in joints.values()], "points": points}
        return wire.frame(1, types().encode(kind, values), place)
    places = [joint.direction * ways[name].position(now) for name, joint in joints.items()]
    if kind == ARRAY:
        return wire.frame(1, types().encode(kind, {"data": places}), place)
    told = (wire.frame(number, types().encode(SINGLE, {"data": place})) for number, place in enumerate(places, 1))
    return b"".join(told)


class Felt:
    """Where ``joints`` were by the newest messages of type ``STATE``."""

    def __init__(self, joints: Mapping[str, TopicJoint]) -> None:
        self._joints = joints
        self.unread: set[str] = set()
        """The joints, by their names there, whose newest position is not a number."""
        # Replaced, never altered: any thread may read it.
        self._all: Mapping[str, tuple[float, float, float]] = {}  # position, velocity, when

    def __contains__(self, name: str) -> bool:
        return name in self._all

    def take(self, told: Any, now: float) -> bool:
        """Take a message; say whether it told of any joint. Raises ValueError, IndexError for figures of no joint."""
        at, found = {there: place for place, there in enumerate(told.name)}, {}
        for name, joint in self._joints.items():
            if (place := at.get(joint.there)) is None:
                continue
            position, before = joint.direction * float(told.position[place]), self._all.get(name)
            if isnan(position):  # it has not been read yet
                self.unread.add(joint.there)
                continue
            self.unread.discard(joint.there)
            velocity = joint.direction * float(told.velocity[place]) if place < len(told.velocity) else nan
            if isnan(velocity):  # nor is measured
                since = 0.0 if before is None else now - before[2]
                velocity = (position - before[0]) / since if before is not None and since > 0 else 0.0
            if not (abs(position) < FAR and abs(velocity) < FAR):
                raise ValueError(f"its joint {joint.there} is at {position:g} rad, {velocity:g} rad/s, in {STATE}")
            found[name] = (position, velocity, now)
        self._all = {**self._all, **found}
        return bool(found)

    def position(self, name: str) -> float:
        """Return where a joint was."""
        return self._all[name][0]

    def moves(self, name: str) -> bool:
        """Whether a joint moved."""
        return abs(self._all[name][1]) > MOVING

    def silent(self, now: float) -> list[str]:
        """Return the joints of which nothing comes."""
        return [name for name in self._joints if name not in self._all or now - self._all[name][2] > SILENT_AFTER]

    def look(self, name: str, progress: JointProgress) -> str:
        """Let ``progress`` look at the newest position of a joint; return what it says."""
        if not progress.active or name not in self._all:
            return ""
        position, _, stamp = self._all[name]
        return progress.look(position, 0.0, stamp)

    def reading(self, name: str, way: Way | None, now: float, *, there: bool, blocked: str = "") -> Reading[JointState]:
        """Return the state of a joint that is on a ``way``. What ROS 2 does not tell is 0."""
        if name not in self._all:
            return Reading(None, now, Quality.NONE)
        position, velocity, stamp = self._all[name]
        moving = abs(velocity) > MOVING or (there and way is not None and way.left(now) > 0)
        goal = None if way is None else way.goal
        state = JointState(position, velocity, goal, 0.0, 0.0, 0.0, moving, torque=True, blocked=blocked)
        return Reading(state, stamp, Quality.GOOD if there and now - stamp <= FRESH else Quality.STALE)


class Bounds:
    """The limits of ``joints``, which may be narrowed; goals beyond them are clamped, and told once an episode."""

    def __init__(self, who: str, joints: Mapping[str, TopicJoint], report: Report) -> None:
        self._who, self._joints, self._report = who, joints, report
        self.limits: Mapping[str, JointLimits] = {name: joint.limits for name, joint in joints.items()}
        self._clamped_at: dict[str, float] = {}

    def curb(self, limits: Mapping[str, JointLimits]) -> Mapping[str, JointLimits]:
        """Narrow the limits of the named joints; see ``drivers.api.Curbed``."""
        widest = {name: joint.limits for name, joint in self._joints.items()}
        self.limits = {**self.limits, **narrowed(self._who, limits, widest)}
        return self.limits

    def accept(self, goals: Mapping[str, float], now: float) -> dict[str, float]:
        """Return the nearest goals within the limits; tell of those that are others."""
        accepted = {name: self.limits[name].clamp(goal) for name, goal in goals.items()}
        for name in (each for each in goals if accepted[each] != goals[each]):
            before, self._clamped_at[name] = self._clamped_at.get(name, -inf), now
            if now - before >= EPISODE:
                what = f"the goal of {name} was clamped to {degrees(accepted[name]):.1f} deg"
                what += f": {degrees(goals[name]):.1f} deg is beyond its limits"
                hint = "change what is asked of it, or its limits in the robot file"
                self._report(DeviceStatus(self._who, "fault", what, hint))
        return accepted
