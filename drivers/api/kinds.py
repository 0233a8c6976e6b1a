"""Kinds of robot parts: their names, protocols and common properties, independent of the driver."""

from collections.abc import Callable, Mapping
from typing import Any

from drivers.api.fast_dataclass import dataclass
from drivers.api.sections import ArmKeys, BaseKeys, HeadKeys, ImuKeys, RangeKeys, Ros2Keys, ScreenKeys, VoiceKeys
from drivers.api.sensor_sections import CameraKeys, MicrophoneKeys
from drivers.api.steering import Source


@dataclass(frozen=True, slots=True)
class PartKind:
    """Kind of part.

    ``name`` is used in files, missions and events; ``field`` is the field of ``behaviours.robot.Robot`` without
    ``_part``, and the name in records. ``keys`` is the base class of the sections. ``protocol`` is the dotted name of
    the device protocol, ``leaf_protocol`` that of the object for leaves, if it differs. ``hold_still`` stops the part;
    it is None for parts that need no stop, such as sensors. ``has_actuators`` is False for parts that only make sounds.
    ``default_driver`` is used if a section names no driver; if it is empty, the section must name one. Parts with
    ``has_port`` have a port, and twins of their own driver. ``made_after`` are the kinds that are made before this one,
    if the robot has them. ``reading_method`` is the method that returns the latest ``Reading``, whose value has
    ``figures``, or a reading for each joint; empty for a part that measures nothing. ``step_order`` is the order in
    which twins are stepped that are due at the same time; None for a part without steps. With ``allows_several``, a
    robot may have more parts of the kind, under names of their own, in sections with ``kind``.
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
    # Another source may drive the base too, and a mission must not stop that.
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
            "An IMU, for the attitude of the robot.",
            ImuKeys,
            "drivers.api:Imu",
            has_port=True,
            reading_method="attitude",
        ),
        PartKind(
            "range",
            "ranger",
            "A rotating range finder.",
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
            "A voice.",
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
            "A screen with the robot's face.",
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
            "The ROS 2 nodes of a robot.",
            Ros2Keys,
            "drivers.api:Ros2",
            hold_still=lambda it: it.stop(),
            default_driver="zenoh",
            has_port=True,
            step_order=6,
        ),
    )
}
"""Kinds of robot parts by name, in the order in which the parts open and close.

The head comes before the arm whose joints it may use. The ROS 2 nodes come last, because other parts send their last
messages through them when they close.
"""


CAPABILITIES: Mapping[str, str] = {"sounds": "base", "lights": "base", "legs": "base"}
"""Optional capabilities of parts by name, as leaves require them, with the kind of part that may have them."""

REPEATABLE_KINDS = tuple(kind.name for kind in KINDS.values() if kind.allows_several)
"""Kinds of parts of which a robot may have several. A leaf selects one of them by an argument."""

STOPPABLE_KINDS = tuple(kind.name for kind in KINDS.values() if kind.hold_still is not None)
"""Kinds of parts that a stop reaches: actuators, and voices, which are silenced."""

ACTUATOR_KINDS = tuple(name for name in STOPPABLE_KINDS if KINDS[name].has_actuators)
"""Kinds of parts with actuators."""

SOUND_KINDS = frozenset(STOPPABLE_KINDS).difference(ACTUATOR_KINDS)
"""Kinds of parts that a stop reaches although they have no actuators."""

PORT_KINDS = tuple(kind.name for kind in KINDS.values() if kind.has_port)
"""Kinds of parts with a port."""
