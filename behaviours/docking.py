"""Leaf that drives the base onto its dock, with the state machine of docking."""

import math
from dataclasses import dataclass, replace
from enum import Enum, StrEnum
from typing import Final

from py_trees.common import Status

from behaviours.driving.go_to import DelegatedMotion
from behaviours.driving.motion import MotionDirection, obstacle_reason
from behaviours.leaf import SUCCESS, argument
from drivers.api import ZERO_VELOCITY, BaseState, DockBeam, Pose2D, Ros2, Steering, Velocity

# The way onto a dock by its infrared beams: a pure step function, from what a base reports to what it should do.
#
# The beams say in which of three sectors before the dock the base is, and a receiver whether the dock is roughly
# where it looks. Neither is an angle. So the base turns past the dock and takes the middle of the headings at which
# its centre receiver heard it; it drives there only from the middle sector, and crosses into that from the two
# others.

CENTRE_BEAMS = DockBeam.NEAR_CENTRE | DockBeam.FAR_CENTRE
LEFT_BEAMS = DockBeam.NEAR_LEFT | DockBeam.FAR_LEFT
RIGHT_BEAMS = DockBeam.NEAR_RIGHT | DockBeam.FAR_RIGHT
NEAR_BEAMS = DockBeam.NEAR_LEFT | DockBeam.NEAR_CENTRE | DockBeam.NEAR_RIGHT

BEAM_HOLD_TIME = 0.3
"""Seconds for which a beam of the dock still counts as received after the last report of it.

Some reports miss a beam; for this reason the vendor's own docking program combines the last 20 reports.
"""

BEAM_TIMEOUT = 1.0
"""Seconds without a beam of the dock after which the base searches for the dock again."""

SWEEP_RATE, MEASURE_RATE = 0.8, 0.4
"""Turn rates in rad/s of the search for the dock, and of the measurement of its direction."""

MAX_SEARCH_ANGLE = math.radians(380)
"""Angle in radians by which the base turns to search for the dock before the leaf fails."""

CROSSING_ANGLE = math.radians(50)
"""Angle in radians between the direction of the dock and the base's course to the dock's middle line.

On this course, a side receiver of the base still receives the dock's beams.
"""

CROSSING_SPEED, MAX_CROSSING_DISTANCE = 0.08, 3.0
"""Speed in m/s of the crossing, and its maximum length in metres."""

HEADING_TOLERANCE, TURN_GAIN = math.radians(0.5), 1.5
"""Heading error in radians that is ignored, and the gain of the turn controller in 1/s."""

CONTACT_SPEED = 0.05
"""Speed in m/s on the last part of the way to the dock, too slow to trigger the bumper or to push the dock away."""

CONTACT_TIMEOUT = 15.0
"""Seconds on the last part of the way to the dock after which the base has missed the contacts."""

BACK_OFF_DISTANCE, BACK_OFF_SPEED, BACK_OFF_TIMEOUT = 0.35, 0.1, 7.0
"""Distance (m) and speed (m/s) of backing off after a miss, and its timeout in seconds."""

MAX_TRIES = 3
"""Number of times that the base may miss the contacts of the dock before the leaf fails."""

NO_BEAMS = DockBeam(0)


class HomingStage(StrEnum):
    """Stage of docking; ``TRANSITIONS`` lists the possible changes. Its value is the leaf's reason, for people."""

    LEAVE = "turning past the dock, to measure where it is"
    SEARCH = "looking for the dock"
    AIM = "turning to the dock"
    DRIVE = "driving to the dock"
    ASIDE = "turning aside, to get in front of the dock"
    CROSS = "getting in front of the dock"
    BACK = "backing off, to try again"


class HomingEvent(Enum):
    """Event that ends a stage of docking.

    HEARD_AHEAD and HEARD_ASIDE: a turn has measured the direction of the dock, and the base is in front of the dock
    (AHEAD) or to one side of it (ASIDE).
    """

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
    """State of the way to the dock between two steps. ``origin`` and ``since`` (s) are where and when the stage began.

    ``side`` is the direction of turns and crossings, 1 for left, and ``course`` the heading to keep. During the search,
    the centre receiver received ``beams`` at headings from ``first_heading`` to ``last_heading``. ``centre_heard_at``
    is the time at which the centre receiver last received a beam, ``beam_heard_at`` the last time for any receiver.
    ``astray_since`` is when the base left the middle sector of the beams. ``near`` is set after the base has aimed at
    the dock from close by. ``failure`` is the reason if homing has failed.
    """

    origin: Pose2D
    since: float
    stage: HomingStage = HomingStage.LEAVE
    side: float = 1.0
    course: float = 0.0
    beams: DockBeam = NO_BEAMS
    first_heading: float | None = None
    last_heading: float = 0.0
    centre_heard_at: float = -math.inf
    beam_heard_at: float = -math.inf
    astray_since: float | None = None
    near: bool = False
    misses: int = 0
    failure: str = ""


