"""The ``arm`` section of a robot file: Dynamixel servos on one bus, as named joints, and groups of them.

SI units and radians throughout. A joint says how it moves in angles, or, as the ROS stack ``dynamixel_controllers``
does, in steps of its servo::

    elbow: {id: 4, zero: 10 deg, limits: [-90 deg, 90 deg], reverse: true}
    knee: {id: 15, model: EX-106+, ticks: {init: 2048, min: 3000, max: 1000}}

With ``ticks`` the joint is at 0 where the servo stands at ``init``, and its angle grows from ``min`` towards ``max``:
where ``min`` is above ``max``, the servo is mounted the other way round.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import degrees
from typing import NamedTuple

from config.away import AwayConfig, read_away
from config.faults import one_of
from config.fields import Fields
from config.marked import Listing, Node, Scalar
from config.servo import ALIASES, SERVO_MODELS, ServoModel
from config.units import seen, written

REACH = 2.6
"""Radians that a joint without limits may turn either way, if its servo does."""


class Ticks(NamedTuple):
    """Where a servo stands (steps) with its joint at 0 and at either end; ``min`` above ``max`` turns it round."""

    init: int
    min: int
    max: int


@dataclass(frozen=True, slots=True)
class JointConfig:
    """One Dynamixel servo as a joint. ``zero`` is where the joint's 0 lies from the servo's centre.

    ``ticks`` is the same as the file has it, where it gave steps instead of angles.
    """

    id: int
    model: str
    zero: float
    reverse: bool
    lower: float
    upper: float
    speed: float
    torque: float
    ticks: Ticks | None = None


@dataclass(frozen=True, slots=True)
class ArmConfig:
    """Dynamixel servos on one bus, by joint name; ``at_end`` is ``hold`` or ``relax``.

    ``rate`` is how often a second those are read that lead or follow, and others at most. ``groups`` are names for
    several joints.
    """

    port: str
    baud: int
    at_end: str
    joints: Mapping[str, JointConfig]
    rate: float = 100.0
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    away: AwayConfig = field(default_factory=AwayConfig)

    @property
    def reaches(self) -> dict[str, tuple[float, float]]:
        """The lower and the upper limit of each joint."""
        return {name: (joint.lower, joint.upper) for name, joint in self.joints.items()}


def read_arm(fields: Fields | None) -> ArmConfig | None:
    """Read the section."""
    if fields is None:
        return None
    fields.choice("driver", ["dynamixel"])
    joints = _joints(fields.section("joints", required=True))
    arm = ArmConfig(
        port=fields.text("port"),
        baud=fields.integer("baud", 1_000_000, low=1),
        at_end=fields.choice("at_end", ["hold", "relax"], "hold"),
        joints=joints,
        rate=fields.quantity("rate", "frequency", 100.0, low=5.0, high=500.0),
        groups=_groups(fields.section("groups"), joints),
        away=read_away(fields.section("away")),
    )
    fields.done()
    return arm


def turned(model: ServoModel, ticks: Ticks) -> tuple[float, bool, float, float]:
    """Return zero (rad), reverse, and the lower and upper limit (rad) that ``ticks`` mean for a servo."""
    reverse = ticks.min > ticks.max
    step = -model.tick if reverse else model.tick
    return model.angle(ticks.init), reverse, (ticks.min - ticks.init) * step, (ticks.max - ticks.init) * step


def beyond(joint: str, angle: float, limits: tuple[float, float]) -> str:
    """Say that ``angle`` is outside a joint's limits, a millionth of a radian allowed; empty where it is not."""
    if limits[0] - 1e-6 <= angle <= limits[1] + 1e-6:
        return ""
    lower, upper = (written(end, "angle") for end in limits)
    return f"'{joint}' at {written(angle, 'angle')} is outside its limits, {lower} to {upper}"


def _joints(section: Fields | None) -> dict[str, JointConfig]:
    joints: dict[str, JointConfig] = {}
    if section is None:
        return joints
    owners: dict[int, str] = {}
    for key, node in section.entries():
        mistakes = len(section.faults)
        joints[key.text] = joint = _joint(section, key.text, node)
        if len(section.faults) > mistakes:
            continue
        owner = owners.setdefault(joint.id, key.text)
        if owner != key.text:
            section.fault(key.mark, f"joint '{key.text}' has id {joint.id}, as '{owner}' has")
    _check_ids(section, joints)
    return joints


