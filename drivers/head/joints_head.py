"""Head made of two joints of an arm: a neck. It depends only on ``drivers.api.Joints``, not on a bus."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Generic, Self, TypeVar

from drivers.api import (
    HEAD_ACCELERATION,
    DeviceStatus,
    HeadPose,
    Health,
    Joints,
    JointState,
    Quality,
    Reading,
    StatusCallback,
    ignore,
)
from drivers.api.fast_dataclass import dataclass
from drivers.clock import Clock
from drivers.errors import BadRequest, DeviceFault, NotConnected
from drivers.head.pantilt import MAX_TRIM, STRAIGHT_AHEAD, PanTiltMotion, ProfiledHead
from drivers.transport.loop import Loop, LoopFactory, ThreadLoop, guard_callback

STEP_INTERVAL = 0.02
"""Seconds between two steps of a head's motion."""

MIN_POSE_CHANGE = math.radians(0.25)
"""Smallest change of the pose in radians that is reported: one step of a servo's sensor."""


MAX_LAG, MAX_DEVIATION = 0.2, math.radians(2)
"""Normal lag of a joint behind its goals: seconds of its motion, plus radians; beyond that it is held back."""


@dataclass(frozen=True, slots=True)
class JointAxis:
    """Axis on one joint of an arm: a ``drivers.head.pantilt.HeadAxis``. Its mounting is described by the joint itself.

    ``lower`` and ``upper`` (radians) limit the head's angle; ``joint_min`` and ``joint_max`` are the limits of the
    joint. ``trim`` (radians, +-45 degrees) is added to the joint's angle. Raises ValueError for impossible values.
    """

    joint: str
    lower: float
    upper: float
    joint_min: float = -math.inf
    joint_max: float = math.inf
    trim: float = 0.0

    def __post_init__(self) -> None:
        if not abs(self.trim) <= MAX_TRIM:
            raise ValueError(f"{self.joint}: a trim of {math.degrees(self.trim):.1f} deg is not within -45..45 deg")
        if not self.range[0] <= self.range[1]:
            raise ValueError(f"{self.joint}: nothing of {self.lower}..{self.upper} rad is within its reach")

    @property
    def sign(self) -> int:
        """1: the joint turns as the head does."""
        return 1

    @property
    def is_measured(self) -> bool:
        """True: the joint reports its angle."""
        return True

    @property
    def range(self) -> tuple[float, float]:
        """Range in radians that is permitted for the head and reachable for the joint."""
        return max(self.lower, self.joint_min - self.trim), min(self.upper, self.joint_max - self.trim)

    def with_trim(self, trim: float) -> Self:
        """Return the same axis with another trim (radians).

        Raises ValueError for more than 45 degrees, or a trim that leaves an empty range.
        """
        return replace(self, trim=trim)


J = TypeVar("J", bound=Joints)


