"""Finding faces in frame after frame, for a tenth of what a full search of each would cost.

The whole picture is searched until there is a face. From then on optical flow carries its box from frame to frame, and
every few frames a search of the region around it confirms that it still is one. Now and then the whole picture is
searched again, for newcomers.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from perception.api import Box, Detection, Image
from perception.flow import carry
from perception.light import Grey, grey
from perception.sighting import Sighting

SAME = 0.3
"""Overlap from which on two boxes are one face."""


class FaceDetector(Protocol):
    """What the finder needs: a search of a whole picture, and one around a known face."""

    def detect(self, image: Grey) -> Sequence[Detection]:
        """Return the faces anywhere in the picture."""
        ...

    def near(self, image: Grey, box: Box) -> Detection | None:
        """Return the face about where ``box`` is, None when there is none."""
        ...


@dataclass(slots=True)
class _Known:
    """A face that is followed: ``times`` it was found, ``misses`` since, frames until its search is ``due``."""

    detection: Detection
    found: bool = True
    times: int = 1
    misses: int = 0
    due: int = 1

    def accept(self, detection: Detection, every: int) -> None:
        """The detector has found it again."""
        self.detection, self.found = detection, True
        self.times, self.misses, self.due = self.times + 1, 0, every


class FaceFinder:
    """Finds and follows faces through the frames of one camera or film. For one thread at a time.

    ``every``: frames from one search of a face's region to the next. ``patience``: searches in a row that may miss
    before a face is given up while flow still carries it (it has turned aside; or it never was one). ``newcomers``:
    frames from one search of the whole picture to the next while a face is known.
    A new face is searched for again in the very next frame, and given up at the first miss: most false ones flicker.
    """

    def __init__(self, detector: FaceDetector, *, every: int = 5, patience: int = 3, newcomers: int = 45) -> None:
        self._detector = detector
        self._every = every
        self._patience = patience
        self._newcomers = newcomers
        self._known: list[_Known] = []
        self._before: Grey | None = None
        self._since_whole = 0

    def find(self, image: Image | Grey) -> list[Sighting]:
        """Return the faces in the next frame, largest first. Raises ValueError for what is not a picture."""
        picture = grey(image)
        before, self._before = self._before, picture
        if before is not None:
            self._known = [known for known in self._known if self._follow(known, before, picture)]
        self._since_whole += 1
        if not self._known or self._since_whole >= self._newcomers:
            self._search_whole(picture)
        self._drop_doubles()
        found = [Sighting(known.detection, known.found) for known in self._known]
        return sorted(found, key=lambda sighting: -sighting.detection.box.width)

    def reset(self) -> None:
        """Forget everything: another film begins."""
        self._known.clear()
        self._before = None

    def _follow(self, known: _Known, before: Grey, picture: Grey) -> bool:
        """Bring a face to the new frame; False when it is gone."""
        carried = carry(before, picture, known.detection.box)
        known.found = False
        known.due -= 1
        if carried is not None:
            known.detection = Detection(carried, known.detection.score)
            if known.due > 0:
                return True
        again = self._detector.near(picture, known.detection.box)
        if again is not None:
            known.accept(again, self._every)
            return True
        known.misses += 1
        known.due = self._every
        return carried is not None and known.times > 1 and known.misses < self._patience

    def _search_whole(self, picture: Grey) -> None:
        """Look for newcomers, and meet those already known."""
        self._since_whole = 0
        for detection in self._detector.detect(picture):
            known = max(self._known, key=lambda k: k.detection.box.overlap(detection.box), default=None)
            if known is not None and known.detection.box.overlap(detection.box) > SAME:
                known.accept(detection, self._every)
            else:
                self._known.append(_Known(detection))

    def _drop_doubles(self) -> None:
        """Where two boxes have come to lie on one face, keep the one known for longer."""
        kept: list[_Known] = []
        for known in self._known:
            if all(known.detection.box.overlap(other.detection.box) <= SAME for other in kept):
                kept.append(known)
        self._known = kept
