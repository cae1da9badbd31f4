"""RootSIFT: 4 x 4 cells x 8 gradient directions.

Lowe, IJCV 2004; square root after Arandjelovic & Zisserman, CVPR 2012.
"""

import numpy as np
from numpy.typing import NDArray

from retrieval.kernels import kernel
from retrieval.patches import PATCH_SIDE

_CELLS = 4
_DIRECTIONS = 8
_CLIP = 0.2
_SCALE = 512.0


@kernel
def describe_sift(magnitude: NDArray[np.float32], angle: NDArray[np.float32]) -> NDArray[np.uint8]:
    """RootSIFT of patches: trilinear votes, clipped at 0.2, sqrt of L1, times 512, at most 255.

    Cell (row, column) and direction k (k / 8 of a turn) are entry (4 row + column) 8 + k.

    Parameters
    ----------
    magnitude, angle : (n, 41, 41) float32; angles in turns.

    Returns
    -------
    (n, 128) uint8; zero for a flat patch.
    """
    n = len(magnitude)
    out = np.zeros((n, _CELLS * _CELLS * _DIRECTIONS), np.uint8)
    window, first, share = _axis()
    # One ring of spare cells takes the votes that fall outside.
    line = np.empty((_CELLS + 2, _DIRECTIONS), np.float32)
    histogram = np.empty((_CELLS + 2, _CELLS + 2, _DIRECTIONS), np.float32)
    for i in range(n):
        histogram[:] = 0.0
        for row in range(1, PATCH_SIDE - 1):
            line[:] = 0.0
            _vote_line(magnitude[i, row], angle[i, row], window, first, share, line)
            lower = window[row] * share[row]
            upper = window[row] - lower
            above, below = histogram[first[row]], histogram[first[row] + 1]
            for cell in range(_CELLS + 2):
                for k in range(_DIRECTIONS):
                    above[cell, k] += upper * line[cell, k]
                    below[cell, k] += lower * line[cell, k]
        _quantise(histogram, out[i])
    return out


@kernel
def _vote_line(
    magnitude: NDArray[np.float32],
    angle: NDArray[np.float32],
    window: NDArray[np.float32],
    first: NDArray[np.uint32],
    share: NDArray[np.float32],
    line: NDArray[np.float32],
) -> None:
    """Votes of one row of pixels for its cells and directions, (6, 8); rows are weighed later."""
    last = np.uint32(_DIRECTIONS - 1)
    for column in range(1, PATCH_SIDE - 1):
        weight = magnitude[column] * window[column]
        direction = angle[column] * np.float32(_DIRECTIONS)
        low = np.uint32(direction)
        part = direction - np.float32(low)
        high = (low + np.uint32(1)) & last
        low &= last
        left = first[column]
        beside = weight * share[column]
        here = weight - beside
        line[left, high] += here * part
        line[left, low] += here - here * part
        line[left + np.uint32(1), high] += beside * part
        line[left + np.uint32(1), low] += beside - beside * part


@kernel
def _axis() -> tuple[NDArray[np.float32], NDArray[np.uint32], NDArray[np.float32]]:
    """Per row or column: Gaussian weight (two cells' deviation), cell before it, share beyond."""
    window = np.empty(PATCH_SIDE, np.float32)
    first = np.empty(PATCH_SIDE, np.uint32)
    share = np.empty(PATCH_SIDE, np.float32)
    cell = PATCH_SIDE / _CELLS
    for pixel in range(PATCH_SIDE):
        window[pixel] = np.exp(-0.5 * ((pixel - PATCH_SIDE // 2) / (2.0 * cell)) ** 2)
        position = (pixel + 0.5) / cell + 0.5
        first[pixel] = int(position)
        share[pixel] = position - int(position)
    return window, first, share


@kernel
def _quantise(histogram: NDArray[np.float32], out: NDArray[np.uint8]) -> None:
    squares = 0.0
    for row in range(1, _CELLS + 1):
        for column in range(1, _CELLS + 1):
            for k in range(_DIRECTIONS):
                squares += float(histogram[row, column, k]) ** 2
    clip = _CLIP * np.sqrt(squares)
    total = 0.0
    for row in range(1, _CELLS + 1):
        for column in range(1, _CELLS + 1):
            for k in range(_DIRECTIONS):
                total += min(float(histogram[row, column, k]), clip)
    if total <= 0.0:
        return
    entry = 0
    for row in range(1, _CELLS + 1):
        for column in range(1, _CELLS + 1):
            for k in range(_DIRECTIONS):
                value = _SCALE * np.sqrt(min(float(histogram[row, column, k]), clip) / total)
                out[entry] = min(int(value + 0.5), 255)
                entry += 1