class JointsHead(ProfiledHead[JointAxis], Generic[J]):
    """Head that is two of the joints of an arm: a ``drivers.api.Head``. The owner of ``joints`` opens and closes them.

    It moves the joints to the goal within ``speed`` (rad/s) and ``acceleration`` (rad/s^2), in small steps: call
    ``step`` every ``STEP_INTERVAL``. The pose is measured by the joints. When the joints are online for the first time,
    the head moves to ``start``. The goal is dropped if a joint goes offline, or if its torque is switched off.
    ``changed`` is called by ``step``. Raises BadRequest for an unknown joint, ValueError for impossible values.
    """

    STEP_INTERVAL = STEP_INTERVAL

    def __init__(
        self,
        joints: J,
        clock: Clock,
        *,
        pan: JointAxis,
        tilt: JointAxis,
        speed: float,
        acceleration: float = HEAD_ACCELERATION,
        report: StatusCallback = ignore,
        changed: Callable[[], None] = ignore,
        start: HeadPose = STRAIGHT_AHEAD,
        name: str = "head",
    ) -> None:
        self.name = name
        if pan.joint == tilt.joint:
            raise ValueError(f"{self.name}: pan and tilt are both joint '{pan.joint}'")
        self._joints = joints
        self._report = guard_callback(report)
        pan, tilt = self._untrimmed_axes = (
            _with_joint_limits(self.name, pan, joints),
            _with_joint_limits(self.name, tilt, joints),
        )
        super().__init__(
            clock, PanTiltMotion(self.name, pan, tilt, speed=speed, acceleration=acceleration, start=start), changed
        )
        self._is_open = self._is_online = False
        self._sent: Mapping[str, float] = {}  # on this connection
        self._were_led = (False, False)  # at the last step
        self._last_pose: Reading[HeadPose] = Reading(None, 0.0, Quality.NONE)
        self._reported_pose: HeadPose | None = None

    # --- what behaviours ask ------------------------------------------------------------------------------------------

    def look(self, target: HeadPose) -> HeadPose:
        """Start moving to ``target``; return the pose accepted after clamping, in radians.

        Raises BadRequest if it is not finite, NotConnected while a joint is offline, DeviceFault while the joints are
        latched or one is blocked.
        """
        self._motion.check(target)
        if not self._is_online:
            health = self.health()
            raise NotConnected(health.detail or f"{self.name}: not online yet", hint=health.hint)
        self._joints.move({})  # raises if they are latched
        self._retry_blocked(target)
        return self._motion.look(target, self._clock.now())

    def stop(self) -> None:
        """Brake the head within its acceleration, and hold; a joint far behind its setpoint stops where it is."""
        super().stop()
        here, now = self._last_pose.value, self._sync_time()
        if self._is_online and here is not None:
            # A reading lags by the motion of the joint since then.
            max_distance = (MAX_LAG + now - self._last_pose.stamp) * self.limits.speed + MAX_DEVIATION
            steps = zip((here.pan, here.tilt), self._motion.advance(now), strict=True)
            pan, tilt = (angle if abs(step.angle - angle) > max_distance else None for angle, step in steps)
            self._motion.drop_goal(pan=pan, tilt=tilt, now=now)
        if blocked := self._blocked_joints():
            self._joints.hold(blocked)  # a later goal may move them again

    def pose(self) -> Reading[HeadPose]:
        """Last measured pose; stale while a joint is offline, and none before both were online."""
        newest = self._last_pose
        return newest if self._is_online or newest.value is None else replace(newest, quality=Quality.STALE)

    # --- life ---------------------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Use the joints as soon as they are online."""
        self._is_open = True

    def close(self) -> None:
        """Hold at once. Safe from any state, more than once."""
        self._is_open = self._is_online = False
        self._motion.halt()

    def health(self) -> Health:
        """Return whether both joints are online."""
        if not self._is_open:
            return Health(False, f"{self.name}: not opened yet", "open it first")
        health, states = self._joints.health(), self._joints.states()
        returned = health.reconnected_at
        silent = [axis.joint for axis in self._motion.axes if not states[axis.joint].good]
        if silent or not health.online:
            what = f"no reading of joint {' and '.join(silent)}" if silent else "its joints are offline"
            detail = f"{self.name}: {what}" + (f": {health.detail}" if health.detail else "")
            return Health(False, detail, _offline_hint(health), reconnected_at=returned)
        return Health(
            self._is_online, "" if self._is_online else f"{self.name}: about to start", reconnected_at=returned
        )

    # --- whoever steps it ---------------------------------------------------------------------------------------------

    def step(self) -> None:
        """Advance: read the joints, and send their next goals."""
        if not self._is_open:
            return
        now, states = self._clock.now(), self._joints.states()
        pan, tilt = (states[axis.joint] for axis in self._motion.axes)
        if not (pan.good and tilt.good) or pan.value is None or tilt.value is None:
            self._go_offline()
            return
        if not self._is_online and not self._joints.health().online:
            return  # the last reading is not stale yet, but the bus is offline
        here = self._record_pose(pan.value, tilt.value, min(pan.stamp, tilt.stamp))
        if not self._is_online:
            self._go_online(here, now)
        self._release_limp_joints(here, _follows_goals(pan.value), _follows_goals(tilt.value), now)
        try:
            self._move_joints(now)
        except NotConnected:
            self._go_offline()
        except DeviceFault:  # latched: ``look`` raises
            self._motion.halt()

    def _record_pose(self, pan: JointState, tilt: JointState, stamp: float) -> HeadPose:
        """Record the pose of the joints; report it if it has changed."""
        axes = self._motion.axes
        here = HeadPose(pan.position - axes[0].trim, tilt.position - axes[1].trim)
        self._last_pose = Reading(here, stamp, Quality.GOOD)
        self._history.add(stamp, (here.pan, here.tilt))
        reported = self._reported_pose
        if reported is None or max(abs(here.pan - reported.pan), abs(here.tilt - reported.tilt)) > MIN_POSE_CHANGE:
            self._reported_pose = here
            self._changed()
        return here

    def _go_online(self, here: HeadPose, now: float) -> None:
        """Start from the measured pose: move to the start pose the first time, later stay there."""
        if self._has_start:
            self._motion.drop_goal(pan=here.pan, tilt=here.tilt, now=now)
        else:
            self._motion.set_position(here, now)
        self._sent, self._were_led = {}, (False, False)
        self._is_online = self._has_start = True
        self._report(DeviceStatus(self.name, "online", "both joints are online"))

    def _release_limp_joints(self, here: HeadPose, pan: bool, tilt: bool, now: float) -> None:
        """Stop a joint that no longer follows its goals (relaxed, shut down or blocked) at its measured angle."""
        limp = [was and not now_is for was, now_is in zip(self._were_led, (pan, tilt), strict=True)]
        self._were_led = (pan, tilt)
        if any(limp):
            self._motion.drop_goal(pan=here.pan if limp[0] else None, tilt=here.tilt if limp[1] else None, now=now)
            self._sent = self._goals(now)  # else the next step would switch their torque on again

    def _goals(self, now: float) -> dict[str, float]:
        """Return the goals of the joints at time ``now``, in radians."""
        return {step.axis.joint: step.angle + step.axis.trim for step in self._motion.advance(now)}

    def _move_joints(self, now: float) -> None:
        goals = self._goals(now)
        if goals != self._sent:
            blocked = self._blocked_joints()
            self._joints.move({joint: goal for joint, goal in goals.items() if joint not in blocked})
            self._sent = goals

    def _blocked_joints(self) -> list[str]:
        readings = ((axis.joint, self._joints.states()[axis.joint].value) for axis in self._motion.axes)
        return [joint for joint, state in readings if state is not None and state.blocked]

    def _retry_blocked(self, target: HeadPose) -> None:
        """Move blocked joints one small step towards ``target``. Raises DeviceFault for joints blocked that way."""
        blocked, here = self._blocked_joints(), self._last_pose.value
        for axis, goal, angle in zip(self._motion.axes, (target.pan, target.tilt), _angles(here), strict=True):
            if axis.joint in blocked:
                step = math.copysign(MAX_DEVIATION, goal - angle)
                self._joints.move({axis.joint: angle + axis.trim + step})

    def _go_offline(self) -> None:
        """Drop the goal, except the start pose before the first connection."""
        if self._has_start:
            self._motion.halt()
        if self._is_online:
            self._is_online = False
            health = self.health()
            self._report(
                DeviceStatus(
                    self.name, "offline", health.detail or f"{self.name}: a joint is offline", _offline_hint(health)
                )
            )


