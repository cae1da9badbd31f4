"""Hessian-affine: blobs and saddles of the determinant of the Hessian, with affine shape.

Mikolajczyk & Schmid, IJCV 2004; details after Perdoch, Chum & Matas, CVPR 2009.
"""

import numpy as np
from numpy.typing import NDArray

from contracts.records import Frames
from retrieval.detectors.affine import adapt_shapes
from retrieval.detectors.extrema import find_extrema
from retrieval.kernels import kernel
from retrieval.pyramid import LEVELS_PER_OCTAVE, Level, Pyramid
from retrieval.selection import favour_large, inside, no_frames, round_frames, spread, take

REGION_SIGMAS = 3.0**0.5
"""Region radius in units of the detection scale (Perdoch's, less the magnification of 3)."""

_FLOOR = 1.0
"""In squared grey levels: a blob of about four grey levels' contrast after stretching."""
_EXCESSES = (1.5, 4.0)
"""Affine adaptation is paid for this many times the frames asked, as some do not converge."""


def detect_hesaff(
    pyramid: Pyramid, max_frames: int, usable: NDArray[np.bool_] | None = None
) -> Frames:
    """Find Hessian-affine frames; shapes are lower triangular (upright). See `detect`."""
    shape = (pyramid.grey.shape[0], pyramid.grey.shape[1])
    rounds = _find_blobs(pyramid)
    rounds = take(rounds, inside(rounds, shape, usable))
    adapted = no_frames()
    for excess in _EXCESSES:
        tried = spread(rounds, shape, int(np.ceil(excess * max_frames)))
        adapted = adapt_shapes(pyramid, tried, REGION_SIGMAS)
        adapted = take(adapted, inside(adapted, shape, usable))
        if len(adapted) >= max_frames or len(tried) == len(rounds):
            break
    return spread(adapted, shape, max_frames)


def _find_blobs(pyramid: Pyramid) -> Frames:
    parts = [_find_in_octave(octave) for octave in pyramid.octaves]
    if not parts:
        return no_frames()
    found = np.concatenate(parts)
    return favour_large(round_frames(found[:, :2], found[:, 2], found[:, 3]))


def _find_in_octave(octave: tuple[Level, ...]) -> NDArray[np.float32]:
    """Return (n, 4) float32: x, y, region radius in photo pixels, response."""
    step = octave[0].step
    responses = [hessian_response(level.pixels, level.sigma / step) for level in octave]
    parts = []
    for i in range(1, LEVELS_PER_OCTAVE + 1):
        found = find_extrema(responses[i - 1], responses[i], responses[i + 1], _FLOOR)
        found[:, :2] *= step
        scale = octave[i].sigma * 2.0 ** (found[:, 2] / LEVELS_PER_OCTAVE)
        found[:, 2] = REGION_SIGMAS * scale
        parts.append(found)
    return np.concatenate(parts)


@kernel
def hessian_response(pixels: NDArray[np.float32], sigma: float) -> NDArray[np.float32]:
    """Determinant of the Hessian times sigma^4, by 3 x 3 differences; zero on the border.

    Parameters
    ----------
    pixels : (h, w) float32. sigma : its blur, in its own pixels.

    Returns
    -------
    (h, w) float32.
    """
    height, width = pixels.shape
    response = np.zeros((height, width), np.float32)
    norm = np.float32(sigma**4)
    for row in range(1, height - 1):
        for column in range(1, width - 1):
            centre = np.float32(2.0) * pixels[row, column]
            dxx = pixels[row, column - 1] + pixels[row, column + 1] - centre
            dyy = pixels[row - 1, column] + pixels[row + 1, column] - centre
            dxy = np.float32(0.25) * (
                pixels[row + 1, column + 1]
                - pixels[row + 1, column - 1]
                - pixels[row - 1, column + 1]
                + pixels[row - 1, column - 1]
            )
            response[row, column] = norm * (dxx * dyy - dxy * dxy)
    return response
