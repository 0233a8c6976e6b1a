"""Common keys of robot file sections, for parts that move, measure ranges or speak.

A driver declares its own keys in a class that extends that of its kind. The keys of cameras and microphones are in
``drivers.api.sensor_sections``.
"""

from collections.abc import Iterator, Mapping
from math import degrees, radians
from typing import Annotated, Literal

from drivers.api.base import BASE_RADIUS
from drivers.api.device import ReconnectPolicy
from drivers.api.joints import JointLimits
from drivers.api.keys import KeyDiagnostic, inside, key, keys
from drivers.api.screen import Mood
from drivers.api.steering import Footprint, RangeGuardKeys, Reflexes
from drivers.api.voice import SpeechStyle

Sector = tuple[float, float]
"""Sector around the base: two bearings in radians. It extends anticlockwise from the first to the second."""

DEFAULT_RANGE_FINDER_HEIGHT = 0.2
"""Default height of a range finder above the floor in metres: the middle plate of a TurtleBot 2."""

MAX_TRIM = radians(45)
"""Maximum trim of an axis of a head in radians, as in the pan/tilt node of the Rodney project."""


@keys
class SerialKeys:
    """Keys of a part on a serial port; a driver overrides the default of ``baud``, 115200."""

    port: str = key(help="Serial port of the device.")
    baud: int = key(default=115_200, low=1, help="Baud rate of the port.")


@keys
class BaseKeys:
    """Keys of every base: limits, reflexes, reconnect policy and range guard."""

    max_speed: float = key("speed", default=0.5, low=0.01, high=5.0, help="Maximum speed.")
    max_turn: float = key("turn rate", default=1.9, low=0.01, high=12.0, help="Maximum turn rate.")
    acceleration: float = key("acceleration", default=0.5, low=0.01, help="Maximum acceleration.")
    turn_acceleration: float = key("turn acceleration", default=3.5, low=0.01, help="Maximum turn acceleration.")
    reflexes: Reflexes = key(default=Reflexes(), help="Reflexes, independent of the source of commands.")
    away: ReconnectPolicy = key(default=ReconnectPolicy(), help="Reconnect policy after it was unplugged or silent.")
    range_guard: RangeGuardKeys | Literal["off"] = key(
        default=RangeGuardKeys(),
        help="Range guard, for all sources of commands; `off` disables it.",
    )

    default_footprint = BASE_RADIUS
    """Default radius of the base's body in metres."""

    default_reaction = 0.25
    """Default seconds from a command to its effect: a little more than users measured on a Kobuki."""

    @property
    def capabilities(self) -> frozenset[str]:
        """Optional capabilities of this base, names of ``drivers.api.kinds.CAPABILITIES``."""
        return frozenset()

    @property
    def has_range_guard(self) -> bool:
        """Whether the range guard is on, for a robot with a range finder."""
        return self.range_guard != "off"

    @property
    def footprint(self) -> Footprint:
        """Outline of the base's body."""
        configured = None if isinstance(self.range_guard, str) else self.range_guard.footprint
        return self.default_footprint if configured is None else configured

    @property
    def reaction(self) -> float:
        """Seconds from a command to its effect on the base."""
        configured = None if isinstance(self.range_guard, str) else self.range_guard.reaction
        return self.default_reaction if configured is None else configured


@keys
class AxisKeys:
    """Keys of an axis of a head."""

    limits: tuple[float, float] = key("angle", help="Range of the head on this axis: [lowest, highest].")
    trim: float = key(
        "angle",
        default=0.0,
        low=-MAX_TRIM,
        high=MAX_TRIM,
        help="Correction of a skewed mounting: `mission head trim`.",
    )

    @property
    def lower(self) -> float:
        """Lower limit of the axis in radians."""
        return self.limits[0]

    @property
    def upper(self) -> float:
        """Upper limit of the axis in radians."""
        return self.limits[1]

    def check_reach(self, reach: tuple[float, float], name: str, at: tuple[str, ...] = ()) -> Iterator[KeyDiagnostic]:
        """Yield an error if no part of the axis's limits is within ``reach`` (radians) of its motor.

        ``name`` is the motor in the message, ``at`` the place of the axis in the section.
        """
        if max(self.lower, reach[0]) > min(self.upper, reach[1]):
            low, high = (f"{degrees(end):.0f} deg" for end in reach)
            about = tuple((*at, word) for word in ("limits", "trim"))
            yield KeyDiagnostic(
                f"'limits': {name} reaches only {low} to {high}, outside of these limits", at, about=about
            )


