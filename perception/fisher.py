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

OUTSIDE = 6.0
"""What the part outside of that space counts, in parts of what is inside, where one person is known; the more people,
the less, in proportion."""

THRESHOLDS = (0.8, 0.9, 0.95, 1.0)
"""The distance (in standard deviations) from which on somebody is a stranger, where one, two, three and more people are
known. How near strangers come cannot be learnt from a few people, so it is not tried: these let 3 to 5 looks at
strangers in 100 pass at most, at the cost of refusals (docs/people.md)."""

FOLDS = 5
"""Parts into which pictures and persons are divided, to ask each part by what the others taught."""


@dataclass(frozen=True, slots=True)
class Calibration:
    """How well a gallery tells people apart, found by leaving out some of it in turn.

    ``refused`` is the share 0..1 of looks at known people that did not give their name, ``accepted`` that of looks at
    strangers that gave one: None where that could not be found out. ``looks`` are how many looks at known people that
    was asked of. ``threshold`` is that of the whole gallery (``Fisher.threshold``).
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
        self._outside = OUTSIDE / len(self.names)

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

    @property
    def threshold(self) -> float:
        """The distance, in standard deviations, from which on somebody is a stranger."""
        return THRESHOLDS[min(len(self.names), len(THRESHOLDS)) - 1]

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


def calibrate(fisher: Fisher, samples: Mapping[str, Sequence[Vectors]]) -> Calibration:
    """Find how often known people are refused and strangers accepted, by those who taught ``fisher``.

    ``samples`` has for each person, picture by picture, the descriptions of that picture and its variants. Some
    persons are left out in turn to be strangers, and some pictures of the others to be looks at them. All are of the
    same days as those that taught: expect more refusals on others.
    """
    refused, accepted = list[bool](), list[bool]()
    for taught, others, strangers in _parts(samples):
        part = Fisher.fit(taught)
        for name, vectors in others.items():
            found = part.all_distances(vectors)
            known = (found.argmin(axis=1) == part.names.index(name)) & (found.min(axis=1) < part.threshold)
            refused += (~known).tolist()
        for vectors in strangers:
            accepted += (part.all_distances(vectors).min(axis=1) < part.threshold).tolist()
    return Calibration(fisher.threshold, _share(refused), _share(accepted), len(refused))


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


def _share(hits: Sequence[bool]) -> float | None:
    """Return the share of hits; None of nothing."""
    return sum(hits) / len(hits) if hits else None
