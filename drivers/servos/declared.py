"""Driver declarations and robot-file keys of Dynamixel arms, and of heads that are two joints of an arm.

A joint describes its motion in angles or, as the ROS stack ``dynamixel_controllers`` does, in servo steps::

    elbow: {id: 4, zero: 10 deg, limits: [-90 deg, 90 deg], reverse: true}
    knee: {id: 15, model: EX-106+, ticks: {init: 2048, min: 3000, max: 1000}}

With ``ticks`` the joint is at 0 when the servo is at ``init``, and its angle grows from ``min`` towards ``max``. If
``min`` is above ``max``, the servo is mounted the other way round.
"""

from collections.abc import Collection, Iterator, Mapping
from math import degrees, pi
from typing import Literal

from drivers.api.device import ReconnectPolicy
from drivers.api.driver import Driver
from drivers.api.joints import JointLimits
from drivers.api.keys import KeyDiagnostic, key, keys
from drivers.api.sections import ArmKeys, AxisKeys, HeadKeys, SerialKeys
from drivers.servos.models import MODELS, ServoModel
from drivers.servos.units import Framing

# Two servos on one joint would work against each other; recognised by the names of their joints.

SECOND_SERVO_WORDS = frozenset({"mimic", "shadow", "slave", "twin", "mirror", "dual", "secondary"})
"""Words in a joint's name that mark it as the second servo of another joint, as in ROS files: `shoulder_mimic`."""


def find_second_servos(joints: Collection[str]) -> Iterator[KeyDiagnostic]:
    """Yield diagnostics for joints whose names mark them as the second servo of another joint."""
    for name in joints:
        words = name.split("_")
        for token in SECOND_SERVO_WORDS & {word.lower() for word in words}:
            first = "_".join(word for word in words if word.lower() != token)
            if first in joints:
                message = f"joints '{first}' and '{name}' seem to be two servos on one joint, which are not driven here"
                hint = f"one would work against the other; if they are two joints, call one without '{token}'"
                about = (("joints", name), ("joints", first))
                yield KeyDiagnostic(message, ("joints", name), marks_key=True, hint=hint, about=about)


ALIASES: Mapping[str, str] = {"AX-12": "AX-12A", "AX-12+": "AX-12A"}
"""Names of servo models that mean the same to the driver, each with the name that it uses."""

DYNAMIXEL_MODELS = tuple(name for name, model in MODELS.items() if model.protocol != "STS")
"""Dynamixel models that the driver supports."""

UNSUPPORTED_HINT = "others, such as XL-320 and SCS0009, are recognised and set up, but not driven"
"""Hint for an unsupported servo model: the end of a sentence that begins with the supported models."""

DEFAULT_REACH = 2.6
"""Largest angle (rad) in either direction of a joint without limits, if its servo reaches it."""


@keys
class Ticks:
    """Servo positions (steps) with the joint at 0, at its lowest and at its highest angle.

    A ``min`` above ``max`` means that the servo is mounted the other way round.
    """

    init: int = key(low=0, high=4095, help="Servo position (steps) with the joint at 0.")
    min: int = key(low=0, high=4095, help="Servo position (steps) at the joint's lowest angle.")
    max: int = key(low=0, high=4095, help="Servo position (steps) at the joint's highest angle.")


