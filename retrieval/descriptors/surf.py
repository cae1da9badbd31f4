"""SURF: sums of Haar responses in 4 x 4 cells.

Bay, Tuytelaars & Van Gool, ECCV 2006.
"""

import numpy as np
from numpy.typing import NDArray

from retrieval.kernels import kernel
from retrieval.patches import PATCH_SIDE

_CELLS = 4
_SITES = 5
"""Haar responses per cell and axis."""
_STEP = 2
_REACH = 2
"""Pixels to either side that a Haar response sums; the central row or column counts for neither."""
_DEVIATION = 13.2
"""Of the Gaussian weight, pixels: Bay's 3.3 sampling steps."""
_SCALE = 256.0
_ZERO = 128


@kernel
def describe_surf(patches: NDArray[np.float32]) -> NDArray[np.uint8]:
    """SURF of patches: (sum dx, sum |dx|, sum dy, sum |dy|) a cell, unit norm, times 256, plus 128.

    Cell (row, column) begins at entry (4 row + column) 4. The 20 x 20 Haar responses lie every
    two pixels, are 5 pixels wide, and are weighted by a Gaussian.

    Parameters
    ----------
    patches : (n, 41, 41) float32.

    Returns
    -------
    (n, 64) uint8, 128 stands for 0; all 128 for a flat patch. Beyond +-0.5 values are clipped.
    """
    n = len(patches)
    out = np.full((n, _CELLS * _CELLS * 4), _ZERO, np.uint8)
    window = _window()
    sums = np.zeros((PATCH_SIDE + 3, PATCH_SIDE + 3), np.float64)
    cells = np.empty((_CELLS * _CELLS, 4), np.float64)
    for i in range(n):
        _integrate(patches[i], sums)
        cells[:] = 0.0
        for row in range(_CELLS * _SITES):
            for column in range(_CELLS * _SITES):
                dx, dy = _haar(sums, 1 + _STEP * row, 1 + _STEP * column)
                weight = window[row] * window[column]
                cell = cells[row // _SITES * _CELLS + column // _SITES]
                cell[0] += weight * dx
                cell[1] += weight * abs(dx)
                cell[2] += weight * dy
                cell[3] += weight * abs(dy)
        _quantise(cells, out[i])
    return out


@kernel
def _window() -> NDArray[np.float64]:
    sites = _CELLS * _SITES
    offset = _STEP * (np.arange(sites) - (sites - 1) / 2)
    weight: NDArray[np.float64] = np.exp(-0.5 * (offset / _DEVIATION) ** 2)
    return weight


@kernel
def _integrate(patch: NDArray[np.float32], sums: NDArray[np.float64]) -> None:
    """Integral image of the patch less its first pixel's value, one border pixel repeated."""
    base = patch[0, 0]
    for row in range(PATCH_SIDE + 2):
        line = 0.0
        from_row = min(max(row - 1, 0), PATCH_SIDE - 1)
        for column in range(PATCH_SIDE + 2):
            line += patch[from_row, min(max(column - 1, 0), PATCH_SIDE - 1)] - base
            sums[row + 1, column + 1] = sums[row, column + 1] + line


@kernel
def _haar(sums: NDArray[np.float64], row: int, column: int) -> tuple[float, float]:
    """Right minus left and lower minus upper box around a pixel of the patch."""
    top, left = row + 1 - _REACH, column + 1 - _REACH
    bottom, right = row + 2 + _REACH, column + 2 + _REACH
    dx = _box(sums, top, right - _REACH, bottom, right)
    dx -= _box(sums, top, left, bottom, left + _REACH)
    dy = _box(sums, bottom - _REACH, left, bottom, right)
    dy -= _box(sums, top, left, top + _REACH, right)
    return dx, dy


@kernel
def _box(sums: NDArray[np.float64], top: int, left: int, bottom: int, right: int) -> float:
    return float(sums[bottom, right] - sums[top, right] - sums[bottom, left] + sums[top, left])


@kernel
def _quantise(cells: NDArray[np.float64], out: NDArray[np.uint8]) -> None:
    norm = 0.0
    for cell in range(len(cells)):
        for k in range(4):
            norm += cells[cell, k] ** 2
    norm = np.sqrt(norm)
    # Rounding in a flat patch's sums must not be blown up to a descriptor.
    if norm <= 1e-6:
        return
    for cell in range(len(cells)):
        for k in range(4):
            value = np.floor(_SCALE * cells[cell, k] / norm + 0.5) + _ZERO
            out[4 * cell + k] = int(min(max(value, 0.0), 255.0))
