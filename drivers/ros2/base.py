"""Protocol of a base on ROS 2 topics: commands as Twist or TwistStamped, pose from Odometry."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from math import atan2, cos, inf, isfinite, remainder, sin, tau
from typing import Any

from drivers.api import BaseLimits, BaseState, DeviceStatus, Lamp, Pose2D, Sides, Tune, Velocity
from drivers.api.fast_dataclass import dataclass
from drivers.base import motion_fault
from drivers.base.diff_drive import DiffDriveProtocol, DiffDriveTiming, ParsedReports
from drivers.base.gyro_bias import GyroBias
from drivers.base.progress_monitor import REACTION_TIME, SentVelocities
from drivers.clock import Clock
from drivers.ros2 import wire
from drivers.ros2.node import TopicFaults, topic_hint
from drivers.ros2.topic_port import TopicChannel, absent_error
from drivers.ros2.types import MalformedMessage, types

# Further topics of a Create 3 (TurtleBot 4) and a TurtleBot 3: contacts, docks, lights, sounds.

BACKUP_LIMIT, BUMP, CLIFF, STALL, WHEEL_DROP, OBJECT_PROXIMITY = range(6)
"""Types of hazards, as irobot_create_msgs numbers them."""

_HAZARD_NAMES = {
    BACKUP_LIMIT: motion_fault.BACKUP_LIMIT,
    STALL: motion_fault.STALL,
    OBJECT_PROXIMITY: motion_fault.OBJECT_NEAR,
}
"""Names of the hazards that are not contacts, by their type in ``irobot_create_msgs``."""

COLOURS = {Lamp.OFF: (0, 0, 0), Lamp.RED: (255, 0, 0), Lamp.GREEN: (0, 255, 0), Lamp.ORANGE: (255, 120, 0)}
"""RGB values of the light ring for each colour."""

TUNES: dict[Tune, tuple[int, ...]] = {
    Tune.ON: (523, 659, 784),
    Tune.OFF: (784, 659, 523),
    Tune.RECHARGE: (440, 523),
    Tune.BUTTON: (880,),
    Tune.ERROR: (220, 220),
    Tune.CLEANING_START: (523, 784),
    Tune.CLEANING_END: (784, 523),
}
"""Tunes as tones in hertz, each a fifth of a second long."""


@dataclass(frozen=True, slots=True)
class HazardReport:
    """Contacts of a base (bumper, cliff, wheel drop), and the names of its other hazards, as in ``BaseState``."""

    bumper: Sides = Sides()
    cliff: Sides = Sides()
    wheel_drop: Sides = Sides()
    others: frozenset[str] = frozenset()

    def __or__(self, other: "HazardReport") -> "HazardReport":
        """Return the hazards of both reports."""
        return HazardReport(
            _either(self.bumper, other.bumper),
            _either(self.cliff, other.cliff),
            _either(self.wheel_drop, other.wheel_drop),
            self.others | other.others,
        )


def parse_hazards(detections: Iterable[Any]) -> HazardReport:
    """Return the contacts and hazards in a Create 3's hazard detections.

    The ``frame_id`` of a detection tells the side, such as ``bump_left``.
    """
    found: dict[int, set[str]] = {BUMP: set(), CLIFF: set(), WHEEL_DROP: set()}
    others = set()
    for each in detections:
        frame = each.header.frame_id.rpartition("/")[2]  # before it: the robot's name
        if each.type not in found:
            others.add(_hazard_name(each.type, frame))
            continue
        centre = "center" in frame or ("left" not in frame and "right" not in frame)
        found[each.type].add("centre" if centre else "left" if "left" in frame else "right")
    bumper, cliff, drop = (Sides("left" in it, "centre" in it, "right" in it) for it in found.values())
    if cliff and not cliff.centre and cliff.left and cliff.right:
        cliff = Sides(centre=True)  # there is no sensor in the middle: left and right mean both
    return HazardReport(bumper, cliff, drop, frozenset(others))


def _hazard_name(kind: int, frame: str) -> str:
    """Return the name of a hazard that is not a contact; for an unknown type, the name has the number ``kind``."""
    if kind not in _HAZARD_NAMES:
        return f"{motion_fault.UNKNOWN} {kind}" + (f" ({frame:.40})" if frame else "")
    side = "" if kind == BACKUP_LIMIT else next((side for side in ("left", "right") if side in frame), "")
    return f"{_HAZARD_NAMES[kind]} {side}".rstrip()


def _either(one: Sides, other: Sides) -> Sides:
    return Sides(one.left or other.left, one.centre or other.centre, one.right or other.right)


def light_ring_message(first: Lamp, second: Lamp) -> dict[str, object]:
    """Return the message for the light ring: the left half is light 1, the right half light 2."""
    leds = [dict(zip(("red", "green", "blue"), COLOURS[each], strict=True)) for each in (first, second)]
    shown = [leds[0]] * 3 + [leds[1]] * 3
    return {"leds": shown, "override_system": (first, second) != (Lamp.OFF, Lamp.OFF)}


def note_message(tones: Iterable[int], seconds: float) -> dict[str, object]:
    """Return the message for the sounder: tones (Hz), each ``seconds`` long."""
    runtime = {"sec": int(seconds), "nanosec": round(seconds % 1 * 1e9)}
    return {"notes": [{"frequency": each, "max_runtime": runtime} for each in tones]}


TWISTS = ("geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped")
ODOMETRY = "nav_msgs/msg/Odometry"

TOPIC_TYPES: Mapping[str, tuple[str, ...]] = {
    "cmd_vel": TWISTS,
    "odom": (ODOMETRY,),
    "battery": ("sensor_msgs/msg/BatteryState",),
    "hazards": ("irobot_create_msgs/msg/HazardDetectionVector",),
    "dock": ("irobot_create_msgs/msg/DockStatus",),
    "lights": ("irobot_create_msgs/msg/LightringLeds",),
    "sounds": ("irobot_create_msgs/msg/AudioNoteVector",),
    "sensors": ("turtlebot3_msgs/msg/SensorState",),
}
"""Possible ROS 2 types of the topics of a base, by the key of the topic in the ``base`` section."""

COMMAND_TOPICS = frozenset({"cmd_vel", "lights", "sounds"})
"""Keys of the topics on which commands are sent to the base."""

CONTACTS_TIMEOUT = 1.0
"""Seconds without a contact report after which a base with contact sensors is offline."""

MAX_POSITION_JUMP = 0.3
"""Tolerance in metres of the change of the reported position between two odometry messages.

