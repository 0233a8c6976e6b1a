"""Face recognition by elastic matching: each patch of a face is searched near its place in pictures of each person.

Faces differ in pose, expression and framing, so a patch may be a little displaced (elastic matching: Hua and
Akbarzadeh, 2009), and each patch may match a different picture of the same person (image-to-class distance: Boiman,
Shechtman and Irani, 2008). The likeness of a face to a person is 1 minus the mean distance of the best matches. This
mean is less sensitive than the mean square to a few patches changed by glasses or a shadow. A face is compared by its
box and, if both eyes are found, upright; the better view counts. A part of the likeness to the second person is
subtracted: a face that is a little like everyone is a poor picture, or a stranger (cohort normalisation).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from perception.identity import FaceMatch
from perception.patches import CELLS, DEPTH, Patches

SEARCH_REACH = 2
"""Distance in cells, to each side, up to which a patch of a face is searched around its own place.

A cell is the step between neighbouring patches of a face.
"""

PATCH_SPACING = 3
"""Distance in cells between neighbouring patches that are searched.

A cell is the step between neighbouring patches of a face.
"""

PATCHES_PER_SIDE = CELLS // PATCH_SPACING
"""Number of searched patches along each side of a face."""

Matches = npt.NDArray[np.float32]
"""Distance of the best match of each patch of a face in each template, 0 (equal) to 1.

The shape is (views of the face, templates, PATCHES_PER_SIDE ** 2). Views are variants of the face, such as upright;
templates are variants of the pictures of known people.
"""


@dataclass(frozen=True, slots=True)
class PictureDescription:
    """A picture of a person as patches: ``views`` are compared with the ``templates`` of other pictures.

    Views and templates are variants of the picture, such as upright or mirrored.
    """

    views: Sequence[Patches]
    templates: Sequence[Patches]


RIVAL_SHARE = 0.3
"""Share of the likeness to the second most similar person that is subtracted from a face's score."""

MIN_RIVAL_LIKENESS = 0.715
"""Smallest likeness assumed for the second most similar person, also if the gallery has only one person.

It is a likeness that is typical of strangers.
"""

STRANGER_MEAN, STRANGER_DEVIATION = 0.522, 0.0085
"""Prior mean score of looks at strangers, and their standard deviation."""

PRIOR_LOOKS = 20
"""Weight of the prior assumptions on the scores of strangers, as a number of comparisons within the gallery."""

THRESHOLD_DEVIATIONS, EXTRA_DEVIATIONS = 2.33, 2.0
"""Standard deviations of the threshold above the mean of strangers, and extra ones divided by the number of people.

2.33 would accept 1 in 100 strangers if scores were normally distributed. A few people say little about strangers.
"""

MIN_COMPARED_PEOPLE = 3
"""Smallest number of people in the gallery whose scores may lower the assumed mean and deviation of strangers.

With fewer people, mean and standard deviation of strangers' scores are at least those of the prior.
"""

OWN_SCORE_SHARE = 0.45
"""Position of a person's threshold between the mean score of strangers (0) and the score of known pictures (1).

The score of known pictures is the mean of that person's own and of all people's. Pictures that are alike, as from one
room and day, have high scores, and so do strangers in that room.
"""

MAX_THRESHOLD_DEVIATIONS = 7.0
"""Largest threshold that ``OWN_SCORE_SHARE`` may give, in standard deviations above the mean of strangers."""


@dataclass(frozen=True, slots=True)
class GalleryCalibration:
    """Thresholds of a gallery and its error rates, found by leaving out parts of it in turn.

    A look is one comparison of a picture with the gallery. ``refusal_rate`` is the share 0..1 of looks at known people
    that do not give their name, ``acceptance_rate`` the share of looks at strangers that give a name; None if unknown.
    ``look_count`` is the number of looks at known people. A score above ``thresholds[name]`` means that person.
    ``uniform_people`` have nearly identical pictures. ``lookalikes`` maps a person to a similar one.
    """

    thresholds: Mapping[str, float]
    refusal_rate: float | None
    acceptance_rate: float | None
    look_count: int
    uniform_people: frozenset[str]
    lookalikes: Mapping[str, str]


class Gallery:
    """Known people, each as the patches of their pictures, with thresholds computed at construction.

    ``cohort`` has pictures of certain strangers: a face that is nearest to one of them is a stranger. Raises ValueError
    without people, and for a person without a picture.
    """

    def __init__(
        self, people: Mapping[str, Sequence[PictureDescription]], cohort: Sequence[Sequence[PictureDescription]] = ()
    ) -> None:
        if not people or not all(people.values()):
            raise ValueError("faces: no people, or a person without a picture")
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
        """Return the person most similar to a face, whose ``face`` has one or more views.

        The margin is the distance of the score from that person's threshold, in standard deviations of the scores of
        strangers.
        """
        matches = self._match_patches(face)
        name, score = self._find_nearest(matches, np.ones(len(self._template_owners), np.bool_))
        thresholds = self.calibration.thresholds
        margin = (score - (thresholds[name] if name else min(thresholds.values()))) / self._deviation
        return FaceMatch(name, margin if name else -abs(margin))

    def _match_patches(self, face: Sequence[Patches]) -> Matches:
        """Return the best match of each patch of each view of a face in each template of the gallery."""
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
        """Return the name of the nearest person, and the score.

        The name is empty if the nearest is a stranger of the cohort. Only the templates that are True in ``among`` are
        compared.
        """
        owners = np.unique(self._template_owners[among])
        best = (matches[:, among & (self._template_owners == owner)].max(axis=1) for owner in owners)
        likeness = [float(each.mean(axis=1).max()) for each in best]
        order = np.argsort(likeness)[::-1]
        rival = max([MIN_RIVAL_LIKENESS, *(likeness[each] for each in order[1:2])])
        first = owners[order[0]]
        return self.names[first] if first < len(self.names) else "", likeness[order[0]] - RIVAL_SHARE * rival

    def _calibrate(self, people: Mapping[str, Sequence[PictureDescription]]) -> GalleryCalibration:
        """Return thresholds and error rates, by leaving out each picture and each person in turn."""
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
        """Return the threshold of each person, from the scores of strangers and of known people.

        ``known`` has an entry per picture, compared with all other pictures: the true name, whether that name was
        nearest, and the score.
        """
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
    """Return the share of True; None for an empty sequence."""
    return sum(hits) / len(hits) if hits else None
