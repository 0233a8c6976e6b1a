"""The patches of a face: what they are made of, and what light does not change."""

import cv2
import numpy as np
import pytest

from perception.image_preparation import GreyImage
from perception.patches import CELLS, DEPTH, MAX_CONTRAST, Patches, _raw_patches, describe_face, normalise_light

CROP = np.random.default_rng(4).integers(0, 256, (75, 75), dtype=np.uint8)


def face(seed: int) -> GreyImage:
    """Make up something that is as smooth as a face."""
    coarse = np.random.default_rng(seed).integers(40, 200, (12, 12), dtype=np.uint8)
    return np.asarray(cv2.resize(coarse, (75, 75), interpolation=cv2.INTER_CUBIC), np.uint8)


def alike(one: Patches, other: Patches) -> float:
    return float((one * other).sum(axis=2).mean())


def test_each_patch_has_length_one() -> None:
    found = describe_face(CROP)
    assert found.shape == (CELLS, CELLS, DEPTH)
    assert found.dtype == np.float32
    assert np.linalg.norm(found, axis=2) == pytest.approx(1.0, abs=1e-3)


def test_a_blank_crop_is_described_too() -> None:
    assert np.isfinite(describe_face(np.full((75, 75), 0, np.uint8))).all()


def test_upright_and_level_stripes_have_less_in_common_than_two_faces() -> None:
    stripes = np.tile(np.asarray(127 + 100 * np.sin(np.arange(75) / 2), np.uint8), (75, 1))
    upright, level = describe_face(stripes), describe_face(np.ascontiguousarray(stripes.T))
    assert alike(upright, upright) == pytest.approx(1.0, abs=1e-3)
    assert alike(upright, level) < alike(describe_face(face(0)), describe_face(face(1))) - 0.2


def test_whitened_patches_are_less_correlated() -> None:
    def repeated(patches: Patches) -> float:
        return float(np.abs(np.corrcoef(patches.reshape(-1, DEPTH), rowvar=False)).mean())

    shown = [face(seed) for seed in range(8)]
    plain, whitened = (np.stack([make(each) for each in shown]) for make in (_raw_patches, describe_face))
    assert repeated(whitened) < 0.75 * repeated(plain)


@pytest.mark.parametrize("seed", range(5))
def test_light_changes_a_face_less_than_another_person_does(seed: int) -> None:
    shown = face(seed)
    from_the_side = np.asarray(shown * np.linspace(0.25, 1.0, 75)[None], np.uint8)
    dark = np.asarray(shown * 0.3, np.uint8)
    another = alike(describe_face(shown), describe_face(face(seed + 50)))
    for other in (from_the_side, dark):
        assert alike(describe_face(shown), describe_face(other)) > another + 0.5 * (1 - another)


def test_contrast_of_strong_edges_is_bounded() -> None:
    shown = np.zeros((75, 75), np.uint8)
    shown[:, 40:] = 255
    assert float(np.abs(normalise_light(shown)).max()) <= MAX_CONTRAST