A change above the sum of this tolerance and the distance that the base can drive meanwhile shows that the odometry was
reset. The pose is then continued from the last one.
"""

MAX_HEADING_JUMP = 0.5
"""Tolerance in radians of the change of the reported heading between two odometry messages.

A change above the sum of this tolerance and the angle that the base can turn meanwhile shows that the odometry was
reset.
"""

MAX_PLAUSIBLE_VALUE = 1e6
"""Limit of plausible odometry, in metres, m/s and rad/s."""

MIN_PERCENT_VALUE = 1.1
"""Battery percentage above which it is taken for percent (0 to 100); ROS 2 defines it as a share (0 to 1).

Shares may slightly exceed 1.
"""

MAX_ODOMETRY_INTERVAL, MIN_ODOMETRY_INTERVAL = 0.4, 0.005
"""Seconds between two messages of the slowest supported odometry, and of messages that arrived together."""

STILL_TOLERANCE = 0.002
"""Speed in m/s, or metres between two messages, below which a base counts as at rest."""

REPORTED_DRIFT = 0.01
"""Drift in radians removed from the heading after which the origin of the pose is passed on again, for goals of Nav2.

The origin is the pose in the robot's odometry frame at which MissionTree's pose is 0. It turns when drift is removed.
"""

STATUS_CHARGING = 1
"""Value of ``power_supply_status`` of a charging battery in sensor_msgs."""


class Ros2BaseProtocol(DiffDriveProtocol):
    """Protocol of a base over the ROS 2 topics in ``channels``; ``name`` is the part.

    ``roles`` are the keys of the channels in ``TOPIC_TYPES``. The pose starts at 0 with the first report, and stays
    continuous when the odometry is reset or the base reconnects. Nothing is sent at rest, so that other nodes, such as
    Nav2, can drive the robot. A motion faster than ``limits`` shows that the odometry was reset. ``on_origin`` is
    called with the origin of the pose in the odometry frame, and the name of that frame. ``is_goal_active`` returns
    True if a goal of another node may move the robot now.
    """

    def __init__(
        self,
        name: str,
        clock: Clock,
        channels: Sequence[TopicChannel],
        roles: Sequence[str],
        limits: BaseLimits,
        *,
        on_origin: Callable[[Pose2D, str], None] = lambda pose, frame: None,  # noqa: ARG005
        is_goal_active: Callable[[], bool] = lambda: False,
    ) -> None:
        self.sounds = self if "sounds" in roles else None
        self.lights = self if "lights" in roles else None
        self._name, self._channels, self._roles, self._limits = name, channels, list(roles), limits
        self._on_origin, self._is_goal_active = on_origin, is_goal_active
        self._new_faults: list[DeviceStatus] = []  # faults of topics, since the last ``parse``
        self._faults = TopicFaults(name, [each.topic for each in channels], clock, self._new_faults.append)
        # Commands from before a moment ago may still move the base.
        self._sent_velocities = SentVelocities(REACTION_TIME)
        self._hazards = self._hazards_since_report = HazardReport()  # now; and since the last odometry
        self._contacts_at = -inf
        self._battery = (0.0, 100.0, False)
        self._is_docked = self._is_percent = False
        self._lamps = {1: Lamp.OFF, 2: Lamp.OFF}
        self._pose = Pose2D(0.0, 0.0, 0.0)
        self._reports = 0
        self.restart()

    def restart(self) -> None:
        self._finder = wire.TopicFrameFinder()
        self._remote_types: dict[str, tuple[str, ...]] = {}
        # The same pose in the odometry frame and in ours.
        self._origin: tuple[Pose2D, Pose2D] | None = None
        self._last_odometry: tuple[Pose2D, float] | None = None
        # The odometry from which the drift is computed next, its arrival, and its stamp by the robot's clock.
        self._drift_reference: tuple[Pose2D, float, float] | None = None
        self._bias = GyroBias(encoders=False)  # the robot may have been switched off and on
        self._unreported_drift = 0.0  # radians of drift since the origin was last reported
        self._set_interval(MAX_ODOMETRY_INTERVAL)

    def greet(self) -> bytes:
        return wire.DISCOVERY_REQUEST

    def parse(self, data: bytes, now: float) -> ParsedReports:
        parsed = ParsedReports()
        for channel, payload in self._finder.feed(data):
            try:
                if channel == wire.ABOUT_CHANNEL:
                    number, kinds = wire.parse_about(payload)
                    word = self._roles[number]
                    if not {*kinds} <= {*TOPIC_TYPES[word]}:
                        raise ValueError(kinds)
                    self._remote_types[word] = kinds
                elif channel == wire.MISMATCH_CHANNEL:
                    self._faults.mismatch(payload)
                else:
                    self._handle_message(self._roles[channel], payload, now, parsed)
            except (MalformedMessage, ValueError, LookupError, ArithmeticError) as error:
                self._faults.add(channel, error)
        parsed.faults += [(each.message, each.hint) for each in self._new_faults]
        self._new_faults.clear()
        return parsed

    def drive(self, velocity: Velocity, now: float) -> bytes:
        self._sent_velocities.add(now, velocity)
        twist = {"linear": {"x": velocity.linear}, "angular": {"z": velocity.angular}}
        # Stamp 0 means now to controllers: two clocks may differ by more than they tolerate.
        stamped: dict[str, object] = {"header": {"frame_id": "base_link"}, "twist": twist}
        command = b""
        for kind in self._remote_types.get("cmd_vel", ()):  # all subscribers: any of them may drive the robot
            place = self._channels[0].kinds.index(kind)
            command += wire.frame(0, types().encode(kind, twist if kind == TWISTS[0] else stamped), place)
        return command

    def play(self, tune: Tune) -> bytes:
        return self._encode("sounds", note_message(TUNES[tune], 0.2))

    def tone(self, frequency: float, seconds: float) -> bytes:
        return self._encode("sounds", note_message([round(frequency)], seconds))

    def light(self, number: int, colour: Lamp) -> bytes:
        self._lamps[number] = colour
        return self._encode("lights", light_ring_message(self._lamps[1], self._lamps[2]))

    def is_ready(self, now: float) -> bool:
        feels = (
            not (self._has_role("hazards") or self._has_role("sensors")) or now - self._contacts_at <= CONTACTS_TIMEOUT
        )
        return bool(self._remote_types.get("cmd_vel")) and feels

    def counters(self) -> Mapping[str, int]:
        return {"reports": self._reports, "malformed": self._faults.count}

    def offline_reason(self, now: float, where: str, baud: int, *, silent: bool) -> tuple[str, str]:
        del where, baud, silent
        for word in ("odom", "cmd_vel", "hazards", "sensors"):
            if self._has_role(word) and not self._remote_types.get(word):
                number = self._roles.index(word)
                error = absent_error(self._name, self._channels[number], self._faults.fault(number))
                return str(error), error.hint
        odometry = self._channels[1].topic
        if self._has_two_publishers:
            what = f"{self._name}: two publishers on {odometry}: odometry ignored"
            return what, "`mission ros2 graph` shows them; two robots need a namespace each"
        for number in (self._roles.index(word) for word in ("odom", "hazards", "sensors") if self._has_role(word)):
            if why := self._faults.fault(number):
                return f"{self._name}: {why}", topic_hint(self._channels[number].topic)
        if self._last_odometry is not None and now - self._last_odometry[1] <= self.timing.offline_after:
            return f"{self._name}: no reports of its bumpers", "is its node still running? `mission ros2 graph`"
        return f"{self._name}: {odometry}: no odometry received", "is the robot on, and the network there?"

    # --- the inside ---------------------------------------------------------------------------------------------------

    def _has_role(self, role: str) -> bool:
        return role in self._roles

    def _set_interval(self, seconds: float) -> None:
        """Adapt the timeouts to the interval of the odometry."""
        self._interval, usual = seconds, DiffDriveTiming()
        self.timing = DiffDriveTiming(
            stale_after=max(usual.stale_after, 1.5 * seconds),
            offline_after=max(usual.offline_after, 2.5 * seconds),
            idle_interval=inf,
        )

    def _encode(self, role: str, values: Mapping[str, object]) -> bytes:
        return wire.frame(self._roles.index(role), types().encode(TOPIC_TYPES[role][0], values))

    def _handle_message(self, role: str, payload: bytes, now: float, parsed: ParsedReports) -> None:
        told = types().decode(TOPIC_TYPES[role][0], payload)
        match role:
            case "odom" if not self._has_two_publishers:
                parsed.states.append(self._odometry(told, now))
            case "hazards":
                self._on_hazards(parse_hazards(told.detections), now)
            case "sensors":
                # A TurtleBot 3's cliff is a raw number of a sensor that few have: use its bumper only.
                self._on_hazards(HazardReport(Sides(centre=told.bumper != 0)), now)
            case "dock":
                self._is_docked = bool(told.is_docked)
            case "battery":
                self._battery = self._parse_battery(told)

    @property
    def _has_two_publishers(self) -> bool:
        """True if several nodes publish odometry, such as two robots of the same name; then the odometry is ignored."""
        return len(self._remote_types.get("odom", ())) > 1

    def _parse_battery(self, message: Any) -> tuple[float, float, bool]:
        """Return voltage, percentage, and whether the battery charges.

        Values that were not measured are 0 V and 100 %.
        """
        share, volts = float(message.percentage), float(message.voltage)
        self._is_percent = self._is_percent or MIN_PERCENT_VALUE < share < inf
        measured = isfinite(share) and (share > 0 or (share == 0 and message.present))
        percent = min(share if self._is_percent else 100 * share, 100.0) if measured else 100.0
        return volts if isfinite(volts) else 0.0, percent, message.power_supply_status == STATUS_CHARGING

    def _on_hazards(self, hazards: HazardReport, now: float) -> None:
        self._hazards, self._contacts_at = hazards, now
        self._hazards_since_report |= hazards

    def _odometry(self, message: Any, now: float) -> BaseState:
        """Return the state after an odometry message. Raises ValueError for implausible values."""
        at, turned, moves = message.pose.pose.position, message.pose.pose.orientation, message.twist.twist
        figures = {
            "position x": at.x, "position y": at.y, "orientation x": turned.x, "orientation y": turned.y,
            "orientation z": turned.z, "orientation w": turned.w, "linear x": moves.linear.x,
            "angular z": moves.angular.z,
        }  # fmt: skip
        for name, figure in figures.items():
            if not abs(figure) < MAX_PLAUSIBLE_VALUE:  # NaN, too
                raise ValueError(f"its {name} is {figure:g}, in {ODOMETRY}")
        raw = Pose2D(at.x, at.y, yaw(turned))
        pose, rate = self._correct_drift(raw, Velocity(moves.linear.x, moves.angular.z), now, message.header)
        felt, self._hazards_since_report = self._hazards_since_report, self._hazards
        volts, percent, charging = self._battery
        velocity = Velocity(moves.linear.x, rate)
        self._pose = pose
        self._reports += 1
        return BaseState(
            pose, velocity, felt.bumper, felt.cliff, felt.wheel_drop, hazards=felt.others,
            battery_voltage=volts, battery_percent=percent, charging=charging, docked=self._is_docked,
            settling=self._bias.settling,
        )  # fmt: skip

    def _correct_drift(self, raw: Pose2D, moves: Velocity, now: float, header: Any) -> tuple[Pose2D, float]:
        """Return the continuous pose and the turn rate for a pose ``raw`` of the odometry, without the gyro's drift.

        ``moves`` is the reported velocity. The drift is learnt while the base is at rest.
        """
        before, frame = self._drift_reference, header.frame_id.lstrip("/")  # tf refuses a leading slash
        stamp = header.stamp.sec + header.stamp.nanosec * 1e-9
        pose = self._to_continuous_pose(raw, now, frame)
        if before is None:
            self._drift_reference = raw, now, stamp
            return pose, moves.angular - self._bias.rate
        was, seconds, stamped = before[0], now - before[1], stamp - before[2]
        if seconds >= MIN_ODOMETRY_INTERVAL:
            self._set_interval(min(max(seconds, 0.9 * self._interval), MAX_ODOMETRY_INTERVAL))
        if MIN_ODOMETRY_INTERVAL <= stamped <= MAX_ODOMETRY_INTERVAL:  # a network may deliver several messages at once
            seconds = stamped
        if seconds < MIN_ODOMETRY_INTERVAL:
            return pose, moves.angular - self._bias.rate
        self._drift_reference = raw, now, stamp
        turn = remainder(raw.heading - was.heading, tau)
        rolled = max(abs(moves.linear), abs(raw.x - was.x), abs(raw.y - was.y))
        self._sent_velocities.lag = REACTION_TIME + self._interval
        self._sent_velocities.bounds(now)
        still = rolled < STILL_TOLERANCE and self._sent_velocities.standing and not self._is_goal_active()
        left, rate = self._bias.correct(turn, moves.angular, seconds, still=still)
        if left == turn:
            return pose, rate
        self._unreported_drift += turn - left
        pose = replace(pose, heading=pose.heading - (turn - left))
        self._origin = raw, pose
        if abs(self._unreported_drift) > REPORTED_DRIFT:
            self._unreported_drift = 0.0
            self._on_origin(_origin_in_odometry(raw, pose), frame)
        return pose, rate

    def _to_continuous_pose(self, raw: Pose2D, now: float, frame: str) -> Pose2D:
        """Return the continuous pose for the pose ``raw`` in the odometry frame, which may have been reset."""
        here = self._pose
        if self._last_odometry is not None:
            was, at = self._last_odometry
            past = max(now - at, 0.0)
            reach, turned = (
                MAX_POSITION_JUMP + 2 * self._limits.speed * past,
                MAX_HEADING_JUMP + 2 * self._limits.turn * past,
            )
            off = abs(remainder(raw.heading - was.heading, tau))
            if (raw.x - was.x) ** 2 + (raw.y - was.y) ** 2 > reach**2 or off > turned:
                self._origin = None
        if self._origin is None:
            self._origin = raw, here
            self._on_origin(_origin_in_odometry(raw, here), frame)
        self._last_odometry = raw, now
        (ox, oy, oh), pose = (self._origin[0].x, self._origin[0].y, self._origin[0].heading), self._origin[1]
        turn = pose.heading - oh
        dx, dy = raw.x - ox, raw.y - oy
        x, y = pose.x + dx * cos(turn) - dy * sin(turn), pose.y + dx * sin(turn) + dy * cos(turn)
        heading = raw.heading + turn
        return Pose2D(x, y, heading + tau * round((here.heading - heading) / tau))


def _origin_in_odometry(raw: Pose2D, here: Pose2D) -> Pose2D:
    """Return where the origin of the continuous pose lies in the odometry frame.

    The continuous pose is the pose of the base without the jumps of an odometry that is reset. ``raw`` is the present
    pose of the base in the odometry frame, ``here`` the same pose as continuous pose.
    """
    turn = raw.heading - here.heading
    x = raw.x - (here.x * cos(turn) - here.y * sin(turn))
    return Pose2D(x, raw.y - (here.x * sin(turn) + here.y * cos(turn)), turn)


def yaw(orientation: Any) -> float:
    """Return the heading in radians of a quaternion, which need not have length 1.

    Raises ValueError for length 0: it was never set.
    """
    x, y, z, w = orientation.x, orientation.y, orientation.z, orientation.w
    if not x * x + y * y + z * z + w * w > 1e-6:
        raise ValueError("its orientation has the length 0")
    return atan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z)
