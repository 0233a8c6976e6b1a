"""The leaf that drives the base onto its dock."""

import math
from dataclasses import dataclass, replace
from enum import Enum, StrEnum
from typing import Final

from py_trees.common import Status

from behaviours.driving.go_to import Entrusting
from behaviours.driving.motion import Way, obstacle
from behaviours.leaf import SUCCESS, argument
from drivers.api import STILL, BaseState, DockBeam, Pose2D, Ros2, Steering, Velocity

# The way onto a dock by its infrared beams: a pure step function, from what a base reports to what it should do.
#
# The beams say in which of three sectors before the dock the base is, and a receiver whether the dock is roughly
# where it looks. Neither is an angle. So the base turns past the dock and takes the middle of the headings at which
# its centre receiver heard it; it drives there only from the middle sector, and crosses into that from the two
# others.

CENTRE = DockBeam.NEAR_CENTRE | DockBeam.FAR_CENTRE
LEFT = DockBeam.NEAR_LEFT | DockBeam.FAR_LEFT
RIGHT = DockBeam.NEAR_RIGHT | DockBeam.FAR_RIGHT
NEAR_BEAMS = DockBeam.NEAR_LEFT | DockBeam.NEAR_CENTRE | DockBeam.NEAR_RIGHT

HOLD = 0.3
"""Seconds for which a beam counts as heard: single reports miss it. (The vendor's docking puts 20 reports together.)"""

LOST = 1.0
"""Seconds of silence after which it looks for the dock anew."""

SWEEP, LISTEN = 0.8, 0.4
"""rad/s at which it looks for the dock, and at which it measures where that is."""

FULL_TURN = math.radians(380)
"""As far it turns in search of a dock."""

ACROSS = math.radians(50)
"""So far beside the dock it crosses into the middle: a side receiver goes on hearing the dock there."""

CROSSING, CROSSING_MOST = 0.08, 3.0
"""m/s at which it crosses, and metres at most."""

FINE, EAGERNESS = math.radians(0.5), 1.5
"""Radians beside a course that do not matter, and rad/s for each radian to turn."""

SLOW = 0.05
"""m/s on the last bit: at this speed a base does not take a touch for a bump, nor does it push its dock away."""

HELD_UP = 15.0
"""Seconds on the last bit after which it has missed the contacts."""

BACK, BACK_SPEED, BACK_TIME = 0.35, 0.1, 7.0
"""Metres that it drives back then, how fast (m/s), and for how long (s) at most."""

TRIES = 3
"""How often it may miss the contacts."""

SILENCE = DockBeam(0)


class HomingStage(StrEnum):
    """HomingStage of the way to a dock, in words for people."""

    LEAVE = "turning past the dock, to measure where it is"
    SEARCH = "looking for the dock"
    AIM = "turning to the dock"
    DRIVE = "driving to the dock"
    ASIDE = "turning aside, to get in front of the dock"
    CROSS = "getting in front of the dock"
    BACK = "backing off, to try again"


class HomingEvent(Enum):
    """Event that ends a stage. HEARD_AHEAD, HEARD_ASIDE: a sweep has measured where the dock is."""

    SILENCE, HEARD_AHEAD, HEARD_ASIDE, AIMED, CONTACTS_MISSED, DOCK_LOST = range(6)


TRANSITIONS: Final = {
    (HomingStage.LEAVE, HomingEvent.SILENCE): HomingStage.SEARCH,
    (HomingStage.SEARCH, HomingEvent.HEARD_AHEAD): HomingStage.AIM,
    (HomingStage.SEARCH, HomingEvent.HEARD_ASIDE): HomingStage.ASIDE,
    (HomingStage.AIM, HomingEvent.AIMED): HomingStage.DRIVE,
    (HomingStage.ASIDE, HomingEvent.AIMED): HomingStage.CROSS,
    (HomingStage.DRIVE, HomingEvent.CONTACTS_MISSED): HomingStage.BACK,
    (HomingStage.DRIVE, HomingEvent.DOCK_LOST): HomingStage.LEAVE,
    (HomingStage.CROSS, HomingEvent.DOCK_LOST): HomingStage.LEAVE,
    (HomingStage.BACK, HomingEvent.DOCK_LOST): HomingStage.LEAVE,
}


@dataclass(frozen=True, slots=True)
class Homing:
    """What it remembers from step to step. ``origin`` and ``since`` (s) are where and when the stage began.

    ``side`` is to which it turns or crosses, 1 for left, and ``course`` the heading to keep. On this sweep the centre
    receiver heard ``beams`` of the dock, at headings from ``first`` to ``last``. ``heard`` is when it last did,
    ``noticed`` when any receiver did. ``astray`` is since when it is not in front of the dock any more. ``near`` says
    that it has taken aim from near. ``failure`` is why it cannot go on.
    """

    origin: Pose2D
    since: float
    stage: HomingStage = HomingStage.LEAVE
    side: float = 1.0
    course: float = 0.0
    beams: DockBeam = SILENCE
    first: float | None = None
    last: float = 0.0
    heard: float = -math.inf
    noticed: float = -math.inf
    astray: float | None = None
    near: bool = False
    missed: int = 0
    failure: str = ""


