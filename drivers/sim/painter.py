"""Drawing of flat shapes of the world into a picture, as a pinhole camera sees them."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import acos, hypot, pi

import cv2
import numpy as np
import numpy.typing as npt

from drivers.api import Camera, CameraFrame, Health, Image
from drivers.sim.room import Colour, Fixture, Room, WallName
from drivers.sim.solids import Solid
from drivers.sim.viewpoint import PinholeLens, Viewpoint
from drivers.sim.world_objects import Edge

# A fixed camera made to pan and tilt: its pictures turned as a moving head would have seen them.
#
# So footage that was recorded once closes the loop with a simulated head.

_AHEAD_ROTATION = np.array(Viewpoint().rotation())


def rotate_view(image: Image, view: Viewpoint, field_of_view: float) -> Image:
    """Return ``image`` as seen after a rotation about the lens by the yaw and pitch of ``view``.

    A pure rotation maps pictures by the homography K R K^-1 at any distance of the scene (Hartley and Zisserman,
    Multiple View Geometry, 8.4). Outside the source the result has the mean colour, in which detectors find nothing.
    """
    lens = PinholeLens(image.shape[1], image.shape[0], field_of_view)
    mean = cv2.mean(image)
    rotation = np.array(view.rotation())
    angle = acos(float(np.clip(rotation[2] @ _AHEAD_ROTATION[2], -1.0, 1.0)))
    # Beyond the first angle the two pictures share nothing; beyond the second the homography would show the source
    # mirrored through the lens, as it cannot tell what is behind it.
    if angle >= min(2 * lens.half_diagonal, pi - 2 * lens.half_diagonal):
        return np.full_like(image, np.rint(mean[:3]))
    camera = np.array(lens.matrix())
    to_source = camera @ _AHEAD_ROTATION @ rotation.T @ np.linalg.inv(camera)
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
    """A ``drivers.api.Camera`` that rotates each picture of ``camera`` to ``viewpoint(stamp)``, as on a moving head.

    Only yaw and pitch count; 0 is straight ahead, along the optical axis of the wrapped camera.
    """

    def __init__(self, camera: Camera, viewpoint: Callable[[float], Viewpoint]) -> None:
        self._camera = camera
        self._viewpoint = viewpoint

    @property
    def name(self) -> str:
        return self._camera.name

    @property
    def field_of_view(self) -> float:
        return self._camera.field_of_view

    def open(self) -> None:
        self._camera.open()

    def rest(self) -> None:
        """Do nothing: a camera has no actuator."""

    def close(self) -> None:
        self._camera.close()

    def health(self) -> Health:
        return self._camera.health()

    def read(self, timeout: float) -> CameraFrame | None:
        """Return the newest frame of the wrapped camera, rotated; None if none arrived within ``timeout`` seconds."""
        frame = self._camera.read(timeout)
        if frame is None:
            return None
        view = self._viewpoint(frame.stamp)
        return CameraFrame(rotate_view(frame.image, view, self.field_of_view), frame.stamp, frame.number)


Floats = npt.NDArray[np.float64]

NEAR_PLANE = 0.1
"""Metres in front of the lens within which nothing is drawn."""

_SHIFT = 4  # bits of sub-pixel accuracy in OpenCV's drawing functions


class Painter:
    """Picture that is being painted. Later shapes cover earlier ones, so draw from back to front."""

    def __init__(self, image: Image, view: Viewpoint, lens: PinholeLens) -> None:
        self.image = image
        self.view = view
        self.lens = lens
        self.eye = np.array(view.position())
        self.rotation = np.array(view.rotation())
        self._middle = np.array(lens.matrix())[:2, 2]
        # How far sideways, up and down the picture reaches, in multiples of the depth.
        self._half_extent = np.array((lens.width, lens.height)) / 2 / lens.focal

    def is_outside(self, solid: Solid) -> bool:
        """Return whether a solid is certainly behind the camera, or left or right of the picture."""
        across, _, depth = self.view.to_camera_axes(solid.x, solid.y, (solid.bottom + solid.top) / 2)
        radius = hypot(solid.bounding_radius, (solid.top - solid.bottom) / 2)
        wide = float(self._half_extent[0])
        return depth < NEAR_PLANE - radius or abs(across) - wide * depth > radius * hypot(1.0, wide)

    def fill(self, corners: Floats, colours: Sequence[Colour]) -> None:
        """Draw quadrilaterals in their order: float64 of shape (n, 4, 3), in metres."""
        seen = (corners - self.eye) @ self.rotation.T  # camera coordinates
        depth = seen[..., 2]
        limits = depth[..., None] * self._half_extent  # (n, 4, 2)
        beyond = np.concatenate((seen[..., :2] > limits, seen[..., :2] < -limits), axis=2).all(axis=1)  # (n, 4)
        shown = (depth.max(axis=1) > NEAR_PLANE) & (beyond.sum(axis=1) == 0)
        whole = depth.min(axis=1) > NEAR_PLANE
        pixels = self._pixels(seen)
        for index in np.flatnonzero(shown).tolist():
            polygon = (
                pixels[index]
                if whole[index]
                else self._pixels(np.array([_clip_to_near_plane(seen[index].tolist())]))[0]
            )
            cv2.fillConvexPoly(self.image, polygon, colours[index][::-1], cv2.LINE_AA, _SHIFT)

    def _pixels(self, points: Floats) -> npt.NDArray[np.int32]:
        """Return the pixels (n, k, 2) of points (n, k, 3) in camera coordinates, in fixed point (``_SHIFT``)."""
        exact = points[..., :2] * (self.lens.focal / np.maximum(points[..., 2:], NEAR_PLANE)) + self._middle
        pixels: npt.NDArray[np.int32] = np.rint(exact * 2**_SHIFT).astype(np.int32)
        return pixels


def _clip_to_near_plane(corners: list[list[float]]) -> list[list[float]]:
    """Return a polygon without its part nearer than ``NEAR_PLANE`` (Sutherland and Hodgman, for one plane)."""
    kept = []
    for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
        if a[2] > NEAR_PLANE:
            kept.append(a)
        if (a[2] > NEAR_PLANE) != (b[2] > NEAR_PLANE):
            share = (NEAR_PLANE - a[2]) / (b[2] - a[2])
            kept.append([p + share * (q - p) for p, q in zip(a, b, strict=True)])
    return kept


# Cuts a room into flat coloured quadrilaterals, ready to be projected into a picture.

_WALL_SHADES: dict[WallName, float] = {"front": 1.0, "left": 0.9, "back": 0.96, "right": 0.84}
_SKIRTING_HEIGHT = 0.09  # metres
_STAIR_COUNT = 6
_STAIR_COLOUR: Colour = (58, 48, 42)
_PLANK_WIDTH = 0.5  # metres, width of a floor board


@dataclass(frozen=True, slots=True, eq=False)
class RoomPanel:
    """A coloured quadrilateral: ``corners`` in metres, float64 of shape (4, 3), in order round its edge."""

    corners: Floats
    colour: Colour


def room_panels(room: Room) -> tuple[RoomPanel, ...]:
    """Return the panels of a room, in the order of painting."""
    fixtures = (part for item in room.fixtures for part in _fixture_panels(room, item))
    return (*_floor_and_ceiling_panels(room), *_wall_panels(room), *fixtures)


def hole_panels(edges: Iterable[Edge]) -> Iterator[RoomPanel]:
    """Yield the panels of areas without floor: stairs that lead down and become darker, with a light rim."""
    for edge in edges:
        low, high = edge.y - edge.width / 2, edge.y + edge.width / 2
        places = np.linspace(edge.x - edge.length / 2, edge.x + edge.length / 2, _STAIR_COUNT + 1)
        for number, (x0, x1) in enumerate(pairwise(places)):
            step = np.array(((x0, low, 0.0), (x1, low, 0.0), (x1, high, 0.0), (x0, high, 0.0)))
            yield RoomPanel(step, shade_colour(_STAIR_COLOUR, 1.0 - number / _STAIR_COUNT))


def shade_colour(colour: Colour, share: float) -> Colour:
    """Return ``colour`` multiplied by ``share``, clipped to 0..255."""
    red, green, blue = (min(255, max(0, round(value * share))) for value in colour)
    return red, green, blue


def _floor_and_ceiling_panels(room: Room) -> Iterator[RoomPanel]:
    (x0, x1), (y0, y1) = room.extent()
    ceiling = ((x0, y0, room.height), (x1, y0, room.height), (x1, y1, room.height), (x0, y1, room.height))
    yield RoomPanel(np.array(ceiling), room.ceiling)
    edges = [*np.arange(y0, y1, _PLANK_WIDTH), y1]
    for number, (low, high) in enumerate(pairwise(edges)):
        board = np.array(((x0, low, 0.0), (x1, low, 0.0), (x1, high, 0.0), (x0, high, 0.0)))
        yield RoomPanel(board, shade_colour(room.floor, (1.0, 0.94, 1.04)[number % 3]))


def _wall_panels(room: Room) -> Iterator[RoomPanel]:
    for wall, shade in _WALL_SHADES.items():
        half = room.wall_length(wall) / 2
        colour = shade_colour(room.wall, shade)
        yield RoomPanel(_wall_rectangle(room, wall, (-half, half), (0.0, room.height)), colour)
        yield RoomPanel(_wall_rectangle(room, wall, (-half, half), (0.0, _SKIRTING_HEIGHT)), shade_colour(colour, 0.62))


def _fixture_panels(room: Room, item: Fixture) -> Iterator[RoomPanel]:
    """Yield the panels of one fixture, such as the frame and the panes of a window."""
    for left, right, low, high, colour in _PARTS[item.kind](item.colour):
        along = (item.along + item.width * (left - 0.5), item.along + item.width * (right - 0.5))
        up = (item.bottom + item.height * low, item.bottom + item.height * high)
        yield RoomPanel(_wall_rectangle(room, item.wall, along, up), colour)


def _wall_rectangle(room: Room, wall: WallName, along: tuple[float, float], up: tuple[float, float]) -> Floats:
    """Return the corners (4, 3) of a rectangle on a wall, in metres.

    ``along`` are its left and right edge from the middle of the wall, positive to the right as seen from inside; ``up``
    are the heights of its lower and upper edge above the floor.
    """
    (x0, x1), (y0, y1) = room.extent()
    x, y = room.centre
    origin, right = {
        "front": ((x1, y), (0.0, -1.0)),
        "left": ((x, y1), (1.0, 0.0)),
        "back": ((x0, y), (0.0, 1.0)),
        "right": ((x, y0), (-1.0, 0.0)),
    }[wall]
    corners = ((along[0], up[0]), (along[1], up[0]), (along[1], up[1]), (along[0], up[1]))
    return np.array([(origin[0] + a * right[0], origin[1] + a * right[1], z) for a, z in corners])


_Parts = Iterator[tuple[float, float, float, float, Colour]]


def _door(colour: Colour) -> _Parts:
    yield 0.0, 1.0, 0.0, 1.0, shade_colour(colour, 0.7)
    yield 0.06, 0.94, 0.0, 0.97, colour
    yield 0.18, 0.82, 0.08, 0.46, shade_colour(colour, 0.88)
    yield 0.18, 0.82, 0.56, 0.9, shade_colour(colour, 0.9)
    yield 0.84, 0.92, 0.5, 0.52, (200, 190, 150)


def _window(colour: Colour) -> _Parts:
    yield 0.0, 1.0, 0.0, 1.0, (232, 230, 224)
    yield 0.05, 0.95, 0.07, 0.95, colour
    yield 0.05, 0.95, 0.07, 0.3, shade_colour(colour, 0.78)
    yield 0.48, 0.52, 0.07, 0.95, (232, 230, 224)
    yield -0.04, 1.04, -0.05, 0.0, (214, 212, 206)


def _picture(colour: Colour) -> _Parts:
    yield 0.0, 1.0, 0.0, 1.0, (62, 50, 42)
    yield 0.06, 0.94, 0.08, 0.92, (226, 222, 212)
    yield 0.14, 0.86, 0.18, 0.82, shade_colour(colour, 1.3)
    yield 0.14, 0.86, 0.18, 0.46, colour
    yield 0.5, 0.86, 0.18, 0.38, shade_colour(colour, 0.7)


_PARTS = {"door": _door, "window": _window, "picture": _picture}
