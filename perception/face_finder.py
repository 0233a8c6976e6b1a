"""Face detection and tracking over frames, at a small part of the cost of searching each frame.

The whole picture is searched until there is a face. The search plan of the detector says for which faces: the first
frame is searched for all but small faces, the second for small ones, later frames for leaning heads. After that,
optical flow carries the box from frame to frame. Now and then a search of the region around it confirms the face, less
often the better both agree. The whole picture is searched for newcomers now and then. In an empty scene every second
frame is searched at first, then every eighth, and fewer while nothing changes. A face counts as long as more
independent confirmations succeeded than failed.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from math import hypot, inf, log2
from typing import Protocol, cast, runtime_checkable

import cv2
import numpy as np
import numpy.typing as npt

from drivers.api.fast_dataclass import dataclass
from perception.api import Box, Detection, Image
from perception.face_search import ANY_FACE, FaceSearch, StillPictureDetector
from perception.image_preparation import GreyImage, check_image, resize, to_grey, window_slices
from perception.tracks import FaceSighting

# Following a patch of the picture from one frame to the next by sparse optical flow.

Floats = npt.NDArray[np.float32]
Points = Floats
"""Positions in a picture: shape (n, 1, 2), dtype float32, x then y in pixels."""

FLOW_REACH = (
    2.4  # how much of the picture is looked at, in widths of the box: it may move by 0.7 of one from frame to frame
)
MIN_FLOW_REACH = (
    40  # or by these, where that is more: a head that pans at 60 degrees/s moves the picture by 32 in 50 ms
)
MAX_PATCH_PIXELS = 32  # pixels to which a larger box is shrunk: what it costs does not grow with the face
MAX_CORNERS = 20
INNER_SHARE = 0.8  # of the box is looked at for corners
FLOW_WINDOW = (9, 9)  # pixels around a corner that are compared
MIN_POINTS = 6  # points that must be followed for the result to count
MAX_RETURN_ERROR = 1.0  # pixels by which a point may miss its start when it is followed back


def track_box(before: Image | GreyImage, after: Image | GreyImage, box: Box) -> Box | None:
    """Return the place in ``after`` of the patch ``box`` of ``before``; None if it cannot be tracked.

    Corners on the inner part of the box are tracked forwards and backwards with pyramidal Lucas-Kanade. Corners that do
    not return to their start are dropped. The median of the rest moves the box; their spread scales it.
    """
    if before.shape != after.shape or box.width <= 0:
        return None
    rows, columns = window_slices(before.shape, box, max(FLOW_REACH, 1.0 + 2 * MIN_FLOW_REACH / box.width))
    if before[rows, columns].size == 0:
        return None
    scale = min(1.0, MAX_PATCH_PIXELS / box.width)
    old, new = (_shrink(to_grey(picture[rows, columns]), scale) for picture in (before, after))
    inner = Box((box.x - columns.start) * scale, (box.y - rows.start) * scale, box.width * scale, box.height * scale)
    start = _find_corners(old, inner)
    if start is None:
        return None
    pairs = _follow_points(old, new, start)
    if pairs is None:
        return None
    return _move_box(box, *pairs, scale, before.shape)


def _shrink(picture: GreyImage, scale: float) -> GreyImage:
    """Return a picture scaled by ``scale``: halved first, since other averages take five times as long.

    The result may lack a pixel at the right and the bottom.
    """
    part = 2 ** int(-log2(scale))
    height, width = (side // part for side in picture.shape[:2])
    if part > 1 and min(height, width) > 0:
        even = picture[: height * part, : width * part]
        picture, scale = cast(GreyImage, cv2.resize(even, (width, height), interpolation=cv2.INTER_AREA)), scale * part
    return resize(picture, scale)


def _find_corners(picture: GreyImage, box: Box) -> Points | None:
    """Return points for tracking on the inner part of the box, away from the background at its edges."""
    rows, columns = window_slices(picture.shape, box, INNER_SHARE)
    if picture[rows, columns].size == 0:
        return None
    # OpenCV says None for no corner at all, which its type stubs leave out.
    found = cast(Points | None, cv2.goodFeaturesToTrack(picture[rows, columns], MAX_CORNERS, 0.02, 3))
    return None if found is None else found + np.array((columns.start, rows.start), np.float32)


def _follow_points(old: GreyImage, new: GreyImage, start: Points) -> tuple[Points, Points] | None:
    """Return the points of ``start`` that could be tracked from ``old`` to ``new`` and back: before, and after.

    Each array has the shape (n, 2). None if too few points could be tracked.
    """
    there, seen, _ = cv2.calcOpticalFlowPyrLK(old, new, start, start.copy(), winSize=FLOW_WINDOW, maxLevel=3)
    back, seen_back, _ = cv2.calcOpticalFlowPyrLK(new, old, there, there.copy(), winSize=FLOW_WINDOW, maxLevel=3)
    missed_by = np.hypot(*(back - start).reshape(-1, 2).T)
    good = (seen.ravel() == 1) & (seen_back.ravel() == 1) & (missed_by < MAX_RETURN_ERROR)
    if np.count_nonzero(good) < MIN_POINTS:
        return None
    return cast(Points, start.reshape(-1, 2)[good]), cast(Points, there.reshape(-1, 2)[good])


def _move_box(box: Box, start: Points, there: Points, scale: float, shape: tuple[int, ...]) -> Box | None:
    """Return ``box`` moved and scaled as the points moved from ``start`` to ``there``; None if it has left the picture.

    The points are in a picture scaled by ``scale``; ``shape`` is that of the original picture.
    """
    middle, middle_there = _median(start), _median(there)
    spread = float(_median(np.hypot(*(start - middle).T)))
    spread_there = float(_median(np.hypot(*(there - middle_there).T)))
    growth = min(max(spread_there / max(spread, 1.0), 0.9), 1.1)
    shift_x, shift_y = _median(there - start) / scale
    x, y = box.centre[0] + float(shift_x), box.centre[1] + float(shift_y)
    if not (0 <= x < shape[1] and 0 <= y < shape[0]):
        return None
    width, height = box.width * growth, box.height * growth
    return Box(x - width / 2, y - height / 2, width, height)


def _median(values: Floats) -> Floats:
    """Return the upper median along the first axis; numpy's own takes ten times as long for so few values."""
    return cast(Floats, np.sort(values, axis=0)[len(values) // 2])


# One face that is followed: how often it was found and borne out, and when it is looked for again.

SAME_FACE_OVERLAP = 0.3
"""Overlap (intersection over union) above which two boxes are one face."""

AGREEMENT_OVERLAP = 0.6
"""Overlap above which detector and optical flow agree on a face: a Haar box jitters by a tenth of its width."""

MAX_RESTED_FRAMES = 2
"""Largest number of consecutive frames in which a face is extrapolated instead of tracked.

Faces are only extrapolated if there are ``MIN_CROWD`` or more of them, to save time.
"""

RETRY_INTERVAL = 5
"""Frames from a failed search for a known face to the next search."""

MAX_TRUST = 3
"""Largest trust of a face; trust rises by one for each confirmed search, and falls by one for each failed search."""


@dataclass(slots=True)
class FollowedFace:
    """A face that is tracked from frame to frame.

    ``found_count`` counts its detections, and ``misses`` the failed searches since the last detection.
    ``search_interval`` is the number of frames between two searches, ``frames_to_search`` that to the next search.
    ``trust`` is confirmations minus failures. ``last_measurement`` is the newest picture in which the face was located,
    with its box; ``rested_frames`` counts the frames since. ``drift`` is the motion in pixels per frame up to then.
    ``is_resting`` is True if the face is extrapolated in this frame.
    """

    detection: Detection
    found: bool = True
    found_count: int = 1
    misses: int = 0
    frames_to_search: int = 1
    search_interval: int = 1
    trust: int = 0
    is_believed: bool = False
    aside_searches: int = 0
    last_measurement: tuple[Image | GreyImage, Box] | None = None
    drift: tuple[float, float] = (0.0, 0.0)
    is_resting: bool = False
    rested_frames: int = 0

    def update_trust(self, confirmed: bool) -> None:
        """Count a confirmation or a failure.

        Until confirmations outnumber failures, the face is searched in each frame.
        """
        self.trust = min(max(self.trust + (1 if confirmed else -1), -MAX_TRUST), MAX_TRUST)
        self.is_believed |= self.trust > 0
        if -MAX_TRUST < self.trust <= 0:
            self.search_interval = self.frames_to_search = 1

    def track(self, before: Image | GreyImage, image: Image | GreyImage) -> bool:
        """Track the face to this frame by optical flow; return False if that fails."""
        shown, box = self.last_measurement or (before, self.detection.box)
        frames, self.rested_frames = self.rested_frames + 1, 0
        carried = track_box(shown, image, box)
        if carried is None:
            return False
        (x, y), (was_x, was_y) = carried.centre, box.centre
        self.drift = (x - was_x) / frames, (y - was_y) / frames
        self.detection = replace(self.detection, box=carried)
        return True

    def extrapolate(self) -> bool:
        """Move the face on at its drift, without tracking; return False if tracking is due."""
        if (
            self.trust <= 0
            or self.frames_to_search <= 1
            or self.rested_frames >= MAX_RESTED_FRAMES
            or self.last_measurement is None
        ):
            return False
        box, (x, y) = self.detection.box, self.drift
        self.detection = replace(self.detection, box=replace(box, x=box.x + x, y=box.y + y))
        self.rested_frames += 1
        return True

    def end_frame(self, image: Image | GreyImage) -> None:
        """Store the picture and box of this frame as the newest measurement, unless the face was extrapolated."""
        if not self.is_resting:
            self.last_measurement, self.rested_frames = (image, self.detection.box), 0
        self.is_resting = False

    def on_found(self, detection: Detection, max_interval: int) -> None:
        """Record that the detector has found the face again.

        If it agrees with the tracked box, the interval to the next search doubles, up to ``max_interval`` frames.
        """
        agrees = self.detection.box.overlap(detection.box) > AGREEMENT_OVERLAP
        self.search_interval = min(2 * self.search_interval, max_interval) if agrees else 1
        self.detection, self.found = detection, True
        self.found_count, self.misses, self.aside_searches, self.frames_to_search = (
            self.found_count + 1,
            0,
            0,
            self.search_interval,
        )

    def on_turned_aside(self) -> None:
        """Record that the face is in profile at the place to which optical flow has tracked it."""
        self.aside_searches += 1
        self.search_interval, self.frames_to_search = 1, RETRY_INTERVAL

    def on_missed(self) -> None:
        """Record that the detector has not found the face at the place to which optical flow has tracked it."""
        self.misses += 1
        self.update_trust(False)
        self.search_interval, self.frames_to_search = 1, RETRY_INTERVAL


def drop_duplicates(followed: Iterable[FollowedFace]) -> list[FollowedFace]:
    """Return the faces without overlapping ones; of two, the one known for longer stays."""
    kept: list[FollowedFace] = []
    for known in followed:
        if all(known.detection.box.overlap(other.detection.box) <= SAME_FACE_OVERLAP for other in kept):
            kept.append(known)
    return kept


LOST_FACE_FRAMES = 25
"""Number of frames after the loss of a face in which the whole picture is searched more often."""

NEWCOMER_INTERVAL = 40
"""Default frames between two searches of the whole picture while a face is known."""

FIRST_NEWCOMER_INTERVAL = 1
"""Frames from the detection of a new face to the first search for further faces, as people may come together.

The interval to each further search is four times as long, up to the newcomer interval.
"""

EMPTY_SEARCH_INTERVAL = 2
"""Frames between two searches while no face is found, for the first ``LONG_EMPTY_SEARCH_INTERVAL`` frames."""

LONG_EMPTY_SEARCH_INTERVAL = 8
"""Frames between two searches once no face was found for that many frames; twice as many if searches are expensive."""

MAX_ASIDE_SEARCHES = 6
"""Number of consecutive searches that find a face in profile after which it is no longer tracked."""

MIN_CROWD = 3
"""Number of faces from which on optical flow tracks only the largest in each frame, and the others in every third."""

MAX_STEADY_SHIFT = 0.02
"""Largest motion of a face per frame at which it counts as standing still, in widths of the face.

It is 0.1 m/s at 30 frames per second.
"""


class FaceDetector(Protocol):
    """Face detector for the finder: searches a whole picture, or near a known face."""

    def detect(
        self, image: Image | GreyImage, *, smallest: float = 0.0, largest: float = inf, roll: float = 0.0
    ) -> Sequence[Detection]:
        """Return the faces anywhere in the picture, at least those whose width is ``smallest``..``largest`` pixels.

        ``roll`` is the angle by which they lean to the right, in radians.
        """
        ...

    def detect_near(self, image: Image | GreyImage, box: Box, *, roll: float = 0.0) -> Detection | None:
        """Return the face near ``box``, or None."""
        ...


@runtime_checkable
class ThoroughDetector(Protocol):
    """Optional abilities of a face detector: confirmation of a face, leaning and turned heads, and a search plan."""

    newcomer_interval: int
    """Frames between two searches of the whole picture while a face is known."""

    search_plan: Sequence[FaceSearch]
    """Searches of a whole picture. The first is the most frequent; each of the others runs now and then in its place.
    """

    quick_search: FaceSearch
    """Search of a whole picture for frames in which there is little time."""

    def is_expensive(self, image: Image | GreyImage) -> bool:
        """Return whether a search of ``image`` takes far longer than usual, for example because it is dark."""
        ...

    def is_confirmed(self, image: Image | GreyImage, box: Box, *, roll: float = 0.0) -> bool:
        """Return whether searches that are independent of the first detection see a face at ``box``, too."""
        ...

    def detect_leaning(self, image: Image | GreyImage, known: Detection) -> Iterable[Detection]:
        """Yield places of the ``known`` face at other angles of lean."""
        ...

    def is_turned_aside(self, image: Image | GreyImage, box: Box) -> bool:
        """Return whether a face that was found at ``box`` is still there, but in profile."""
        ...


class FaceFinder:
    """Finds and tracks faces in the frames of one camera or film. For one thread at a time.

    ``confirm_interval``: frames between two searches near a certain face. ``max_misses``: failed searches in a row
    until a face is dropped while optical flow still tracks it; it is then in profile, or was no face at all.
    ``newcomer_interval``: frames between two searches of the whole picture while a face is known; by default that of
    the detector. A sighting is ``found`` if the detector found it and, for a ``ThoroughDetector``, it was confirmed. An
    unconfirmed face is searched again in the next frame and dropped at the first miss, because most false faces
    flicker.
    """

    def __init__(
        self,
        detector: FaceDetector,
        *,
        confirm_interval: int = 10,
        max_misses: int = 3,
        newcomer_interval: int | None = None,
    ) -> None:
        self._detector = detector
        self._confirm_interval = confirm_interval
        self._max_misses = max_misses
        self._thorough = detector if isinstance(detector, ThoroughDetector) else None
        self._newcomer_interval = newcomer_interval or (
            self._thorough.newcomer_interval if self._thorough else NEWCOMER_INTERVAL
        )
        self._faces: list[FollowedFace] = []
        self._previous: Image | GreyImage | None = None
        self._frames_since_search = 0
        self._search_plan = tuple(self._thorough.search_plan) if self._thorough else (ANY_FACE,)
        self._search_count = 0  # how many of them were made
        self._lost_face_frames = 0  # frames for which a face that was lost is still looked for
        self._lost_face_search = self._search_plan[0]  # the search that would find it
        self._newcomer_wait = FIRST_NEWCOMER_INTERVAL  # frames to the next search for newcomers
        self._empty_frames = 0  # frames in a row without a face
        self._is_expensive = False  # whether the newest search was
        self._still_detector = StillPictureDetector()
        self._last_centres: list[tuple[float, float]] = []  # of known faces, as it was last asked what can be spared

    def find(self, image: Image | GreyImage) -> list[FaceSighting]:
        """Return the faces in the next frame, largest first. Raises ValueError for an invalid picture."""
        check_image(image)
        before, self._previous = self._previous, image
        followed = self._faces
        whole = self._frames_since_search + 1 >= self._search_interval()
        if before is not None:
            largest = max(followed, key=lambda known: known.detection.box.width, default=None)
            for known in followed if len(followed) >= MIN_CROWD and not whole else ():
                known.is_resting = known is not largest and known.extrapolate()
            self._faces = [known for known in followed if self._track(known, before, image, wait=whole)]
        believed = [known for known in followed if known.is_believed]
        if believed and not self._faces:
            self._expect_return(believed[0], image)
        self._frames_since_search += 1
        if self._frames_since_search >= (pause := self._search_interval()):
            empty = pause > 1 and not any(known.trust > 0 for known in self._faces)
            self._search_picture(image, unless_still=empty)
        self._faces = [
            known
            for known in self._faces
            if known.frames_to_search > 0 or self._search_near(known, image, carried=True)
        ]
        self._faces = drop_duplicates(self._faces)
        self._empty_frames = 0 if any(known.trust > 0 for known in self._faces) else self._empty_frames + 1
        self._lost_face_frames -= 1
        for known in believed:
            if known.found_count > 2 and all(known is not other for other in self._faces):
                self._expect_return(known, image)
        found = [
            FaceSighting(known.detection, known.found and known.trust > 0, is_believed=known.is_believed)
            for known in self._faces
        ]
        for known in self._faces:
            known.end_frame(image)
        return sorted(found, key=lambda sighting: -sighting.detection.box.width)

    def skip_frames(self, limit: int) -> int:
        """Return how many of the next frames, at most ``limit``, may be skipped, and count them as searched.

        Only frames in which no search is due are skipped. If there are faces, all of them must have stayed in place
        since the frame before, and at most a third of ``limit`` is skipped.
        """
        before, self._last_centres = self._last_centres, [known.detection.box.centre for known in self._faces]
        pause = self._search_interval()
        if self._faces:
            limit = limit // 3 if self._lost_face_frames <= 0 and self._is_steady(before) else 0
        elif pause < LONG_EMPTY_SEARCH_INTERVAL:
            return 0
        spared = max(
            0, min(limit, pause - 1 - self._frames_since_search, *(known.frames_to_search - 1 for known in self._faces))
        )
        for known in self._faces:
            known.frames_to_search -= spared
        self._frames_since_search += spared
        return spared

    def _is_steady(self, before: Sequence[tuple[float, float]]) -> bool:
        """Return whether all faces are certain, and have stayed in place.

        ``before`` are the centres of their boxes at the last call.
        """
        return len(before) == len(self._faces) and all(
            known.trust > 0 and hypot(x - was_x, y - was_y) <= MAX_STEADY_SHIFT * known.detection.box.width
            for known, (x, y), (was_x, was_y) in zip(self._faces, self._last_centres, before, strict=True)
        )

    def reset(self) -> None:
        """Forget all faces, before the frames of another film."""
        self._faces.clear()
        self._previous = None
        self._frames_since_search, self._search_count, self._lost_face_frames = 0, 0, 0
        self._empty_frames, self._newcomer_wait, self._is_expensive = 0, FIRST_NEWCOMER_INTERVAL, False
        self._still_detector = StillPictureDetector()

    def _search_interval(self) -> int:
        """Return the frames from one search of the whole picture to the next."""
        lost = self._lost_face_frames > 0
        if any(known.trust > 0 for known in self._faces):
            return RETRY_INTERVAL if lost else self._newcomer_wait
        if lost or self._empty_frames < len(self._search_plan):
            return 1
        if self._is_expensive:
            return 2 * LONG_EMPTY_SEARCH_INTERVAL
        return EMPTY_SEARCH_INTERVAL if self._empty_frames < LONG_EMPTY_SEARCH_INTERVAL else LONG_EMPTY_SEARCH_INTERVAL

    def _next_search(self, image: Image | GreyImage) -> FaceSearch:
        """Return the next search of the whole picture, by the detector's search plan."""
        sure = [known for known in self._faces if known.trust > 0]
        if self._lost_face_frames > 0 and (sure or self._lost_face_frames % 2):
            return self._lost_face_search
        if self._thorough and not sure and len(self._search_plan) <= self._empty_frames < LONG_EMPTY_SEARCH_INTERVAL:
            return self._thorough.quick_search
        turn, self._search_count = self._search_count, self._search_count + 1
        main, *others = self._search_plan
        if sure:  # who is with whom they know
            return main if turn % 2 else self._search_for_face(sure[0].detection, image)
        if turn < len(self._search_plan):
            return self._search_plan[turn]
        return others[turn // 2 % len(others)] if turn % 2 and others else main

    def _search_for_face(self, face: Detection, image: Image | GreyImage) -> FaceSearch:
        """Return the first search of the plan that would find a face of the size and lean of ``face``."""
        return next((each for each in self._search_plan if each.fits(face, max(image.shape))), self._search_plan[0])

    def _on_found(self, known: FollowedFace, detection: Detection, image: Image | GreyImage) -> None:
        """Record a detection of a known face, and confirm the face while it is not certain."""
        known.on_found(detection, self._confirm_interval)
        self._confirm(known, image)

    def _confirm(self, known: FollowedFace, image: Image | GreyImage) -> None:
        if known.trust < MAX_TRUST:
            known.update_trust(self._thorough is None or self._is_confirmed(self._thorough, known.detection, image))

    def _is_confirmed(self, thorough: ThoroughDetector, found: Detection, image: Image | GreyImage) -> bool:
        return thorough.is_confirmed(image, found.box, roll=found.roll)

    def _expect_return(self, lost: FollowedFace, image: Image | GreyImage) -> None:
        """Search the whole picture soon for faces of the size of the face ``lost``.

        It may come back, for example if someone has walked through the picture in front of it.
        """
        self._lost_face_frames = LOST_FACE_FRAMES
        self._lost_face_search = self._search_for_face(lost.detection, image)

    def _track(self, known: FollowedFace, before: Image | GreyImage, image: Image | GreyImage, *, wait: bool) -> bool:
        """Track a face to the new frame; return False if it is lost.

        With ``wait``, the search near the face is postponed, so that not too many searches fall into one frame.
        """
        known.found = False
        known.frames_to_search -= 1
        if known.is_resting:
            return True
        carried = known.track(before, image)
        if carried and (known.frames_to_search > 0 or wait):
            return True
        return self._search_near(known, image, carried=carried)

    def _search_near(self, known: FollowedFace, image: Image | GreyImage, *, carried: bool) -> bool:
        """Search near the place of a known face; return False if it is lost.

        ``carried`` is True if optical flow has tracked the face to this frame.
        """
        again = self._find_again(known, image)
        if again is not None:
            self._on_found(known, again, image)
            return True
        if carried and self._is_turned_aside(known, image):
            known.on_turned_aside()
            return True
        known.on_missed()
        return carried and known.trust > 0 and known.misses < self._max_misses

    def _find_again(self, known: FollowedFace, image: Image | GreyImage) -> Detection | None:
        """Return the detection near the place of a known face, or None.

        If it is not found with the same lean of the head as before, other leans are tried, and confirmed.
        """
        at, thorough = known.detection, self._thorough
        again = self._detector.detect_near(image, at.box, roll=at.roll)
        if again is not None or thorough is None or known.trust <= 0:
            return again
        return next(
            (found for found in thorough.detect_leaning(image, at) if self._is_confirmed(thorough, found, image)), None
        )

    def _is_turned_aside(self, known: FollowedFace, image: Image | GreyImage) -> bool:
        """Return whether a face with full trust is now in profile; if so, it stays tracked for a while."""
        sure = self._thorough is not None and known.trust == MAX_TRUST and known.aside_searches < MAX_ASIDE_SEARCHES
        return sure and self._thorough is not None and self._thorough.is_turned_aside(image, known.detection.box)

    def _search_picture(self, image: Image | GreyImage, *, unless_still: bool) -> None:
        """Search the whole picture for newcomers, and match the found faces with the known ones.

        The detector's search plan selects the search. With ``unless_still``, the search is skipped if the picture is
        unchanged since the last such search.
        """
        self._frames_since_search = 0
        self._newcomer_wait = min(4 * self._newcomer_wait, self._newcomer_interval)
        due = self._next_search(image)
        self._is_expensive = self._thorough is not None and self._thorough.is_expensive(image)
        if unless_still and self._still_detector.can_skip(image, due):
            return
        side = max(image.shape)
        found = self._detector.detect(image, smallest=due.smallest * side, largest=due.largest * side, roll=due.roll)
        for detection in found:
            known = max(self._faces, key=lambda k: k.detection.box.overlap(detection.box), default=None)
            if known is not None and known.detection.box.overlap(detection.box) > SAME_FACE_OVERLAP:
                if not known.found or known.trust <= 0:
                    self._on_found(known, detection, image)
            else:
                newcomer = FollowedFace(detection)
                self._confirm(newcomer, image)
                self._faces.append(newcomer)
                self._lost_face_frames = 0
                if newcomer.trust > 0:
                    self._newcomer_wait = FIRST_NEWCOMER_INTERVAL
