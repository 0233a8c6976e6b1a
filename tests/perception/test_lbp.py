"""Local binary patterns: against a plain count of them, and what light does not change."""

import cv2
import numpy as np
import pytest

from perception.lbp import CELLS, LENGTH, PATTERNS, describe

CROP = np.random.default_rng(4).integers(0, 256, (96, 96), dtype=np.uint8)


def test_a_description_has_length_one_and_each_cell_an_equal_share_of_it() -> None:
    found = describe(CROP)
    assert found.shape == (LENGTH,)
    assert found.dtype == np.float32
    assert float(np.linalg.norm(found)) == pytest.approx(1.0, abs=1e-5)
    cells = (found.reshape(CELLS * CELLS, PATTERNS) ** 2).sum(axis=1)
    assert cells == pytest.approx(1 / CELLS**2, abs=1e-5)


def test_a_blank_picture_has_one_pattern_everywhere() -> None:
    found = describe(np.full((96, 96), 90, np.uint8)).reshape(CELLS * CELLS, PATTERNS)
    assert (found > 0).sum(axis=1).tolist() == [1] * CELLS**2


def test_there_are_58_patterns_that_go_over_at_most_twice() -> None:
    codes = [code for code in range(256) if (code ^ ((code >> 1) | (code & 1) << 7)).bit_count() <= 2]
    assert len(codes) == PATTERNS - 1


def test_less_light_changes_a_face_less_than_another_face_does() -> None:
    smooth = np.asarray(np.add.outer(np.arange(96), np.sin(np.arange(96) / 5) * 40 + 60), np.float32)
    other = smooth[::-1]
    bright, dark, another = (describe(np.clip(each, 0, 255).astype(np.uint8)) for each in (smooth, smooth * 0.6, other))
    assert np.linalg.norm(bright - dark) < 0.5 * np.linalg.norm(bright - another)


def test_a_face_far_away_is_described_as_it_is_near() -> None:
    def face(seed: int) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
        coarse = np.random.default_rng(seed).integers(0, 256, (12, 12), dtype=np.uint8)
        fine = np.random.default_rng(seed + 1).normal(0.0, 6.0, (96, 96))
        return np.clip(cv2.resize(coarse, (96, 96), interpolation=cv2.INTER_CUBIC) + fine, 0, 255).astype(np.uint8)

    near = face(1)
    far = cv2.resize(cv2.resize(near, (32, 32), interpolation=cv2.INTER_AREA), (96, 96))
    apart = np.linalg.norm(describe(near) - describe(face(7)))
    assert np.linalg.norm(describe(near) - describe(np.asarray(far, np.uint8))) < 0.3 * apart
