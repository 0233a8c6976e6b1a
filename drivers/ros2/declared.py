"""Driver declarations and robot-file keys of robots with ROS 2 over Zenoh."""

from collections.abc import Iterator, Mapping
from math import pi
from typing import Literal

from drivers.api.device import ReconnectPolicy
from drivers.api.driver import Driver
from drivers.api.joints import JointLimits
from drivers.api.keys import KeyDiagnostic, key, keys
from drivers.api.sections import ArmKeys, AxisKeys, BaseKeys, HeadKeys, RangeKeys, Ros2Keys, VoiceKeys
from drivers.api.sensor_sections import CameraKeys
from drivers.ros2 import wire

JOINT_PLACEHOLDER = "{joint}"
"""Placeholder for the name of the joint in the topic of joint commands."""


def _topic_mistakes(section: object, *words: str) -> Iterator[KeyDiagnostic]:
    """Yield a diagnostic for each key in ``words`` of the section whose value is not a valid topic name."""
    for word in words:
        name: str = getattr(section, word)
        if name and not wire.is_name(name.replace(JOINT_PLACEHOLDER, "joint") if word == "command" else name):
            yield KeyDiagnostic(f"'{word}': {name!r:.80} is not a valid topic name", (word,), hint=wire.NAME_HINT)


@keys
class ZenohKeys(Ros2Keys):
    """The ``ros2`` section of the robot file of a robot that is reached over Zenoh.

    The robot uses `rmw_zenoh` or zenoh-bridge-ros2dds.
    """

    router: str = key(
        default="tcp/127.0.0.1:7447",
        help="Address of the Zenoh router: `tcp/HOST:7447`, or `tls/HOST:PORT` with `ca`; several with commas.",
    )
    mode: Literal["client", "peer"] = key(
        default="client",
        help="`client` sends everything over the router; `peer` connects directly to the nodes that it announces.",
    )
    user: str = key(default="", help="User name, if the router requires one.")
    password_file: str = key(default="", help="A file with the user's password in its first line.")
    ca: str = key(default="", help="A file with the CA certificate of the router, for `tls/`.")
    certificate: str = key(default="", help="A file with our own certificate, if the router requires one.")
    private_key: str = key(default="", help="A file with the key of our own certificate.")

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield a diagnostic for keys that require each other, and for invalid addresses and topic names."""
        if bool(self.user) != bool(self.password_file):
            lacking = "password_file" if self.user else "user"
            yield KeyDiagnostic(f"'user' and 'password_file' go together: '{lacking}' is missing", ("router",))
        if bool(self.certificate) != bool(self.private_key):
            lacking = "private_key" if self.certificate else "certificate"
            yield KeyDiagnostic(f"'certificate' and 'private_key' go together: '{lacking}' is missing", ("router",))
        for each in self.router.split(","):
            if each.strip().split("/")[0] not in {"tcp", "tls", "quic", "ws", "unixsock-stream"} or "/" not in each:
                yield KeyDiagnostic(
                    f"'router': '{each.strip()}' is not an address such as tcp/192.168.1.20:7447", ("router",)
                )
        yield from _topic_mistakes(self, "namespace", "navigation", "through")


ZENOH = Driver(
    "zenoh",
    "ros2",
    "The nodes of ROS 2, over Zenoh: by rmw_zenoh, or by zenoh-bridge-ros2dds.",
    ZenohKeys,
    make="drivers.ros2.make:graph",
    twin="drivers.ros2.twin:graph",
    virtual="drivers.ros2.virtual:graph",
    checkup="drivers.ros2.checkup:checkup",
    extra="ros2",
)


@keys
class Ros2BaseKeys(BaseKeys):
    """The ``base`` section of a robot with ROS 2."""

    max_speed: float = key("speed", default=0.3, low=0.01, high=5.0, help="The highest speed.")
    cmd_vel: str = key(default="cmd_vel", help="The topic of its velocity commands: a Twist or a TwistStamped.")
    odom: str = key(default="odom", help="The topic of its odometry.")
    battery: str = key(default="", help="The topic of its battery (sensor_msgs/BatteryState); by default none.")
    hazards: str = key(default="", help="The topic of a Create 3's hazards (HazardDetectionVector); by default none.")
    dock: str = key(default="", help="The topic of a Create 3's dock (DockStatus); by default none.")
    lights: str = key(default="", help="The topic of a Create 3's ring of lights; by default none.")
    sounds: str = key(default="", help="The topic of a Create 3's sounds; by default none.")
    sensors: str = key(default="", help="The topic of a TurtleBot 3's bumper and cliff (SensorState); by default none.")

    @property
    def capabilities(self) -> frozenset[str]:
        """Optional capabilities of the base for which a topic is configured."""
        topics = {"sounds": self.sounds, "lights": self.lights}
        return frozenset(name for name, topic in topics.items() if topic)

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield a diagnostic for each key whose value is not a valid topic name."""
        topics = ("cmd_vel", "odom", "battery", "hazards", "dock", "lights", "sounds", "sensors")
        yield from _topic_mistakes(self, *topics)


