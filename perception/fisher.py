"""Who is nearest, and how near: Fisher's distance between descriptions of faces.

The directions in which pictures of one person differ among themselves count little, the others much: the descriptions
are brought into the space that they span, and whitened there by the scatter within persons. The usual next step, to
keep only the directions in which the known persons differ from each other, is left out: in those a stranger is as near
to somebody as anybody. What of a description lies outside of the space altogether counts too, the more the fewer people
made it (Moghaddam and Pentland's distance from the feature space, 1997): one person alone spans a space in which all
the world is near.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import ceil
from typing import Self

import numpy as np
import numpy.typing as npt

from perception.lbp import Vector

Vectors = npt.NDArray[np.float32]
"""Descriptions of one person: shape (how many, ``perception.lbp.LENGTH``), float32."""

DIMENSIONS = 120
"""How many dimensions the descriptions are brought down to, at most."""

RIDGE = 0.03
"""The share of the mean scatter that is added in each direction: in none of them do a few pictures show all of it."""

OUTSIDE = 3.0
"""What the part outside of that space counts where one person is known, in parts of what is inside; the more people,
the less, by the square of their number: chosen on drawn people and clips, where it told strangers apart best."""

LONE = 1.0
"""The threshold where one person is known, or the pictures are too few: nothing tells then how near strangers come."""

LOWEST, HIGHEST = 1.0, 1.3
"""Between which a threshold must lie, whatever a few pictures say. With two or three people known strangers pass:
docs/people.md has the figures."""

OTHER_DAYS = 1.3
"""How much farther known people are in pictures that did not teach, beside those that are left out of the same series:
drawn people at twice the distance, and clips a second later. Other days were not tried."""

FOLDS = 5
"""Parts into which pictures and persons are divided, to ask each part by what the others taught."""


@dataclass(frozen=True, slots=True)
class Calibration:
    """How well a gallery tells people apart, found by leaving out some of it in turn.

    ``threshold`` is the distance (in standard deviations) from which on somebody is a stranger. ``refused`` is the
    share 0..1 of looks at known people that did not give their name, ``accepted`` that of looks at strangers that gave
    one: None where that could not be found out. ``looks`` are how many looks at known people that was asked of.
    """

    threshold: float
    refused: float | None
    accepted: float | None
    looks: int


class Fisher:
    """Persons, each as the middle of their descriptions; made with ``fit``, and not changed after."""

    def __init__(
        self,
        names: Sequence[str],
        *,
        mean: Vector,
        basis: npt.NDArray[np.float32],
        white: npt.NDArray[np.float32],
        middles: npt.NDArray[np.float32],
        scatter: float,
    ) -> None:
        self.names = tuple(names)
        self._mean = mean
        self._basis = basis
        self._white = white
        self._middles = middles
        self._scatter = scatter
        self._outside = OUTSIDE / len(self.names) ** 2

    @classmethod
    def fit(cls, samples: Mapping[str, Vectors]) -> Self:
        """Learn what persons look like. Raises ValueError for nobody, and for a person without descriptions."""
        if not samples or not all(len(vectors) for vectors in samples.values()):
            raise ValueError("faces: nobody to be recognised, or somebody without a picture")
        whole = np.concatenate(list(samples.values())).astype(np.float32)
        mean = whole.mean(axis=0)
        whole -= mean
        basis = _basis(whole)
        placed = whole @ basis
        ends = np.cumsum([len(vectors) for vectors in samples.values()])
        groups = np.split(placed, ends[:-1])
        middles = np.array([group.mean(axis=0) for group in groups])
        within = np.concatenate([group - middle for group, middle in zip(groups, middles, strict=True)])
        scatter = within.T.astype(np.float64) @ within / len(within)
        total, size = max(float(np.trace(scatter)), 1e-9), len(scatter)
        inverse = np.linalg.inv(scatter + RIDGE * total / size * np.eye(size))
        white = np.linalg.cholesky(inverse).astype(np.float32)
        return cls(list(samples), mean=mean, basis=basis, white=white, middles=middles @ white, scatter=total)

    def distances(self, vector: Vector) -> dict[str, float]:
        """Return how far a description is from each person, by name: the root mean square, in standard deviations."""
        found = self.all_distances(vector[None])[0]
        return dict(zip(self.names, found.tolist(), strict=True))

    def all_distances(self, vectors: Vectors) -> npt.NDArray[np.float32]:
        """Return the distances of several descriptions: shape (how many, persons in the order of ``names``)."""
        off = vectors - self._mean
        placed = off @ self._basis
        outside = np.maximum((off * off).sum(axis=1) - (placed * placed).sum(axis=1), 0.0) / self._scatter
        apart = (placed @ self._white)[:, None, :] - self._middles[None]
        inside = (apart * apart).mean(axis=2)
        return np.asarray(np.sqrt((inside + self._outside * outside[:, None]) / (1 + self._outside)), np.float32)


def _basis(centred: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Return the main directions of centred samples, as columns: by the Gram matrix, there being few samples."""
    strength, vectors = np.linalg.eigh(centred @ centred.T)
    keep = np.argsort(strength)[::-1][:DIMENSIONS]
    keep = keep[strength[keep] > max(1e-5 * float(strength.max()), 1e-12)]
    if not len(keep):  # one description, or the same one again: any direction does
        return np.eye(centred.shape[1], 1, dtype=np.float32)
    return np.asarray(centred.T @ (vectors[:, keep] / np.sqrt(strength[keep])), np.float32)


