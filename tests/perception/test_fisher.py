"""Fisher's distance and its threshold, on clouds of points that stand for people."""

import numpy as np
import numpy.typing as npt
import pytest

from perception.fisher import THRESHOLDS, Calibration, Fisher, Vectors, calibrate

LENGTH = 300
PICTURES, VARIANTS = 8, 7


class People:
    """Persons as points, with pictures of them that scatter around; along ``shared`` directions much."""

    def __init__(self, count: int, *, apart: float = 1.0, seed: int = 0) -> None:
        self.random = np.random.default_rng(seed)
        self.middles = self.random.normal(0.0, apart / LENGTH**0.5, (count, LENGTH))
        self.shared = self.random.normal(0.0, 0.3 / LENGTH**0.5, (5, LENGTH))

    def picture(self, person: int, size: int = VARIANTS) -> Vectors:
        light = self.random.normal(0.0, 1.0, (size, 5)) @ self.shared
        noise = self.random.normal(0.0, 0.1 / LENGTH**0.5, (size, LENGTH))
        found: npt.NDArray[np.float64] = self.middles[person] + light + noise
        return found.astype(np.float32)

    def samples(self, *persons: int) -> dict[str, list[Vectors]]:
        return {f"p{person}": [self.picture(person) for _ in range(PICTURES)] for person in persons}


def fitted(samples: dict[str, list[Vectors]]) -> Fisher:
    return Fisher.fit({name: np.concatenate(pictures) for name, pictures in samples.items()})


@pytest.mark.parametrize("count", [1, 2, 5])
def test_somebody_known_is_nearest_to_themselves_and_a_stranger_is_far_from_all(count: int) -> None:
    people = People(count + 1)
    fisher = fitted(people.samples(*range(count)))
    for person in range(count):
        distances = fisher.distances(people.picture(person, 1)[0])
        assert min(distances, key=distances.__getitem__) == f"p{person}"
        assert distances[f"p{person}"] < 1.5
    assert min(fisher.distances(people.picture(count, 1)[0]).values()) > 2.0


def test_a_stranger_to_one_person_is_seen_by_what_lies_outside_of_all_that_they_have_shown() -> None:
    people = People(2)
    fisher = fitted(people.samples(0))
    outside = people.middles[0] + 3.0 * (people.middles[1] - people.middles[0])
    assert fisher.distances(outside.astype(np.float32))["p0"] > 3.0


def test_nobody_and_somebody_without_a_picture_are_refused() -> None:
    for samples in ({}, {"p0": np.empty((0, LENGTH), np.float32)}):
        with pytest.raises(ValueError, match="without a picture"):
            Fisher.fit(samples)


def test_one_description_alone_is_enough_not_to_fail() -> None:
    vector = People(1).picture(0, 1)
    assert Fisher.fit({"p0": vector}).distances(vector[0])["p0"] == pytest.approx(0.0, abs=1e-3)


def calibrated(samples: dict[str, list[Vectors]]) -> Calibration:
    return calibrate(fitted(samples), samples)


def test_people_who_are_far_apart_are_hardly_ever_refused_and_strangers_hardly_accepted() -> None:
    found = calibrated(People(4).samples(*range(4)))
    assert found.looks > 0
    assert found.refused == pytest.approx(0.0, abs=0.03)
    assert found.accepted == pytest.approx(0.0, abs=0.03)


def test_people_who_are_alike_are_told_to_be_so() -> None:
    found = calibrated(People(4, apart=0.05).samples(*range(4)))
    assert found.refused is not None
    assert found.accepted is not None
    assert found.refused + found.accepted > 0.2


def test_the_fewer_are_known_the_nearer_somebody_must_be() -> None:
    people = People(6)
    found = [fitted(people.samples(*range(count))).threshold for count in range(1, 7)]
    assert found == [*THRESHOLDS, *THRESHOLDS[-1:] * 2]
    assert found == sorted(found)


def test_of_one_person_it_is_not_known_how_near_strangers_come() -> None:
    found = calibrated(People(1).samples(0))
    assert found.threshold == THRESHOLDS[0]
    assert found.accepted is None
    assert found.refused is not None


def test_of_one_picture_nothing_is_known() -> None:
    assert calibrated({"p0": [People(1).picture(0)]}) == Calibration(THRESHOLDS[0], None, None, 0)
