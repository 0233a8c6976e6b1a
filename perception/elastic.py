"""Who is it: each patch of a face is looked for in the pictures of each person, about where it should be.

Faces differ in how they are turned, what they express, and how the detector has framed them, so a patch may lie a
little beside its place (elastic matching: Hua and Akbarzadeh, 2009), and each may be found in another picture of the
same person (image-to-class distance: Boiman, Shechtman and Irani, 2008). The likeness of a face to a person is 1 less
the mean distance of the best matches, which heeds less than its square would the few patches that glasses or a shadow
have changed. A face is seen by its box and, where both eyes are found, upright by them; the more alike sight counts.
Of the likeness to the nearest person a part of that to the next one is taken: what is a little like
everybody is a poor picture, or a stranger (cohort normalisation).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from perception.identity import Look
from perception.patches import CELLS, DEPTH, Patches

REACH = 2
"""Cells to each side of its place in which a patch is looked for."""

APART = 3
"""Cells from one patch of a face that is looked for to the next."""

PLACES = CELLS // APART
"""Patches of a face, along each side, that are looked for."""

Matches = npt.NDArray[np.float32]
"""How well each patch of a face is found in each template, up to 1: shape (sights, templates, PLACES ** 2)."""


@dataclass(frozen=True, slots=True)
class Picture:
    """One picture of a person: the ``sights`` that a look at it would have, and the ``templates`` to compare with."""

    sights: Sequence[Patches]
    templates: Sequence[Patches]


RIVAL = 0.3
"""The part of the likeness to the next person that is taken from that to the nearest."""

ALONE = 0.715
"""Likeness to the next person that is assumed at least, also where only one is known: that of strangers mostly."""

MEAN, DEVIATION = 0.522, 0.0085
"""Mean score of looks at strangers, and their standard deviation, as far as nothing else is known."""

WEIGHT = 20
"""Looks that those two are worth, beside the looks at its own people that a gallery has."""

ABOVE, ABOVE_ONE = 2.33, 2.0
"""Standard deviations above that mean from which on somebody is known: 1 in 100 strangers, were scores normal; and how
many more where one person is compared, divided by the number of persons: few say little of what strangers score."""

FEW = 3
"""Persons up from which their own looks may lower the mean and deviation of strangers below the usual."""

VARIED = 0.45
"""How far the threshold of a person is from the mean of strangers to the score of known pictures (half the person's
own, half all). Pictures that are alike, as those of one room and day, score high, and so do strangers in that room."""

HIGHEST = 7.0
"""Standard deviations above the mean of strangers that ``VARIED`` leads to at most."""


@dataclass(frozen=True, slots=True)
class Calibration:
    """How well a gallery tells people apart, found by leaving out some of it in turn.

    ``refused`` is the share 0..1 of looks at known people that did not give their name, ``accepted`` that of looks at
    strangers that gave one: None where that could not be found out. ``looks`` are how many looks at known people that
    was asked of. ``threshold`` is the score from which on somebody is known.
    """

    thresholds: Mapping[str, float]
    refused: float | None
    accepted: float | None
    looks: int
    alike: frozenset[str]
    near: Mapping[str, str]


class Gallery:
    """Persons, each as the patches of their pictures. Its thresholds are made from them, and do not change after.

    ``cohort`` are pictures of others who are strangers for sure: who is more like one of them is a stranger too.
    Raises ValueError for nobody, and for a person without a picture.
    """

    def __init__(self, people: Mapping[str, Sequence[Picture]], cohort: Sequence[Sequence[Picture]] = ()) -> None:
        if not people or not all(people.values()):
            raise ValueError("faces: nobody to be recognised, or somebody without a picture")
        self.names = tuple(people)
        whole = [(person, number, patches) for person, pictures in enumerate([*people.values(), *cohort])
                 for number, picture in enumerate(pictures) for patches in picture.templates]  # fmt: skip
        self._owners = np.array([person for person, _, _ in whole])
        self._numbers = np.array([number for _, number, _ in whole])
        rim = REACH - APART // 2  # cells that windows at the edges reach over it
        cells = np.pad(np.stack([patches for _, _, patches in whole], axis=2), ((rim, rim), (rim, rim), (0, 0), (0, 0)))
        self._cells = cells  # (rows, columns, templates, DEPTH): those of a row of a window follow each other
        self._compared = len(people) + len(cohort)
        self._deviation = DEVIATION
        self.calibration = self._calibrate(people)

    def look(self, face: Sequence[Patches]) -> Look:
        """Return whom the sights of a face are most like.

        The margin is in standard deviations of looks at strangers.
        """
        matches = self._matches(face)
        name, score = self._nearest(matches, np.ones(len(self._owners), np.bool_))
        thresholds = self.calibration.thresholds
        margin = (score - (thresholds[name] if name else min(thresholds.values()))) / self._deviation
        return Look(name, margin if name else -abs(margin))

    def _matches(self, face: Sequence[Patches]) -> Matches:
        """Return how well the patches of each sight are found in each template."""
        first, window, count = APART // 2, 2 * REACH + 1, len(self._owners)
        found = np.empty((len(face), count, PLACES**2), np.float32)
        for place in range(PLACES**2):
            row, column = (APART * each for each in divmod(place, PLACES))
            sought = np.stack([patches[row + first, column + first] for patches in face], axis=1)
            rows = (self._cells[row + each, column : column + window].reshape(-1, DEPTH) for each in range(window))
            best = [(cells @ sought).reshape(window, count, -1).max(axis=0) for cells in rows]
            found[:, :, place] = np.max(best, axis=0).T
        return np.asarray(1 - np.sqrt(np.maximum(1 - found, 0)), np.float32)

    def _nearest(self, matches: Matches, among: npt.NDArray[np.bool_]) -> tuple[str, float]:
        """Return who of the people with some templates ``among`` all is nearest, and the score; with nobody, ""."""
        owners = np.unique(self._owners[among])
        best = (matches[:, among & (self._owners == owner)].max(axis=1) for owner in owners)
        likeness = [float(each.mean(axis=1).max()) for each in best]
        order = np.argsort(likeness)[::-1]
        rival = max([ALONE, *(likeness[each] for each in order[1:2])])
        first = owners[order[0]]
        return self.names[first] if first < len(self.names) else "", likeness[order[0]] - RIVAL * rival

    def _calibrate(self, people: Mapping[str, Sequence[Picture]]) -> Calibration:
        """Find what strangers score, and how surely people are known, by leaving out each picture and its person."""
        strangers, known = list[tuple[str, str, float]](), list[tuple[str, bool, float]]()
        for owner, (name, pictures) in enumerate(people.items()):
            own = self._owners == owner
            for number, picture in enumerate(pictures):
                matches = self._matches(picture.sights)
                others = ~own & (self._owners < len(people))
                if others.any():
                    strangers.append((name, *self._nearest(matches, others)))
                if len(pictures) > 1:
                    found, score = self._nearest(matches, ~(own & (self._numbers == number)))
                    known.append((name, found == name, score))
        usual = self._thresholds([], known)
        near = {name: other for name, other, score in strangers if score > usual[other]}
        alike = frozenset(name for name, each in usual.items() if each >= MEAN + HIGHEST * DEVIATION)
        thresholds = self._thresholds([score for _, _, score in strangers], known)
        refused = [not right or score <= thresholds[name] for name, right, score in known]
        accepted = [score > thresholds[other] for _, other, score in strangers]
        return Calibration(thresholds, _share(refused), _share(accepted), len(known), alike, near)

    def _thresholds(self, strangers: Sequence[float], known: Sequence[tuple[str, bool, float]]) -> Mapping[str, float]:
        """Return the threshold of each person, from the scores of strangers and those of the pictures left out."""
        mean, variance = MEAN, DEVIATION**2
        if strangers:
            seen = len(strangers)
            mean = (WEIGHT * mean + seen * float(np.mean(strangers))) / (WEIGHT + seen)
            variance = (WEIGHT * variance + seen * float(np.var(strangers))) / (WEIGHT + seen)
        if self._compared < FEW:
            mean, variance = max(mean, MEAN), max(variance, DEVIATION**2)
        self._deviation = variance**0.5
        least, most = (mean + above * self._deviation for above in (ABOVE + ABOVE_ONE / self._compared, HIGHEST))
        found = dict.fromkeys(self.names, least)
        for name in {name for name, _, _ in known}:
            own = float(np.mean([score for each, _, score in known if each == name]))
            usual = (own + float(np.mean([score for _, _, score in known]))) / 2
            found[name] = max(least, min(mean + VARIED * (usual - mean), most))
        return found


def _share(hits: Sequence[bool]) -> float | None:
    """Return the share of hits; None of nothing."""
    return sum(hits) / len(hits) if hits else None
