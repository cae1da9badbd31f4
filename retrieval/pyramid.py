"""A photograph's Gaussian scale space, built once and read by every detector and descriptor."""

from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

LEVELS_PER_OCTAVE = 3
BASE_SIGMA = 1.6
"""Blur of the first level that detectors search (Lowe 2004), pixels of its own octave."""

CAMERA_SIGMA = 0.5
"""Blur of a sharp photo, pixels (Lowe 2004)."""
_FINE_SIGMAS = (CAMERA_SIGMA, 0.8, 1.0, 1.27)
_MIN_SIDE = 16
_MAX_GAIN = 4.0


@dataclass(frozen=True, slots=True)
class Level:
    """One blurred image.

    pixels : (h, w) float32. sigma : its blur, in pixels of the photo. step : photo pixels per
    pixel of this level; pixel (i, j) lies at photo position (i * step, j * step).
    """

    pixels: NDArray[np.float32]
    sigma: float
    step: int


@dataclass(frozen=True, slots=True)
class Pyramid:
    """The scale space of one photo, contrast stretched.

    rgb : (h, w, 3) uint8, the photo as given. gain : by how much the stretch multiplied contrast.
    grey : (h, w) float32, usually within 0 to 255. grey8 : the same, clipped to uint8.
    fine : full-size levels below BASE_SIGMA, for sampling only.
    octaves : each LEVELS_PER_OCTAVE + 2 levels, finest first; empty for a tiny photo.
    """

    rgb: NDArray[np.uint8]
    gain: float
    grey: NDArray[np.float32]
    grey8: NDArray[np.uint8]
    fine: tuple[Level, ...]
    octaves: tuple[tuple[Level, ...], ...]

    def sampling_levels(self) -> tuple[Level, ...]:
        """Return the levels without the overlap of neighbouring octaves, sigma ascending."""
        return self.fine + tuple(
            level for octave in self.octaves for level in octave[:LEVELS_PER_OCTAVE]
        )


def build_pyramid(rgb: NDArray[np.uint8]) -> Pyramid:
    """Build the scale space of a photo.

    Faded and dark photos are first stretched (linearly, gain at most 4), so that detectors can
    keep one low absolute floor against noise and rank by response above it.

    Parameters
    ----------
    rgb : (h, w, 3) uint8, upright.

    Raises
    ------
    ValueError : another shape or dtype, or no pixels.
    """
    if rgb.ndim != 3 or rgb.shape[2] != 3 or rgb.dtype != np.uint8 or rgb.size == 0:
        raise ValueError(
            f"image: found shape {rgb.shape} and dtype {rgb.dtype}, expected (h, w, 3) uint8 with "
            "at least one pixel; decode it to RGB first"
        )
    grey, gain = _stretch(np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY), np.uint8))
    grey8 = np.clip(np.rint(grey), 0, 255).astype(np.uint8)
    levels = _blur_up(grey, _FINE_SIGMAS)
    fine = tuple(Level(p, s, 1) for p, s in zip(levels, _FINE_SIGMAS, strict=True))
    return Pyramid(rgb, gain, grey, grey8, fine, _build_octaves(fine[-1]))


def _stretch(grey: NDArray[np.uint8]) -> tuple[NDArray[np.float32], float]:
    """Map the 1st to 99th percentile onto the full range; also return the gain."""
    cumulative = np.cumsum(np.bincount(grey.ravel(), minlength=256)) / grey.size
    low, high = np.searchsorted(cumulative, (0.01, 0.99))
    gain = min(255.0 / max(int(high) - int(low), 1), _MAX_GAIN)
    stretched = (grey.astype(np.float32) - np.float32(low)) * np.float32(gain)
    return stretched.astype(np.float32), gain


def _build_octaves(finest: Level) -> tuple[tuple[Level, ...], ...]:
    sigmas = [BASE_SIGMA * 2 ** (i / LEVELS_PER_OCTAVE) for i in range(LEVELS_PER_OCTAVE + 2)]
    octaves: list[tuple[Level, ...]] = []
    base, step = finest.pixels, 1
    if min(base.shape) >= _MIN_SIDE:
        base = _blur(base, finest.sigma, BASE_SIGMA)
    while min(base.shape) >= _MIN_SIDE:
        levels = _blur_up(base, sigmas)
        octaves.append(tuple(Level(p, s * step, step) for p, s in zip(levels, sigmas, strict=True)))
        base = np.ascontiguousarray(levels[LEVELS_PER_OCTAVE][::2, ::2])
        step *= 2
    return tuple(octaves)


def _blur_up(
    first: NDArray[np.float32], sigmas: list[float] | tuple[float, ...]
) -> list[NDArray[np.float32]]:
    levels = [first]
    for before, after in pairwise(sigmas):
        levels.append(_blur(levels[-1], before, after))
    return levels


def _blur(pixels: NDArray[np.float32], before: float, after: float) -> NDArray[np.float32]:
    sigma = (after**2 - before**2) ** 0.5
    side = 2 * int(np.ceil(3.0 * sigma)) + 1
    blurred = cv2.GaussianBlur(pixels, (side, side), sigma, borderType=cv2.BORDER_REPLICATE)
    return np.ascontiguousarray(blurred, dtype=np.float32)
