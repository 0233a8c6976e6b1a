"""The state of the robot over time, to plot and to look at, from what its parts have answered.

The answers are all in the moments already, exactly; these are for people. So they are fewer: ``PERIOD`` seconds apart
at least, and ``UNCHANGED`` seconds while a part only says again what it said.
"""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from drivers.api import COMMAND_LIFE, STILL, BaseState, HeadPose, JointState, RangeScan, Reading, Velocity
from drivers.api.joints import joint_called
from missions.executive.tick_record import TickRecord
from missions.records.recording import foxglove
from missions.records.recording.codec import number, to_json
from missions.records.recording.foxglove import Epoch, Json
from perception.api import Gaze

PERIOD = 0.1
"""Seconds between two figures of one part, at least."""

TF_PERIOD = 0.05
"""Seconds between two places of a frame, at least."""


UNCHANGED = 0.5
"""Seconds between two of them that say the same, at least."""


class Figure(NamedTuple):
    """A message to be: on which topic, when, and what it says."""

    topic: str
    t: float
    data: Json


class Figures:
    """Follows the parts of one robot. ``eye`` is where its camera sits (m)."""

    def __init__(self, epoch: Epoch, eye: tuple[float, float, float]) -> None:
        self._epoch = epoch
        self._eye = eye
        self._told: dict[str, float] = {}  # by topic and frame, when it was told last
        self._stamps: dict[str, float] = {}  # and of when that was
        self._values: dict[str, object] = {}  # and what it said
        self._wanted = self._given = STILL
        self._driven = float("-inf")
        self._looking: HeadPose | None = None

    def of(self, moment: TickRecord) -> Iterator[Figure]:
        """Yield the figures that a moment brings."""
        newest: dict[tuple[str, str], object] = {}
        for part, what, arguments, value in moment.answers:
            newest[part, what] = value
            self._command(moment.t, part, what, arguments, value)
        joints: dict[str, object] = {}
        for (part, what), value in newest.items():
            if what == "states" and isinstance(value, Mapping):
                joints |= {joint_called(part, name): state for name, state in value.items()}
            match value:
                case Reading(value=BaseState() as state) as reading:
                    yield from self._base(moment.t, reading.stamp, str(reading.quality), state)
                case Reading(value=HeadPose() as pose) as reading if part == "head":
                    yield from self._head(moment.t, reading.stamp, str(reading.quality), pose)
                case Reading(value=RangeScan() as scan) if self._due("/scan", moment.t, scan.stamp, scan.number):
                    yield Figure("/scan", moment.t, foxglove.scan(self._epoch.stamp(scan.stamp), scan))
        yield from self._arms(moment.t, joints)

    def _command(self, t: float, part: str, what: str, arguments: tuple[object, ...], value: object) -> None:
        """Take in what a part was told, and what came of it."""
        match part, what, value:
            case "base", "drive", Velocity():
                asked = arguments[0]
                self._wanted = asked if isinstance(asked, Velocity) else value
                self._given, self._driven = value, t
            case "base", "stop" | "latch" | "rest", _:
                self._wanted = self._given = STILL
            case "head", "look", HeadPose():
                self._looking = value

    def _base(self, t: float, stamp: float, quality: str, state: BaseState) -> Iterator[Figure]:
        pose = state.pose
        if foxglove.is_finite(pose.x, pose.y, pose.heading) and self._due("odom", t, stamp, pose, TF_PERIOD):
            at = self._epoch.stamp(stamp)
            yield Figure("/tf", t, foxglove.base_transform(at, pose))
            yield Figure("/base/pose", t, foxglove.base_pose(at, pose))
        commanded = t - self._driven <= COMMAND_LIFE
        wanted, given = (self._wanted, self._given) if commanded else (STILL, STILL)
        if self._due("/state/base", t, stamp, (quality, state, wanted, given)):
            numbers = {
                "x": pose.x,
                "y": pose.y,
                "heading": pose.heading,
                "speed": state.velocity.linear,
                "turn": state.velocity.angular,
                "wanted_speed": wanted.linear,
                "wanted_turn": wanted.angular,
                "given_speed": given.linear,
                "given_turn": given.angular,
                "battery_voltage": state.battery_voltage,
                "battery_percent": state.battery_percent,
            }
            words = {
                "bumper": str(state.bumper),
                "cliff": str(state.cliff),
                "wheel_drop": str(state.wheel_drop),
                "charging": state.charging,
                "docked": state.docked,
                "reckoned": state.reckoned,
            }
            head = {"t": t, "stamp": stamp, "quality": quality}
            yield Figure(
                "/state/base", t, {**head, **{name: number(value) for name, value in numbers.items()}, **words}
            )

    def _head(self, t: float, stamp: float, quality: str, pose: HeadPose) -> Iterator[Figure]:
        if foxglove.is_finite(pose.pan, pose.tilt) and self._due("camera", t, stamp, pose, TF_PERIOD):
            gaze = Gaze(pose.pan, pose.tilt)
            yield Figure("/tf", t, foxglove.camera_transform(self._epoch.stamp(stamp), self._eye, gaze))
        wanted = self._looking
        if self._due("/state/head", t, stamp, (quality, pose, wanted)):
            yield Figure(
                "/state/head",
                t,
                {
                    "t": t,
                    "stamp": stamp,
                    "quality": quality,
                    "pan": number(pose.pan),
                    "tilt": number(pose.tilt),
                    "wanted_pan": None if wanted is None else number(wanted.pan),
                    "wanted_tilt": None if wanted is None else number(wanted.tilt),
                },
            )

    def _arms(self, t: float, states: Mapping[str, object]) -> Iterator[Figure]:
        joints = {
            name: {"stamp": reading.stamp, "quality": str(reading.quality), **_fields(reading.value)}
            for name, reading in states.items()
            if isinstance(reading, Reading) and isinstance(reading.value, JointState)
        }
        stamp = max((reading.stamp for reading in states.values() if isinstance(reading, Reading)), default=0.0)
        if joints and self._due("/state/arm", t, stamp, joints):
            yield Figure("/state/arm", t, {"t": t, "joints": joints})

    def _due(self, what: str, t: float, stamp: float, value: object, period: float = PERIOD) -> bool:
        """Say whether something is to be told now; then it counts as told."""
        if self._stamps.get(what) == stamp:
            return False
        # A tick may come a little early: what is due within a tenth of a period is due.
        wait = UNCHANGED if self._values.get(what) == value else period
        if t < self._told.get(what, float("-inf")) + 0.9 * wait:
            return False
        self._told[what], self._stamps[what], self._values[what] = t, stamp, value
        return True


def _fields(state: JointState) -> Json:
    fields = to_json(state)
    return fields if isinstance(fields, dict) else {}
