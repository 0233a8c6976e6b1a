"""The leaf that tries a head with a camera: ahead, to its left, ahead, up, ahead; and the pictures of each pose."""

from collections import deque
from collections.abc import Callable
from math import radians

import cv2
import numpy as np
from py_trees.common import Status

from behaviours.head import Arrival, shown
from behaviours.leaf import SUCCESS, Leaf
from drivers.api import HeadPose, Image
from perception.api import Frame

ANGLE = radians(8)
"""Radians of each turn."""

POSES = (
    ("ahead", HeadPose(0.0, 0.0)),
    ("left", HeadPose(ANGLE, 0.0)),
    ("between", HeadPose(0.0, 0.0)),
    ("up", HeadPose(0.0, -ANGLE)),
    ("end", HeadPose(0.0, 0.0)),
)
"""Where it looks, one after the other."""

STILL_AFTER, DWELL = 0.6, 1.4
"""Seconds after its arrival from which on pictures count, since cameras are late, and until which it stays."""

TURN_TIMEOUT = 6.0
"""Seconds that a turn may take."""

WIDTH = 320
"""Pixels to which pictures are reduced."""

MAX_PICTURES = 300


class TryHead(Leaf):
    """Turn the head a little to each side, and note when it stood where.

    Running for about 10 s, then succeeds. Fails when the head does not arrive.
    """

    word = "try_head"
    needs = frozenset({"head", "camera"})
    drives = frozenset({"head"})
    senses = frozenset()
    stills: dict[str, tuple[float, float]]
    """From when to when the head stood in each pose, in seconds on the run's clock."""
    _index = 0
    _arrival: Arrival
    _since = 0.0
    _arrived_at: float | None = None

    def initialise(self) -> None:
        """Begin with the first pose."""
        self.stills = {}
        self._index = 0
        self._begin()

    def update(self) -> Status:
        """Go on to the present pose, and stay there for a while."""
        self.robot.sight.looked()  # a camera that nobody asks rests
        if self._index == len(POSES):
            return SUCCESS
        name, pose = POSES[self._index]
        head, now = self.robot.head, self.run.now()
        if self._arrived_at is None:
            goal = head.look(pose)
            if self._arrival(head.pose(), goal, now):
                self._arrived_at = now
            elif self._arrival.stuck or now - self._since > TURN_TIMEOUT:
                here = head.pose().value
                return self.fail(f"the head does not come to {shown(goal)}" + (f": {shown(here)}" if here else ""))
            return self.wait(f"on its way to {shown(goal)}")
        if now - self._arrived_at >= DWELL:
            self.stills[name] = self._arrived_at + STILL_AFTER, now
            self._index += 1
            self._begin()
        return self.wait(f"looks at {shown(pose)}")

    def _begin(self) -> None:
        self._arrival, self._since, self._arrived_at = Arrival(), self.run.now(), None

    def terminate(self, new_status: Status) -> None:
        """Stand still, whatever comes."""
        if new_status is not SUCCESS:
            self.robot.head.stop()


class PictureLog:
    """The newest pictures, small and grey, with their stamps. Called on the camera's thread; read once that ended."""

    def __init__(self) -> None:
        self._kept: deque[tuple[float, Image]] = deque(maxlen=MAX_PICTURES)

    def __call__(self, frame: Frame, _: object) -> None:
        """Keep a picture."""
        self._kept.append((frame.stamp, small(frame.image)))

    def within(self, start: float, end: float) -> Image | None:
        """Return the newest picture that was taken between two times; None without one."""
        return next((image for stamp, image in reversed(self._kept) if start <= stamp <= end), None)


def small(image: Image) -> Image:
    """Return a picture in shades of grey, ``WIDTH`` pixels wide."""
    grey = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    height = max(2, round(grey.shape[0] * WIDTH / grey.shape[1]))
    reduced: Image = np.asarray(cv2.resize(grey, (WIDTH, height), interpolation=cv2.INTER_AREA), np.uint8)
    return reduced


Pictures = Callable[[str], Image | None]
"""Returns the picture that was taken in a pose of ``POSES``."""
