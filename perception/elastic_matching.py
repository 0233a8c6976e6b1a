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

from perception.identity import FaceMatch
from perception.patches import CELLS, DEPTH, Patches

SEARCH_REACH = 2
"""Cells to each side of its place in which a patch is looked for."""

PATCH_SPACING = 3
"""Cells from one patch of a face that is looked for to the next."""

PATCHES_PER_SIDE = CELLS // PATCH_SPACING
"""Patches of a face, along each side, that are looked for."""

Matches = npt.NDArray[np.float32]
"""How well each patch of a face is found in each template, up to 1: shape (sights, templates, PLACES ** 2)."""


@dataclass(frozen=True, slots=True)
class PictureDescription:
    """One picture of a person: the ``views`` that a look at it would have, and the ``templates`` to compare with."""

    views: Sequence[Patches]
    templates: Sequence[Patches]


RIVAL_SHARE = 0.3
"""The part of the likeness to the next person that is taken from that to the nearest."""

MIN_RIVAL_LIKENESS = 0.715
"""Likeness to the next person that is assumed at least, also where only one is known: that of strangers mostly."""

STRANGER_MEAN, STRANGER_DEVIATION = 0.522, 0.0085
"""Mean score of looks at strangers, and their standard deviation, as far as nothing else is known."""

PRIOR_LOOKS = 20
"""Looks that those two are worth, beside the looks at its own people that a gallery has."""

THRESHOLD_DEVIATIONS, EXTRA_DEVIATIONS = 2.33, 2.0
"""Standard deviations above that mean from which on somebody is known: 1 in 100 strangers, were scores normal; and how
many more where one person is compared, divided by the number of persons: few say little of what strangers score."""

MIN_COMPARED_PEOPLE = 3
"""Persons up from which their own looks may lower the mean and deviation of strangers below the usual."""

OWN_SCORE_SHARE = 0.45
"""How far the threshold of a person is from the mean of strangers to the score of known pictures (half the person's
own, half all). Pictures that are alike, as those of one room and day, score high, and so do strangers in that room."""

MAX_THRESHOLD_DEVIATIONS = 7.0
"""Standard deviations above the mean of strangers that ``OWN_SCORE_SHARE`` leads to at most."""


@dataclass(frozen=True, slots=True)
class GalleryCalibration:
    """How well a gallery tells people apart, found by leaving out some of it in turn.

    ``refusal_rate`` is the share 0..1 of looks at known people that did not give their name, ``acceptance_rate`` that of looks at
    strangers that gave one: None where that could not be found out. ``look_count`` are how many looks at known people that
    was asked of. ``threshold`` is the score from which on somebody is known.
    """

    thresholds: Mapping[str, float]
    refusal_rate: float | None
    acceptance_rate: float | None
    look_count: int
    uniform_people: frozenset[str]
    lookalikes: Mapping[str, str]


