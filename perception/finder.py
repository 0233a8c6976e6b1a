"""Finding faces in frame after frame, for a small part of what a full search of each would cost.

The whole picture is searched until there is a face: in one frame for all but small ones, in the next for those, then
for heads that lean, as the detector says. From then on optical flow carries its box from frame to frame, and now and
then a search of the region around it confirms that it still is one: the more seldom, the better both agree. Now and
then the whole picture is searched again, for newcomers; where nobody is, every second frame for near ones at first,
then every eighth, and less often while all stays as it was. What was found counts as a face as long as more searches
that are independent of the first agreed than not.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from math import hypot, inf, log2
from typing import Protocol, cast, runtime_checkable

import cv2
import numpy as np
import numpy.typing as npt

from drivers.api.quick import dataclass
from perception.api import Box, Detection, Image
from perception.light import Grey, check, grey, resized, window
from perception.tracks import Sighting
from perception.turns import ANY, Search, Still

# Following a patch of the picture from one frame to the next by sparse optical flow.

Floats = npt.NDArray[np.float32]
Points = Floats
"""Places in a picture: shape (n, 1, 2), dtype float32, x then y in pixels."""

REACH = 2.4  # how much of the picture is looked at, in widths of the box: it may move by 0.7 of one from frame to frame
REACH_PIXELS = 40  # or by these, where that is more: a head that pans at 60 degrees/s moves the picture by 32 in 50 ms
PATCH = 32  # pixels to which a larger box is shrunk: what it costs does not grow with the face
CORNERS = 20
INNER = 0.8  # of the box is looked at for corners
WINDOW = (9, 9)  # pixels around a corner that are compared
ENOUGH = 6  # points that must be followed for the result to count
RETURN = 1.0  # pixels by which a point may miss its start when it is followed back


def carry(before: Image | Grey, after: Image | Grey, box: Box) -> Box | None:
    """Return where the patch in ``box`` of ``before`` is in ``after``; None when it can't be followed.

    Corners on the inner part of the box are followed with pyramidal Lucas-Kanade, forth and back; those that do not
    return to their start are dropped, the median of the rest moves the box, the change of their spread scales it.
    """
    if before.shape != after.shape or box.width <= 0:
        return None
    rows, columns = window(before.shape, box, max(REACH, 1.0 + 2 * REACH_PIXELS / box.width))
    if before[rows, columns].size == 0:
        return None
    scale = min(1.0, PATCH / box.width)
    old, new = (_shrunk(grey(picture[rows, columns]), scale) for picture in (before, after))
    inner = Box((box.x - columns.start) * scale, (box.y - rows.start) * scale, box.width * scale, box.height * scale)
    start = _corners(old, inner)
    if start is None:
        return None
    pairs = _followed(old, new, start)
    if pairs is None:
        return None
    return _moved(box, *pairs, scale, before.shape)


def _shrunk(picture: Grey, scale: float) -> Grey:
    """Return a picture ``scale`` times as large: halved first, as other averages take five times as long.

    Up to a pixel of the result is missing at the right and the bottom.
    """
    part = 2 ** int(-log2(scale))
    height, width = (side // part for side in picture.shape[:2])
    if part > 1 and min(height, width) > 0:
        even = picture[: height * part, : width * part]
        picture, scale = cast(Grey, cv2.resize(even, (width, height), interpolation=cv2.INTER_AREA)), scale * part
    return resized(picture, scale)


def _corners(picture: Grey, box: Box) -> Points | None:
    """Points worth following on the inner part of the box, away from the background at its edges."""
    rows, columns = window(picture.shape, box, INNER)
    if picture[rows, columns].size == 0:
        return None
    # OpenCV says None for no corner at all, which its type stubs leave out.
    found = cast(Points | None, cv2.goodFeaturesToTrack(picture[rows, columns], CORNERS, 0.02, 3))
    return None if found is None else found + np.array((columns.start, rows.start), np.float32)


def _followed(old: Grey, new: Grey, start: Points) -> tuple[Points, Points] | None:
    """The points that were followed forth and back, before and after, each of shape (n, 2)."""
    there, seen, _ = cv2.calcOpticalFlowPyrLK(old, new, start, start.copy(), winSize=WINDOW, maxLevel=3)
    back, seen_back, _ = cv2.calcOpticalFlowPyrLK(new, old, there, there.copy(), winSize=WINDOW, maxLevel=3)
    missed_by = np.hypot(*(back - start).reshape(-1, 2).T)
    good = (seen.ravel() == 1) & (seen_back.ravel() == 1) & (missed_by < RETURN)
    if np.count_nonzero(good) < ENOUGH:
        return None
    return cast(Points, start.reshape(-1, 2)[good]), cast(Points, there.reshape(-1, 2)[good])


def _moved(box: Box, start: Points, there: Points, scale: float, shape: tuple[int, ...]) -> Box | None:
    """Move and scale the box as the points did; None when it has left the picture."""
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
    """Return the (upper) median along the first axis; numpy's own takes ten times as long for so few."""
    return cast(Floats, np.sort(values, axis=0)[len(values) // 2])


# One face that is followed: how often it was found and borne out, and when it is looked for again.

SAME = 0.3
"""Overlap from which on two boxes are one face."""

SURE = 0.6
"""Overlap from which on the detector agrees with the flow: a Haar box jitters by a tenth of its width."""

REST = 2
"""Frames in a row in which flow may leave out a face of many."""

RETRY = 5
"""Frames from a search that missed a face to the next."""

TRUST = 3
"""What a face can earn at most: one for each search whose witnesses agree, less one for each that fails."""


@dataclass(slots=True)
class Known:
    """A face that is followed: ``times`` it was found, ``misses`` since, frames until its search is ``due``.

    ``rest`` is from one search to the next, in frames; ``trust`` the searches that agreed less those that did not.
    ``measured`` is the newest picture in which its place was found, and that place; ``rested`` the frames since, and
    ``drift`` how far it moved from frame to frame before, in pixels. It ``rests`` where no flow carries it now.
    """

    detection: Detection
    found: bool = True
    times: int = 1
    misses: int = 0
    due: int = 1
    rest: int = 1
    trust: int = 0
    believed: bool = False
    aside: int = 0
    measured: tuple[Image | Grey, Box] | None = None
    drift: tuple[float, float] = (0.0, 0.0)
    rests: bool = False
    rested: int = 0

    def weigh(self, agreed: bool) -> None:
        """Others were asked whether it is a face: while that is open, they are asked in each frame."""
        self.trust = min(max(self.trust + (1 if agreed else -1), -TRUST), TRUST)
        self.believed |= self.trust > 0
        if -TRUST < self.trust <= 0:
            self.rest = self.due = 1

    def carry(self, before: Image | Grey, image: Image | Grey) -> bool:
        """Bring it to the next frame by optical flow, from ``before`` at least; False where that fails."""
        shown, box = self.measured or (before, self.detection.box)
        frames, self.rested = self.rested + 1, 0
        carried = carry(shown, image, box)
        if carried is None:
            return False
        (x, y), (was_x, was_y) = carried.centre, box.centre
        self.drift = (x - was_x) / frames, (y - was_y) / frames
        self.detection = replace(self.detection, box=carried)
        return True

    def moves_on(self) -> bool:
        """Let it move on as before, without a look at the frame; False where one is due, or the last had none."""
        if self.trust <= 0 or self.due <= 1 or self.rested >= REST or self.measured is None:
            return False
        box, (x, y) = self.detection.box, self.drift
        self.detection = replace(self.detection, box=replace(box, x=box.x + x, y=box.y + y))
        self.rested += 1
        return True

    def settle(self, image: Image | Grey) -> None:
        """End a frame: its place was found in it, unless it rests."""
        if not self.rests:
            self.measured, self.rested = (image, self.detection.box), 0
        self.rests = False

    def accept(self, detection: Detection, longest: int) -> None:
        """The detector has found it again."""
        agrees = self.detection.box.overlap(detection.box) > SURE
        self.rest = min(2 * self.rest, longest) if agrees else 1
        self.detection, self.found = detection, True
        self.times, self.misses, self.aside, self.due = self.times + 1, 0, 0, self.rest

    def turn(self) -> None:
        """It looks to one side, where flow has carried it."""
        self.aside += 1
        self.rest, self.due = 1, RETRY

    def miss(self) -> None:
        """The detector has not found it where the flow has carried it."""
        self.misses += 1
        self.weigh(False)
        self.rest, self.due = 1, RETRY


def distinct(followed: Iterable[Known]) -> list[Known]:
    """Return the faces; where two boxes have come to lie on one, that which is known for longer."""
    kept: list[Known] = []
    for known in followed:
        if all(known.detection.box.overlap(other.detection.box) <= SAME for other in kept):
            kept.append(known)
    return kept


MISSING = 25
"""Frames for which the whole picture is searched that often too, after a face was lost."""

NEWCOMERS = 40
"""Frames from one search of the whole picture to the next while a face is known, where the detector does not say."""

SOON = 1
"""Frames to the first search for others after somebody was found, as they may have come together; then 4 times that."""

TURNING = 2
"""The same where one of each kind has found no face, for the first ``EMPTY`` frames: a head may be turned away."""

EMPTY = 8
"""The same after that, and twice that where searches are dear; see Still for what stays as it was."""

ASIDE = 6
"""Searches in a row for which a face that looks to one side may be carried on."""

CROWD = 3
"""Known faces from which on flow carries all but the largest in every third frame only."""

STEADY = 0.02
"""How far a face may have moved from one frame to the next that stays in one place, in widths of it: 0.1 m/s."""


class FaceDetector(Protocol):
    """What the finder needs: a search of a whole picture, and one around a known face."""

    def detect(
        self, image: Image | Grey, *, smallest: float = 0.0, largest: float = inf, roll: float = 0.0
    ) -> Sequence[Detection]:
        """Return the faces anywhere in the picture, those at least whose width is ``smallest``..``largest`` pixels.

        ``roll`` is by how much they lean to the right, in radians.
        """
        ...

    def near(self, image: Image | Grey, box: Box, *, roll: float = 0.0) -> Detection | None:
        """Return the face about where ``box`` is, None when there is none."""
        ...


@runtime_checkable
class Thorough(Protocol):
    """What a detector may offer besides: a second opinion, other sights of a head, and what it looks for how often."""

    newcomers: int
    """Frames from one search of the whole picture to the next while a face is known."""

    turns: Sequence[Search]
    """What it searches a whole picture for, the most frequent first; the others take turns between."""

    quickly: Search
    """What it searches a whole picture for where there is little time."""

    def dear(self, image: Image | Grey) -> bool:
        """Whether to search such a picture costs far more than its size tells."""
        ...

    def agrees(self, image: Image | Grey, box: Box, *, roll: float = 0.0) -> bool:
        """Whether searches that are independent of the first see a face at ``box`` too."""
        ...

    def leaning(self, image: Image | Grey, known: Detection) -> Iterable[Detection]:
        """Yield where the face that was ``known`` may be, should it lean otherwise by now."""
        ...

    def aside(self, image: Image | Grey, box: Box) -> bool:
        """Whether a face that was at ``box`` is there, but looks to one side."""
        ...


class FaceFinder:
    """Finds and follows faces through the frames of one camera or film. For one thread at a time.

    ``every``: frames from one search of a face's region to the next, once it is sure. ``patience``: searches in a row
    that may miss before a face is given up while flow still carries it (it has turned aside; or it never was one).
    ``newcomers``: frames from one search of the whole picture to the next while a face is known; else as the detector
    says, which is more often for a network than for a cascade. A sighting counts as ``found`` where its detector found
    it and, if that is ``Thorough``, is borne out; what is not is carried by flow until the next miss at most.
    A new face is searched for again in the very next frame, and given up at the first miss: most false ones flicker.
    """

    def __init__(
        self, detector: FaceDetector, *, every: int = 10, patience: int = 3, newcomers: int | None = None
    ) -> None:
        self._detector = detector
        self._every = every
        self._patience = patience
        self._thorough = detector if isinstance(detector, Thorough) else None
        self._newcomers = newcomers or (self._thorough.newcomers if self._thorough else NEWCOMERS)
        self._known: list[Known] = []
        self._before: Image | Grey | None = None
        self._since_whole = 0
        self._plan = tuple(self._thorough.turns) if self._thorough else (ANY,)
        self._turn = 0  # how many of them were made
        self._missing = 0  # frames for which a face that was lost is still looked for
        self._lost = self._plan[0]  # the search that would find it
        self._patiently = SOON  # frames to the next search for newcomers
        self._vain = 0  # frames in a row without a face
        self._dear = False  # whether the newest search was
        self._still = Still()
        self._places: list[tuple[float, float]] = []  # of known faces, as it was last asked what can be spared

    def find(self, image: Image | Grey) -> list[Sighting]:
        """Return the faces in the next frame, largest first. Raises ValueError for what is not a picture."""
        check(image)
        before, self._before = self._before, image
        followed = self._known
        whole = self._since_whole + 1 >= self._pause()
        if before is not None:
            largest = max(followed, key=lambda known: known.detection.box.width, default=None)
            for known in followed if len(followed) >= CROWD and not whole else ():
                known.rests = known is not largest and known.moves_on()
            self._known = [known for known in followed if self._follow(known, before, image, wait=whole)]
        believed = [known for known in followed if known.believed]
        if believed and not self._known:
            self._expect(believed[0], image)
        self._since_whole += 1
        if self._since_whole >= (pause := self._pause()):
            empty = pause > 1 and not any(known.trust > 0 for known in self._known)
            self._search_whole(image, unless_still=empty)
        self._known = [known for known in self._known if known.due > 0 or self._confirm(known, image, carried=True)]
        self._known = distinct(self._known)
        self._vain = 0 if any(known.trust > 0 for known in self._known) else self._vain + 1
        self._missing -= 1
        for known in believed:
            if known.times > 2 and all(known is not other for other in self._known):
                self._expect(known, image)
        found = [
            Sighting(known.detection, known.found and known.trust > 0, believed=known.believed) for known in self._known
        ]
        for known in self._known:
            known.settle(image)
        return sorted(found, key=lambda sighting: -sighting.detection.box.width)

    def spare(self, most: int) -> int:
        """Return how many of the next frames, up to ``most``, it need not be shown, and count them as if it had been.

        It would search none of them, and either nobody is there, or a third as many are spared since all known faces
        have stayed in one place from the frame before to this one.
        """
        before, self._places = self._places, [known.detection.box.centre for known in self._known]
        pause = self._pause()
        if self._known:
            most = most // 3 if self._missing <= 0 and self._steady(before) else 0
        elif pause < EMPTY:
            return 0
        spared = max(0, min(most, pause - 1 - self._since_whole, *(known.due - 1 for known in self._known)))
        for known in self._known:
            known.due -= spared
        self._since_whole += spared
        return spared

    def _steady(self, before: Sequence[tuple[float, float]]) -> bool:
        """Whether all known faces are beyond doubt, and where they were."""
        return len(before) == len(self._known) and all(
            known.trust > 0 and hypot(x - was_x, y - was_y) <= STEADY * known.detection.box.width
            for known, (x, y), (was_x, was_y) in zip(self._known, self._places, before, strict=True)
        )

    def reset(self) -> None:
        """Forget everything: another film begins."""
        self._known.clear()
        self._before = None
        self._since_whole, self._turn, self._missing = 0, 0, 0
        self._vain, self._patiently, self._dear = 0, SOON, False
        self._still = Still()

    def _pause(self) -> int:
        """Return how many frames after a search of the whole picture the next one is due."""
        lost = self._missing > 0
        if any(known.trust > 0 for known in self._known):
            return RETRY if lost else self._patiently
        if lost or self._vain < len(self._plan):
            return 1
        if self._dear:
            return 2 * EMPTY
        return TURNING if self._vain < EMPTY else EMPTY

    def _due(self, image: Image | Grey) -> Search:
        """Return what the whole picture is searched for next."""
        sure = [known for known in self._known if known.trust > 0]
        if self._missing > 0 and (sure or self._missing % 2):
            return self._lost
        if self._thorough and not sure and len(self._plan) <= self._vain < EMPTY:
            return self._thorough.quickly
        turn, self._turn = self._turn, self._turn + 1
        main, *others = self._plan
        if sure:  # who is with whom they know
            return main if turn % 2 else self._fitting(sure[0].detection, image)
        if turn < len(self._plan):
            return self._plan[turn]
        return others[turn // 2 % len(others)] if turn % 2 and others else main

    def _fitting(self, face: Detection, image: Image | Grey) -> Search:
        """Return the first search that would find such a face."""
        return next((each for each in self._plan if each.fits(face, max(image.shape))), self._plan[0])

    def _accept(self, known: Known, detection: Detection, image: Image | Grey) -> None:
        """A search has found it again; others are asked as long as it is not beyond doubt."""
        known.accept(detection, self._every)
        self._ask(known, image)

    def _ask(self, known: Known, image: Image | Grey) -> None:
        if known.trust < TRUST:
            known.weigh(self._thorough is None or self._witnessed(self._thorough, known.detection, image))

    def _witnessed(self, thorough: Thorough, found: Detection, image: Image | Grey) -> bool:
        return thorough.agrees(image, found.box, roll=found.roll)

    def _expect(self, lost: Known, image: Image | Grey) -> None:
        """Look for a lost face again soon, among those of its size: somebody may just have walked past it."""
        self._missing = MISSING
        self._lost = self._fitting(lost.detection, image)

    def _follow(self, known: Known, before: Image | Grey, image: Image | Grey, *, wait: bool) -> bool:
        """Bring a face to the new frame; False when it is gone. Where it can ``wait``, its own search may follow."""
        known.found = False
        known.due -= 1
        if known.rests:
            return True
        carried = known.carry(before, image)
        if carried and (known.due > 0 or wait):
            return True
        return self._confirm(known, image, carried=carried)

    def _confirm(self, known: Known, image: Image | Grey, *, carried: bool) -> bool:
        """Search for a known face where it should be; False when it is gone."""
        again = self._again(known, image)
        if again is not None:
            self._accept(known, again, image)
            return True
        if carried and self._turned_aside(known, image):
            known.turn()
            return True
        known.miss()
        return carried and known.trust > 0 and known.misses < self._patience

    def _again(self, known: Known, image: Image | Grey) -> Detection | None:
        """Return a known face where it is now, upright or leaning as before; or as one that others see lean."""
        at, thorough = known.detection, self._thorough
        again = self._detector.near(image, at.box, roll=at.roll)
        if again is not None or thorough is None or known.trust <= 0:
            return again
        return next((found for found in thorough.leaning(image, at) if self._witnessed(thorough, found, image)), None)

    def _turned_aside(self, known: Known, image: Image | Grey) -> bool:
        """Whether a face that was beyond doubt has turned to one side: it is carried on for a while."""
        sure = self._thorough is not None and known.trust == TRUST and known.aside < ASIDE
        return sure and self._thorough is not None and self._thorough.aside(image, known.detection.box)

    def _search_whole(self, image: Image | Grey, *, unless_still: bool) -> None:
        """Look for newcomers, of one kind after the other; meet those already known."""
        self._since_whole = 0
        self._patiently = min(4 * self._patiently, self._newcomers)
        due = self._due(image)
        self._dear = self._thorough is not None and self._thorough.dear(image)
        if unless_still and self._still.same(image, due):
            return
        side = max(image.shape)
        found = self._detector.detect(image, smallest=due.smallest * side, largest=due.largest * side, roll=due.roll)
        for detection in found:
            known = max(self._known, key=lambda k: k.detection.box.overlap(detection.box), default=None)
            if known is not None and known.detection.box.overlap(detection.box) > SAME:
                if not known.found or known.trust <= 0:
                    self._accept(known, detection, image)
            else:
                newcomer = Known(detection)
                self._ask(newcomer, image)
                self._known.append(newcomer)
                self._missing = 0
                if newcomer.trust > 0:
                    self._patiently = SOON
