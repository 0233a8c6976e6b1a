"""Camera on a ROS 2 topic, of type Image or CompressedImage."""

from collections.abc import Callable
from threading import Event
from typing import Any

import cv2
import numpy as np

from drivers.api import Image, StatusCallback, ignore
from drivers.clock import Clock
from drivers.errors import NotConnected
from drivers.pictures.decode import MAX_PIXELS, SKIPPED_PICTURE, decode_picture
from drivers.ros2 import wire
from drivers.ros2.node import TopicFaults, topic_hint
from drivers.ros2.topic_port import GetNode, TopicChannel, TopicPort, absent_error
from drivers.ros2.types import MalformedMessage, types

IMAGES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")

RECEIVE_TIMEOUT = 0.2
"""Maximum seconds of one wait for a picture; ``TopicFeed.grab`` waits repeatedly, for ``OFFLINE_TIMEOUT`` in all."""

OFFLINE_TIMEOUT = 2.0
"""Seconds without a picture after which the topic is subscribed again."""

_ENCODINGS = {
    "bgr8": (3, None),
    "rgb8": (3, cv2.COLOR_RGB2BGR),
    "8uc3": (3, None),
    "bgra8": (4, cv2.COLOR_BGRA2BGR),
    "rgba8": (4, cv2.COLOR_RGBA2BGR),
    "mono8": (1, cv2.COLOR_GRAY2BGR),
    "8uc1": (1, cv2.COLOR_GRAY2BGR),
    "yuv422_yuy2": (2, cv2.COLOR_YUV2BGR_YUY2),
    "yuyv": (2, cv2.COLOR_YUV2BGR_YUY2),
    "yuv422": (2, cv2.COLOR_YUV2BGR_UYVY),
    "uyvy": (2, cv2.COLOR_YUV2BGR_UYVY),
    "nv21": (1, cv2.COLOR_YUV2BGR_NV21),
    "bayer_rggb8": (1, cv2.COLOR_BayerBG2BGR),  # OpenCV names the pattern by its second row
    "bayer_bggr8": (1, cv2.COLOR_BayerRG2BGR),
    "bayer_gbrg8": (1, cv2.COLOR_BayerGR2BGR),
    "bayer_grbg8": (1, cv2.COLOR_BayerGB2BGR),
}
"""Supported encodings of Image messages: bytes per pixel, and OpenCV's conversion code to BGR or None.

Only the upper 8 bits of a 16-bit encoding are used.
"""


class TopicFeed:
    """A ``drivers.pictures.capture.CameraFeed`` of the pictures on a topic."""

    def __init__(self, get_node: GetNode, topic: str, clock: Clock, report: StatusCallback = ignore) -> None:
        self._get_node = get_node
        self._faults = TopicFaults("camera", [topic], clock, report)
        self._channel = TopicChannel(topic, IMAGES, depth=1)
        self._port: TopicPort | None = None
        self._finder = wire.TopicFrameFinder()
        self._kind = ""

    @property
    def source_name(self) -> str:
        """Name of the topic that brings the pictures."""
        return self._channel.topic

    @property
    def hint(self) -> str:
        """Command to type if no picture comes. If received messages are unusable, the reason comes before it."""
        why = self._faults.fault(0)
        return f"{why}; {topic_hint(self._channel.topic)}" if why else topic_hint(self._channel.topic)

    def start(self, closing: Event) -> float | None:  # noqa: ARG002 - it waits for nothing
        """Subscribe to the topic. Raises NotConnected while it has no publisher."""
        self._port = TopicPort(self._get_node("camera"), [self._channel])
        self._finder, self._kind = wire.TopicFrameFinder(), ""
        for channel, payload in self._finder.feed(self._port.read_available(0.0)):
            self._handle_control_frame(channel, payload)
        if not self._kind:
            self.stop()
            raise absent_error("camera", self._channel, self._faults.fault(0))
        return None

    def grab(self, skip_count: Callable[[], int]) -> Image | None:
        """Return the next picture; None after a timeout, or if the session is lost: see ``CameraFeed``."""
        for _ in range(round(OFFLINE_TIMEOUT / RECEIVE_TIMEOUT)):
            found = self._receive_messages()
            if found is None:
                return None
            for payload in found[-1:]:
                if skip_count() > 0:
                    return SKIPPED_PICTURE
                try:
                    return decode_image(self._kind, payload)
                except (MalformedMessage, ValueError) as error:
                    self._faults.add(0, error)
        return None

    def stop(self) -> None:
        """Unsubscribe. Safe from any state, more than once."""
        port, self._port = self._port, None
        if port is not None:
            port.close()

    def _receive_messages(self) -> list[bytes] | None:
        """Return the messages received within ``RECEIVE_TIMEOUT``, maybe none; None if the session is lost."""
        if self._port is None:
            return None
        try:
            data = self._port.read_available(RECEIVE_TIMEOUT)
        except (OSError, NotConnected):
            return None
        return [
            payload for channel, payload in self._finder.feed(data) if not self._handle_control_frame(channel, payload)
        ]

    def _handle_control_frame(self, channel: int, payload: bytes) -> bool:
        """Handle a control frame of the topic port, which tells about the publishers; return False for other frames.

        Other frames are messages with pictures.
        """
        if channel == wire.ABOUT_CHANNEL:
            self._kind = next(iter(wire.parse_about(payload)[1]), self._kind)
        elif channel == wire.MISMATCH_CHANNEL:
            self._faults.mismatch(payload)
        return channel in (wire.ABOUT_CHANNEL, wire.MISMATCH_CHANNEL)


def decode_image(kind: str, payload: bytes) -> Image:
    """Return the picture of a message: (height, width, 3), BGR. Raises MalformedMessage, ValueError if invalid."""
    told = types().decode(kind, payload)
    if kind == IMAGES[1]:
        found = decode_picture(told.data.tobytes())
        if found is None:
            raise ValueError(f"{told.format}: no picture")
        return found
    return _decode_raw(told)


def _decode_raw(message: Any) -> Image:
    encoding, of = str(message.encoding).lower(), 1
    if encoding.endswith("16"):
        encoding, of = f"{encoding[:-2]}8", 2
    if encoding not in _ENCODINGS:
        raise ValueError(f"the encoding {message.encoding!r:.40} is not understood")
    size, made = _ENCODINGS[encoding]
    width, height, step = int(message.width), int(message.height), int(message.step)
    if not (width and height and width * height <= MAX_PIXELS and step >= of * size * width):
        raise ValueError(f"{width} x {height} pixels in rows of {step} bytes are not a valid picture")
    lines = height * 3 // 2 if encoding == "nv21" else height
    if len(message.data) < step * lines:
        raise ValueError(f"{len(message.data)} bytes are not enough")
    upper = 1 if of == 2 and not message.is_bigendian else 0
    rows = message.data[: step * lines].reshape(lines, step)[:, upper : of * size * width : of]
    image = np.ascontiguousarray(rows).reshape(lines, width, size)
    try:
        converted = image if made is None else cv2.cvtColor(image, made)
    except cv2.error as error:
        raise ValueError(str(error)) from error
    return np.asarray(converted, np.uint8).copy()