def calibrate(samples: Mapping[str, Sequence[Vectors]]) -> Calibration:
    """Find the distance at which as many strangers are accepted as known people are refused.

    ``samples`` has for each person, picture by picture, the descriptions of that picture and its variants. Some
    persons are left out in turn to be strangers, and some pictures of the others to be looks at them. All are of the
    same days as those that taught: expect more refusals on others.
    """
    known: list[float] = []
    strange: list[float] = []
    for taught, others, strangers in _parts(samples):
        fisher = Fisher.fit(taught)
        for name, vectors in others.items():
            found = fisher.all_distances(vectors)
            right = found.argmin(axis=1) == fisher.names.index(name)
            known += np.where(right, found.min(axis=1), np.inf).tolist()
        for vectors in strangers:
            strange += fisher.all_distances(vectors).min(axis=1).tolist()
    if not (known and strange):
        return Calibration(LONE, _share(known, LONE), None, len(known))
    threshold = min(max(_balanced(OTHER_DAYS * np.array(known), np.array(strange)), LOWEST), HIGHEST)
    accepted = float(np.mean(np.array(strange) <= threshold))
    return Calibration(threshold, _share(known, threshold), accepted, len(known))


def _parts(
    samples: Mapping[str, Sequence[Vectors]],
) -> Iterator[tuple[Mapping[str, Vectors], Mapping[str, Vectors], Sequence[Vectors]]]:
    """Yield, part by part, what teaches, what is asked of the same persons, and what is asked of persons left out."""
    persons = len(samples)
    groups = min(persons, FOLDS)
    for fold in range(groups * ceil(FOLDS / groups) if groups else 0):
        taught, others, strangers = dict[str, Vectors](), dict[str, Vectors](), list[Vectors]()
        for number, (name, pictures) in enumerate(samples.items()):
            if persons > 1 and number % groups == fold % groups:
                strangers.append(np.concatenate(pictures))
                continue
            held = [one for place, one in enumerate(pictures) if place % FOLDS == fold % FOLDS]
            rest = [one for place, one in enumerate(pictures) if place % FOLDS != fold % FOLDS]
            if rest:
                taught[name] = np.concatenate(rest)
                others |= {name: np.concatenate(held)} if held else {}
        if taught:
            yield taught, others, strangers


def _balanced(known: npt.NDArray[np.float64], strange: npt.NDArray[np.float64]) -> float:
    """Return the distance at which the greater of both errors is least; of several, the one in their middle."""
    places = np.unique(np.concatenate([known[np.isfinite(known)], strange]))
    between = (places[:-1] + places[1:]) / 2 if len(places) > 1 else places
    refused = np.mean(known[None] > between[:, None], axis=1)
    accepted = np.mean(strange[None] <= between[:, None], axis=1)
    worse = np.maximum(refused, accepted)
    best = between[worse <= worse.min() + 1e-9]
    return float((best[0] + best[-1]) / 2)


def _share(known: Sequence[float], threshold: float) -> float | None:
    """Return the share of distances beyond the threshold."""
    return float(np.mean(np.array(known) > threshold)) if known else None