BASE = Driver(
    "ros2",
    "base",
    "A base driven by ROS 2: a TurtleBot 4, a TurtleBot 3, any with Twist and Odometry.",
    Ros2BaseKeys,
    make="drivers.ros2.make:base",
    twin="drivers.ros2.twin:base",
    virtual="drivers.ros2.virtual:base",
    needs=("ros2",),
    extra="ros2",
)


@keys
class Ros2RangeKeys(RangeKeys):
    """The ``range`` section of a robot whose range finder is a ROS 2 topic."""

    scan: str = key(default="scan", help="The topic of its scans (sensor_msgs/LaserScan).")

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield a diagnostic for each key whose value is not a valid topic name."""
        yield from _topic_mistakes(self, "scan")


RANGE = Driver(
    "ros2",
    "range",
    "A range finder on a topic of ROS 2.",
    Ros2RangeKeys,
    make="drivers.ros2.make:ranger",
    twin="drivers.ros2.twin:ranger",
    virtual="drivers.ros2.virtual:ranger",
    needs=("ros2",),
    extra="ros2",
)


@keys
class Ros2CameraKeys(CameraKeys):
    """The ``camera`` section of a robot whose pictures are on a ROS 2 topic."""

    image: str = key(default="image_raw", help="The topic of its pictures: Image or CompressedImage.")

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield the diagnostics of ``CameraKeys``, and one for each key whose value is not a valid topic name."""
        yield from super().diagnostics()
        yield from _topic_mistakes(self, "image")


CAMERA = Driver(
    "ros2",
    "camera",
    "A camera on a topic of ROS 2.",
    Ros2CameraKeys,
    make="drivers.ros2.make:camera",
    virtual="drivers.ros2.virtual:camera",
    needs=("ros2",),
    extra="ros2",
)


COMMAND_HELP = (
    "Topic of their controller: a JointTrajectory, or a Float64MultiArray with a position for each joint, in the "
    "order of this file; with `{joint}` in it one for each joint (Float64)."
)


def _limit_mistakes(limits: tuple[float, float]) -> Iterator[KeyDiagnostic]:
    """Yield a diagnostic unless ``limits`` are the lowest and the highest angle (rad), within half a turn."""
    if not -pi - 1e-9 <= limits[0] < limits[1] <= pi + 1e-9:
        yield KeyDiagnostic("'limits' must be [lowest, highest], within -180 deg and 180 deg", ("limits",))


