"""Patch features of a face: directions of its edges, independent of the light.

The light is removed first (Tan and Triggs: Enhanced local texture feature sets for face recognition under difficult
lighting conditions, 2010): a root brightens dark parts, the mean of the surroundings is subtracted from each pixel, and
the contrast is normalised. The rest is described by dense SIFT (Lowe, 2004) with square roots (Arandjelović and
Zisserman, 2012). Properties common to all pictures, such as continuing edges, are removed by whitening. It is computed
from noise with the roughness of nature (1/f: Field, 1987), so no faces are needed.
"""

from functools import cache

import cv2
import numpy as np
import numpy.typing as npt

from perception.crops import CROP_SIDE
from perception.image_preparation import GreyImage

Patches = npt.NDArray[np.float32]
"""Patches of a face: shape (CELLS, CELLS, DEPTH), float32, each of length 1 (or 0 without an edge)."""

PATCH_STEP = 3
"""Pixels from one patch of a crop to the next."""

DIRECTIONS = 8
"""Number of edge directions in a full turn."""

PARTS_PER_SIDE, PART_SPACING = 4, 4
"""Points along each side of a patch at which edges are sampled, and pixels between them."""

BLUR_SIGMA = 1.5
"""Pixels (sigma) around a point of a patch over which edges are summed."""

DEPTH = PARTS_PER_SIDE * PARTS_PER_SIDE * DIRECTIONS

NOISE_CROPS = 16
"""Number of artificial noise pictures from which the whitening of patches is computed: 7056 patches."""

VARIANCE_FLOOR = 0.1
"""Addition to the variance of each component before whitening, as a share of the mean variance of all components."""

_PATCH_RADIUS = PART_SPACING * (PARTS_PER_SIDE - 1) // 2  # pixels from the middle of a patch to its outermost points
CELLS = (CROP_SIDE - 2 * _PATCH_RADIUS) // PATCH_STEP

FINE_SIGMA, WIDE_SIGMA = 1.0, 4.5
"""Pixels (sigma) of the smoothing of a crop, and of the surroundings of a pixel."""

LIGHT_ROOT, CONTRAST_POWER, MAX_CONTRAST = 0.2, 0.1, 10.0
"""Constants of Tan and Triggs: root of the light, power for averaging the contrast, and limit of the contrast."""


def describe_face(crop: GreyImage) -> Patches:
    """Return the patches of a face's crop: (CELLS, CELLS, DEPTH), float32."""
    return _to_unit_length(_raw_patches(crop) @ _whitening())


def _raw_patches(crop: GreyImage) -> Patches:
    """Return the patches of a crop before whitening."""
    even = cv2.GaussianBlur(normalise_light(crop), (0, 0), FINE_SIGMA)
    across, down = (cv2.Sobel(even, cv2.CV_32F, *order, ksize=1) for order in ((1, 0), (0, 1)))
    strength, angle = cv2.cartToPolar(across, down)
    turned = angle % (2 * np.pi) * (DIRECTIONS / (2 * np.pi))
    edges = np.empty((*crop.shape, DIRECTIONS), np.float32)
    for direction in range(DIRECTIONS):
        off = np.abs(turned - direction)
        near = np.maximum(1 - np.minimum(off, DIRECTIONS - off), 0)
        edges[:, :, direction] = cv2.GaussianBlur(strength * near, (0, 0), BLUR_SIGMA)
    points = _part_pixels()
    parts = edges[points[:, None, :, None], points[None, :, None, :]]
    found = _to_unit_length(parts.reshape(CELLS, CELLS, DEPTH))
    return _to_unit_length(np.sqrt(found))


def likeness(one: Patches, other: Patches) -> float:
    """Return the similarity of two faces, from patches at the same place in both: 1 if the faces are equal."""
    return float(np.mean(1 - np.sqrt(np.maximum(1 - (one * other).sum(axis=2), 0))))


def normalise_light(crop: GreyImage) -> npt.NDArray[np.float32]:
    """Return a crop without the effect of the light: (height, width), float32, -MAX_CONTRAST..MAX_CONTRAST."""
    light = (crop.astype(np.float32) / 255 + 0.01) ** LIGHT_ROOT
    light -= cv2.GaussianBlur(light, (0, 0), WIDE_SIGMA)
    light /= _mean_contrast(np.abs(light))
    light /= _mean_contrast(np.minimum(np.abs(light), MAX_CONTRAST))
    return np.asarray(MAX_CONTRAST * np.tanh(light / MAX_CONTRAST), np.float32)


def _mean_contrast(contrast: npt.NDArray[np.float32]) -> float:
    """Return the mean contrast, in which strong edges have little weight."""
    return float(np.mean(contrast**CONTRAST_POWER) ** (1 / CONTRAST_POWER)) + 1e-9


def _to_unit_length(patches: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Return patches of length 1; those without an edge stay 0."""
    return np.asarray(patches / (np.linalg.norm(patches, axis=-1, keepdims=True) + 1e-6), np.float32)


@cache
def _whitening() -> npt.NDArray[np.float32]:
    """Return the matrix (DEPTH, DEPTH) that equalises the variances of the components for noise."""
    random = np.random.default_rng(0)
    waves = np.hypot(*np.meshgrid(np.fft.fftfreq(CROP_SIDE), np.fft.fftfreq(CROP_SIDE)))
    waves[0, 0] = 1 / CROP_SIDE
    noises = np.fft.ifft2(np.fft.fft2(random.normal(size=(NOISE_CROPS, CROP_SIDE, CROP_SIDE))) / waves).real
    crops = 128 + 40 * noises / noises.std(axis=(1, 2), keepdims=True)
    seen = np.concatenate([_raw_patches(np.clip(each, 0, 255).astype(np.uint8)).reshape(-1, DEPTH) for each in crops])
    variances, axes = np.linalg.eigh(np.cov(seen, rowvar=False))
    return np.asarray(axes / np.sqrt(variances + VARIANCE_FLOOR * variances.mean()) @ axes.T, np.float32)


@cache
def _part_pixels() -> npt.NDArray[np.int64]:
    """Return the rows of the points of each patch in a crop, in pixels: shape (CELLS, PARTS_PER_SIDE).

    A patch is a square grid of points, so the same numbers are their columns.
    """
    return np.arange(CELLS)[:, None] * PATCH_STEP + np.arange(PARTS_PER_SIDE)[None] * PART_SPACING