@keys
class JointKeys:
    """Keys of a joint that a Dynamixel servo turns: the servo, its mounting, and the limits of the joint.

    Other programs call ``zero`` offset, ``limits`` min_angle and max_angle, and ``reverse`` inverted.
    """

    id: int = key(low=0, high=253, help="The ID of the servo on the bus.")
    written_model: str = key(
        default="AX-12A",
        among=[*DYNAMIXEL_MODELS, *ALIASES],
        word="model",
        hint=UNSUPPORTED_HINT,
        help="The model of the servo.",
    )
    written_zero: float | None = key(
        "angle", default=None, word="zero", help="Servo angle at the joint's 0, from the middle of the servo."
    )
    written_reverse: bool | None = key(
        default=None, word="reverse", help="Whether the servo is mounted the other way round."
    )
    limits: tuple[float, float] | None = key(
        "angle",
        default=None,
        help="Range of the joint: [lowest, highest]; by default that of its servo, up to 149 deg.",
    )
    speed: float = key("turn rate", default=2.0, low=0.02, help="Maximum turn rate.")
    torque: float = key(
        "share", default=1.0, low=0.01, high=1.0, help="Maximum torque, as a share of the stall torque."
    )
    ticks: Ticks | None = key(default=None, help="`zero`, `limits` and `reverse`, in steps of the servo.")

    @property
    def model(self) -> str:
        """Name of the servo model, with aliases resolved."""
        return ALIASES.get(self.written_model, self.written_model)

    @property
    def servo_model(self) -> ServoModel:
        """Data of the servo model."""
        return MODELS[self.model]

    @property
    def reverse(self) -> bool:
        """Whether the servo is mounted the other way round."""
        return bool(self.written_reverse) if self.ticks is None else self.ticks.min > self.ticks.max

    @property
    def zero(self) -> float:
        """Angle of the servo (rad from its centre) at which the joint is at 0."""
        return self.written_zero or 0.0 if self.ticks is None else self.servo_model.angle(self.ticks.init)

    @property
    def lower(self) -> float:
        """Lowest angle of the joint, in radians."""
        return self.angle_limits[0]

    @property
    def upper(self) -> float:
        """Highest angle of the joint, in radians."""
        return self.angle_limits[1]

    @property
    def angle_limits(self) -> tuple[float, float]:
        """Lowest and highest angle of the joint in radians, as configured or as the servo can reach."""
        ticks = self.ticks
        if ticks is not None:
            step = -self.servo_model.tick if self.reverse else self.servo_model.tick
            return (ticks.min - ticks.init) * step, (ticks.max - ticks.init) * step
        if self.limits is not None:
            return self.limits
        least, most = self.reachable_angles
        return max(least, -DEFAULT_REACH), min(most, DEFAULT_REACH)

    @property
    def reachable_angles(self) -> tuple[float, float]:
        """Lowest and highest joint angle that the servo can reach, in radians."""
        way = -1 if self.reverse else 1
        least, most = sorted((self.servo_model.angle(end) - self.zero) * way for end in (0, self.servo_model.last_tick))
        return least, most

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield settings that the servo does not support."""
        last = max_id(self.servo_model)
        if self.id > last:
            yield KeyDiagnostic(f"'id' must be at most {last}, not {self.id}", ("id",))
        if self.ticks is not None:
            yield from self._ticks_mistakes(self.ticks)
            return
        lower, upper = self.angle_limits
        least, most = self.reachable_angles
        slack = self.servo_model.tick / 2
        if not least - slack <= lower < upper <= most + slack:
            ends = f"{degrees(least):.1f} deg to {degrees(most):.1f} deg"
            asked = f"{_format_degrees(lower)} to {_format_degrees(upper)}"
            message = f"'limits': from that zero, an {self.model} reaches from {ends}, not {asked}"
            yield KeyDiagnostic(message, ("limits",), ("zero",))

    def _ticks_mistakes(self, ticks: Ticks) -> Iterator[KeyDiagnostic]:
        for word, said in (("zero", self.written_zero), ("limits", self.limits), ("reverse", self.written_reverse)):
            if said is not None:
                message = f"'{word}' is already defined by 'ticks'"
                yield KeyDiagnostic(message, (word,), hint="give 'ticks', or zero, limits and reverse")
        beyond = {
            word: step for word in ("init", "min", "max") if (step := getattr(ticks, word)) > self.servo_model.last_tick
        }
        for word in beyond:
            yield KeyDiagnostic(f"'{word}' must be at most {self.servo_model.last_tick}", ("ticks", word))
        if ticks.min == ticks.max and not beyond:
            yield KeyDiagnostic(f"'ticks': 'min' and 'max' are both {ticks.min}", ("ticks",))


def max_id(model: ServoModel) -> int:
    """Return the highest ID of a servo model."""
    return 252 if model.protocol == 2 else 253


@keys
class DynamixelKeys(ArmKeys, SerialKeys):
    """The ``arm`` section of a robot with Dynamixel servos on one bus."""

    baud: int = key(default=1_000_000, low=1, help="Baud rate of the bus.")
    framing: Framing = key(default="own", help="Packet code: our own, or `sdk`, that of ROBOTIS, for comparison.")
    at_end: Literal["hold", "relax"] = key(
        default="hold", help="At the end of a run it keeps its torque, or switches it off."
    )
    joints: Mapping[str, JointKeys] = key(help="The servos, by the names of their joints.", each="joint")
    rate: float = key(
        "frequency",
        default=100.0,
        low=5.0,
        high=500.0,
        help="Poll rate of servos that lead or follow; the maximum for others.",
    )
    away: ReconnectPolicy = key(default=ReconnectPolicy(), help="Reconnect policy after it was unplugged or silent.")

    @property
    def limits(self) -> Mapping[str, JointLimits]:
        """Angle and speed limits by joint."""
        return {name: JointLimits(joint.lower, joint.upper, joint.speed) for name, joint in self.servos.items()}

    @property
    def servos(self) -> Mapping[str, JointKeys]:
        """Configuration of each joint by name, as the driver uses it. Subclasses add data of a calibration file."""
        return self.joints

    @property
    def offsets(self) -> Mapping[str, int]:
        """Position offset (steps) that each servo must have, by joint; empty if no calibration file defines them."""
        return {}

    def resolution(self, joint: str) -> float:
        """Return the angle (rad) of one step of a joint's servo."""
        return self.joints[joint].servo_model.tick

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield errors for two joints with the same ID, and for a second servo of a joint that is listed as a joint.

        The errors of ArmKeys follow.
        """
        owners: dict[int, str] = {}
        for name, joint in self.joints.items():
            owner = owners.setdefault(joint.id, name)
            if owner != name:
                message = f"joint '{name}' has id {joint.id}, as '{owner}' has"
                about = (("joints", name, "id"), ("joints", owner, "id"))
                yield KeyDiagnostic(message, ("joints", name), marks_key=True, about=about)
        yield from find_second_servos(self.joints)
        if len({joint.servo_model.protocol for joint in self.joints.values()}) > 1:
            for name, joint in self.joints.items():
                if joint.id == 253:  # it would take every packet of protocol 2.0 for its own
                    message = f"joint '{name}' cannot have id 253 beside servos of protocol 2.0"
                    yield KeyDiagnostic(message, ("joints", name), marks_key=True, about=(("joints",),))
        yield from ArmKeys.diagnostics(self)


@keys
class NeckJointKeys(AxisKeys):
    """An axis of the head that is a joint of the arm; the joint describes its mounting."""

    joint: str = key(help="The joint of the arm.")
    limits: tuple[float, float] = key("angle", default=(-pi, pi), help="Range of the head: [lowest, highest].")


@keys
class NeckKeys(HeadKeys):
    """The ``head`` section of a robot whose head is two joints on the arm's bus."""

    pan: NeckJointKeys = key(help="The joint that turns the head left and right.")
    tilt: NeckJointKeys = key(help="The joint that turns the head up and down.")

    @property
    def led_joints(self) -> tuple[str, ...]:
        """Names of the two joints of the arm that turn the head; a command to one of them moves the head."""
        return self.pan.joint, self.tilt.joint

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield a diagnostic if both axes are the same joint."""
        if self.pan.joint == self.tilt.joint:
            about = (("pan", "joint"), ("tilt", "joint"))
            yield KeyDiagnostic(f"'pan' and 'tilt' are both joint '{self.pan.joint}'", about=about)


def check_neck_joints(neck: NeckKeys, others: Mapping[str, object]) -> Iterator[KeyDiagnostic]:
    """Yield diagnostics for axes of a head that are not joints of the arm, or that exceed the range of their joint.

    ``others`` are the other sections of the robot file, by name.
    """
    arm = others.get("arm")
    limits = arm.limits if isinstance(arm, ArmKeys) else {}
    for axis, its in (("pan", neck.pan), ("tilt", neck.tilt)):
        if not isinstance(arm, ArmKeys):
            message = "a head of Dynamixel servos needs two joints of an arm: this robot has no arm"
            yield KeyDiagnostic(message, (axis,), about=((axis, "joint"),))
        elif its.joint not in limits:
            message, at = f"'joint' cannot be '{its.joint}'", (axis, "joint")
            yield KeyDiagnostic(message, at, unknown_word=its.joint, known_words=limits, about=(at,))
        else:
            joint = limits[its.joint]
            reach = (joint.lower - its.trim, joint.upper - its.trim)
            yield from its.check_reach(reach, f"joint '{its.joint}'", (axis,))


def _format_degrees(angle: float) -> str:
    return f"{round(degrees(angle), 4) + 0.0:g} deg"


ARM = Driver(
    "dynamixel",
    "arm",
    "Dynamixel servos on one bus.",
    DynamixelKeys,
    make="drivers.servos.make:arm",
    twin="drivers.servos.twin:make",
    virtual="drivers.servos.virtual.chain:make",
    probe="drivers.servos.probe:probe",
    checkup="drivers.servos.checkup:checkup",
    usb=(
        "0403:6001",
        "0403:6014",
        "0403:6015",
        "0483:5740",
        "16d0:06a7",
        "1a86:55d3",
        "1a86:7523",
        "2f5d:2202",
        "fff1:ff48",
    ),
)

NECK = Driver(
    "dynamixel",
    "head",
    "Two Dynamixel servos that are joints of the arm.",
    NeckKeys,
    make="drivers.servos.make:neck",
    twin="drivers.servos.twin:make_neck",
    virtual="drivers.servos.virtual.chain:make_neck",
    needs=("arm",),
    check=check_neck_joints,
)