def _check_ids(section: Fields, joints: Mapping[str, JointConfig]) -> None:
    """Note a servo with id 253 on a bus of both protocols: it would take every packet of 2.0 for one to itself."""
    if len({SERVO_MODELS[joint.model].protocol for joint in joints.values()}) < 2:
        return
    for key, _ in section.entries():
        if joints[key.text].id == 253:
            section.fault(key.mark, f"joint '{key.text}' cannot have id 253 beside servos of protocol 2.0")


def _joint(section: Fields, name: str, node: Node) -> JointConfig:
    fields = Fields(section.source, node, section.faults, what=f"joint '{name}'")
    named = fields.choice("model", [*SERVO_MODELS, *ALIASES], "AX-12A")
    model = SERVO_MODELS[ALIASES.get(named, named)]
    ticks = _ticks(fields, model)
    zero, reverse, lower, upper = _angles(fields, model) if ticks is None else turned(model, ticks)
    joint = JointConfig(
        id=fields.integer("id", low=0, high=model.last_id),
        model=model.name,
        zero=zero,
        reverse=reverse,
        lower=lower,
        upper=upper,
        speed=fields.quantity("speed", "turn rate", 2.0, low=0.02),
        torque=fields.quantity("torque", "share", 1.0, low=0.01, high=1.0),
        ticks=ticks,
    )
    fields.done()
    return joint


def _angles(fields: Fields, model: ServoModel) -> tuple[float, bool, float, float]:
    """Read zero, reverse, and limits within the servo's reach."""
    zero, reverse = fields.quantity("zero", "angle", 0.0), fields.flag("reverse", False)
    least, most = sorted((end - zero) * (-1 if reverse else 1) for end in model.reach)
    mistakes = len(fields.faults)
    lower, upper = fields.span("limits", "angle", (max(least, -REACH), min(most, REACH)))
    node = fields.node_of("limits") or fields.node_of("zero")
    slack = model.tick / 2
    reached = least - slack <= lower < upper <= most + slack
    if node is not None and len(fields.faults) == mistakes and not reached:
        ends = f"{degrees(least):.1f} deg to {degrees(most):.1f} deg"
        asked = f"{written(lower, 'angle')} to {written(upper, 'angle')}"
        fields.fault(node.mark, f"'limits': from that zero, an {model.name} reaches from {ends}, not {asked}")
    return zero, reverse, lower, upper


def _ticks(fields: Fields, model: ServoModel) -> Ticks | None:
    """Read ``ticks: {init, min, max}``; None where there is none, or nothing to go by."""
    section = fields.section("ticks")
    if section is None:
        return None
    for key in ("zero", "limits", "reverse"):
        node = fields.node_of(key)
        if node is not None:
            fields.fault(
                node.mark, f"'{key}' is what 'ticks' says already", "give 'ticks', or zero, limits and reverse"
            )
    mistakes = len(fields.faults)
    ticks = Ticks(*(section.integer(key, low=0, high=model.last) for key in Ticks._fields))
    section.done()
    if ticks.min == ticks.max and len(fields.faults) == mistakes:
        section.fault(section.node.mark, f"'ticks': 'min' and 'max' are both {ticks.min}")
    return ticks


def _groups(section: Fields | None, joints: Mapping[str, JointConfig]) -> dict[str, tuple[str, ...]]:
    """Read names for several joints."""
    groups: dict[str, tuple[str, ...]] = {}
    if section is None:
        return groups
    for key, node in section.entries():
        if key.text in joints:
            section.fault(key.mark, f"'{key.text}' is a joint already")
        groups[key.text] = _members(section, key.text, node, joints)
    return groups


def _members(section: Fields, name: str, node: Node, joints: Mapping[str, JointConfig]) -> tuple[str, ...]:
    """Read the joints of one group."""
    if not isinstance(node, Listing) or not node.items:
        section.fault(node.mark, f"group '{name}' needs a list of joints")
        return ()
    members: list[str] = []
    for item in node.items:
        joint = item.text if isinstance(item, Scalar) else ""
        if joint not in joints:
            section.fault(item.mark, f"group '{name}': there is no joint {seen(joint)}", one_of(joint, joints))
        elif joint in members:
            section.fault(item.mark, f"group '{name}' has '{joint}' already")
        else:
            members.append(joint)
    return tuple(members)