class Gallery:
    """Persons, each as the patches of their pictures. Its thresholds are made from them, and do not change after.

    ``cohort`` are pictures of others who are strangers for sure: who is more like one of them is a stranger too.
    Raises ValueError for nobody, and for a person without a picture.
    """

    def __init__(
        self, people: Mapping[str, Sequence[PictureDescription]], cohort: Sequence[Sequence[PictureDescription]] = ()
    ) -> None:
        if not people or not all(people.values()):
            raise ValueError("faces: nobody to be recognised, or somebody without a picture")
        self.names = tuple(people)
        whole = [(person, number, patches) for person, pictures in enumerate([*people.values(), *cohort])
                 for number, picture in enumerate(pictures) for patches in picture.templates]  # fmt: skip
        self._template_owners = np.array([person for person, _, _ in whole])
        self._picture_numbers = np.array([number for _, number, _ in whole])
        rim = SEARCH_REACH - PATCH_SPACING // 2  # cells that windows at the edges reach over it
        cells = np.pad(np.stack([patches for _, _, patches in whole], axis=2), ((rim, rim), (rim, rim), (0, 0), (0, 0)))
        self._cells = cells  # (rows, columns, templates, DEPTH): those of a row of a window follow each other
        self._compared_count = len(people) + len(cohort)
        self._deviation = STRANGER_DEVIATION
        self.calibration = self._calibrate(people)

    def match(self, face: Sequence[Patches]) -> FaceMatch:
        """Return whom the sights of a face are most like.

        The margin is in standard deviations of looks at strangers.
        """
        matches = self._match_patches(face)
        name, score = self._find_nearest(matches, np.ones(len(self._template_owners), np.bool_))
        thresholds = self.calibration.thresholds
        margin = (score - (thresholds[name] if name else min(thresholds.values()))) / self._deviation
        return FaceMatch(name, margin if name else -abs(margin))

    def _match_patches(self, face: Sequence[Patches]) -> Matches:
        """Return how well the patches of each sight are found in each template."""
        first, window, count = PATCH_SPACING // 2, 2 * SEARCH_REACH + 1, len(self._template_owners)
        found = np.empty((len(face), count, PATCHES_PER_SIDE**2), np.float32)
        for place in range(PATCHES_PER_SIDE**2):
            row, column = (PATCH_SPACING * each for each in divmod(place, PATCHES_PER_SIDE))
            sought = np.stack([patches[row + first, column + first] for patches in face], axis=1)
            rows = (self._cells[row + each, column : column + window].reshape(-1, DEPTH) for each in range(window))
            best = [(cells @ sought).reshape(window, count, -1).max(axis=0) for cells in rows]
            found[:, :, place] = np.max(best, axis=0).T
        return np.asarray(1 - np.sqrt(np.maximum(1 - found, 0)), np.float32)

    def _find_nearest(self, matches: Matches, among: npt.NDArray[np.bool_]) -> tuple[str, float]:
        """Return who of the people with some templates ``among`` all is nearest, and the score; with nobody, ""."""
        owners = np.unique(self._template_owners[among])
        best = (matches[:, among & (self._template_owners == owner)].max(axis=1) for owner in owners)
        likeness = [float(each.mean(axis=1).max()) for each in best]
        order = np.argsort(likeness)[::-1]
        rival = max([MIN_RIVAL_LIKENESS, *(likeness[each] for each in order[1:2])])
        first = owners[order[0]]
        return self.names[first] if first < len(self.names) else "", likeness[order[0]] - RIVAL_SHARE * rival

    def _calibrate(self, people: Mapping[str, Sequence[PictureDescription]]) -> GalleryCalibration:
        """Find what strangers score, and how surely people are known, by leaving out each picture and its person."""
        strangers, known = list[tuple[str, str, float]](), list[tuple[str, bool, float]]()
        for owner, (name, pictures) in enumerate(people.items()):
            own = self._template_owners == owner
            for number, picture in enumerate(pictures):
                matches = self._match_patches(picture.views)
                others = ~own & (self._template_owners < len(people))
                if others.any():
                    strangers.append((name, *self._find_nearest(matches, others)))
                if len(pictures) > 1:
                    found, score = self._find_nearest(matches, ~(own & (self._picture_numbers == number)))
                    known.append((name, found == name, score))
        usual = self._thresholds([], known)
        near = {name: other for name, other, score in strangers if score > usual[other]}
        alike = frozenset(
            name
            for name, each in usual.items()
            if each >= STRANGER_MEAN + MAX_THRESHOLD_DEVIATIONS * STRANGER_DEVIATION
        )
        thresholds = self._thresholds([score for _, _, score in strangers], known)
        refused = [not right or score <= thresholds[name] for name, right, score in known]
        accepted = [score > thresholds[other] for _, other, score in strangers]
        return GalleryCalibration(thresholds, _true_share(refused), _true_share(accepted), len(known), alike, near)

    def _thresholds(self, strangers: Sequence[float], known: Sequence[tuple[str, bool, float]]) -> Mapping[str, float]:
        """Return the threshold of each person, from the scores of strangers and those of the pictures left out."""
        mean, variance = STRANGER_MEAN, STRANGER_DEVIATION**2
        if strangers:
            seen = len(strangers)
            mean = (PRIOR_LOOKS * mean + seen * float(np.mean(strangers))) / (PRIOR_LOOKS + seen)
            variance = (PRIOR_LOOKS * variance + seen * float(np.var(strangers))) / (PRIOR_LOOKS + seen)
        if self._compared_count < MIN_COMPARED_PEOPLE:
            mean, variance = max(mean, STRANGER_MEAN), max(variance, STRANGER_DEVIATION**2)
        self._deviation = variance**0.5
        least, most = (
            mean + above * self._deviation
            for above in (THRESHOLD_DEVIATIONS + EXTRA_DEVIATIONS / self._compared_count, MAX_THRESHOLD_DEVIATIONS)
        )
        found = dict.fromkeys(self.names, least)
        for name in {name for name, _, _ in known}:
            own = float(np.mean([score for each, _, score in known if each == name]))
            usual = (own + float(np.mean([score for _, _, score in known]))) / 2
            found[name] = max(least, min(mean + OWN_SCORE_SHARE * (usual - mean), most))
        return found


def _true_share(hits: Sequence[bool]) -> float | None:
    """Return the share of hits; None of nothing."""
    return sum(hits) / len(hits) if hits else None
