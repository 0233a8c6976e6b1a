"""Leaf that turns a head with a camera to known poses, and a log of the pictures."""

from collections import deque
from collections.abc import Callable
from math import radians

import cv2
import numpy as np
from py_trees.common import Status

from behaviours.head import ArrivalDetector, pose_text
from behaviours.leaf import SUCCESS, Leaf
from drivers.api import HeadPose, Image
from perception.api import Frame

TURN_ANGLE = radians(8)
"""Angle in radians by which a head trial turns the head."""

TRIAL_POSES = (
    ("ahead", HeadPose(0.0, 0.0)),
    ("left", HeadPose(TURN_ANGLE, 0.0)),
    ("between", HeadPose(0.0, 0.0)),
    ("up", HeadPose(0.0, -TURN_ANGLE)),
    ("end", HeadPose(0.0, 0.0)),
)
"""Names and poses of the steps of a head trial, in order."""

SETTLING_TIME, DWELL_TIME = 0.6, 1.4
"""Seconds in each pose; pictures count after ``SETTLING_TIME``, since cameras are late."""

TURN_TIMEOUT = 6.0
"""Maximum seconds until the head has turned to a pose."""

PICTURE_WIDTH = 320
"""Width in pixels to which camera pictures are reduced."""

MAX_PICTURES = 300


class TryHead(Leaf):
    """Turn the head a little to each side, and record the times in each pose.

    Running for about 10 s, then succeeds. Fails if the head does not arrive.
    """

    tag = "try_head"
    needs = frozenset({"head", "camera"})
    drives = frozenset({"head"})
    senses = frozenset()
    still_times: dict[str, tuple[float, float]]
    """Start and end of the time in which the head was at rest in each pose, by the name of the pose (s, run's clock).
    """
    _index = 0
    _arrival: ArrivalDetector
    _started_at = 0.0
    _arrived_at: float | None = None

    def initialise(self) -> None:
        self.still_times = {}
        self._index = 0
        self._start_pose()

    def update(self) -> Status:
        self.robot.sight.looked()  # perception sleeps unless it is queried
        if self._index == len(TRIAL_POSES):
            return SUCCESS
        name, pose = TRIAL_POSES[self._index]
        head, now = self.robot.head, self.run.now()
        if self._arrived_at is None:
            goal = head.look(pose)
            if self._arrival(head.pose(), goal, now):
                self._arrived_at = now
            elif self._arrival.stuck or now - self._started_at > TURN_TIMEOUT:
                here = head.pose().value
                return self.fail(
                    f"the head does not reach {pose_text(goal)}" + (f": it is at {pose_text(here)}" if here else "")
                )
            return self.wait(f"on its way to {pose_text(goal)}")
        if now - self._arrived_at >= DWELL_TIME:
            self.still_times[name] = self._arrived_at + SETTLING_TIME, now
            self._index += 1
            self._start_pose()
        return self.wait(f"looks at {pose_text(pose)}")

    def _start_pose(self) -> None:
        self._arrival, self._started_at, self._arrived_at = ArrivalDetector(), self.run.now(), None

    def terminate(self, new_status: Status) -> None:
        """Stop the head."""
        if new_status is not SUCCESS:
            self.robot.head.stop()


class PictureLog:
    """The newest camera pictures, small and grey, with their stamps; filled on the camera's thread.

    Read it only after that thread has ended.
    """

    def __init__(self) -> None:
        self._pictures: deque[tuple[float, Image]] = deque(maxlen=MAX_PICTURES)

    def __call__(self, frame: Frame, _: object) -> None:
        self._pictures.append((frame.stamp, reduce_picture(frame.image)))

    def within(self, start: float, end: float) -> Image | None:
        """Return the newest picture between two times; None without one."""
        return next((image for stamp, image in reversed(self._pictures) if start <= stamp <= end), None)


def reduce_picture(image: Image) -> Image:
    """Return a picture in grey, scaled to a width of ``PICTURE_WIDTH`` pixels."""
    grey = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    height = max(2, round(grey.shape[0] * PICTURE_WIDTH / grey.shape[1]))
    reduced: Image = np.asarray(cv2.resize(grey, (PICTURE_WIDTH, height), interpolation=cv2.INTER_AREA), np.uint8)
    return reduced


PictureLookup = Callable[[str], Image | None]
"""Function that returns the picture taken in a pose of ``TRIAL_POSES``, by the pose's name."""
