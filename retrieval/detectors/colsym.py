"""Colour symmetry: points that edges of any colour channel face from opposite sides.

Heidemann, PAMI 26(7) 2004, after Reisfeld, Wolfson & Yeshurun, IJCV 1995. What they leave open,
scale above all, is reconstructed: docs/decisions/0008.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.records import Frames
from retrieval.detectors.extrema import find_extrema
from retrieval.detectors.symmetry import colour_symmetry
from retrieval.pyramid import CAMERA_SIGMA, LEVELS_PER_OCTAVE, Pyramid
from retrieval.selection import inside, no_frames, round_frames, spread, take

_RADII = tuple(2.5 * 2.0 ** (i / LEVELS_PER_OCTAVE) for i in range(LEVELS_PER_OCTAVE + 2))
"""Of the rings of an octave, in its pixels."""
_BLUR_PER_RADIUS = 0.45
_REGION_RADII = 1.4
"""Region radius over ring radius: the edges that make a point symmetric lie well inside."""
_FLOOR = 15.0
"""A grey disc of two grey levels' contrast has about 20, noise of four grey levels up to 10."""
_MIN_SIDE = 24


def detect_colsym(
    pyramid: Pyramid, max_frames: int, usable: NDArray[np.bool_] | None = None
) -> Frames:
    """Find centres of colour symmetry, round. See `detect`.

    Symmetries too small to be seen at half the resolution repeat less well; only a photo with too
    few others needs them.
    """
    shape = (pyramid.grey.shape[0], pyramid.grey.shape[1])
    found = [_find_in_octave(pyramid, step) for step in _steps(shape)]
    frames = _frames(found, shape, usable)
    if len(frames) < max_frames and min(shape) >= _MIN_SIDE:
        frames = _frames([_find_in_octave(pyramid, 1), *found], shape, usable)
    return spread(frames, shape, max_frames)


def _steps(shape: tuple[int, int]) -> list[int]:
    """Every octave's step: 2, 4, ... while enough of the photo is left."""
    octaves = int(np.log2(max(min(shape) / _MIN_SIDE, 1.0)))
    return [2 ** (1 + i) for i in range(octaves)]


def _frames(
    found: list[NDArray[np.float32]], shape: tuple[int, int], usable: NDArray[np.bool_] | None
) -> Frames:
    if not found:
        return no_frames()
    table = np.concatenate(found)
    frames = round_frames(table[:, :2], table[:, 2], table[:, 3])
    return take(frames, inside(frames, shape, usable))


def _find_in_octave(pyramid: Pyramid, step: int) -> NDArray[np.float32]:
    """Return (n, 4) float32: x, y, region radius in photo pixels, response."""
    responses = [
        colour_symmetry(colour, radius)
        for colour, radius in zip(_blurred(pyramid, step), _RADII, strict=True)
    ]
    parts = []
    for i in range(1, LEVELS_PER_OCTAVE + 1):
        found = find_extrema(responses[i - 1], responses[i], responses[i + 1], _FLOOR)
        radius = _RADII[i] * 2.0 ** (found[:, 2] / LEVELS_PER_OCTAVE)
        found[:, 2] = _REGION_RADII * step * radius
        found[:, :2] = found[:, :2] * step + 0.5 * (step - 1)
        parts.append(found)
    return np.concatenate(parts)


def _blurred(pyramid: Pyramid, step: int) -> list[NDArray[np.float32]]:
    """The photo's channels (3, h, w), reduced by `step`, at the blur of each ring.

    They are stretched like the grey photo and multiplied by their blur, so that the gradients of
    a structure are the same at whatever size it is seen.
    """
    height, width = (side // step for side in pyramid.rgb.shape[:2])
    # Whole blocks of step x step pixels only: else the reduction is not by `step`.
    whole = pyramid.rgb[: height * step, : width * step]
    small = cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA)
    reduced: NDArray[np.float32] = small.astype(np.float32)
    before, levels = CAMERA_SIGMA / step, []
    for radius in _RADII:
        sigma = _BLUR_PER_RADIUS * radius
        blurred = cv2.GaussianBlur(reduced, (0, 0), (sigma**2 - before**2) ** 0.5)
        reduced = np.asarray(blurred, np.float32)
        gain = np.float32(pyramid.gain * sigma)
        levels.append(np.ascontiguousarray(reduced.transpose(2, 0, 1)) * gain)
        before = sigma
    return levels
