"""One face that is followed: how often it was found and borne out, and when it is looked for again."""

from dataclasses import dataclass

from perception.api import Detection

SURE = 0.6
"""Overlap from which on the detector agrees with the flow: a Haar box jitters by a tenth of its width."""

RETRY = 5
"""Frames from a search that missed a face to the next."""

TRUST = 3
"""What a face can earn at most: one for each search whose witnesses agree, less one for each that fails."""


@dataclass(slots=True)
class Known:
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
    aside: int = 0

    def weigh(self, agreed: bool) -> None:
        """Others were asked whether it is a face: while that is open, they are asked in each frame."""
        self.trust = min(max(self.trust + (1 if agreed else -1), -TRUST), TRUST)
        self.believed |= self.trust > 0
        if -TRUST < self.trust <= 0:
            self.rest = self.due = 1

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
