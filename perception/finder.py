"""Finding faces in frame after frame, for a small part of what a full search of each would cost.

The whole picture is searched until there is a face: in one frame for those that are close, in the next for those
farther away. From then on optical flow carries its box from frame to frame, and now and then a search of the region
around it confirms that it still is one: the more seldom, the better both agree. Now and then the whole picture is
searched again, for newcomers; where nobody is, every eighth frame, and less often while all stays as it was. What was
found counts as a face as long as more searches that are independent of the first agreed than not.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, inf
from typing import Protocol, runtime_checkable

from perception.api import Box, Detection, Image
from perception.flow import carry
from perception.light import Grey, check
from perception.sighting import Sighting
from perception.still import Still

SAME = 0.3
"""Overlap from which on two boxes are one face."""

SURE = 0.6
"""Overlap from which on the detector agrees with the flow: a Haar box jitters by a tenth of its width."""

CLOSE = 0.09
"""Width of a close face, as a share of the picture's longer side: 1.7 m away, for an angle of view of 60 degrees."""

RETRY = 5
"""Frames from a search that missed a face to the next."""

MISSING = 25
"""Frames for which the whole picture is searched that often too, after a face was lost."""

NEWCOMERS = 40
"""Frames from one search of the whole picture to the next while a face is known, where the detector does not say."""

EAGER = 8
"""Frames in a row without a face in which each is searched: at first, and after a face was there."""

EMPTY = 8
"""Frames from one search to the next after that, of a picture that is not the one searched before; see Still."""

STEADY = 0.02
"""How far a face may have moved from one frame to the next that stays in one place, in widths of it: 0.1 m/s."""

TRUST = 3
"""What a face can earn at most: one for each search whose witnesses agree, less one for each that fails."""


class FaceDetector(Protocol):
    """What the finder needs: a search of a whole picture, and one around a known face."""

    def detect(self, image: Image | Grey, *, smallest: float = 0.0, largest: float = inf) -> Sequence[Detection]:
        """Return the faces anywhere in the picture, those at least whose width is ``smallest``..``largest`` pixels."""
        ...

    def near(self, image: Image | Grey, box: Box) -> Detection | None:
        """Return the face about where ``box`` is, None when there is none."""
        ...


@runtime_checkable
class Thorough(Protocol):
    """What a detector may offer besides: a second opinion, and how often it can afford to search a whole picture."""

    newcomers: int
    """Frames from one search of the whole picture to the next while a face is known."""

    def agrees(self, image: Image | Grey, box: Box) -> bool:
        """Whether searches that are independent of the first see a face at ``box`` too."""
        ...


