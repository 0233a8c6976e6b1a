"""Who is it: each patch of a face is looked for in the pictures of each person, about where it should be.

Faces differ in how they are turned, what they express, and how the detector has framed them, so a patch may lie a
little beside its place (elastic matching: Hua and Akbarzadeh, 2009), and each may be found in another picture of the
same person (image-to-class distance: Boiman, Shechtman and Irani, 2008). The likeness of a face to a person is 1 less
the mean distance of the best matches, which heeds less than its square would the few patches that glasses or a shadow
have changed. Of the likeness to the nearest person a part of that to the next one is taken: what is a little like
everybody is a poor picture, or a stranger (cohort normalisation).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from perception.identity import Look
from perception.patches import CELLS, DEPTH, Patches

Picture = Sequence[Patches]
"""One picture of a person: its patches, and those of its variants after it."""

WINDOW = 3
"""Cells, along each side, among which a patch is looked for."""

PLACES = CELLS // WINDOW
"""Patches of a face, along each side, that are looked for."""

RIVAL = 0.3
"""The part of the likeness to the next person that is taken from that to the nearest."""

ALONE = 0.715
"""Likeness to the next person that is assumed at least, also where only one is known: that of strangers mostly."""

MEAN, DEVIATION = 0.522, 0.0095
"""Mean score of looks at strangers, and their standard deviation, as far as nothing else is known."""

WEIGHT = 20
"""Looks that those two are worth, beside the looks at its own people that a gallery has."""

ABOVE = 2.33
"""Standard deviations above that mean from which on somebody is known: 1 in 100 strangers, were scores normal."""

FEW, ABOVE_FEW = 3, 4.75
"""The same where fewer persons are compared: a wrong name is worse than none, and few say little of what strangers
score, so that ``MEAN`` and ``DEVIATION`` are the least then. With one and with two known, no look in 100 at strangers
passed then of ten people of the ORL database, and of four in films, who look alike (docs/people.md)."""


@dataclass(frozen=True, slots=True)
class Calibration:
    """How well a gallery tells people apart, found by leaving out some of it in turn.

    ``refused`` is the share 0..1 of looks at known people that did not give their name, ``accepted`` that of looks at
    strangers that gave one: None where that could not be found out. ``looks`` are how many looks at known people that
    was asked of. ``threshold`` is the score from which on somebody is known.
    """

    threshold: float
    refused: float | None
    accepted: float | None
    looks: int


class Gallery:
    """Persons, each as the patches of their pictures. Its threshold is made from them; it is not changed after.

    ``cohort`` are pictures of others who are strangers for sure: who is more like one of them is a stranger too.
    Raises ValueError for nobody, and for a person without a picture.
    """

    def __init__(self, people: Mapping[str, Sequence[Picture]], cohort: Sequence[Sequence[Picture]] = ()) -> None:
        if not people or not all(people.values()):
            raise ValueError("faces: nobody to be recognised, or somebody without a picture")
        self.names = tuple(people)
        whole = [(person, number, patches) for person, pictures in enumerate([*people.values(), *cohort])
                 for number, picture in enumerate(pictures) for patches in picture]  # fmt: skip
        self._owners = np.array([person for person, _, _ in whole])
        self._numbers = np.array([number for _, number, _ in whole])
        cells = np.stack([patches for _, _, patches in whole])
        windows = cells.reshape(-1, PLACES, WINDOW, PLACES, WINDOW, DEPTH).transpose(1, 3, 0, 2, 4, 5)
        self._windows = windows.reshape(PLACES**2, -1, DEPTH)
        self._mean, self._deviation = MEAN, DEVIATION
        self._above = ABOVE_FEW if len(people) + len(cohort) < FEW else ABOVE
        self.calibration = self._calibrate(people)

    def look(self, face: Patches) -> Look:
        """Return whom a face is most like; the margin is in standard deviations of looks at strangers."""
        matches = self._matches(face)
        name, score = self._nearest(matches, np.ones(len(self._owners), np.bool_))
        margin = (score - self._mean) / self._deviation - self._above
        return Look(name, margin if name else -abs(margin))

    def _matches(self, face: Patches) -> npt.NDArray[np.float32]:
        """Return how well each patch of a face is found in each template, up to 1: (places, templates)."""
        sought = face[WINDOW // 2 :: WINDOW, WINDOW // 2 :: WINDOW].reshape(PLACES**2, DEPTH, 1)
        cosines = np.matmul(self._windows, sought).reshape(PLACES**2, -1, WINDOW**2)
        return np.asarray(1 - np.sqrt(np.maximum(1 - cosines.max(axis=2), 0)), np.float32)

    def _nearest(self, matches: npt.NDArray[np.float32], among: npt.NDArray[np.bool_]) -> tuple[str, float]:
        """Return who of the people with some templates ``among`` all is nearest, and the score; with nobody, ""."""
        owners = np.unique(self._owners[among])
        likeness = [float(matches[:, among & (self._owners == owner)].max(axis=1).mean()) for owner in owners]
        order = np.argsort(likeness)[::-1]
        rival = max([ALONE, *(likeness[each] for each in order[1:2])])
        first = owners[order[0]]
        return self.names[first] if first < len(self.names) else "", likeness[order[0]] - RIVAL * rival

    def _calibrate(self, people: Mapping[str, Sequence[Picture]]) -> Calibration:
        """Find what strangers score, and how surely people are known, by leaving out each picture and its person."""
        strangers, known = list[float](), list[tuple[bool, float]]()
        for owner, (name, pictures) in enumerate(people.items()):
            own = self._owners == owner
            for number, picture in enumerate(pictures):
                matches = self._matches(picture[0])
                others = ~own & (self._owners < len(people))
                if others.any():
                    strangers.append(self._nearest(matches, others)[1])
                if len(pictures) > 1:
                    found, score = self._nearest(matches, ~(own & (self._numbers == number)))
                    known.append((found == name, score))
        if strangers:
            seen = len(strangers)
            mean = (WEIGHT * MEAN + seen * float(np.mean(strangers))) / (WEIGHT + seen)
            variance = (WEIGHT * DEVIATION**2 + seen * float(np.var(strangers))) / (WEIGHT + seen)
            few = self._above == ABOVE_FEW
            self._mean = max(mean, MEAN) if few else mean
            self._deviation = max(variance**0.5, DEVIATION) if few else variance**0.5
        threshold = self._mean + self._above * self._deviation
        refused = [not right or score <= threshold for right, score in known]
        accepted = [score > threshold for score in strangers]
        return Calibration(threshold, _share(refused), _share(accepted), len(known))


def _share(hits: Sequence[bool]) -> float | None:
    """Return the share of hits; None of nothing."""
    return sum(hits) / len(hits) if hits else None
