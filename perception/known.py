"""One face that is followed: how often it was found and borne out, and when it is looked for again."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

from perception.api import Box, Detection, Image
from perception.flow import carry
from perception.light import Grey

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