@keys
class Ros2JointKeys:
    """A joint of a robot with ROS 2."""

    joint: str = key(default="", help="Name of the joint in JointState; by default the name here.")
    limits: tuple[float, float] = key("angle", default=(-pi, pi), help="Range: [lowest, highest].")
    speed: float = key("turn rate", default=0.5, low=0.02, help="Maximum turn rate.")
    reverse: bool = key(default=False, help="Whether it turns the other way in ROS 2.")

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield a diagnostic for invalid angle limits of the joint."""
        yield from _limit_mistakes(self.limits)


@keys
class Ros2ArmKeys(ArmKeys):
    """The ``arm`` section of a robot whose joints are moved by ROS 2."""

    states: str = key(default="joint_states", help="The topic of its joint states (sensor_msgs/JointState).")
    command: str = key(default="joint_trajectory_controller/joint_trajectory", help=COMMAND_HELP)
    joints: Mapping[str, Ros2JointKeys] = key(help="The joints, by their names here.", each="joint")
    away: ReconnectPolicy = key(default=ReconnectPolicy(), help="Reconnect policy after it was disconnected or silent.")

    @property
    def limits(self) -> Mapping[str, JointLimits]:
        """Angle and speed limits by joint."""
        return {name: JointLimits(*joint.limits, joint.speed) for name, joint in self.joints.items()}

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield diagnostics for duplicate joints and invalid topic names, and those of ``ArmKeys``."""
        owners: dict[str, str] = {}
        for name, joint in self.joints.items():
            if (owner := owners.setdefault(joint.joint or name, name)) != name:
                message = f"joint '{name}' is '{joint.joint or name}' of ROS 2, as '{owner}' is"
                yield KeyDiagnostic(
                    message, ("joints", name), marks_key=True, about=(("joints", name), ("joints", owner))
                )
            if not wire.is_name(joint.joint or name) and JOINT_PLACEHOLDER in self.command:
                yield KeyDiagnostic(
                    f"joint '{name}': its name cannot stand in a topic", ("joints", name), hint=wire.NAME_HINT
                )
        yield from _topic_mistakes(self, "states", "command")
        yield from ArmKeys.diagnostics(self)


@keys
class Ros2AxisKeys(AxisKeys):
    """Keys of an axis of a head that is a joint of ROS 2."""

    joint: str = key(help="Name of the joint in JointState.")
    limits: tuple[float, float] = key("angle", default=(-pi, pi), help="Range of the head: [lowest, highest].")
    reverse: bool = key(default=False, help="Whether a rising angle in ROS 2 turns the head right, or up.")

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield a diagnostic for invalid angle limits of the axis."""
        yield from _limit_mistakes(self.limits)


@keys
class Ros2HeadKeys(HeadKeys):
    """The ``head`` section of a robot whose head is moved by ROS 2."""

    states: str = key(default="joint_states", help="The topic of its joint states (sensor_msgs/JointState).")
    command: str = key(default="head_controller/joint_trajectory", help=COMMAND_HELP)
    pan: Ros2AxisKeys = key(help="The joint that turns the head left and right.")
    tilt: Ros2AxisKeys = key(help="The joint that turns the head up and down.")
    away: ReconnectPolicy = key(default=ReconnectPolicy(), help="Reconnect policy after it was disconnected or silent.")

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield a diagnostic if both axes are the same joint, and one for each invalid topic name."""
        if self.pan.joint == self.tilt.joint:
            about = (("pan", "joint"), ("tilt", "joint"))
            yield KeyDiagnostic(f"'pan' and 'tilt' are both joint '{self.pan.joint}'", about=about)
        yield from _topic_mistakes(self, "states", "command")


@keys
class Ros2VoiceKeys(VoiceKeys):
    """The ``voice`` section of a robot that speaks by a ROS 2 topic."""

    topic: str = key(default="say", help="The topic of the speech node: each text is a std_msgs/String.")

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield a diagnostic for each key whose value is not a valid topic name."""
        yield from _topic_mistakes(self, "topic")


HEAD = Driver(
    "ros2",
    "head",
    "A head whose two joints are moved by ROS 2.",
    Ros2HeadKeys,
    make="drivers.ros2.make:head",
    twin="drivers.ros2.joints_twin:head",
    virtual="drivers.ros2.virtual:head",
    needs=("ros2",),
    extra="ros2",
)
ARM = Driver(
    "ros2",
    "arm",
    "An arm whose joints are moved by ROS 2.",
    Ros2ArmKeys,
    make="drivers.ros2.make:arm",
    twin="drivers.ros2.joints_twin:arm",
    virtual="drivers.ros2.virtual:arm",
    needs=("ros2",),
    extra="ros2",
)
VOICE = Driver(
    "ros2",
    "voice",
    "A speech node on a topic of ROS 2.",
    Ros2VoiceKeys,
    make="drivers.ros2.make:voice",
    needs=("ros2",),
    extra="ros2",
)