class NeckDriver(JointsHead[Joints]):
    """``JointsHead`` that steps itself on a thread of its own while it is open; its joints are opened separately."""

    make_loop: LoopFactory = ThreadLoop
    """Makes the loop that calls ``step``."""
    _loop: Loop | None = None
    _fault = ""

    def open(self) -> None:
        """Use the joints as soon as they are online; does nothing while open."""
        super().open()
        if self._loop is None:
            self._loop = self.make_loop(f"{self.name} joints", self._run_step, ignore)
        self._loop.start()

    def close(self) -> None:
        """End the steps, and hold. Safe from any state, more than once."""
        if self._loop is not None:
            self._loop.end()
        super().close()

    def _run_step(self) -> float:
        try:
            self.step()
        except BaseException as error:  # SystemExit too: without this thread the head would not even brake
            if (fault := f"{type(error).__name__}: {error}") != self._fault:
                self._fault = fault
                self._report(DeviceStatus(self.name, "fault", fault))
        return STEP_INTERVAL


def _with_joint_limits(name: str, axis: JointAxis, joints: Joints) -> JointAxis:
    """Return ``axis`` with the limits of its joint. Raises BadRequest for an unknown joint."""
    limits = joints.limits.get(axis.joint)
    if limits is None:
        names = ", ".join(joints.limits)
        raise BadRequest(f"{name}: no joint '{axis.joint}' (there are {names})", hint="check the joints of the arm")
    return replace(axis, joint_min=limits.lower, joint_max=limits.upper)


def _follows_goals(state: JointState) -> bool:
    return state.torque and not state.blocked


def _angles(pose: HeadPose | None) -> tuple[float, float]:
    return (0.0, 0.0) if pose is None else (pose.pan, pose.tilt)


def _offline_hint(health: Health) -> str:
    return health.hint or "check the power and cable of its servos"
