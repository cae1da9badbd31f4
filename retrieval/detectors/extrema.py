"""Extrema of a response over position and scale, and their refinement."""

import numpy as np
from numpy.typing import NDArray

from retrieval.kernels import kernel

_MAX_EDGE_RATIO = 10.0
_EDGE_SCORE = (_MAX_EDGE_RATIO + 1.0) ** 2 / _MAX_EDGE_RATIO
_MAX_FITS = 5


@kernel
def find_extrema(
    below: NDArray[np.float32],
    level: NDArray[np.float32],
    above: NDArray[np.float32],
    floor: float,
) -> NDArray[np.float32]:
    """Find positive maxima and negative minima over 3 x 3 x 3 neighbours, refined (Lowe 2004).

    Parameters
    ----------
    below, level, above : (h, w) float32, responses at three neighbouring scales.
    floor : weaker extrema are noise.

    Returns
    -------
    (n, 4) float32 : x, y in pixels of the level, offset in levels, absolute response.
    """
    height, width = level.shape
    # One maximum and one minimum fit into every 2 x 2 block.
    found = np.empty((2 * (height // 2 + 1) * (width // 2 + 1), 4), np.float32)
    n_found = 0
    for row in range(2, height - 2):
        for column in range(2, width - 2):
            value = level[row, column]
            if abs(value) <= floor or not _tops_its_row(level, row, column):
                continue
            if not _is_extremum(below, level, above, row, column):
                continue
            if _refine(below, level, above, row, column, found[n_found]):
                n_found += 1
    return found[:n_found].copy()


@kernel
def _tops_its_row(level: NDArray[np.float32], row: int, column: int) -> bool:
    """Turn most pixels down before all 26 neighbours are looked at."""
    value, left, right = level[row, column], level[row, column - 1], level[row, column + 1]
    if value > 0:
        return bool(value > left and value >= right)
    return bool(value < left and value <= right)


@kernel
def _is_extremum(
    below: NDArray[np.float32],
    level: NDArray[np.float32],
    above: NDArray[np.float32],
    row: int,
    column: int,
) -> bool:
    """Plateaus yield one extremum at most: earlier neighbours must be strictly weaker."""
    sign = 1.0 if level[row, column] > 0 else -1.0
    value = sign * level[row, column]
    for down in range(-1, 2):
        for right in range(-1, 2):
            here = sign * level[row + down, column + right]
            earlier = down < 0 or (down == 0 and right < 0)
            if here > value or (earlier and here == value):
                return False
            if sign * below[row + down, column + right] >= value:
                return False
            if sign * above[row + down, column + right] > value:
                return False
    return True


@kernel
def _refine(
    below: NDArray[np.float32],
    level: NDArray[np.float32],
    above: NDArray[np.float32],
    row: int,
    column: int,
    out: NDArray[np.float32],
) -> bool:
    """Fit a quadratic; False if it runs away or the extremum is drawn out along an edge."""
    height, width = level.shape
    for _ in range(_MAX_FITS):
        dx = 0.5 * (level[row, column + 1] - level[row, column - 1])
        dy = 0.5 * (level[row + 1, column] - level[row - 1, column])
        ds = 0.5 * (above[row, column] - below[row, column])
        centre = 2.0 * level[row, column]
        dxx = level[row, column + 1] + level[row, column - 1] - centre
        dyy = level[row + 1, column] + level[row - 1, column] - centre
        dss = above[row, column] + below[row, column] - centre
        dxy = 0.25 * (
            level[row + 1, column + 1]
            - level[row + 1, column - 1]
            - level[row - 1, column + 1]
            + level[row - 1, column - 1]
        )
        dxs = 0.25 * (
            above[row, column + 1]
            - above[row, column - 1]
            - below[row, column + 1]
            + below[row, column - 1]
        )
        dys = 0.25 * (
            above[row + 1, column]
            - above[row - 1, column]
            - below[row + 1, column]
            + below[row - 1, column]
        )
        flat = dxx * dyy - dxy * dxy
        if flat <= 0.0 or (dxx + dyy) ** 2 / flat > _EDGE_SCORE:
            return False
        across_x = dxy * dys - dyy * dxs
        across_y = dxy * dxs - dxx * dys
        determinant = dss * flat + dxs * across_x + dys * across_y
        if determinant == 0.0:
            return False
        x = -(dx * (dyy * dss - dys * dys) + dy * (dxs * dys - dxy * dss) + ds * across_x)
        y = -(dx * (dxs * dys - dxy * dss) + dy * (dxx * dss - dxs * dxs) + ds * across_y)
        s = -(dx * across_x + dy * across_y + ds * flat)
        x, y, s = x / determinant, y / determinant, s / determinant
        right = 1 if x > 0.6 else (-1 if x < -0.6 else 0)
        down = 1 if y > 0.6 else (-1 if y < -0.6 else 0)
        if right == 0 and down == 0:
            if abs(s) > 1.0:
                return False
            out[0], out[1], out[2] = column + x, row + y, s
            out[3] = abs(level[row, column] + 0.5 * (dx * x + dy * y + ds * s))
            return True
        row, column = row + down, column + right
        if row < 1 or row >= height - 1 or column < 1 or column >= width - 1:
            return False
    return False
