"""Joints of a robot with ROS 2: positions from JointState, setpoints on the topic of their controller."""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from math import inf
from threading import RLock

from drivers.api import (
    Coupling,
    DeviceStatus,
    Health,
    JointLimits,
    JointState,
    Reading,
    ReconnectPolicy,
    StatusCallback,
    ignore,
)
from drivers.api.joints import ActiveCouplings, qualified_joint_name
from drivers.clock import Clock
from drivers.errors import NotConnected
from drivers.joints.progress import HINT, JointProgress
from drivers.joints.request_checks import check_couplings, check_move, check_names
from drivers.ros2 import wire
from drivers.ros2.joint_topics import (
    JOINT_STATE,
    MIN_SPEED,
    NO_TORQUE_OFF,
    NO_TORQUE_OFF_HINT,
    RUNAWAY_HINT,
    RUNAWAY_NOTICE,
    TRAJECTORY,
    JointFeedback,
    LinearTrajectory,
    TopicJoint,
    TopicJointLimits,
    command_frames,
)
from drivers.ros2.node import TopicFaults, topic_hint
from drivers.ros2.topic_port import TopicChannel, absent_error
from drivers.ros2.types import MalformedMessage, types
from drivers.transport.link import SerialLink
from drivers.transport.loop import guard_callback
from drivers.transport.reconnect import LatchingPart, ReconnectTracker

RENEWAL_INTERVAL = 0.05
"""Seconds between two trajectories that are sent while joints move."""

MAX_TRACKING_ERROR = 0.2
"""Difference in radians between setpoint and measured position above which a new motion starts at the measured one."""


