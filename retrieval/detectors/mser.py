"""Maximally stable extremal regions, dark and bright, as ellipses of their moments.

Matas, Chum, Urban & Pajdla, BMVC 2002. A region's variation tells by how much of its area it
changes when the threshold moves: (A(t + delta) - A(t - delta)) / A(t).
"""

import numpy as np
from numpy.typing import NDArray

from contracts.records import Frames
from retrieval.detectors.component_tree import TOP_LEVEL, build_tree, region_moments
from retrieval.kernels import kernel
from retrieval.pyramid import Pyramid
from retrieval.selection import inside, no_frames, spread, take

_LEVEL = 2
"""Of the pyramid's fine levels: unblurred, what compression and grain leave stable is noise."""
_DELTA = 4
_MIN_AREA = 30
_MAX_AREA_SHARE = 0.05
_MAX_VARIATION = 1.2
"""Generous, for faded photos; where there are many regions the response weeds."""
_ALIKE = 1.4
"""Of nested regions whose areas differ by less than this factor the most stable is kept."""
_STEADY = 0.1
"""Below about this variation regions hardly differ in how well they repeat."""
_MAX_STRETCH = 10.0
_MIN_SIDE = 16


def detect_mser(
    pyramid: Pyramid, max_frames: int, usable: NDArray[np.bool_] | None = None
) -> Frames:
    """Find MSER frames of both polarities; shapes are lower triangular (upright). See `detect`.

    The response falls with the variation and grows with the size: of equally stable regions the
    larger repeat better.
    """
    shape = (pyramid.grey8.shape[0], pyramid.grey8.shape[1])
    if min(shape) < _MIN_SIDE:
        return no_frames()
    grey = np.clip(np.rint(pyramid.fine[_LEVEL].pixels), 0, TOP_LEVEL).astype(np.uint8)
    dark, bright = _find_dark(grey), _find_dark(TOP_LEVEL - grey)
    found = Frames(
        np.concatenate((dark.xy, bright.xy)),
        np.concatenate((dark.shape, bright.shape)),
        np.concatenate((dark.response, bright.response)),
    )
    return spread(take(found, inside(found, shape, usable)), shape, max_frames)


def _find_dark(grey: NDArray[np.uint8]) -> Frames:
    tree = build_tree(grey, _MIN_AREA)
    area = tree.area
    variation = area_variation(tree.level, area, tree.parent, _DELTA)
    fit = (variation <= _MAX_VARIATION) & (area <= _MAX_AREA_SHARE * grey.size)
    rows = np.flatnonzero(fit)
    # A stable sort: of equally stable nested regions the smaller, which lies before, is better.
    best_first = rows[np.argsort(variation[rows], kind="stable")]
    rows = best_first[distinct_regions(best_first, area, tree.parent)]
    moments = region_moments(tree, rows)
    shape = moment_ellipses(moments[:, 2], moments[:, 3], moments[:, 4])
    response = np.sqrt(area[rows]) / (variation[rows] + _STEADY)
    frames = Frames(moments[:, :2].astype(np.float32), shape, response.astype(np.float32))
    return take(frames, shape[:, 0, 0] > 0)


@kernel
def area_variation(
    level: NDArray[np.uint8], area: NDArray[np.int32], parent: NDArray[np.int32], delta: int
) -> NDArray[np.float32]:
    """Relative growth of each region from `delta` levels below its own to `delta` above.

    Parameters
    ----------
    level, area, parent : (n,), of a `ComponentTree`.

    Returns
    -------
    (n,) float32 : the area of the region around it at level + delta, less that of the largest
    region of the tree inside it at level - delta (0 if there is none), over its own.
    """
    around = area.copy()
    within = np.zeros(len(area), np.int32)
    for i in range(len(area)):
        # Region i lasts to just below its parent's level: so long it is what others have within.
        own, next_up = np.int64(level[i]), parent[i]
        if next_up < 0:
            continue
        last = np.int64(level[next_up]) - 1
        while next_up >= 0 and level[next_up] <= last + delta:
            if level[next_up] <= own + delta:
                around[i] = area[next_up]
            if level[next_up] >= own + delta:
                within[next_up] = max(within[next_up], area[i])
            next_up = parent[next_up]
    return ((around - within) / area).astype(np.float32)


@kernel
def distinct_regions(
    rows: NDArray[np.intp], area: NDArray[np.int32], parent: NDArray[np.int32]
) -> NDArray[np.bool_]:
    """Tell which regions are not near copies of one before them that is kept.

    Parameters
    ----------
    rows : (m,) intp, regions of the tree, best first. area, parent : (n,), of the tree.

    Returns
    -------
    (m,) bool : False where a kept region contains it, or lies in it, and their areas differ by
    less than a factor of 1.4.
    """
    kept = np.zeros(len(area), np.bool_)
    holds_copy = np.zeros(len(area), np.bool_)
    distinct = np.zeros(len(rows), np.bool_)
    for i in range(len(rows)):
        row = rows[i]
        distinct[i] = not holds_copy[row]
        up = parent[row]
        while distinct[i] and up >= 0 and area[up] < _ALIKE * area[row]:
            distinct[i] = not kept[up]
            up = parent[up]
        if not distinct[i]:
            continue
        kept[row] = True
        up = parent[row]
        while up >= 0 and area[up] < _ALIKE * area[row]:
            holds_copy[up] = True
            up = parent[up]
    return distinct


def moment_ellipses(
    xx: NDArray[np.float64], xy: NDArray[np.float64], yy: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Shapes of the ellipses that have the given second moments.

    Parameters
    ----------
    xx, xy, yy : (n,) float64, variances and covariance, squared pixels.

    Returns
    -------
    (n, 2, 2) float32, lower triangular; zero where a region is a line or stretched more than 10
    times.
    """
    shape = np.zeros((len(xx), 2, 2), np.float32)
    spread_ = np.sqrt((xx - yy) ** 2 + 4.0 * xy * xy)
    short, long = xx + yy - spread_, xx + yy + spread_
    rows = (short * _MAX_STRETCH**2 >= long) & (short > 0.0)
    xx, xy, yy = xx[rows], xy[rows], yy[rows]
    # A full ellipse's semi-axis is twice its standard deviation.
    first = np.sqrt(xx)
    shape[rows, 0, 0] = 2.0 * first
    shape[rows, 1, 0] = 2.0 * xy / first
    shape[rows, 1, 1] = 2.0 * np.sqrt(yy - xy * xy / xx)
    return shape
