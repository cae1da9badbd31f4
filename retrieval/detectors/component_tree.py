"""Component tree: every connected region that any threshold cuts out of a picture.

Built by the flood of Nistér & Stewénius, ECCV 2008. Water that spreads over the picture, always
on at the lowest level it has reached, wets the pixels of each region one after the other; so a
region is a run of the order in which pixels get wet, and no list of its pixels is ever made.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from retrieval.kernels import kernel

TOP_LEVEL = 254
"""Highest grey level of a picture; one byte's last value marks wet pixels and the border."""
_WET = TOP_LEVEL + 1
_SEEN_BEFORE = 1 << 31


@dataclass(frozen=True, slots=True)
class ComponentTree:
    """Regions of pixels (4-connected) not above a level, each once, at the lowest such level.

    level : (n,) uint8, the lowest. begin, end : (n,) int32, the region's run of `order`.
    parent : (n,) int32, the next larger region, always further on; -1 for the largest.
    order : (h * w,) uint32, each pixel as row * width + column of the picture with a border of one
    pixel. width : int, of that.
    """

    level: NDArray[np.uint8]
    begin: NDArray[np.int32]
    end: NDArray[np.int32]
    parent: NDArray[np.int32]
    order: NDArray[np.uint32]
    width: int

    @property
    def area(self) -> NDArray[np.int32]:
        """Pixels of each region; (n,) int32."""
        return self.end - self.begin


def build_tree(grey: NDArray[np.uint8], min_area: int) -> ComponentTree:
    """Build the tree of the dark regions of a picture; of an inverted picture, the bright ones.

    Parameters
    ----------
    grey : (h, w) uint8, none above TOP_LEVEL, at least one pixel and less than 2**31.
    min_area : regions of fewer pixels are left out.

    Raises
    ------
    ValueError : a grey level above TOP_LEVEL, or no pixels.
    """
    if grey.size == 0 or grey.max() > TOP_LEVEL:
        found = f"up to {grey.max()}" if grey.size else "no pixels"
        raise ValueError(
            f"grey levels: found {found}, expected at least one pixel and none above {TOP_LEVEL}; "
            "clip the picture first"
        )
    regions, order = flood(np.ascontiguousarray(grey), min_area)
    level, begin, end = np.ascontiguousarray(regions.T)
    parent = find_parents(begin)
    return ComponentTree(level.astype(np.uint8), begin, end, parent, order, grey.shape[1] + 2)


@kernel
def flood(grey: NDArray[np.uint8], min_area: int) -> tuple[NDArray[np.int32], NDArray[np.uint32]]:
    """Wet a picture from below; arguments as of `build_tree`.

    Returns
    -------
    regions (n, 3) int32 : level, begin and end of each, inner ones first. order, as of
    `ComponentTree`.
    """
    # Unsigned indices spare the compiled loop its test for negative ones.
    one, wide, seen_before = np.uint32(1), np.uint32(grey.shape[1] + 2), np.uint32(_SEEN_BEFORE)
    dry, bottom = _fill(grey)
    # Wetted pixels not yet looked at, a stack a level; none outgrows its level's pixels.
    waiting = np.empty(grey.size, np.uint32)
    top = bottom.copy()
    order = np.empty(grey.size, np.uint32)
    regions = np.empty((4096, 3), np.int32)
    n_regions = 0
    # Regions being filled, each inside the one before; below them lies one that is never left.
    open_level = np.full(TOP_LEVEL + 3, 2 * _WET, np.uint32)
    open_begin = np.zeros(TOP_LEVEL + 3, np.uint32)
    pixel = wide + one
    level = np.uint32(dry[pixel])
    dry[pixel] = _WET
    depth = one
    open_level[depth] = level
    order[0] = pixel
    n_wet = one
    while True:
        lower, n_lower = _wet_neighbours(pixel, level, wide, dry, waiting, top)
        if n_lower > 0:
            if n_lower > 1:
                # Only one at a time: the others may be apart from it below this level.
                waiting[top[level]] = pixel | seen_before
                top[level] += one
            pixel, level = lower, np.uint32(dry[lower])
            dry[pixel] = _WET
            depth += one
            open_level[depth], open_begin[depth] = level, n_wet
            order[n_wet] = pixel
            n_wet += one
            continue
        rise = level
        while rise < _WET and top[rise] == bottom[rise]:
            rise += one
        while level < rise:
            if n_wet - open_begin[depth] >= min_area:
                if n_regions == len(regions):
                    regions = _doubled(regions)
                regions[n_regions, 0] = level
                regions[n_regions, 1] = open_begin[depth]
                regions[n_regions, 2] = n_wet
                n_regions += 1
            if open_level[depth - one] > rise:
                open_level[depth] = rise
            else:
                depth -= one
            level = open_level[depth]
        if level == _WET:
            break
        top[level] -= one
        pixel = waiting[top[level]]
        if pixel & seen_before:
            pixel ^= seen_before
        else:
            order[n_wet] = pixel
            n_wet += one
    return regions[:n_regions], order