def step(memory: Homing, state: BaseState, now: float, speed: float) -> tuple[Homing, Velocity]:
    """Return what to remember and how to move after a report; ``speed`` (m/s) is that of the drive to the dock."""
    if state.dock.centre:
        memory = replace(memory, heard=now)
    if state.dock:
        memory = replace(memory, noticed=now)
    match memory.stage:
        case HomingStage.LEAVE:
            return _leave(memory, state, now)
        case HomingStage.SEARCH:
            return _search(memory, state, now)
        case HomingStage.AIM | HomingStage.ASIDE:
            return _turn(memory, state, now)
        case HomingStage.DRIVE:
            return _drive(memory, state, now, speed)
        case HomingStage.CROSS:
            return _cross(memory, state, now)
        case HomingStage.BACK:
            return _back(memory, state, now)


def _leave(memory: Homing, state: BaseState, now: float) -> tuple[Homing, Velocity]:
    """Turn away until the dock is out of hearing: a sweep has to begin in silence."""
    if now - memory.heard < HOLD:
        return memory, Velocity(0.0, -memory.side * LISTEN)
    return _begin(memory, HomingEvent.SILENCE, state, now), STILL


def _search(memory: Homing, state: BaseState, now: float) -> tuple[Homing, Velocity]:
    heading, beams = state.pose.heading, state.dock.centre
    if beams:
        first = heading if memory.first is None else memory.first
        memory = replace(memory, first=first, last=heading, beams=memory.beams | beams)
    if memory.first is None:
        if abs(heading - memory.origin.heading) >= FULL_TURN:
            return replace(memory, failure="no dock is heard in a full turn"), STILL
        return memory, Velocity(0.0, memory.side * SWEEP)
    if now - memory.heard < HOLD:
        return memory, Velocity(0.0, memory.side * LISTEN)
    dock, aside = (memory.first + memory.last) / 2, _aside(memory.beams)
    if aside == 0.0:
        return replace(_begin(memory, HomingEvent.HEARD_AHEAD, state, now), course=dock), STILL
    return replace(_begin(memory, HomingEvent.HEARD_ASIDE, state, now), side=aside, course=dock + aside * ACROSS), STILL


def _turn(memory: Homing, state: BaseState, now: float) -> tuple[Homing, Velocity]:
    off = memory.course - state.pose.heading
    if abs(off) <= FINE:
        return _begin(memory, HomingEvent.AIMED, state, now), STILL
    return memory, Velocity(0.0, max(-SWEEP, min(SWEEP, EAGERNESS * off)))


def _drive(memory: Homing, state: BaseState, now: float, speed: float) -> tuple[Homing, Velocity]:
    beams = state.dock.centre
    if state.bumper or (memory.near and now - memory.since > HELD_UP):
        if memory.missed + 1 == TRIES:
            return replace(memory, failure=f"has missed the contacts of the dock {TRIES} times"), STILL
        return replace(
            _begin(memory, HomingEvent.CONTACTS_MISSED, state, now), missed=memory.missed + 1, near=False
        ), STILL
    if beams & NEAR_BEAMS and not memory.near:
        return _look(replace(memory, near=True), state, now)
    if now - max(memory.heard, memory.since) > LOST:
        return _look(replace(memory, near=False), state, now)
    # From near the beams lie so close together that being in the middle one, too, is good enough.
    if not beams or _aside(beams) == 0.0 or (memory.near and beams & CENTRE):
        memory = replace(memory, astray=None)
    elif memory.astray is None:
        memory = replace(memory, astray=now)
    elif now - memory.astray >= HOLD:
        return _look(memory, state, now)
    return memory, Velocity(SLOW if memory.near else speed, _steering(memory, state))


def _cross(memory: Homing, state: BaseState, now: float) -> tuple[Homing, Velocity]:
    if _gone(memory, state) > CROSSING_MOST:
        return replace(memory, failure="does not get in front of the dock"), STILL
    beams = state.dock.left | state.dock.centre | state.dock.right
    if (beams and _aside(beams) != memory.side) or now - max(memory.noticed, memory.since) > LOST:
        return _look(replace(memory, side=-memory.side), state, now)
    return memory, Velocity(CROSSING, _steering(memory, state))


