"""Maximally stable extremal regions, dark and bright, as ellipses of their moments.

Matas, Chum, Urban & Pajdla, BMVC 2002; the regions are OpenCV's.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.records import Frames
from retrieval.kernels import kernel
from retrieval.pyramid import Pyramid
from retrieval.selection import inside, mean_radius, no_frames, sort_frames, spread, take

_DELTAS = (5, 2)
_ENOUGH = 0.5
_MIN_AREA = 30
_MAX_AREA_SHARE = 0.05
_MAX_VARIATION = 0.5
_MIN_DIVERSITY = 0.0
"""OpenCV's own pruning throws whole chains of nested regions away; `distinct_regions` does not."""
_NEAR = 0.25
"""Two regions whose centres are closer than this share of the radius..."""
_ALIKE = 1.4
"""... and whose areas differ by less than this factor are one."""
_MAX_STRETCH = 10.0
_MIN_SIDE = 16
_RING = 1.5
"""The surroundings are looked at on the region's ellipse times this."""
_RING_POINTS = 32


def detect_mser(
    pyramid: Pyramid, max_frames: int, usable: NDArray[np.bool_] | None = None
) -> Frames:
    """Find MSER frames of both polarities; shapes are lower triangular (upright). See `detect`.

    OpenCV does not tell a region's stability, so the response is the contrast between a region
    and its surroundings: regions that stand out stay stable over more thresholds.
    """
    shape = (pyramid.grey8.shape[0], pyramid.grey8.shape[1])
    frames = no_frames()
    if min(shape) < _MIN_SIDE:
        return frames
    # Slightly blurred: a stretched photo's missing grey levels would leave OpenCV nothing stable.
    grey = np.clip(np.rint(pyramid.fine[1].pixels), 0, 255).astype(np.uint8)
    for delta in _DELTAS:
        found = _find_regions(grey, delta)
        found = take(found, inside(found, shape, usable))
        frames = max(frames, found, key=len)
        if len(frames) >= _ENOUGH * max_frames:
            break
    return spread(frames, shape, max_frames)


def _find_regions(grey: NDArray[np.uint8], delta: int) -> Frames:
    detector = cv2.MSER.create(
        delta, _MIN_AREA, int(_MAX_AREA_SHARE * grey.size), _MAX_VARIATION, _MIN_DIVERSITY
    )
    regions, _ = detector.detectRegions(grey)
    if len(regions) == 0:
        return no_frames()
    starts = np.zeros(len(regions) + 1, np.int64)
    starts[1:] = np.cumsum([len(region) for region in regions])
    points = np.ascontiguousarray(np.concatenate(regions).reshape(-1, 2), np.int32)
    xy, ellipse, level = region_moments(points, starts, grey)
    kept = ellipse[:, 0, 0] > 0
    xy, ellipse, level = xy[kept], ellipse[kept], level[kept]
    frames = sort_frames(Frames(xy, ellipse, _contrast(grey, xy, ellipse, level)))
    return take(frames, distinct_regions(frames.xy, mean_radius(frames.shape)))


def _contrast(
    grey: NDArray[np.uint8],
    xy: NDArray[np.float32],
    ellipse: NDArray[np.float32],
    level: NDArray[np.float32],
) -> NDArray[np.float32]:
    """Absolute difference of each region's mean grey value and that of a ring around it."""
    turn = 2 * np.pi * np.arange(_RING_POINTS) / _RING_POINTS
    circle = _RING * np.stack((np.cos(turn), np.sin(turn))).astype(np.float32)
    ring = np.rint(xy[:, :, None] + ellipse @ circle).astype(np.int64)
    height, width = grey.shape
    around = grey[np.clip(ring[:, 1], 0, height - 1), np.clip(ring[:, 0], 0, width - 1)]
    contrast: NDArray[np.float32] = np.abs(around.mean(axis=1) - level).astype(np.float32)
    return contrast


@kernel
def distinct_regions(xy: NDArray[np.float32], radius: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Tell which regions are not near copies of one before them that is kept.

    Parameters
    ----------
    xy (n, 2), radius (n,) : float32, best first.

    Returns
    -------
    (n,) bool.
    """
    kept = np.ones(len(xy), np.bool_)
    ratio = np.float32(_ALIKE**0.5)
    for i in range(len(xy)):
        for j in range(i):
            if not kept[j]:
                continue
            small, large = min(radius[i], radius[j]), max(radius[i], radius[j])
            dx, dy = xy[i, 0] - xy[j, 0], xy[i, 1] - xy[j, 1]
            near = np.float32(_NEAR) * large
            if dx * dx + dy * dy < near * near and large < ratio * small:
                kept[i] = False
                break
    return kept


@kernel
def region_moments(
    points: NDArray[np.int32], starts: NDArray[np.int64], grey: NDArray[np.uint8]
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Fit an ellipse to each region: that of the same first and second moments.

    Parameters
    ----------
    points : (p, 2) int32, x and y of all regions' pixels, region after region.
    starts : (n + 1,) int64, where each region begins. grey : (h, w) uint8.

    Returns
    -------
    xy (n, 2) float32; shape (n, 2, 2) float32, lower triangular, zero where a region is a line or
    stretched more than 10 times; mean grey value (n,) float32.
    """
    n = len(starts) - 1
    centre = np.empty((n, 2), np.float32)
    shape = np.zeros((n, 2, 2), np.float32)
    level = np.empty(n, np.float32)
    for i in range(n):
        area = float(starts[i + 1] - starts[i])
        sum_x, sum_y, sum_grey = 0.0, 0.0, 0.0
        for j in range(starts[i], starts[i + 1]):
            sum_x += points[j, 0]
            sum_y += points[j, 1]
            sum_grey += grey[points[j, 1], points[j, 0]]
        mean_x, mean_y = sum_x / area, sum_y / area
        xx, xy, yy = 0.0, 0.0, 0.0
        for j in range(starts[i], starts[i + 1]):
            dx, dy = points[j, 0] - mean_x, points[j, 1] - mean_y
            xx += dx * dx
            xy += dx * dy
            yy += dy * dy
        xx, xy, yy = xx / area, xy / area, yy / area
        centre[i, 0], centre[i, 1], level[i] = mean_x, mean_y, sum_grey / area
        spread = np.sqrt((xx - yy) ** 2 + 4.0 * xy * xy)
        short, long = 0.5 * (xx + yy - spread), 0.5 * (xx + yy + spread)
        if short * _MAX_STRETCH**2 >= long and short > 0.0:
            # A full ellipse's semi-axis is twice its standard deviation.
            first = np.sqrt(xx)
            shape[i, 0, 0] = 2.0 * first
            shape[i, 1, 0] = 2.0 * xy / first
            shape[i, 1, 1] = 2.0 * np.sqrt(yy - xy * xy / xx)
    return centre, shape, level
