"""A fixed camera made to pan and tilt: its pictures turned as a moving head would have seen them.

So footage that was recorded once closes the loop with a simulated head.
"""

from collections.abc import Callable
from math import acos, pi

import cv2
import numpy as np

from drivers.api import Camera, CameraFrame, Health, Image
from drivers.sim.viewpoint import Pinhole, Viewpoint

_AHEAD = Viewpoint().rotation()


def turned(image: Image, view: Viewpoint, field_of_view: float) -> Image:
    """Return ``image`` as seen after a rotation about the lens by the yaw and pitch of ``view``.

    A pure rotation maps pictures by the homography K R K^-1, whatever the distance of what they show (Hartley and
    Zisserman, Multiple View Geometry, 8.4). Outside the source there is the mean colour of the picture, in which
    no detector finds anything.
    """
    lens = Pinhole(image.shape[1], image.shape[0], field_of_view)
    mean = cv2.mean(image)
    rotation = view.rotation()
    angle = acos(float(np.clip(rotation[2] @ _AHEAD[2], -1.0, 1.0)))
    # Beyond the first angle the two pictures share nothing; beyond the second the homography would show the source
    # mirrored through the lens, as it cannot tell what is behind it.
    if angle >= min(2 * lens.half_diagonal, pi - 2 * lens.half_diagonal):
        return np.full_like(image, np.rint(mean[:3]))
    camera = lens.matrix()
    to_source = camera @ _AHEAD @ rotation.T @ np.linalg.inv(camera)
    moved = cv2.warpPerspective(
        image,
        to_source,
        (lens.width, lens.height),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=mean,
    )
    return np.asarray(moved, np.uint8)


class PannedCamera:
    """Turns each picture of ``camera`` to where ``viewpoint(stamp)`` looks; meets ``drivers.api.Camera``.

    Only yaw and pitch count: 0 is straight ahead, along the optical axis of the wrapped camera. Opening, closing and
    health are those of the wrapped camera.
    """

    def __init__(self, camera: Camera, viewpoint: Callable[[float], Viewpoint]) -> None:
        self._camera = camera
        self._viewpoint = viewpoint

    @property
    def name(self) -> str:
        """The name of the wrapped camera."""
        return self._camera.name

    @property
    def field_of_view(self) -> float:
        """The horizontal angle of view in radians."""
        return self._camera.field_of_view

    def open(self) -> None:
        """Open the wrapped camera."""
        self._camera.open()

    def rest(self) -> None:
        """Do nothing: a camera moves nothing."""

    def close(self) -> None:
        """Close the wrapped camera."""
        self._camera.close()

    def health(self) -> Health:
        """Say how the wrapped camera is."""
        return self._camera.health()

    def read(self, timeout: float) -> CameraFrame | None:
        """Return the wrapped camera's newest frame, turned; None when none came within ``timeout`` seconds."""
        frame = self._camera.read(timeout)
        if frame is None:
            return None
        view = self._viewpoint(frame.stamp)
        return CameraFrame(turned(frame.image, view, self.field_of_view), frame.stamp, frame.number)