def _back(memory: Homing, state: BaseState, now: float) -> tuple[Homing, Velocity]:
    if _gone(memory, state) >= BACK or now - memory.since > BACK_TIME:
        return _look(memory, state, now)
    return memory, Velocity(-BACK_SPEED, 0.0)


def _look(memory: Homing, state: BaseState, now: float) -> tuple[Homing, Velocity]:
    """Look for the dock, and measure where it is."""
    return replace(_begin(memory, HomingEvent.DOCK_LOST, state, now), first=None, beams=SILENCE), STILL


def _begin(memory: Homing, event: HomingEvent, state: BaseState, now: float) -> Homing:
    """Begin the stage that follows, here and now."""
    return replace(memory, stage=TRANSITIONS[memory.stage, event], origin=state.pose, since=now, astray=None)


def _aside(beams: DockBeam) -> float:
    """Return to which side of the middle sector the base is: 1 for the dock's left, 0 for in front of it.

    From the dock's left it has to go to its own left, as it looks at the dock.
    """
    left, right = bool(beams & LEFT), bool(beams & RIGHT)
    return 0.0 if left == right else 1.0 if left else -1.0


def _steering(memory: Homing, state: BaseState) -> float:
    """Return the turn rate that keeps it on its course."""
    return max(-0.5, min(0.5, 2.0 * (memory.course - state.pose.heading)))


def _gone(memory: Homing, state: BaseState) -> float:
    return math.hypot(state.pose.x - memory.origin.x, state.pose.y - memory.origin.y)


SETTLED = 0.4
"""Seconds on the contacts after which it is sure of them: twenty reports of a Kobuki."""


ACTION = "dock"
"""What a Create 3 offers for it."""


DOCK_TIME = 100.0
"""Seconds in which a base finds its dock within hearing, and reaches it, at the third try perhaps, at 0.1 m/s."""


class Dock(Entrusting):
    """Drive the base onto its dock, by the dock's infrared beams, or by the robot's own action.

    Running until the base stands on the contacts, then succeeds; at once, if it does so already. A robot of ROS 2 that
    has an action `dock`, as a Create 3 does, goes there by that, and it ends as that does. For others, the dock must be
    within hearing: some two metres, and not behind anything. Fails when it hears no dock in a full turn, when it has
    missed the contacts three times, when something is in its way, at a cliff, when a wheel drops, and while the base is
    stopped until somebody enables it. While somebody steers the base by hand it waits, then looks for the dock anew.
    """

    word = "dock"
    stores = "how full the battery is (percent)"
    keeps = float
    speed: float = argument("speed", "how fast until it is near", default=0.1, low=0.02, high=0.3)
    _homing: Homing | None = None
    _docked_since: float | None = None

    def initialise(self) -> None:
        super().initialise()
        self._homing = self._docked_since = None

    def entrust(self, nodes: Ros2) -> int | None:
        state = self.state()
        if (state is not None and state.docked) or not nodes.does(ACTION):
            return None
        return nodes.begin(ACTION, "irobot_create_msgs/action/Dock", "{}")

    def finished(self, state: BaseState | None) -> bool:
        return state is not None and state.docked

    def watch(self, state: BaseState) -> str:
        self.result = state.battery_percent
        return "it docks by itself"

    def trouble(self, state: BaseState, steering: Steering) -> str:
        stage = None if self._homing is None else self._homing.stage
        # What it touches on its way to the dock is the dock; and there is no edge where it stands on that.
        return obstacle(state, Way.AHEAD if stage is HomingStage.CROSS else Way.ROUND, steering)

    def resume(self, state: BaseState) -> None:
        super().resume(state)
        if self._homing is not None and self._homing.stage is not HomingStage.DRIVE:
            self._homing = None

    def seconds_needed(self, state: BaseState, start: Pose2D) -> float:
        del state, start
        limits = self.robot.base.limits
        return DOCK_TIME * max(1.0, 0.1 / min(self.speed, limits.speed), SWEEP / limits.turn)

    def go(self, state: BaseState, start: Pose2D) -> Status:
        del start
        now = self.run.now()
        if state.docked:
            return self._settle_on_it(state, now)
        self._docked_since, self._stopping = None, False
        homing = self._homing or Homing(state.pose, now)
        self._homing, velocity = step(homing, state, now, self.speed)
        if self._homing.failure:
            return self.fail(self._homing.failure)
        return self.steer(velocity, self._homing.stage.value)

    def _settle_on_it(self, state: BaseState, now: float) -> Status:
        if self._docked_since is None:
            self._docked_since = now
        resting = self.come_to_rest(state.velocity.linear)
        if resting is not SUCCESS or now - self._docked_since < SETTLED:
            return self.wait("on the dock")
        self.result = state.battery_percent
        return SUCCESS
