"""Draws flat shapes of the world into one picture, as a pinhole camera sees them."""

from collections.abc import Callable, Sequence
from math import acos, hypot, pi

import cv2
import numpy as np
import numpy.typing as npt

from drivers.api import Camera, CameraFrame, Health, Image
from drivers.sim.block import Solid
from drivers.sim.room import Colour
from drivers.sim.viewpoint import Pinhole, Viewpoint

# A fixed camera made to pan and tilt: its pictures turned as a moving head would have seen them.
#
# So footage that was recorded once closes the loop with a simulated head.

_AHEAD = np.array(Viewpoint().rotation())


def turned(image: Image, view: Viewpoint, field_of_view: float) -> Image:
    """Return ``image`` as seen after a rotation about the lens by the yaw and pitch of ``view``.

    A pure rotation maps pictures by the homography K R K^-1, whatever the distance of what they show (Hartley and
    Zisserman, Multiple View Geometry, 8.4). Outside the source there is the mean colour of the picture, in which
    no detector finds anything.
    """
    lens = Pinhole(image.shape[1], image.shape[0], field_of_view)
    mean = cv2.mean(image)
    rotation = np.array(view.rotation())
    angle = acos(float(np.clip(rotation[2] @ _AHEAD[2], -1.0, 1.0)))
    # Beyond the first angle the two pictures share nothing; beyond the second the homography would show the source
    # mirrored through the lens, as it cannot tell what is behind it.
    if angle >= min(2 * lens.half_diagonal, pi - 2 * lens.half_diagonal):
        return np.full_like(image, np.rint(mean[:3]))
    camera = np.array(lens.matrix())
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


Floats = npt.NDArray[np.float64]

NEAR_PLANE = 0.1
"""Metres in front of the lens within which nothing is drawn."""

_SHIFT = 4  # bits of sub-pixel accuracy in OpenCV's drawing functions


class Painter:
    """One picture that is being drawn. What is drawn hides what was there: begin with what is farthest."""

    def __init__(self, image: Image, view: Viewpoint, lens: Pinhole) -> None:
        self.image = image
        self.view = view
        self.lens = lens
        self.eye = np.array(view.place())
        self.turn = np.array(view.rotation())
        self._middle = np.array(lens.matrix())[:2, 2]
        # How far sideways, up and down the picture reaches, in multiples of the depth.
        self._reach = np.array((lens.width, lens.height)) / 2 / lens.focal

    def is_outside(self, solid: Solid) -> bool:
        """Say whether something is surely behind the camera, or left or right of the picture."""
        across, _, depth = self.view.sees(solid.x, solid.y, (solid.bottom + solid.top) / 2)
        radius = hypot(solid.reach, (solid.top - solid.bottom) / 2)
        wide = float(self._reach[0])
        return depth < NEAR_PLANE - radius or abs(across) - wide * depth > radius * hypot(1.0, wide)

    def fill(self, corners: Floats, colours: Sequence[Colour]) -> None:
        """Draw quadrilaterals, float64 of shape (n, 4, 3) in metres, in their order."""
        seen = (corners - self.eye) @ self.turn.T  # camera coordinates
        depth = seen[..., 2]
        limits = depth[..., None] * self._reach  # (n, 4, 2)
        beyond = np.concatenate((seen[..., :2] > limits, seen[..., :2] < -limits), axis=2).all(axis=1)  # (n, 4)
        shown = (depth.max(axis=1) > NEAR_PLANE) & (beyond.sum(axis=1) == 0)
        whole = depth.min(axis=1) > NEAR_PLANE
        pixels = self._pixels(seen)
        for index in np.flatnonzero(shown).tolist():
            polygon = pixels[index] if whole[index] else self._pixels(np.array([_clipped(seen[index].tolist())]))[0]
            cv2.fillConvexPoly(self.image, polygon, colours[index][::-1], cv2.LINE_AA, _SHIFT)

    def _pixels(self, points: Floats) -> npt.NDArray[np.int32]:
        """Return the pixels (n, k, 2) of points (n, k, 3) in camera coordinates, as OpenCV draws with ``_SHIFT``."""
        exact = points[..., :2] * (self.lens.focal / np.maximum(points[..., 2:], NEAR_PLANE)) + self._middle
        pixels: npt.NDArray[np.int32] = np.rint(exact * 2**_SHIFT).astype(np.int32)
        return pixels


def _clipped(corners: list[list[float]]) -> list[list[float]]:
    """Cut off what of a polygon lies nearer than ``NEAR_PLANE`` (Sutherland and Hodgman, for this one plane)."""
    kept = []
    for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
        if a[2] > NEAR_PLANE:
            kept.append(a)
        if (a[2] > NEAR_PLANE) != (b[2] > NEAR_PLANE):
            share = (NEAR_PLANE - a[2]) / (b[2] - a[2])
            kept.append([p + share * (q - p) for p, q in zip(a, b, strict=True)])
    return kept