def step(homing: Homing, state: BaseState, now: float, speed: float) -> tuple[Homing, Velocity]:
    """Return the next state of ``homing``, and the velocity to send.

    ``state`` is the newest report of the base, ``now`` the time in seconds. ``speed`` (m/s) is used on the drive to the
    dock.
    """
    if state.dock.centre:
        homing = replace(homing, centre_heard_at=now)
    if state.dock:
        homing = replace(homing, beam_heard_at=now)
    match homing.stage:
        case HomingStage.LEAVE:
            return _leave(homing, state, now)
        case HomingStage.SEARCH:
            return _search(homing, state, now)
        case HomingStage.AIM | HomingStage.ASIDE:
            return _turn(homing, state, now)
        case HomingStage.DRIVE:
            return _drive(homing, state, now, speed)
        case HomingStage.CROSS:
            return _cross(homing, state, now)
        case HomingStage.BACK:
            return _back(homing, state, now)


def _leave(homing: Homing, state: BaseState, now: float) -> tuple[Homing, Velocity]:
    """Turn away until no beam of the dock is received, since the search must begin outside of the beams."""
    if now - homing.centre_heard_at < BEAM_HOLD_TIME:
        return homing, Velocity(0.0, -homing.side * MEASURE_RATE)
    return _enter_stage(homing, HomingEvent.SILENCE, state, now), ZERO_VELOCITY


def _search(homing: Homing, state: BaseState, now: float) -> tuple[Homing, Velocity]:
    heading, beams = state.pose.heading, state.dock.centre
    if beams:
        first = heading if homing.first_heading is None else homing.first_heading
        homing = replace(homing, first_heading=first, last_heading=heading, beams=homing.beams | beams)
    if homing.first_heading is None:
        if abs(heading - homing.origin.heading) >= MAX_SEARCH_ANGLE:
            return replace(homing, failure="no dock beam received in a full turn"), ZERO_VELOCITY
        return homing, Velocity(0.0, homing.side * SWEEP_RATE)
    if now - homing.centre_heard_at < BEAM_HOLD_TIME:
        return homing, Velocity(0.0, homing.side * MEASURE_RATE)
    dock, aside = (homing.first_heading + homing.last_heading) / 2, _sector_side(homing.beams)
    if aside == 0.0:
        return replace(_enter_stage(homing, HomingEvent.HEARD_AHEAD, state, now), course=dock), ZERO_VELOCITY
    return replace(
        _enter_stage(homing, HomingEvent.HEARD_ASIDE, state, now), side=aside, course=dock + aside * CROSSING_ANGLE
    ), ZERO_VELOCITY


def _turn(homing: Homing, state: BaseState, now: float) -> tuple[Homing, Velocity]:
    off = homing.course - state.pose.heading
    if abs(off) <= HEADING_TOLERANCE:
        return _enter_stage(homing, HomingEvent.AIMED, state, now), ZERO_VELOCITY
    return homing, Velocity(0.0, max(-SWEEP_RATE, min(SWEEP_RATE, TURN_GAIN * off)))


def _drive(homing: Homing, state: BaseState, now: float, speed: float) -> tuple[Homing, Velocity]:
    beams = state.dock.centre
    if state.bumper or (homing.near and now - homing.since > CONTACT_TIMEOUT):
        if homing.misses + 1 == MAX_TRIES:
            return replace(homing, failure=f"missed the dock's contacts {MAX_TRIES} times"), ZERO_VELOCITY
        return replace(
            _enter_stage(homing, HomingEvent.CONTACTS_MISSED, state, now), misses=homing.misses + 1, near=False
        ), ZERO_VELOCITY
    if beams & NEAR_BEAMS and not homing.near:
        return _restart_search(replace(homing, near=True), state, now)
    if now - max(homing.centre_heard_at, homing.since) > BEAM_TIMEOUT:
        return _restart_search(replace(homing, near=False), state, now)
    # From near the beams lie so close together that being in the middle one, too, is good enough.
    if not beams or _sector_side(beams) == 0.0 or (homing.near and beams & CENTRE_BEAMS):
        homing = replace(homing, astray_since=None)
    elif homing.astray_since is None:
        homing = replace(homing, astray_since=now)
    elif now - homing.astray_since >= BEAM_HOLD_TIME:
        return _restart_search(homing, state, now)
    return homing, Velocity(CONTACT_SPEED if homing.near else speed, _steering(homing, state))


def _cross(homing: Homing, state: BaseState, now: float) -> tuple[Homing, Velocity]:
    if _distance_gone(homing, state) > MAX_CROSSING_DISTANCE:
        return replace(homing, failure="could not get in front of the dock"), ZERO_VELOCITY
    beams = state.dock.left | state.dock.centre | state.dock.right
    if (beams and _sector_side(beams) != homing.side) or now - max(homing.beam_heard_at, homing.since) > BEAM_TIMEOUT:
        return _restart_search(replace(homing, side=-homing.side), state, now)
    return homing, Velocity(CROSSING_SPEED, _steering(homing, state))


def _back(homing: Homing, state: BaseState, now: float) -> tuple[Homing, Velocity]:
    if _distance_gone(homing, state) >= BACK_OFF_DISTANCE or now - homing.since > BACK_OFF_TIMEOUT:
        return _restart_search(homing, state, now)
    return homing, Velocity(-BACK_OFF_SPEED, 0.0)


