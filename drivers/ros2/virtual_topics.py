"""Virtual base, range finder and camera of a robot with ROS 2: they exchange messages with the driver over topics."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from math import cos, inf, sin
from threading import RLock
from typing import Any

import cv2
import numpy as np

from drivers.api import Image, Lamp, Pose2D, Sides, Velocity
from drivers.base.reckoning import Reckoning
from drivers.ros2 import base, wire
from drivers.ros2.base import COMMAND_TOPICS, TOPIC_TYPES
from drivers.ros2.camera import IMAGES
from drivers.ros2.ranger import LASER_SCAN
from drivers.ros2.topic_port import ROUTER_PORT, TopicChannel
from drivers.ros2.types import MalformedMessage, types
from drivers.sim.base_body import NO_SIDES, BaseBody, merge_sides
from drivers.sim.scanner import RangeFunction
from drivers.sim.wheels import DelayLine

ODOMETRY_INTERVAL = 0.02
"""Seconds between two odometry messages."""

BATTERY_INTERVAL = 0.5
"""Seconds between two messages of battery and dock."""

BATTERY_VOLTAGE = 14.4

_FRAMES: Mapping[int, Mapping[str, tuple[str, ...]]] = {
    base.BUMP: {"left": ("bump_left",), "centre": ("bump_front_center",), "right": ("bump_right",)},
    base.CLIFF: {
        "left": ("cliff_side_left",),
        "centre": ("cliff_front_left", "cliff_front_right"),
        "right": ("cliff_side_right",),
    },
    base.WHEEL_DROP: {"left": ("wheel_drop_left",), "centre": (), "right": ("wheel_drop_right",)},
}
"""``frame_id`` of the contact sensors of a Create 3, by type of hazard and side."""


class VirtualTopics:
    """Base class of virtual devices on ``channels``: a ``drivers.virtual.terminal.WireDevice``. Thread-safe."""

    baud = ROUTER_PORT

    def __init__(self, channels: Sequence[TopicChannel]) -> None:
        self.channels = list(channels)
        self.is_stalled = False
        """True while the device sends and receives no messages, like a stalled connection."""
        self._finder = wire.TopicFrameFinder()
        self._lock = RLock()
        self._discovery_requested = False

    def power_on(self, now: float) -> None:  # noqa: ARG002 - it has its power from its battery
        """Reset the connection."""
        self._finder = wire.TopicFrameFinder()

    def feed(self, data: bytes, now: float) -> bytes:
        """Receive frames; return the replies."""
        with self._lock:
            for channel, payload in self._finder.feed(data):
                if channel == wire.ABOUT_CHANNEL:
                    self._discovery_requested = True
                elif not self.is_stalled and channel < wire.channel_code(
                    0, 1
                ):  # its first type is the one it subscribes to
                    self._handle_message(channel, payload, now)
            return self._take_frames(now)

    def poll(self, now: float) -> bytes:
        """Advance to time ``now``; return the frames that are due."""
        with self._lock:
            return self._take_frames(now)

    def _take_frames(self, now: float) -> bytes:
        asked, self._discovery_requested = self._discovery_requested, False
        about = [wire.about_frame(number, self._kind(number)) for number in range(len(self.channels))] if asked else []
        frames = [wire.frame(number, payload) for number, payload in self._messages(now)]
        return b"".join(about if self.is_stalled else [*about, *frames])

    def _kind(self, channel: int) -> str:
        return self.channels[channel].kinds[0]

    def _handle_message(self, channel: int, payload: bytes, now: float) -> None: ...

    def _messages(self, now: float) -> Iterable[tuple[int, bytes]]:  # noqa: ARG002 - of those that say something
        """Yield the messages that are due at ``now``, each with the index of its channel."""
        return ()


class VirtualRos2Base(VirtualTopics):
    """Virtual base on ROS 2 topics, with a simulated ``body``; ``topics`` are its topics by key.

    With ``stamped`` it subscribes to TwistStamped instead of Twist. It reports the contacts of its body, and those set
    by a test: ``bumper``, ``cliff``, ``wheel_drop``, and ``hazards`` (type and ``frame_id`` of each). Its odometry
    begins at ``origin``, as for a robot that has driven before. While ``velocity_source`` returns a velocity, that
    drives the base, as Nav2 does. Odometry is sent every ``odometry_interval`` seconds, delayed by ``odometry_delay``.
    ``received_velocities`` lists the received commands with their times.
    """

    def __init__(
        self,
        body: BaseBody,
        topics: Mapping[str, str],
        *,
        stamped: bool = False,
        origin: Pose2D = Pose2D(0.0, 0.0, 0.0),  # noqa: B008 - it is frozen
    ) -> None:
        twists = TOPIC_TYPES["cmd_vel"][::-1] if stamped else TOPIC_TYPES["cmd_vel"]
        super().__init__(
            [
                TopicChannel(name, twists if word == "cmd_vel" else TOPIC_TYPES[word], word in COMMAND_TOPICS)
                for word, name in topics.items()
            ]
        )
        self.body, self.origin = body, origin
        self.bumper = self.cliff = self.wheel_drop = Sides()
        self.hazards: list[tuple[int, str]] = []
        self.lamps: tuple[Lamp, Lamp] = (Lamp.OFF, Lamp.OFF)
        self.played_notes: list[int] = []
        self.received_velocities: list[tuple[float, Velocity]] = []
        self.velocity_source: Callable[[float, Pose2D], Velocity | None] = lambda now, pose: None  # noqa: ARG005
        self._roles = list(topics)
        self._reckoning = Reckoning()
        self.odometry_interval = ODOMETRY_INTERVAL
        self.odometry_delay: DelayLine[dict[str, object]] = DelayLine()
        self._due = self._slow_due = self._odometry_due = -inf

    def pose(self, now: float) -> Pose2D:
        """Return the true pose at time ``now``."""
        with self._lock:
            return self.body.advance(now)

    @property
    def odometry(self) -> Pose2D:
        """Pose of the virtual base by its odometry."""
        at, own = self.origin, self._reckoning.pose
        along, across = cos(at.heading), sin(at.heading)
        x, y = at.x + own.x * along - own.y * across, at.y + own.x * across + own.y * along
        return Pose2D(x, y, at.heading + own.heading)

    def _handle_message(self, channel: int, payload: bytes, now: float) -> None:
        word = self._roles[channel]
        try:
            told = types().decode(self._kind(channel), payload)
        except MalformedMessage:
            return
        if word == "cmd_vel":
            twist = getattr(told, "twist", told)
            velocity = Velocity(twist.linear.x, twist.angular.z)
            self.received_velocities.append((now, velocity))
            self.body.command(velocity.linear, velocity.angular, now)
        elif word == "lights":
            shown = [(each.red, each.green, each.blue) for each in told.leds]
            named = {colour: lamp for lamp, colour in base.COLOURS.items()}
            self.lamps = named[shown[0]], named[shown[5]]
        elif word == "sounds":
            self.played_notes += [each.frequency for each in told.notes]

    def _messages(self, now: float) -> Iterable[tuple[int, bytes]]:
        self.body.advance(now)
        velocity = self.velocity_source(now, self.odometry)
        if velocity is not None:
            self.body.command(velocity.linear, velocity.angular, now)
        self._reckoning.advance(now, self._wheel_velocity())
        if now >= self._due:
            self._due = now + ODOMETRY_INTERVAL
            yield from self._send("hazards", self._hazards())
            yield from self._send("sensors", {"bumper": int(bool(merge_sides(self.bumper, self.body.bumper)))})
        if now >= self._odometry_due:
            self._odometry_due = now + self.odometry_interval
            self.odometry_delay.put(now, self._odometry())
        for odometry in self.odometry_delay.pop_due(now):
            yield from self._send("odom", odometry)
        if now >= self._slow_due:
            self._slow_due = now + BATTERY_INTERVAL
            battery = self.body.battery
            status = 1 if self.body.docked else 2
            share = {"voltage": BATTERY_VOLTAGE, "percentage": battery.percent / 100, "power_supply_status": status}
            yield from self._send("battery", share)
            yield from self._send(
                "dock", {"dock_visible": bool(self.body.dock_signals()), "is_docked": self.body.docked}
            )

    def _send(self, role: str, values: Mapping[str, object]) -> Iterable[tuple[int, bytes]]:
        if role in self._roles:
            number = self._roles.index(role)
            yield number, types().encode(self._kind(number), values)

    def _wheel_velocity(self) -> Velocity:
        left, right = self.body.wheel_encoders.speeds
        return Velocity((left + right) / 2, (right - left) / self.body.wheels.separation + self.body.gyro_drift.rate)

    def _odometry(self) -> dict[str, object]:
        at, moves = self.odometry, self._wheel_velocity()
        turned = {"z": sin(at.heading / 2), "w": cos(at.heading / 2)}
        return {
            "header": {"frame_id": "odom"},
            "child_frame_id": "base_link",
            "pose": {"pose": {"position": {"x": at.x, "y": at.y}, "orientation": turned}},
            "twist": {"twist": {"linear": {"x": moves.linear}, "angular": {"z": moves.angular}}},
        }

    def _hazards(self) -> dict[str, object]:
        felt: dict[int, Sides] = {
            base.BUMP: merge_sides(self.bumper, self.body.bumper),
            base.CLIFF: merge_sides(self.cliff, self.body.cliff),
            base.WHEEL_DROP: merge_sides(self.wheel_drop, self.body.wheel_drop or NO_SIDES),
        }
        found = [
            (kind, frame)
            for kind, sides in felt.items()
            for side, frames in _FRAMES[kind].items()
            if getattr(sides, side)
            for frame in frames
        ]
        if self.body.backup_limit is not None and self.body.backup_limit.is_reached:
            found.append((base.BACKUP_LIMIT, "base_link"))
        return {"detections": [{"type": kind, "header": {"frame_id": frame}} for kind, frame in found + self.hazards]}


class VirtualScan(VirtualTopics):
    """Virtual range finder on a ROS 2 topic, which measures with ``look``.

    ``yaw`` is its mounting angle on the base (radians). A scan has ``beams`` beams all around; ``rate`` is in scans per
    second.
    """

    def __init__(
        self, look: RangeFunction, topic: str, *, yaw: float = 0.0, beams: int = 360, rate: float = 8.0, seed: int = 0
    ) -> None:
        super().__init__([TopicChannel(topic, (LASER_SCAN,))])
        self._look, self._yaw, self._beams, self._period = look, yaw, beams, 1 / rate
        self._random = np.random.default_rng(seed)
        self._due = -inf

    def _messages(self, now: float) -> Iterable[tuple[int, bytes]]:
        if now < self._due:
            return
        self._due = now + self._period
        step = 2 * np.pi / self._beams
        own = -np.pi + step * np.arange(self._beams)
        ranges = self._look(np.asarray(own + self._yaw, np.float64), now - self._period / 2)
        ranges = ranges * (1 + self._random.normal(0, 0.01, self._beams))
        ranges[ranges > 12.0] = np.inf
        scan: dict[str, Any] = {
            "header": {"frame_id": "laser"}, "angle_min": -np.pi, "angle_max": np.pi - step, "angle_increment": step,
            "scan_time": self._period, "range_min": 0.15, "range_max": 12.0, "ranges": ranges.astype(np.float32),
        }  # fmt: skip
        yield 0, types().encode(LASER_SCAN, scan)


class VirtualPictures(VirtualTopics):
    """Virtual camera on a ROS 2 topic: sends the result of ``draw``, ``rate`` times per second.

    Pictures have the shape (height, width, 3), BGR. With ``compressed`` they are sent as JPEG in CompressedImage
    messages.
    """

    def __init__(
        self, draw: Callable[[float], Image], topic: str, *, compressed: bool = False, rate: float = 10.0
    ) -> None:
        super().__init__([TopicChannel(topic, IMAGES[1:] if compressed else IMAGES[:1])])
        self._draw, self._period = draw, 1 / rate
        self._due = -inf

    def _messages(self, now: float) -> Iterable[tuple[int, bytes]]:
        if now < self._due:
            return
        self._due = now + self._period
        image = self._draw(now)
        kind = self._kind(0)
        if kind == IMAGES[1]:
            data = cv2.imencode(".jpg", image)[1].tobytes()
            yield 0, types().encode(kind, {"format": "bgr8; jpeg compressed bgr8", "data": data})
            return
        height, width = image.shape[:2]
        values = {"height": height, "width": width, "encoding": "bgr8", "step": 3 * width, "data": image.tobytes()}
        yield 0, types().encode(kind, values)
