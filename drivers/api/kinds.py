"""The kinds of parts that a robot may have: what each is called, and what holds for it whichever driver it has."""

from collections.abc import Callable, Mapping
from typing import Any

from drivers.api.fast_dataclass import dataclass
from drivers.api.sections import ArmKeys, BaseKeys, HeadKeys, ImuKeys, RangeKeys, Ros2Keys, ScreenKeys, VoiceKeys
from drivers.api.sensor_sections import CameraKeys, MicrophoneKeys
from drivers.api.steering import Source


@dataclass(frozen=True, slots=True)
class PartKind:
    """A kind of part.

    ``name`` stands in files, missions and events; ``field`` is its field in ``behaviours.robot.Robot`` and its name in
    records, without ``_part``. ``keys`` is what the section of every driver of this kind extends. ``protocol`` is the
    dotted name of the protocol of its device, ``leaf_protocol`` of what leaves see of it, where that is another. ``hold_still`` makes
    it hold still, None for what does nothing by itself; ``has_actuators`` is False for what is heard and does not move.
    ``default_driver`` is the driver of a section that names none; where it is empty, the section must name one. ``has_port`` parts
    have a port, and stand-ins of their own driver. ``made_after`` are the kinds that are made before it, where the robot has
    them. ``reading_method`` is the method of its newest ``Reading``, whose value tells its ``figures``, or of one for each of
    its joints; empty for what measures nothing. ``step_order`` is its place among the twins of one moment; None for a part
    that is not stepped. A robot may have ``allows_several`` of a kind: the others under names of their own, in sections that
    say ``kind``.
    """

    name: str
    field: str
    about: str
    keys: type
    protocol: str
    leaf_protocol: str = ""
    hold_still: Callable[[Any], None] | None = None
    has_actuators: bool = True
    default_driver: str = ""
    has_port: bool = False
    made_after: tuple[str, ...] = ()
    reading_method: str = ""
    step_order: int | None = None
    allows_several: bool = False


def _stop_mission(base: Any) -> None:
    # Others may steer the base besides, and what they do is not a mission's to end.
    base.stop(source=Source.MISSION)


KINDS: Mapping[str, PartKind] = {
    kind.name: kind
    for kind in (
        PartKind(
            "base",
            "base",
            "Wheels.",
            BaseKeys,
            "drivers.api:Base",
            hold_still=_stop_mission,
            has_port=True,
            reading_method="state",
            step_order=0,
        ),
        PartKind(
            "head",
            "head",
            "A pan/tilt head.",
            HeadKeys,
            "drivers.api:Head",
            hold_still=lambda it: it.stop(),
            has_port=True,
            reading_method="pose",
            step_order=1,
            allows_several=True,
        ),
        PartKind(
            "arm",
            "arm",
            "Joints.",
            ArmKeys,
            "drivers.api:Joints",
            hold_still=lambda it: it.hold(),
            has_port=True,
            reading_method="states",
            step_order=2,
            allows_several=True,
        ),
        PartKind(
            "imu",
            "imu",
            "What feels how the robot leans.",
            ImuKeys,
            "drivers.api:Imu",
            has_port=True,
            reading_method="attitude",
        ),
        PartKind(
            "range",
            "ranger",
            "A range finder that turns.",
            RangeKeys,
            "drivers.api:Ranger",
            has_port=True,
            reading_method="scan",
            step_order=5,
        ),
        PartKind(
            "microphone",
            "hearing",
            "Ears.",
            MicrophoneKeys,
            "drivers.api:Microphone",
            leaf_protocol="perception.api:Hearing",
            default_driver="microphone",
            made_after=("voice",),
            step_order=4,
        ),
        PartKind(
            "voice",
            "voice",
            "What the robot speaks with.",
            VoiceKeys,
            "drivers.api:Voice",
            hold_still=lambda it: it.rest(),
            has_actuators=False,
            default_driver="auto",
            step_order=3,
        ),
        PartKind(
            "screen",
            "screen",
            "Where the robot shows its face.",
            ScreenKeys,
            "drivers.api:Screen",
            default_driver="page",
            made_after=("voice",),
        ),
        PartKind(
            "camera",
            "sight",
            "Eyes.",
            CameraKeys,
            "drivers.api:Camera",
            leaf_protocol="perception.api:Sight",
            default_driver="opencv",
            made_after=("base", "head"),
        ),
        PartKind(
            "ros2",
            "ros2",
            "The nodes of ROS 2 that a robot is made of.",
            Ros2Keys,
            "drivers.api:Ros2",
            hold_still=lambda it: it.stop(),
            default_driver="zenoh",
            has_port=True,
            step_order=6,
        ),
    )
}
"""The kinds by name, in the order in which parts open and close: the head before the arm whose joints it may lead, and
last the nodes of ROS 2, by which others say their last word."""


CAPABILITIES: Mapping[str, str] = {"sounds": "base", "lights": "base", "legs": "base"}
"""Names of optional capabilities, as leaves need them, with the kind of part that may have them."""

REPEATABLE_KINDS = tuple(kind.name for kind in KINDS.values() if kind.allows_several)
"""The kinds of which a robot may have several. A leaf says which one it means by an argument of such a kind."""

STOPPABLE_KINDS = tuple(kind.name for kind in KINDS.values() if kind.hold_still is not None)
"""The kinds of parts that a stop reaches: those that move, and a voice, which is silenced."""

ACTUATOR_KINDS = tuple(name for name in STOPPABLE_KINDS if KINDS[name].has_actuators)
"""The parts with actuators."""

SOUND_KINDS = frozenset(STOPPABLE_KINDS).difference(ACTUATOR_KINDS)
"""The parts that a stop reaches, and that move nothing."""

PORT_KINDS = tuple(kind.name for kind in KINDS.values() if kind.has_port)
"""The parts that have a port."""