@kernel
def _fill(grey: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], NDArray[np.uint32]]:
    """Surround the picture by wet pixels, flattened; and count pixels below each level."""
    height, width = grey.shape
    dry = np.full((height + 2) * (width + 2), _WET, np.uint8)
    below = np.zeros(_WET + 1, np.uint32)
    for row in range(height):
        start = (row + 1) * (width + 2) + 1
        for column in range(width):
            dry[start + column] = grey[row, column]
            below[grey[row, column] + 1] += np.uint32(1)
    for level in range(_WET):
        below[level + 1] += below[level]
    return dry, below


@kernel
def _wet_neighbours(
    pixel: np.uint32,
    level: np.uint32,
    wide: np.uint32,
    dry: NDArray[np.uint8],
    waiting: NDArray[np.uint32],
    top: NDArray[np.uint32],
) -> tuple[np.uint32, int]:
    """Put neighbours that are not lower on their stacks; return a lower one and how many are."""
    one = np.uint32(1)
    lower, n_lower = pixel, 0
    for near in (pixel + one, pixel - one, pixel + wide, pixel - wide):
        other = np.uint32(dry[near])
        if other < level:
            lower = near
            n_lower += 1
        elif other != _WET:
            waiting[top[other]] = near
            top[other] += one
            dry[near] = _WET
    return lower, n_lower


@kernel
def _doubled(table: NDArray[np.int32]) -> NDArray[np.int32]:
    larger = np.empty((2 * table.shape[0], table.shape[1]), table.dtype)
    # In numba, assigning an array to a slice takes seconds more to compile.
    for row in range(table.shape[0]):
        for column in range(table.shape[1]):
            larger[row, column] = table[row, column]
    return larger


@kernel
def find_parents(begin: NDArray[np.int32]) -> NDArray[np.int32]:
    """Find the smallest region around each; runs that begin (n,), inner ones first."""
    parent = np.full(len(begin), -1, np.int32)
    around = np.empty(TOP_LEVEL + 1, np.int32)
    depth = 0
    for back in range(len(begin)):
        i = len(begin) - 1 - back
        while depth > 0 and begin[around[depth - 1]] > begin[i]:
            depth -= 1
        if depth > 0:
            parent[i] = around[depth - 1]
        around[depth] = i
        depth += 1
    return parent


def region_moments(tree: ComponentTree, rows: NDArray[np.intp]) -> NDArray[np.float64]:
    """Measure regions of a tree; all their sums come from one walk along the order.

    Parameters
    ----------
    rows : (m,) intp, which regions.

    Returns
    -------
    (m, 5) float64 : mean x and y in pixels of the picture, variance of x, covariance, variance
    of y.
    """
    area = tree.area[rows, None].astype(np.float64)
    stops = np.concatenate((tree.begin[rows], tree.end[rows]))
    sums = sums_at(tree.order, tree.width, stops, np.argsort(stops))
    moments: NDArray[np.float64] = (sums[len(rows) :] - sums[: len(rows)]) / area
    x, y = moments[:, 0], moments[:, 1]
    moments[:, 2:] -= np.stack((x * x, x * y, y * y), axis=1)
    return moments


@kernel
def sums_at(
    order: NDArray[np.uint32], width: int, stops: NDArray[np.int32], ascending: NDArray[np.intp]
) -> NDArray[np.int64]:
    """Sum x, y, x x, x y and y y over the regions' pixels that come before each stop.

    Parameters
    ----------
    order, width : of a `ComponentTree`. stops : (2 m,) int32, where m regions begin, then where
    they end. ascending : (2 m,) intp, sorts the stops.

    Returns
    -------
    (2 m, 5) int64.
    """
    sums = np.zeros((len(stops), 5), np.int64)
    wide = np.uint32(width)
    sum_x, sum_y, sum_xx, sum_xy, sum_yy = 0, 0, 0, 0, 0
    at, n_open = 0, 0
    for i in ascending:
        if n_open > 0:
            for j in range(at, stops[i]):
                row = order[j] // wide
                x, y = int(order[j] - row * wide) - 1, int(row) - 1
                sum_x += x
                sum_y += y
                sum_xx += x * x
                sum_xy += x * y
                sum_yy += y * y
        at = stops[i]
        n_open += 1 if i < len(stops) // 2 else -1
        sums[i, 0], sums[i, 1] = sum_x, sum_y
        sums[i, 2], sums[i, 3], sums[i, 4] = sum_xx, sum_xy, sum_yy
    return sums
