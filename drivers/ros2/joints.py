"""Joints of a robot of ROS 2: where they are by JointState, where they are to be by a topic of their controller."""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from math import inf
from threading import RLock

from drivers.api import Away, Coupling, DeviceStatus, Health, JointLimits, JointState, Reading, Report, ignore
from drivers.api.joints import Following, joint_called
from drivers.clock import Clock
from drivers.errors import NotConnected
from drivers.joints.progress import HINT, JointProgress
from drivers.joints.refusals import check_couplings, check_move, check_names
from drivers.ros2 import wire
from drivers.ros2.line import Channel, absent
from drivers.ros2.node import TopicFaults, hint_for
from drivers.ros2.types import Malformed, types
from drivers.ros2.ways import (
    LIMP,
    RUNAWAY,
    RUNAWAY_HINT,
    SLOWEST,
    STATE,
    STIFF,
    TRAJECTORY,
    Bounds,
    Felt,
    TopicJoint,
    Way,
    frames,
)
from drivers.transport.link import Link
from drivers.transport.loop import guarded
from drivers.transport.reconnect import Absence, Enabling

RENEWAL = 0.05
"""Seconds between two legs of a way."""

STRAYED = 0.2
"""Radians from where it is to be from which on a joint is sent on from where it is instead."""


class TopicJoints(Enabling):
    """A ``drivers.api.Joints`` over a link to ``channels``; see ``channels_of``.

    The type of who listens says what is sent: a JointTrajectory with the next ``LEG`` of the way, or where each is to
    be now. Either way all joints are told of, and who hears no more stands within ``LEG``. ROS 2 has no word for
    torque: they are always stiff, and ``relax`` lets them stand where they are, with a notice. A joint that runs away
    stops the whole arm until it is enabled.
    """

    def __init__(
        self,
        link: Link,
        clock: Clock,
        channels: Sequence[Channel],
        joints: Mapping[str, TopicJoint],
        *,
        name: str = "arm",
        away: Away | None = None,
        report: Report = ignore,
    ) -> None:
        self.name = name
        self._link, self._clock, self._channels, self._joints = link, clock, list(channels), dict(joints)
        self._report = guarded(report)
        self._bounds, self._felt = Bounds(name, self._joints, self._report), Felt(self._joints)
        self._lock = RLock()  # over what is sent, whoever sends it
        self._progress = {each: JointProgress(f"joint {joint_called(name, each)}") for each in joints}
        self._absence = Absence(away)
        self._following = Following()
        self._faults = TopicFaults(name, [each.topic for each in channels], clock, self._report)
        self._finder = wire.FrameFinder()
        self._kinds: dict[int, str] = {}
        self._ways: dict[str, Way] = {}
        self._sent_at = -inf
        self._settled = True  # nothing is left to be sent
        self._there = False
        self._unheld: set[str] = set()
        self._counters: Counter[str] = Counter({"reports": 0, "malformed": 0})

    # --- what behaviours ask -----------------------------------------------------------------------------------------

    @property
    def limits(self) -> Mapping[str, JointLimits]:
        """The joints by name, in the order of the robot file."""
        return self._bounds.limits

    def curb(self, limits: Mapping[str, JointLimits]) -> Mapping[str, JointLimits]:
        """See ``drivers.api.Curbed``: of the named joints, from the next goal of each on."""
        return self._bounds.curb(limits)

    def move(self, goals: Mapping[str, float], *, speeds: Mapping[str, float] | None = None) -> Mapping[str, float]:
        """Start moving the named joints to ``goals`` (radians); return the goals after clamping.

        Raises BadRequest for an unknown joint or a value that is not finite, NotConnected, DeviceFault while latched or
        blocked.
        """
        check_move(self.name, goals, speeds or {}, self._joints)
        with self._lock:
            self._require()
            now = self._clock.now()
            for joint, goal in goals.items():
                self._progress[joint].permit(goal, now)
            accepted = self._bounds.accept(goals, now)
            self._following.end(accepted)
            self._go(accepted, speeds or {}, now)
            if accepted:
                self._send(now)
        return accepted

    def states(self) -> Mapping[str, Reading[JointState]]:
        """The newest state of each joint; effort and temperature are not known, and told as 0."""
        now = self._clock.now()
        there = self._there and self._link.online
        return {
            name: self._felt.reading(name, self._ways.get(name), now, there=there, blocked=progress.blocked)
            for name, progress in self._progress.items()
        }

    def hold(self, joints: Collection[str] | None = None) -> None:
        """Let the named joints (None: all) stand where they are now. Raises BadRequest for an unknown joint."""
        names = list(self._joints) if joints is None else list(joints)
        check_names(self.name, set(names), self._joints)
        with self._lock:
            self._following.end(names)
            if not self._there:
                for name in names:
                    self._progress[name].hold(None)
                self._miss(names)
                return
            now = self._clock.now()
            for name in names:
                self._stand(name, now)
            if names:
                try:
                    self._send(now)
                except NotConnected:
                    self._miss(names)

    def relax(self, joints: Collection[str] | None = None) -> None:
        """Let the named joints stand where they are, and tell that ROS 2 cannot make them limp. Safe as ``hold``."""
        names = list(self._joints) if joints is None else list(joints)
        self.hold(names)
        if names:
            self._report(DeviceStatus(self.name, "fault", f"{', '.join(names)} {STIFF}", LIMP))

    def follow(self, couplings: Sequence[Coupling]) -> None:
        """Let joints follow others from now on; () ends it. Raises BadRequest, and NotConnected, but not to end it."""
        check_couplings(self.name, couplings, self._joints)
        with self._lock:
            if couplings:
                self._require()
            freed = self._following.freed_by(couplings)
            self._following = Following(couplings)
            self.hold(freed)

    def recover(self) -> tuple[str, ...]:
        """Enable it: no joint is known to have shut down. Raises NotConnected."""
        self._require_there()
        self._absence.enable()
        return ()

    # --- life --------------------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Start looking for its topics; returns at once."""
        self._absence.begin()
        self._link.open(self)

    def rest(self) -> None:
        """Stand where it is."""
        self.hold()

    def close(self) -> None:
        """Stand where it is, and listen no more. Safe from any state, more than once."""
        try:
            self.hold()
        finally:
            self._link.close()
            self._there = False
            self._unheld.clear()

    def health(self) -> Health:
        """Say whether states of all joints come, and whether somebody listens."""
        link, returned = self._link.health(), self._absence.returned
        counters = {**link.counters, **self._counters}
        if not link.online:
            return Health(False, link.detail, link.hint, counters, returned)
        if self._there:
            return Health(True, counters=counters, returned=returned)
        detail, hint = self._silence(self._clock.now())
        return Health(False, detail, hint, counters, returned)

    # --- the link's thread: see drivers.transport.link.Talker --------------------------------------------------------

    def connected(self) -> None:
        """Begin anew: nothing of before is in force."""
        with self._lock:
            self._finder = wire.FrameFinder()
            self._kinds.clear()
            self._there, self._settled = False, True
            self._link.write(wire.ASK)

    def received(self, data: bytes) -> None:
        """Take what has come."""
        for channel, payload in self._finder.feed(data):
            try:
                if channel == wire.ABOUT:
                    number, kinds = wire.told(payload)
                    if not {*kinds} <= {*self._channels[number].kinds}:
                        raise ValueError(kinds)
                    self._kinds[number] = next(iter(kinds), "")
                elif channel == wire.MISMATCH:
                    self._faults.mismatch(payload)
                elif channel == 0 and self._felt.take(types().decode(STATE, payload), self._clock.now()):
                    self._counters["reports"] += 1
            except (Malformed, ValueError, LookupError) as error:
                self._faults.add(channel, error)
        self._counters["malformed"] = self._faults.count

    def pulse(self) -> None:
        """Lead the joints on, and notice silence."""
        now = self._clock.now()
        with self._lock:
            hears = self._hears(now)
            if hears is not self._there:
                self._appear(now) if hears else self._lose(now)
            if not hears:
                return
            self._absence.heard(now)
            if self._following:
                self._lead(now)
            self._give_up(now)
            array = self._kinds.get(1) != TRAJECTORY
            if not self._settled and (array or now - self._sent_at >= RENEWAL):
                self._send(now)

    def ending(self) -> None:
        """Let it stand."""
        if not self._settled:
            self.hold()

    # --- the inside --------------------------------------------------------------------------------------------------

    def _hears(self, now: float) -> bool:
        return not self._felt.silent(now) and all(self._kinds.get(number) for number in range(1, len(self._channels)))

    def _appear(self, now: float) -> None:
        """Begin with joints that stand where they are."""
        self._there = True
        self._ways = {name: self._still(name, now) for name in self._ways}
        self._settled = True
        if self._absence.heard(now):
            self._following = Following()
        self._following.pause()
        if self._unheld:
            self._ways |= {name: self._still(name, now) for name in self._unheld}
            self._unheld.clear()
            self._send(now)
        self._report(DeviceStatus(self.name, "online", f"{self._channels[0].topic}: all its joints are there"))

    def _lose(self, now: float) -> None:
        """Send nothing any farther: each ends the leg that it was sent."""
        self._there, self._settled = False, True
        detail, hint = self._silence(now)
        self._report(DeviceStatus(self.name, "offline", detail, hint))

    def _silence(self, now: float) -> tuple[str, str]:
        for number, channel in enumerate(self._channels):
            if not self._kinds.get(number) and (number or not self._counters["reports"]):
                error = absent(self.name, channel, self._faults.why(number))
                return str(error), error.hint
        if why := self._faults.why(0):
            return f"{self.name}: {why}", hint_for(self._channels[0].topic)
        silent = ", ".join(self._joints[name].there for name in self._felt.silent(now)) or "its joints"
        unread = f"; not a number: {', '.join(sorted(self._felt.unread))}" if self._felt.unread else ""
        what = f"{self.name}: {self._channels[0].topic}: nothing comes of {silent}{unread}"
        return what, f"`mission ros2 echo {self._channels[0].topic}` shows what comes"

    def _require_there(self) -> None:
        if not self._there or not self._link.online:
            health = self.health()
            raise NotConnected(health.detail or f"{self.name}: not there yet", hint=health.hint)

    def _require(self) -> None:
        self._require_there()
        self._absence.require(self.name)

    def _go(self, goals: Mapping[str, float], speeds: Mapping[str, float], now: float) -> None:
        for name, goal in goals.items():
            fastest, way = self._bounds.limits[name].speed, self._ways.get(name)
            start = self._felt.position(name)
            if way is not None and abs(way.position(now) - start) < STRAYED:
                start = way.position(now)
            speed = min(max(speeds.get(name, fastest), SLOWEST), fastest)
            self._ways[name] = Way(start, now, goal, speed)
            self._progress[name].command(goal, speed, now)

    def _give_up(self, now: float) -> None:
        """Let the joints stand where they are that do not get where they are sent."""
        for name, progress in self._progress.items():
            if not (said := self._felt.look(name, progress)):
                continue
            if progress.runs_away:
                self._stop_for_runaway(said, now)
                continue
            self._report(DeviceStatus(self.name, "fault", said, f"{HINT}; is its controller running?"))
            if progress.blocked:
                self._following.end([name])
                self._ways[name], self._settled, self._sent_at = self._still(name, now), False, -inf

    def _stop_for_runaway(self, said: str, now: float) -> None:
        """Latch, and let the other joints stand; the goal of one that runs away stays, as a new one could drive it on.

        Its controller may have a wrong sign, and there is no message that switches its motor off.
        """
        said = f"{said}: {RUNAWAY}"
        self._report(DeviceStatus(self.name, "fault", said, RUNAWAY_HINT))
        self._absence.latch(said, graver=True)
        self._following = Following()
        for name, progress in self._progress.items():
            if not progress.runs_away:
                self._stand(name, now)
        self._settled, self._sent_at = False, -inf

    def _still(self, name: str, now: float) -> Way:
        here = self._felt.position(name)
        return Way(here, now, here, SLOWEST)

    def _stand(self, name: str, now: float) -> None:
        """Let a joint stand: at its goal if it is there, else where it is."""
        way = self._ways.get(name)
        if way is None or way.left(now) > 0 or self._felt.moves(name):
            way = self._ways[name] = self._still(name, now)
        self._progress[name].hold(way.goal)

    def _lead(self, now: float) -> None:
        """Send every follower where it belongs now."""
        positions = {name: self._felt.position(name) for name in self._joints}
        goals = self._bounds.accept(self._following.goals(positions), now)
        self._go(goals, self._following.speeds(goals, positions, now), now)
        self._settled = False

    def _send(self, now: float) -> None:
        """Send all joints the next leg, or where they are to be now. Raises NotConnected."""
        for name in self._joints:
            if name not in self._ways:
                self._ways[name] = self._still(name, now)
        self._sent_at = now
        kind, kinds = self._kinds.get(1, ""), self._channels[1].kinds
        place = kinds.index(kind) if kind in kinds else 0
        self._link.write(frames(kind, self._joints, self._ways, now, place))
        self._settled = all(way.left(now) == 0.0 for way in self._ways.values())

    def _miss(self, names: Collection[str]) -> None:
        """Tell, once, what could not be held; it is held when it is back. What was never there was never moved."""
        missed = {name for name in names if name in self._felt} - self._unheld
        if missed and self._ways:
            self._unheld |= missed
            what = f"could not be held: {', '.join(name for name in self._joints if name in missed)}"
            self._report(DeviceStatus(self.name, "fault", what, "switch its power off by hand, if it moves"))
