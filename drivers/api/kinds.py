"""The kinds of parts that a robot may have: what each is called, and what holds for it whichever driver it has."""

from collections.abc import Callable, Mapping
from typing import Any

from drivers.api.quick import dataclass
from drivers.api.sections import ArmKeys, BaseKeys, HeadKeys, ImuKeys, RangeKeys, Ros2Keys, ScreenKeys, VoiceKeys
from drivers.api.senses import CameraKeys, MicrophoneKeys
from drivers.api.steering import Source


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of part.

    ``name`` stands in files, missions and events; ``field`` is its field in ``behaviours.robot.Robot`` and its name in
    records, without ``_part``. ``keys`` is what the section of every driver of this kind extends. ``device`` is the
    dotted name of the protocol of its device, ``seen`` of what leaves see of it, where that is another. ``still`` makes
    it hold still, None for what does nothing by itself; ``moves`` is False for what is heard and does not move.
    ``usual`` is the driver of a section that names none; where it is empty, the section must name one. ``wired`` parts
    have a port, and stand-ins of their own driver. ``after`` are the kinds that are made before it, where the robot has
    them. ``reading`` is the method of its newest ``Reading``, whose value tells its ``figures``, or of one for each of
    its joints; empty for what measures nothing. ``step`` is its place among the twins of one moment; None for a part
    that is not stepped. A robot may have ``several`` of a kind: the others under names of their own, in sections that
    say ``kind``.
    """

    name: str
    field: str
    about: str
    keys: type
    device: str
    seen: str = ""
    still: Callable[[Any], None] | None = None
    moves: bool = True
    usual: str = ""
    wired: bool = False
    after: tuple[str, ...] = ()
    reading: str = ""
    step: int | None = None
    several: bool = False


def _stop(base: Any) -> None:
    # Others may steer the base besides, and what they do is not a mission's to end.
    base.stop(source=Source.MISSION)


KINDS: Mapping[str, Kind] = {
    kind.name: kind
    for kind in (
        Kind("base", "base", "Wheels.", BaseKeys, "drivers.api:Base", still=_stop, wired=True, reading="state", step=0),
        Kind(
            "head",
            "head",
            "A pan/tilt head.",
            HeadKeys,
            "drivers.api:Head",
            still=lambda it: it.stop(),
            wired=True,
            reading="pose",
            step=1,
            several=True,
        ),
        Kind(
            "arm",
            "arm",
            "Joints.",
            ArmKeys,
            "drivers.api:Joints",
            still=lambda it: it.hold(),
            wired=True,
            reading="states",
            step=2,
            several=True,
        ),
        Kind(
            "imu", "imu", "What feels how the robot leans.", ImuKeys, "drivers.api:Imu", wired=True, reading="attitude"
        ),
        Kind(
            "range",
            "ranger",
            "A range finder that turns.",
            RangeKeys,
            "drivers.api:Ranger",
            wired=True,
            reading="scan",
            step=5,
        ),
        Kind(
            "microphone",
            "hearing",
            "Ears.",
            MicrophoneKeys,
            "drivers.api:Microphone",
            seen="perception.api:Hearing",
            usual="microphone",
            after=("voice",),
            step=4,
        ),
        Kind(
            "voice",
            "voice",
            "What the robot speaks with.",
            VoiceKeys,
            "drivers.api:Voice",
            still=lambda it: it.rest(),
            moves=False,
            usual="auto",
            step=3,
        ),
        Kind(
            "screen",
            "screen",
            "Where the robot shows its face.",
            ScreenKeys,
            "drivers.api:Screen",
            usual="page",
            after=("voice",),
        ),
        Kind(
            "camera",
            "sight",
            "Eyes.",
            CameraKeys,
            "drivers.api:Camera",
            seen="perception.api:Sight",
            usual="opencv",
            after=("base", "head"),
        ),
        Kind(
            "ros2",
            "ros2",
            "The nodes of ROS 2 that a robot is made of.",
            Ros2Keys,
            "drivers.api:Ros2",
            still=lambda it: it.stop(),
            usual="zenoh",
            wired=True,
            step=6,
        ),
    )
}
"""The kinds by name, in the order in which parts open and close: the head before the arm whose joints it may lead, and
last the nodes of ROS 2, by which others say their last word."""


CAPABILITIES: Mapping[str, str] = {"sounds": "base", "lights": "base", "legs": "base"}
"""Names of optional capabilities, as leaves need them, with the kind of part that may have them."""

SEVERAL = tuple(kind.name for kind in KINDS.values() if kind.several)
"""The kinds of which a robot may have several. A leaf says which one it means by an argument of such a kind."""

STILLED = tuple(kind.name for kind in KINDS.values() if kind.still is not None)
"""The kinds of parts that a stop reaches: those that move, and a voice, which is silenced."""

MOVING = tuple(name for name in STILLED if KINDS[name].moves)
"""The parts with actuators."""

SOUNDING = frozenset(STILLED).difference(MOVING)
"""The parts that a stop reaches, and that move nothing."""

WIRED = tuple(kind.name for kind in KINDS.values() if kind.wired)
"""The parts that have a port."""