@dataclass(slots=True)
class _Known:
    """A face that is followed: ``times`` it was found, ``misses`` since, frames until its search is ``due``.

    ``rest`` is from one search to the next, in frames; ``trust`` the searches that agreed less those that did not.
    """

    detection: Detection
    found: bool = True
    times: int = 1
    misses: int = 0
    due: int = 1
    rest: int = 1
    trust: int = 0
    believed: bool = False

    def weigh(self, agreed: bool) -> None:
        """Others were asked whether it is a face."""
        self.trust = min(max(self.trust + (1 if agreed else -1), -TRUST), TRUST)
        self.believed |= self.trust > 0

    def accept(self, detection: Detection, longest: int) -> None:
        """The detector has found it again."""
        agrees = self.detection.box.overlap(detection.box) > SURE
        self.rest = min(2 * self.rest, longest) if agrees else 1
        self.detection, self.found = detection, True
        self.times, self.misses, self.due = self.times + 1, 0, self.rest

    def miss(self) -> None:
        """The detector has not found it where the flow has carried it."""
        self.misses += 1
        self.rest, self.due = 1, RETRY
        self.weigh(False)


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
        self._known: list[_Known] = []
        self._before: Image | Grey | None = None
        self._since_whole = 0
        self._close_next = True
        self._missing = 0  # frames for which a face that was lost is still looked for
        self._turns = 2  # searches that are due at once: one for those that are close, one for those that are not
        self._vain = 0  # frames in a row without a face
        self._still = Still()
        self._places: list[tuple[float, float]] = []  # of known faces, as it was last asked what can be spared

    def find(self, image: Image | Grey) -> list[Sighting]:
        """Return the faces in the next frame, largest first. Raises ValueError for what is not a picture."""
        check(image)
        before, self._before = self._before, image
        followed = self._known
        if before is not None:
            self._known = [known for known in followed if self._follow(known, before, image)]
        believed = [known for known in followed if known.believed]
        if believed and not self._known:
            self._expect(believed[0], image)
        self._since_whole += 1
        if self._since_whole >= (pause := self._pause()) and not (pause == EMPTY and self._nothing_new(image)):
            self._search_whole(image)
        self._drop_doubles()
        self._vain = 0 if any(known.trust > 0 for known in self._known) else self._vain + 1
        self._missing -= 1
        for known in believed:
            if known.times > 2 and all(known is not other for other in self._known):
                self._expect(known, image)
        found = [Sighting(known.detection, known.found and known.trust > 0) for known in self._known]
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
        self._since_whole, self._close_next, self._missing = 0, True, 0
        self._turns, self._vain = 2, 0
        self._still = Still()

    def _nothing_new(self, image: Image | Grey) -> bool:
        """Whether a search would see what one of its kind, for close faces or others, has seen before; see Still."""
        if not self._still.same(image, close=self._close_next):
            return False
        self._since_whole, self._close_next = 0, not self._close_next
        return True

    def _pause(self) -> int:
        """Return how many frames after a search of the whole picture the next one is due."""
        lost = self._missing > 0
        if self._turns > 0:
            return 1
        if any(known.trust > 0 for known in self._known):
            return RETRY if lost else self._newcomers
        return 1 if lost or self._vain < EAGER else EMPTY

    def _accept(self, known: _Known, detection: Detection, image: Image | Grey) -> None:
        """A search has found it again; others are asked as long as it is not beyond doubt."""
        known.accept(detection, self._every)
        self._ask(known, image)

    def _ask(self, known: _Known, image: Image | Grey) -> None:
        if known.trust < TRUST:
            known.weigh(self._thorough is None or self._thorough.agrees(image, known.detection.box))

    def _expect(self, lost: _Known, image: Image | Grey) -> None:
        """Look for a lost face again soon, among those of its size: somebody may just have walked past it."""
        self._missing = MISSING
        self._close_next = lost.detection.box.width >= CLOSE * max(image.shape)

    def _follow(self, known: _Known, before: Image | Grey, image: Image | Grey) -> bool:
        """Bring a face to the new frame; False when it is gone."""
        carried = carry(before, image, known.detection.box)
        known.found = False
        known.due -= 1
        if carried is not None:
            known.detection = Detection(carried, known.detection.score)
            if known.due > 0:
                return True
        again = self._detector.near(image, known.detection.box)
        if again is not None:
            self._accept(known, again, image)
            return True
        known.miss()
        return carried is not None and known.trust > 0 and known.misses < self._patience

    def _search_whole(self, image: Image | Grey) -> None:
        """Look for newcomers, in turns for those that are close and those that are not; meet those already known."""
        self._since_whole = 0
        self._turns -= 1
        close = self._close_next
        if self._missing <= 0 or self._turns >= 0 or not self._known:
            self._close_next = not close
        limit = CLOSE * max(image.shape)
        detect = self._detector.detect
        found = detect(image, smallest=limit) if close else detect(image, largest=1.2 * limit)
        for detection in found:
            known = max(self._known, key=lambda k: k.detection.box.overlap(detection.box), default=None)
            if known is not None and known.detection.box.overlap(detection.box) > SAME:
                self._accept(known, detection, image)
            else:
                newcomer = _Known(detection)
                self._ask(newcomer, image)
                self._known.append(newcomer)
                self._missing = 0

    def _drop_doubles(self) -> None:
        """Where two boxes have come to lie on one face, keep the one known for longer."""
        kept: list[_Known] = []
        for known in self._known:
            if all(known.detection.box.overlap(other.detection.box) <= SAME for other in kept):
                kept.append(known)
        self._known = kept