def _restart_search(homing: Homing, state: BaseState, now: float) -> tuple[Homing, Velocity]:
    """Turn to search for the dock, and measure its direction."""
    return replace(
        _enter_stage(homing, HomingEvent.DOCK_LOST, state, now), first_heading=None, beams=NO_BEAMS
    ), ZERO_VELOCITY


def _enter_stage(homing: Homing, event: HomingEvent, state: BaseState, now: float) -> Homing:
    """Enter the stage that follows ``event``. It begins at the present pose and at ``now``."""
    return replace(homing, stage=TRANSITIONS[homing.stage, event], origin=state.pose, since=now, astray_since=None)


def _sector_side(beams: DockBeam) -> float:
    """Return on which side of the dock's middle sector the base is: 1, 0 for the middle, or -1.

    1 is the left side of the dock, which is to the right of a base that faces the dock. So from there the base must
    cross to its own left.
    """
    left, right = bool(beams & LEFT_BEAMS), bool(beams & RIGHT_BEAMS)
    return 0.0 if left == right else 1.0 if left else -1.0


def _steering(homing: Homing, state: BaseState) -> float:
    """Return the turn rate (rad/s) that keeps the base on its course."""
    return max(-0.5, min(0.5, 2.0 * (homing.course - state.pose.heading)))


def _distance_gone(homing: Homing, state: BaseState) -> float:
    return math.hypot(state.pose.x - homing.origin.x, state.pose.y - homing.origin.y)


CONTACT_SETTLE_TIME = 0.4
"""Seconds for which the base must stand on the contacts of the dock; a Kobuki sends twenty reports in that time."""


DOCK_ACTION = "dock"
"""Name of the docking action of a Create 3."""


DOCK_TIME_LIMIT = 100.0
"""Expected seconds to find a dock within range and to reach it, with three tries at 0.1 m/s."""


class DockLeaf(DelegatedMotion):
    """Drive the base onto its dock, guided by infrared beams or by the robot's own action.

    Running until the base stands on the contacts, then succeeds; at once if it is docked already. If a ROS 2 robot
    offers an action `dock`, as a Create 3 does, the leaf uses that action and ends with its result. All other bases
    must receive the dock's beams: about two metres away, with nothing in between. Fails if no beam is received in a
    full turn, and after three misses of the contacts. It also fails at an obstacle or cliff, when a wheel drops, and
    while the base is latched. While a person steers the base, the leaf waits, then searches for the dock again.
    """

    tag = "dock"
    example = "- dock"
    output_doc = "the charge of the battery in percent"
    output_type = float
    speed: float = argument("speed", "speed of the approach, before the last part", default=0.1, low=0.02, high=0.3)
    _homing: Homing | None = None
    _docked_since: float | None = None

    def initialise(self) -> None:
        super().initialise()
        self._homing = self._docked_since = None

    def delegate(self, nodes: Ros2) -> int | None:
        state = self.state()
        if (state is not None and state.docked) or not nodes.does(DOCK_ACTION):
            return None
        return nodes.begin(DOCK_ACTION, "irobot_create_msgs/action/Dock", "{}")

    def is_finished(self, state: BaseState | None) -> bool:
        return state is not None and state.docked

    def update_progress(self, state: BaseState) -> str:
        self.result = state.battery_percent
        return "docking by its own action"

    def stop_reason(self, state: BaseState, steering: Steering) -> str:
        stage = None if self._homing is None else self._homing.stage
        # What it touches on its way to the dock is the dock; and there is no edge where it stands on that.
        return obstacle_reason(
            state, MotionDirection.AHEAD if stage is HomingStage.CROSS else MotionDirection.ROUND, steering
        )

    def resume(self, state: BaseState) -> None:
        super().resume(state)
        if self._homing is not None and self._homing.stage is not HomingStage.DRIVE:
            self._homing = None

    def seconds_needed(self, state: BaseState, start: Pose2D) -> float:
        del state, start
        limits = self.robot.base.limits
        return DOCK_TIME_LIMIT * max(1.0, 0.1 / min(self.speed, limits.speed), SWEEP_RATE / limits.turn)

    def go(self, state: BaseState, start: Pose2D) -> Status:
        del start
        now = self.run.now()
        if state.docked:
            return self._settle_on_contacts(state, now)
        self._docked_since, self._stopping = None, False
        homing = self._homing or Homing(state.pose, now)
        self._homing, velocity = step(homing, state, now, self.speed)
        if self._homing.failure:
            return self.fail(self._homing.failure)
        return self.steer(velocity, self._homing.stage.value)

    def _settle_on_contacts(self, state: BaseState, now: float) -> Status:
        if self._docked_since is None:
            self._docked_since = now
        resting = self.come_to_rest(state.velocity.linear)
        if resting is not SUCCESS or now - self._docked_since < CONTACT_SETTLE_TIME:
            return self.wait("on the dock")
        self.result = state.battery_percent
        return SUCCESS
