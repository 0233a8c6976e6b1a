"""A camera whose pictures come by ROS 2: as Image, or as CompressedImage."""

from collections.abc import Callable
from threading import Event
from typing import Any

import cv2
import numpy as np

from drivers.api import Image, Report, ignore
from drivers.clock import Clock
from drivers.errors import NotConnected
from drivers.pictures.decode import MOST_PIXELS, UNWANTED, decoded
from drivers.ros2 import wire
from drivers.ros2.line import Channel, Nodes, TopicPort, absent
from drivers.ros2.node import TopicFaults, hint_for
from drivers.ros2.types import Malformed, types

IMAGES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")

PATIENCE = 0.2
"""Seconds for which a picture is waited for, before it is looked whether anybody still wants one."""

SILENT_AFTER = 2.0
"""Seconds without a picture after which the topic is looked for again."""

_CHANNELS = {
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
    "bayer_rggb8": (1, cv2.COLOR_BayerBG2BGR),  # which OpenCV calls by its second row
    "bayer_bggr8": (1, cv2.COLOR_BayerRG2BGR),
    "bayer_gbrg8": (1, cv2.COLOR_BayerGR2BGR),
    "bayer_grbg8": (1, cv2.COLOR_BayerGB2BGR),
}
"""The encodings that are understood: bytes of a pixel, and what OpenCV is to make of them.

Those of 16 bits are understood by the upper 8.
"""


class TopicFeed:
    """A ``drivers.pictures.capture.Feed`` of the pictures on a topic."""

    def __init__(self, nodes: Nodes, topic: str, clock: Clock, report: Report = ignore) -> None:
        self._nodes = nodes
        self._faults = TopicFaults("camera", [topic], clock, report)
        self._channel = Channel(topic, IMAGES, depth=1)
        self._port: TopicPort | None = None
        self._finder = wire.FrameFinder()
        self._kind = ""

    @property
    def what(self) -> str:
        """The topic."""
        return self._channel.topic

    @property
    def hint(self) -> str:
        """What to try when no picture comes; why what has come is none."""
        why = self._faults.why(0)
        return f"{why}; {hint_for(self._channel.topic)}" if why else hint_for(self._channel.topic)

    def start(self, ending: Event) -> float | None:  # noqa: ARG002 - it waits for nothing
        """Listen to the topic. Raises NotConnected while nobody sends it."""
        self._port = TopicPort(self._nodes("camera"), [self._channel])
        self._finder, self._kind = wire.FrameFinder(), ""
        for channel, payload in self._finder.feed(self._port.arrived(0.0)):
            self._note(channel, payload)
        if not self._kind:
            self.stop()
            raise absent("camera", self._channel, self._faults.why(0))
        return None

    def grab(self, spare: Callable[[], int]) -> Image | None:
        """Return the next picture; None when none has come for a while, or the session is lost: see Feed."""
        for _ in range(round(SILENT_AFTER / PATIENCE)):
            found = self._next()
            if found is None:
                return None
            for payload in found[-1:]:
                if spare() > 0:
                    return UNWANTED
                try:
                    return picture(self._kind, payload)
                except (Malformed, ValueError) as error:
                    self._faults.add(0, error)
        return None

    def stop(self) -> None:
        """Listen no more. Safe from any state, more than once."""
        port, self._port = self._port, None
        if port is not None:
            port.close()

    def _next(self) -> list[bytes] | None:
        """Return the messages that have come, none after a while; None when the session is lost."""
        if self._port is None:
            return None
        try:
            data = self._port.arrived(PATIENCE)
        except (OSError, NotConnected):
            return None
        return [payload for channel, payload in self._finder.feed(data) if not self._note(channel, payload)]

    def _note(self, channel: int, payload: bytes) -> bool:
        """Take note of who sends; say whether that was what has come."""
        if channel == wire.ABOUT:
            self._kind = next(iter(wire.told(payload)[1]), self._kind)
        elif channel == wire.MISMATCH:
            self._faults.mismatch(payload)
        return channel in (wire.ABOUT, wire.MISMATCH)


def picture(kind: str, payload: bytes) -> Image:
    """Return the picture of a message: (height, width, 3), BGR. Raises Malformed, ValueError for what is none."""
    told = types().decode(kind, payload)
    if kind == IMAGES[1]:
        found = decoded(told.data.tobytes())
        if found is None:
            raise ValueError(f"{told.format}: no picture")
        return found
    return _raw(told)


def _raw(told: Any) -> Image:
    encoding, of = str(told.encoding).lower(), 1
    if encoding.endswith("16"):
        encoding, of = f"{encoding[:-2]}8", 2
    if encoding not in _CHANNELS:
        raise ValueError(f"the encoding {told.encoding!r:.40} is not understood")
    size, made = _CHANNELS[encoding]
    width, height, step = int(told.width), int(told.height), int(told.step)
    if not (width and height and width * height <= MOST_PIXELS and step >= of * size * width):
        raise ValueError(f"{width} x {height} pixels in rows of {step} bytes are no picture")
    lines = height * 3 // 2 if encoding == "nv21" else height
    if len(told.data) < step * lines:
        raise ValueError(f"{len(told.data)} bytes are too few")
    upper = 1 if of == 2 and not told.is_bigendian else 0
    rows = told.data[: step * lines].reshape(lines, step)[:, upper : of * size * width : of]
    image = np.ascontiguousarray(rows).reshape(lines, width, size)
    try:
        converted = image if made is None else cv2.cvtColor(image, made)
    except cv2.error as error:
        raise ValueError(str(error)) from error
    return np.asarray(converted, np.uint8).copy()
