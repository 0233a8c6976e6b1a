"""A robot that speaks ROS 2 over Zenoh, and its parts, as drivers; their keys in a robot file."""

from collections.abc import Iterator
from typing import Literal

from drivers.api.driver import Driver
from drivers.api.keys import Mistake, key, keys
from drivers.api.sections import BaseKeys, RangeKeys, Ros2Keys
from drivers.api.senses import CameraKeys


@keys
class ZenohKeys(Ros2Keys):
    """The ``ros2`` section of a robot that is reached over Zenoh (`rmw_zenoh`)."""

    router: str = key(
        default="tcp/127.0.0.1:7447",
        help="Where its Zenoh router is: `tcp/HOST:7447`, or `tls/HOST:PORT` with `ca`; several with commas.",
    )
    mode: Literal["client", "peer"] = key(
        default="client", help="`client` sends all over the router; `peer` goes directly to the nodes that it tells of."
    )
    user: str = key(default="", help="The user, where the router asks for one.")
    password_file: str = key(default="", help="A file with the user's password in its first line.")
    ca: str = key(default="", help="A file with the certificate that has signed the router's, for `tls/`.")
    certificate: str = key(default="", help="A file with our own certificate, where the router asks for one.")
    private_key: str = key(default="", help="A file with the key of our own certificate.")

    def mistakes(self) -> Iterator[Mistake]:
        """Yield what does not go together."""
        if bool(self.user) != bool(self.password_file):
            lacking = "password_file" if self.user else "user"
            yield Mistake(f"'user' and 'password_file' go together: '{lacking}' is missing", ("router",))
        if bool(self.certificate) != bool(self.private_key):
            lacking = "private_key" if self.certificate else "certificate"
            yield Mistake(f"'certificate' and 'private_key' go together: '{lacking}' is missing", ("router",))
        for each in self.router.split(","):
            if each.strip().split("/")[0] not in {"tcp", "tls", "quic", "ws", "unixsock-stream"} or "/" not in each:
                yield Mistake(f"'router': '{each.strip()}' is no address such as tcp/192.168.1.20:7447", ("router",))


ZENOH = Driver(
    "zenoh",
    "ros2",
    "The nodes of ROS 2, over Zenoh (rmw_zenoh).",
    ZenohKeys,
    make="drivers.ros2.make:graph",
    twin="drivers.sim.twins.ros2:graph",
    virtual="drivers.virtual.ros2:graph",
    extra="ros2",
)


@keys
class Ros2BaseKeys(BaseKeys):
    """The ``base`` section of a robot that is driven by ROS 2."""

    max_speed: float = key("speed", default=0.3, low=0.01, high=5.0, help="The highest speed.")
    cmd_vel: str = key(default="cmd_vel", help="The topic of its velocity: a Twist or a TwistStamped.")
    odom: str = key(default="odom", help="The topic of its odometry.")
    battery: str = key(default="", help="The topic of its battery (sensor_msgs/BatteryState); none without.")
    hazards: str = key(default="", help="The topic of a Create 3's bumpers, cliffs and wheel drops; none without.")
    dock: str = key(default="", help="The topic of a Create 3's dock (DockStatus); none without.")
    lights: str = key(default="", help="The topic of a Create 3's ring of lights; none without.")
    sounds: str = key(default="", help="The topic of a Create 3's sounds; none without.")
    sensors: str = key(default="", help="The topic of a TurtleBot 3's bumper and cliff (SensorState); none without.")


BASE = Driver(
    "ros2",
    "base",
    "A base that is driven by ROS 2: a TurtleBot 4, a TurtleBot 3, any with Twist and Odometry.",
    Ros2BaseKeys,
    make="drivers.ros2.make:base",
    twin="drivers.sim.twins.ros2:base",
    virtual="drivers.virtual.ros2:base",
    needs=("ros2",),
    extra="ros2",
)


@keys
class Ros2RangeKeys(RangeKeys):
    """The ``range`` section of a robot whose range finder is a topic of ROS 2."""

    scan: str = key(default="scan", help="The topic of its scans (sensor_msgs/LaserScan).")


RANGE = Driver(
    "ros2",
    "range",
    "A range finder whose scans come by ROS 2.",
    Ros2RangeKeys,
    make="drivers.ros2.make:ranger",
    twin="drivers.sim.twins.ros2:ranger",
    virtual="drivers.virtual.ros2:ranger",
    needs=("ros2",),
    extra="ros2",
)


@keys
class Ros2CameraKeys(CameraKeys):
    """The ``camera`` section of a robot whose pictures come by ROS 2."""

    image: str = key(default="image_raw", help="The topic of its pictures: Image or CompressedImage.")


CAMERA = Driver(
    "ros2",
    "camera",
    "A camera whose pictures come by ROS 2.",
    Ros2CameraKeys,
    make="drivers.ros2.make:camera",
    needs=("ros2",),
    extra="ros2",
)