class TopicJoints(LatchingPart):
    """Joints of a robot with ROS 2: a ``drivers.api.Joints`` over a link to ``channels``.

    ``drivers.ros2.joint_topics.joint_channels`` makes the channels. The type of the subscriber selects the message: a
    JointTrajectory for the next ``drivers.ros2.joint_topics.TRAJECTORY_HORIZON``, or the current setpoints. Each
    message covers all joints, so joints whose controller gets no new message stop within this time. ROS 2 cannot switch
    the torque off: ``relax`` holds the joints, and reports that. If a joint moves away from its goal, the whole part
    stops and is latched.
    """

    def __init__(
        self,
        link: SerialLink,
        clock: Clock,
        channels: Sequence[TopicChannel],
        joints: Mapping[str, TopicJoint],
        *,
        name: str = "arm",
        away: ReconnectPolicy | None = None,
        report: StatusCallback = ignore,
    ) -> None:
        self.name = name
        self._link, self._clock, self._channels, self._joints = link, clock, list(channels), dict(joints)
        self._report = guard_callback(report)
        self._bounds, self._feedback = TopicJointLimits(name, self._joints, self._report), JointFeedback(self._joints)
        self._lock = RLock()  # guards all sending
        self._progress = {each: JointProgress(f"joint {qualified_joint_name(name, each)}") for each in joints}
        self._reconnect = ReconnectTracker(away)
        self._following = ActiveCouplings()
        self._faults = TopicFaults(name, [each.topic for each in channels], clock, self._report)
        self._finder = wire.TopicFrameFinder()
        self._remote_types: dict[int, str] = {}
        self._trajectories: dict[str, LinearTrajectory] = {}
        self._sent_at = -inf
        self._all_sent = True  # nothing left to send
        self._is_online = False
        self._unheld_joints: set[str] = set()
        self._counters: Counter[str] = Counter({"reports": 0, "malformed": 0})

    # --- what behaviours ask -----------------------------------------------------------------------------------------

    @property
    def limits(self) -> Mapping[str, JointLimits]:
        """Current limits by joint, in the order of the robot file."""
        return self._bounds.limits

    def restrict_limits(self, limits: Mapping[str, JointLimits]) -> Mapping[str, JointLimits]:
        """Restrict the limits of the named joints, from their next goals on; see ``drivers.api.Limitable``."""
        return self._bounds.restrict_limits(limits)

    def move(self, goals: Mapping[str, float], *, speeds: Mapping[str, float] | None = None) -> Mapping[str, float]:
        """Start moving the named joints to ``goals`` (radians); return the clamped goals.

        Raises BadRequest for an unknown joint or a value that is not finite, NotConnected, DeviceFault while latched or
        blocked.
        """
        check_move(self.name, goals, speeds or {}, self._joints)
        with self._lock:
            self._require_ready()
            now = self._clock.now()
            for joint, goal in goals.items():
                self._progress[joint].permit(goal, now)
            accepted = self._bounds.clamp_goals(goals, now)
            self._following.release(accepted)
            self._set_trajectories(accepted, speeds or {}, now)
            if accepted:
                self._send(now)
        return accepted

    def states(self) -> Mapping[str, Reading[JointState]]:
        """Return the newest state of each joint. Effort and temperature are not measured, and always 0."""
        now = self._clock.now()
        there = self._is_online and self._link.online
        return {
            name: self._feedback.reading(
                name, self._trajectories.get(name), now, online=there, blocked=progress.blocked
            )
            for name, progress in self._progress.items()
        }

    def hold(self, joints: Collection[str] | None = None) -> None:
        """Hold the named joints (None: all) at their current position. Raises BadRequest for an unknown joint."""
        names = list(self._joints) if joints is None else list(joints)
        check_names(self.name, set(names), self._joints)
        with self._lock:
            self._following.release(names)
            if not self._is_online:
                for name in names:
                    self._progress[name].hold(None)
                self._report_unheld(names)
                return
            now = self._clock.now()
            for name in names:
                self._hold_joint(name, now)
            if names:
                try:
                    self._send(now)
                except NotConnected:
                    self._report_unheld(names)

    def relax(self, joints: Collection[str] | None = None) -> None:
        """Hold the named joints (None: all), and report that ROS 2 cannot switch their torque off.

        Raises BadRequest for an unknown joint.
        """
        names = list(self._joints) if joints is None else list(joints)
        self.hold(names)
        if names:
            self._report(DeviceStatus(self.name, "fault", f"{', '.join(names)} {NO_TORQUE_OFF}", NO_TORQUE_OFF_HINT))

    def follow(self, couplings: Sequence[Coupling]) -> None:
        """Couple follower joints to leader joints, whose motion they copy; () ends all couplings.

        Raises BadRequest for invalid couplings, and NotConnected while offline unless ``couplings`` is empty.
        """
        check_couplings(self.name, couplings, self._joints)
        with self._lock:
            if couplings:
                self._require_ready()
            freed = self._following.followers_without(couplings)
            self._following = ActiveCouplings(couplings)
            self.hold(freed)

    def recover(self) -> tuple[str, ...]:
        """Release the latch. Raises NotConnected.

        Returns no joints: the result is for joints that had shut down, and ROS 2 does not report shutdowns.
        """
        self._require_online()
        self._reconnect.enable()
        return ()

    # --- life --------------------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Start connecting to the topics of the joints; returns at once."""
        self._reconnect.restart()
        self._link.open(self)

    def rest(self) -> None:
        """Hold all joints."""
        self.hold()

    def close(self) -> None:
        """Hold all joints, and disconnect. Safe from any state, more than once."""
        try:
            self.hold()
        finally:
            self._link.close()
            self._is_online = False
            self._unheld_joints.clear()

    def health(self) -> Health:
        """Return online if states of all joints arrive and the commands have a subscriber."""
        link, returned = self._link.health(), self._reconnect.reconnected_at
        counters = {**link.counters, **self._counters}
        if not link.online:
            return Health(False, link.detail, link.hint, counters, returned)
        if self._is_online:
            return Health(True, counters=counters, reconnected_at=returned)
        detail, hint = self._offline_reason(self._clock.now())
        return Health(False, detail, hint, counters, returned)

    # --- the link's thread: see drivers.transport.link.LinkHandler ----------------------------------------------------

    def on_connected(self) -> None:
        """Reset the state of the connection, since the port was just opened. Earlier trajectories are dropped."""
        with self._lock:
            self._finder = wire.TopicFrameFinder()
            self._remote_types.clear()
            self._is_online, self._all_sent = False, True
            self._link.write(wire.DISCOVERY_REQUEST)

    def on_data(self, data: bytes) -> None:
        """Handle received frames."""
        for channel, payload in self._finder.feed(data):
            try:
                if channel == wire.ABOUT_CHANNEL:
                    number, kinds = wire.parse_about(payload)
                    if not {*kinds} <= {*self._channels[number].kinds}:
                        raise ValueError(kinds)
                    self._remote_types[number] = next(iter(kinds), "")
                elif channel == wire.MISMATCH_CHANNEL:
                    self._faults.mismatch(payload)
                elif channel == 0 and self._feedback.update(types().decode(JOINT_STATE, payload), self._clock.now()):
                    self._counters["reports"] += 1
            except (MalformedMessage, ValueError, LookupError) as error:
                self._faults.add(channel, error)
        self._counters["malformed"] = self._faults.count

    def on_poll(self) -> None:
        """Detect disconnects and blocked joints, and send the setpoints that are due."""
        now = self._clock.now()
        with self._lock:
            hears = self._is_connected(now)
            if hears is not self._is_online:
                self._on_online(now) if hears else self._on_offline(now)
            if not hears:
                return
            self._reconnect.on_report(now)
            if self._following:
                self._update_followers(now)
            self._stop_blocked_joints(now)
            array = self._remote_types.get(1) != TRAJECTORY
            if not self._all_sent and (array or now - self._sent_at >= RENEWAL_INTERVAL):
                self._send(now)

    def on_closing(self) -> None:
        """Hold all joints if any is still on the way to its goal."""
        if not self._all_sent:
            self.hold()

    # --- the inside --------------------------------------------------------------------------------------------------

    def _is_connected(self, now: float) -> bool:
        return not self._feedback.silent_joints(now) and all(
            self._remote_types.get(number) for number in range(1, len(self._channels))
        )

    def _on_online(self, now: float) -> None:
        """Hold the commanded joints at their measured positions, since the part is online again."""
        self._is_online = True
        self._trajectories = {name: self._hold_trajectory(name, now) for name in self._trajectories}
        self._all_sent = True
        if self._reconnect.on_report(now):
            self._following = ActiveCouplings()
        self._following.mark_paused()
        if self._unheld_joints:
            self._trajectories |= {name: self._hold_trajectory(name, now) for name in self._unheld_joints}
            self._unheld_joints.clear()
            self._send(now)
        self._report(DeviceStatus(self.name, "online", f"{self._channels[0].topic}: all joints are online"))

    def _on_offline(self, now: float) -> None:
        """Report that the part is offline, and send nothing more.

        The joints still finish the last trajectories that they have received.
        """
        self._is_online, self._all_sent = False, True
        detail, hint = self._offline_reason(now)
        self._report(DeviceStatus(self.name, "offline", detail, hint))

    def _offline_reason(self, now: float) -> tuple[str, str]:
        for number, channel in enumerate(self._channels):
            if not self._remote_types.get(number) and (number or not self._counters["reports"]):
                error = absent_error(self.name, channel, self._faults.fault(number))
                return str(error), error.hint
        if why := self._faults.fault(0):
            return f"{self.name}: {why}", topic_hint(self._channels[0].topic)
        silent = ", ".join(self._joints[name].ros_name for name in self._feedback.silent_joints(now)) or "its joints"
        unread = (
            f"; not a number: {', '.join(sorted(self._feedback.unread_joints))}" if self._feedback.unread_joints else ""
        )
        what = f"{self.name}: {self._channels[0].topic}: no states of {silent}{unread}"
        return what, f"`mission ros2 echo {self._channels[0].topic}` shows its messages"

    def _require_online(self) -> None:
        if not self._is_online or not self._link.online:
            health = self.health()
            raise NotConnected(health.detail or f"{self.name}: not there yet", hint=health.hint)

    def _require_ready(self) -> None:
        self._require_online()
        self._reconnect.require_unlatched(self.name)

    def _set_trajectories(self, goals: Mapping[str, float], speeds: Mapping[str, float], now: float) -> None:
        for name, goal in goals.items():
            fastest, way = self._bounds.limits[name].speed, self._trajectories.get(name)
            start = self._feedback.position(name)
            if way is not None and abs(way.position(now) - start) < MAX_TRACKING_ERROR:
                start = way.position(now)
            speed = min(max(speeds.get(name, fastest), MIN_SPEED), fastest)
            self._trajectories[name] = LinearTrajectory(start, now, goal, speed)
            self._progress[name].command(goal, speed, now)

    def _stop_blocked_joints(self, now: float) -> None:
        """Hold each joint that is newly blocked, and report it. Stop the part if a joint moves away from its goal."""
        for name, progress in self._progress.items():
            if not (said := self._feedback.check_progress(name, progress)):
                continue
            if progress.runs_away:
                self._stop_for_runaway(said, now)
                continue
            self._report(DeviceStatus(self.name, "fault", said, f"{HINT}; is its controller running?"))
            if progress.blocked:
                self._following.release([name])
                self._trajectories[name], self._all_sent, self._sent_at = self._hold_trajectory(name, now), False, -inf

    def _stop_for_runaway(self, finding: str, now: float) -> None:
        """Latch the part, and hold all joints but the one that moves away from its goal.

        The goal of this joint is kept, because its controller may have a wrong sign, and a new goal could drive the
        joint further. No message can switch its motor off. ``finding`` is the message of the fault.
        """
        finding = f"{finding}: {RUNAWAY_NOTICE}"
        self._report(DeviceStatus(self.name, "fault", finding, RUNAWAY_HINT))
        self._reconnect.latch(finding, replace=True)
        self._following = ActiveCouplings()
        for name, progress in self._progress.items():
            if not progress.runs_away:
                self._hold_joint(name, now)
        self._all_sent, self._sent_at = False, -inf

    def _hold_trajectory(self, name: str, now: float) -> LinearTrajectory:
        here = self._feedback.position(name)
        return LinearTrajectory(here, now, here, MIN_SPEED)

    def _hold_joint(self, name: str, now: float) -> None:
        """Hold a joint: at its goal if the motion has ended there, else at its measured position."""
        way = self._trajectories.get(name)
        if way is None or way.remaining_time(now) > 0 or self._feedback.is_moving(name):
            way = self._trajectories[name] = self._hold_trajectory(name, now)
        self._progress[name].hold(way.goal)

    def _update_followers(self, now: float) -> None:
        positions = {name: self._feedback.position(name) for name in self._joints}
        goals = self._bounds.clamp_goals(self._following.goals(positions), now)
        self._set_trajectories(goals, self._following.speeds(goals, positions, now), now)
        self._all_sent = False

    def _send(self, now: float) -> None:
        """Send the next trajectory, or the current setpoints, of all joints. Raises NotConnected."""
        for name in self._joints:
            if name not in self._trajectories:
                self._trajectories[name] = self._hold_trajectory(name, now)
        self._sent_at = now
        kind, kinds = self._remote_types.get(1, ""), self._channels[1].kinds
        place = kinds.index(kind) if kind in kinds else 0
        self._link.write(command_frames(kind, self._joints, self._trajectories, now, place))
        self._all_sent = all(way.remaining_time(now) == 0.0 for way in self._trajectories.values())

    def _report_unheld(self, names: Collection[str]) -> None:
        """Report joints that could not be held while disconnected, each once; they are held after the reconnect.

        Nothing is reported before the first command.
        """
        missed = {name for name in names if name in self._feedback} - self._unheld_joints
        if missed and self._trajectories:
            self._unheld_joints |= missed
            what = f"could not be held: {', '.join(name for name in self._joints if name in missed)}"
            self._report(DeviceStatus(self.name, "fault", what, "switch its power off by hand, if it moves"))