@keys
class HeadKeys:
    """Keys of every head: maximum speed and acceleration of each axis."""

    speed: float = key("turn rate", default=2.0, low=0.01, help="Maximum turn rate of each axis.")
    acceleration: float = key("turn acceleration", default=7.0, low=0.1, help="Maximum turn acceleration of each axis.")

    @property
    def led_joints(self) -> tuple[str, ...]:
        """Joints of the arm that turn the head, so that moving one of them moves the head.

        Empty for a head with its own servos.
        """
        return ()


@keys
class ArmKeys:
    """Keys of every arm: groups of joints. A driver adds the joints."""

    groups: Mapping[str, Annotated[tuple[str, ...], inside(wrong="group '{}' needs a list of joints")]] = key(
        default={}, help="Groups of joints, each with a list of joints; missions use their names like those of joints."
    )

    @property
    def limits(self) -> Mapping[str, JointLimits]:
        """Limits of each joint by name. Raises TypeError unless the driver overrides it."""
        raise TypeError(f"{type(self).__name__} has no joints: define the property `limits`")

    @property
    def ranges(self) -> Mapping[str, tuple[float, float]]:
        """Lower and upper limit of each joint, in radians."""
        return {name: (each.lower, each.upper) for name, each in self.limits.items()}

    def resolution(self, joint: str) -> float:  # noqa: ARG002 - a driver's arm may know
        """Return the smallest step of a joint's goal in radians; 0 if unknown."""
        return 0.0

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield the errors in the groups of joints."""
        known = self.limits
        for group, members in self.groups.items():
            inside = ("groups", group)
            about: tuple[tuple[str | int, ...], ...] = (inside,)
            if group in known:
                yield KeyDiagnostic(f"'{group}' is a joint already", inside, marks_key=True, about=about)
            if not members:
                yield KeyDiagnostic(f"group '{group}' needs a list of joints", inside, about=about)
            for place, joint in enumerate(members):
                at = (*inside, place)
                if joint not in known:
                    message = f"group '{group}': no joint '{joint}'"
                    yield KeyDiagnostic(message, at, unknown_word=joint, known_words=known, about=about)
                elif joint in members[:place]:
                    yield KeyDiagnostic(f"group '{group}' has '{joint}' already", at, about=about)


@keys
class Ros2Keys:
    """Keys of every connection to ROS 2 nodes: domain, namespace, and named places on the map for navigation."""

    domain: int | None = key(
        default=None, low=0, high=232, help="Domain; the default is ROS_DOMAIN_ID in the environment, or 0."
    )
    namespace: str = key(default="", help="Namespace of names that do not begin with `/`, such as `/robot1`.")
    places: str = key(
        default="",
        help="File with places by name, for `navigate`; relative to the robot file unless it begins with `/`.",
    )
    navigation: str = key(default="navigate_to_pose", help="Action of Nav2 that drives to a place.")
    through: str = key(default="navigate_through_poses", help="Action of Nav2 that drives through several places.")


@keys
class RangeKeys:
    """Keys of every range finder: its mounting, and the sectors that the robot itself blocks."""

    position: tuple[float, float, float] = key(
        "length",
        default=(0.0, 0.0, DEFAULT_RANGE_FINDER_HEIGHT),
        help="Mounting position, from the middle of the base on the floor: [x, y, z].",
    )
    yaw: float = key("angle", default=0.0, help="Mounting yaw, to the left of the robot's front.")
    blind: tuple[Sector, ...] = key(
        "angle",
        default=(),
        wrong="'{}' needs pairs of angles, anticlockwise",
        hint="blind: [[100 deg, 120 deg]]",
        help="Sectors that the robot itself blocks: pairs of bearings, anticlockwise.",
    )

    @property
    def place(self) -> tuple[float, float, float]:
        """Mounting pose on the base: x and y in metres, yaw in radians."""
        return self.position[0], self.position[1], self.yaw


@keys
class ImuKeys:
    """Keys of every IMU."""

    level: tuple[float, float] = key(
        "angle",
        default=(0.0, 0.0),
        wrong="'{}' needs two angles, such as [0.5 deg, -1 deg]",
        help="Reading with the robot upright: [roll, pitch].",
    )


@keys
class VoiceKeys:
    """Keys of every voice: the default style of its speech."""

    voice: str = key(default="", help="Voice, by its name in the synthesiser.")
    speed: float = key(default=150.0, low=80, high=450, help="Words per minute.")
    language: str = key(default="", help="Language, such as `en-us`.")
    volume: float = key("share", default=1.0, low=0.0, high=2.0, help="Volume; `100 %` leaves the sound unchanged.")
    device: str = key(default="", help="Part of the loudspeaker's name; by default the system's choice.")

    @property
    def style(self) -> SpeechStyle:
        """Default style of speech, unless the mission sets another."""
        return SpeechStyle(self.voice, self.speed, self.language)


@keys
class ScreenKeys:
    """Keys of every screen."""

    mood: str = key(default="neutral", among=[*Mood], help="Initial expression of the face.")
