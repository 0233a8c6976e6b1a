"""The ``head`` section of a robot file: two hobby servos on an Arduino, or two Dynamixel servos of the arm's bus.

SI units and radians throughout.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from config.away import AwayConfig, read_away
from config.fields import Fields

TRIM = math.radians(45)
"""Radians by which a servo may be trimmed at most, as in the Rodney project's node."""


@dataclass(frozen=True, slots=True)
class ServoConfig:
    """One servo of the head: which output of the board, its limits, whether it is mounted the other way round.

    ``joint`` is what the axis is called, as in the Rodney project. ``start`` is where the sketch sends it when it
    starts, in degrees as the sketch takes them; None for what the Rodney project's sketches do.
    """

    index: int
    joint: str
    lower: float
    upper: float
    flip: bool
    trim: float
    start: int | None = None


@dataclass(frozen=True, slots=True)
class HeadConfig:
    """A pan/tilt head on an Arduino with the Rodney sketch.

    ``boot`` is how long the board needs to start when its port was opened, 0 for one that does not start then;
    ``speed`` and ``acceleration`` are those of each axis.
    """

    port: str
    baud: int
    boot: float
    speed: float
    acceleration: float
    pan: ServoConfig
    tilt: ServoConfig
    away: AwayConfig = field(default_factory=AwayConfig)


@dataclass(frozen=True, slots=True)
class NeckJointConfig:
    """One axis of the head as a joint of the arm, by its name there; the joint says how it is mounted."""

    joint: str
    lower: float
    upper: float
    trim: float


@dataclass(frozen=True, slots=True)
class NeckConfig:
    """A pan/tilt head of two joints on the arm's bus."""

    speed: float
    acceleration: float
    pan: NeckJointConfig
    tilt: NeckJointConfig


def read_head(fields: Fields | None, joints: Mapping[str, tuple[float, float]]) -> HeadConfig | NeckConfig | None:
    """Read the section; ``joints`` are those of the arm, with their limits."""
    if fields is None:
        return None
    arduino = fields.choice("driver", ["arduino", "dynamixel"]) == "arduino"
    head = _servos(fields) if arduino else _neck(fields, joints)
    fields.done()
    return head


def _servos(fields: Fields) -> HeadConfig:
    speed, acceleration = _pace(fields)
    head = HeadConfig(
        port=fields.text("port"),
        baud=fields.integer("baud", 57_600, low=1),
        boot=fields.quantity("boot", "duration", 2.0, low=0.0),
        speed=speed,
        acceleration=acceleration,
        pan=_servo(fields.section("pan", required=True), 0, "head_pan"),
        tilt=_servo(fields.section("tilt", required=True), 1, "head_tilt"),
        away=read_away(fields.section("away")),
    )
    if head.pan.index == head.tilt.index and not fields.faults:
        fields.fault(fields.node.mark, f"'pan' and 'tilt' are both on servo {head.pan.index}")
    return head


def _neck(fields: Fields, joints: Mapping[str, tuple[float, float]]) -> NeckConfig:
    speed, acceleration = _pace(fields)
    neck = NeckConfig(
        speed=speed,
        acceleration=acceleration,
        pan=_joint(fields.section("pan", required=True), joints),
        tilt=_joint(fields.section("tilt", required=True), joints),
    )
    if neck.pan.joint == neck.tilt.joint and not fields.faults:
        fields.fault(fields.node.mark, f"'pan' and 'tilt' are both joint '{neck.pan.joint}'")
    return neck


def _pace(fields: Fields) -> tuple[float, float]:
    """Read the speed (rad/s) and the acceleration (rad/s^2)."""
    speed = fields.quantity("speed", "turn rate", 2.0, low=0.01)
    return speed, fields.quantity("acceleration", "turn acceleration", 7.0, low=0.1)


def _servo(fields: Fields | None, index: int, joint: str) -> ServoConfig:
    if fields is None:
        return ServoConfig(index, joint, 0.0, 0.0, flip=False, trim=0.0)
    # A hobby servo turns from 0 to 180 degrees; 90 is straight ahead. Limits as in the Rodney project's nodes.
    lower, upper = fields.span("limits", "angle", (-math.pi / 2, math.pi / 2))
    servo = ServoConfig(
        index=fields.integer("servo", index, low=0, high=3),
        joint=fields.text("joint", joint),
        lower=lower,
        upper=upper,
        flip=fields.flag("flip", False),
        trim=_trim(fields),
        start=None if fields.node_of("start") is None else fields.integer("start", low=0, high=180),
    )
    way = -1 if servo.flip else 1
    ends = sorted((way * (-math.pi / 2 - servo.trim), way * (math.pi / 2 - servo.trim)))
    _reach(fields, (lower, upper), (ends[0], ends[1]), f"servo {servo.index}")
    fields.done()
    return servo


def _joint(fields: Fields | None, joints: Mapping[str, tuple[float, float]]) -> NeckJointConfig:
    if fields is None:
        return NeckJointConfig("", 0.0, 0.0, trim=0.0)
    name = fields.choice("joint", [*joints]) if joints else fields.text("joint")
    if not joints:
        fields.fault(fields.node.mark, "a head of Dynamixel servos is two joints of the arm: this robot has no arm")
    lower, upper = fields.span("limits", "angle", (-math.pi, math.pi))
    joint = NeckJointConfig(joint=name, lower=lower, upper=upper, trim=_trim(fields))
    if name in joints:
        least, most = joints[name]
        _reach(fields, (lower, upper), (least - joint.trim, most - joint.trim), f"joint '{name}'")
    fields.done()
    return joint


def _trim(fields: Fields) -> float:
    return fields.quantity("trim", "angle", 0.0, low=-TRIM, high=TRIM)


def _reach(fields: Fields, limits: tuple[float, float], reach: tuple[float, float], what: str) -> None:
    """Note limits of which nothing is within reach, unless they are none."""
    if limits[0] < limits[1] and max(limits[0], reach[0]) > min(limits[1], reach[1]):
        low, high = (f"{math.degrees(end):.0f} deg" for end in reach)
        fields.fault(fields.node.mark, f"'limits': {what} reaches from {low} to {high}, which is none of them")
