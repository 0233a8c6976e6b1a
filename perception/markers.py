"""Sense for other robots: square numbered markers of ArUco and AprilTag."""

from math import atan2, cos, remainder, sin, sqrt, tan, tau

import cv2
import numpy as np
import numpy.typing as npt

from perception.api import Box, Frame, Gaze, Image, Marker
from perception.geometry import Pinhole
from perception.image_preparation import to_grey
from perception.tracks import MarkerSet, MarkerSighting, Tracker

Corners = npt.NDArray[np.float32]
"""Corners of a marker's black frame in pixels: shape (4, 2), dtype float32, clockwise from the marker's own top left.
"""


class MarkerSense:
    """Detects and tracks markers: a ``perception.senses.Sense[Marker]``.

    If several sides of a robot are visible, the largest marker counts.
    """

    def __init__(self, kind: MarkerSet) -> None:
        self._kind = kind
        dictionary = marker_dictionary(kind.family)
        parameters = cv2.aruco.DetectorParameters()
        # Two looks at the edges, fine and coarse, find what three do.
        parameters.adaptiveThreshWinSizeMin, parameters.adaptiveThreshWinSizeMax = 5, 23
        parameters.adaptiveThreshWinSizeStep = 18
        parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        self._detector = cv2.aruco.ArucoDetector(dictionary, parameters)
        self._tracker = Tracker[Marker]()

    def sense(self, frame: Frame, camera: Pinhole, gaze: Gaze | None) -> tuple[Marker, ...]:
        largest: dict[int, Corners] = {}
        for number, corners in self.find(frame.image):
            if number not in largest or _area(corners) > _area(largest[number]):
                largest[number] = corners
        pitch = 0.0 if gaze is None else gaze.pitch
        sightings = [self._sighting(number, corners, camera, pitch) for number, corners in largest.items()]
        return self._tracker.update(sightings, camera=camera, gaze=gaze, stamp=frame.stamp)

    def find(self, image: Image) -> list[tuple[int, Corners]]:
        """Return the number and the corners of each marker in a picture."""
        found, numbers, _ = self._detector.detectMarkers(to_grey(image))
        if not found:  # then there are no numbers either
            return []
        return [
            (int(number), np.asarray(corners, np.float32).reshape(4, 2))
            for number, corners in zip(np.asarray(numbers).ravel(), found, strict=True)
        ]

    def _sighting(self, number: int, corners: Corners, camera: Pinhole, pitch: float) -> MarkerSighting:
        place, normal = _pose(corners, camera, self._kind.size)
        x, y = (float(value) for value in corners.min(axis=0))
        right, bottom = (float(value) for value in corners.max(axis=0))
        return MarkerSighting(
            number,
            self._kind.robots.get(number, ""),
            Box(x, y, right - x, bottom - y),
            sqrt(sum(value * value for value in place)),
            _heading(place, normal, pitch),
        )


def marker_dictionary(family: str) -> cv2.aruco.Dictionary:
    """Return OpenCV's dictionary of one of the ``MARKER_FAMILIES``."""
    number: int = getattr(cv2.aruco, f"DICT_{family.upper()}")
    return cv2.aruco.getPredefinedDictionary(number)


def _area(corners: Corners) -> float:
    return float(cv2.contourArea(corners))


def _pose(corners: Corners, camera: Pinhole, size: float) -> tuple[list[float], list[float]]:
    """Return position in metres and outward normal of a marker, both in camera axes: right, down, forward.

    The corners are converted to directions first, so that the lens distortion is corrected. Two poses show a square
    almost alike (Collins and Bartoli, "Infinitesimal plane-based pose estimation", 2014); the one that fits better is
    returned.
    """
    angles = [camera.pixel_to_angles(float(x), float(y)) for x, y in corners]
    directions = np.array([(-tan(bearing), tan(elevation) / cos(bearing)) for bearing, elevation in angles])
    half = size / 2
    square = np.array([(-half, half, 0.0), (half, half, 0.0), (half, -half, 0.0), (-half, -half, 0.0)])
    _, turn, place = cv2.solvePnP(square, directions, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE_SQUARE)
    matrix, _ = cv2.Rodrigues(turn)
    return [float(value) for value in np.ravel(place)], [float(value) for value in np.asarray(matrix)[:, 2]]


def _heading(place: list[float], normal: list[float], pitch: float) -> float:
    """Return the heading of a marker in radians about the vertical: 0 towards the camera, positive to its own left.

    ``place`` and ``normal`` are the marker's position and outward normal in camera axes. ``pitch`` is that of the
    camera; with it, the camera axes are levelled.
    """

    def level(vector: list[float]) -> tuple[float, float]:
        right, down, forward = vector
        return right, forward * cos(pitch) - down * sin(pitch)

    (facing_right, facing_on), (right, on) = level(normal), level(place)
    return remainder(atan2(facing_right, -facing_on) - atan2(-right, on), tau)
