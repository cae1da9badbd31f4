"""How much two detectors add to each other on one photo: METHOD section 4.

The scores are those of the complementary-detector literature that Eq. 1 regresses on: number of
keypoints, spatial distribution (Ehsan et al. 2011, 2013), contribution (Gales et al. 2010) and
spatial clusters; the last two are reconstructions.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from contracts.config import Detector
from contracts.records import Frames
from retrieval.kernels import kernel

_MAX_SPREAD_POINTS = 2_000
_SAME_POINT_PX = 1.0
_NEAR_PX_AT_1024 = 3.0
_CLUSTER_RADIUS = 0.03
"""Of the image diagonal."""

_Points = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Complementarity:
    """The four features of Eq. 1 of a pair of detectors on one photo.

    kp_thousands : keypoints of both together, in thousands.
    csdi : how widely the union is spread; in image diagonals, a harmonic mean distance.
    csco : share of keypoints with none of the other detector near; 0 to 1.
    cscl : how far spatial clusters belong to one detector only; 0 to 1.
    """

    kp_thousands: float
    csdi: float
    csco: float
    cscl: float

    def as_tuple(self) -> tuple[float, float, float, float]:
        """Give the features in the order of the coefficients of Eq. 1."""
        return self.kp_thousands, self.csdi, self.csco, self.cscl


def complementarity(a: Frames, b: Frames, width_px: int, height_px: int) -> Complementarity:
    """Score a pair of frame sets; the order of the two does not matter.

    CSCo and CSCl are 0 if either set is empty, CSDi if fewer than two points are left.

    Parameters
    ----------
    a, b : frames of two detectors, best response first.
    width_px, height_px : of the image they were detected in.
    """
    first, second = a.xy.astype(np.float64), b.xy.astype(np.float64)
    both_found = len(first) > 0 and len(second) > 0
    diagonal = float(np.hypot(width_px, height_px))
    near = _NEAR_PX_AT_1024 * max(width_px, height_px) / 1024
    return Complementarity(
        kp_thousands=(len(first) + len(second)) / 1000,
        csdi=spread(np.concatenate([first, second]), diagonal),
        csco=contribution(first, second, near) if both_found else 0.0,
        cscl=cluster_purity(first, second, _CLUSTER_RADIUS * diagonal) if both_found else 0.0,
    )


def all_pairs(
    frames: Mapping[Detector, Frames], width_px: int, height_px: int
) -> dict[tuple[Detector, Detector], Complementarity]:
    """Score every pair of detectors, named in the order of `frames`."""
    return {
        (a, b): complementarity(frames[a], frames[b], width_px, height_px)
        for a, b in combinations(frames, 2)
    }


def spread(xy: _Points, diagonal_px: float) -> float:
    """CSDi: N (N - 1) over the sum of inverse distances, in diagonals.

    The harmonic mean over points of the harmonic mean distance to the others. Points closer
    than a pixel count once; of more than 2,000 every so-many-th in raster order is taken.

    Parameters
    ----------
    xy : (n, 2) float64, pixels.
    """
    points = _thinned(_in_raster_order(xy), _SAME_POINT_PX)
    if len(points) > _MAX_SPREAD_POINTS:
        points = points[np.arange(_MAX_SPREAD_POINTS) * len(points) // _MAX_SPREAD_POINTS]
    n = len(points)
    if n < 2:
        return 0.0
    columns = np.ascontiguousarray(points.T / diagonal_px, dtype=np.float32)
    return n * (n - 1) / (2 * _inverse_distances(columns[0], columns[1]))


def contribution(a: _Points, b: _Points, near_px: float) -> float:
    """CSCo: the share of the points of two sets without a point of the other within `near_px`.

    a, b : (n, 2) and (m, 2) float64, pixels, neither empty.
    """
    a, b = _in_raster_order(a), _in_raster_order(b)
    alone = _count_alone(a, b, near_px) + _count_alone(b, a, near_px)
    return alone / (len(a) + len(b))


def cluster_purity(a: _Points, b: _Points, radius_px: float) -> float:
    """CSCl: 1 - mean normalised entropy of membership per leader cluster, weighted by size.

    Responses of two detectors have no common scale: points lead by their rank within their own
    detector, the two best first; equal ranks by position.

    Parameters
    ----------
    a, b : (n, 2) and (m, 2) float64, pixels, best response first, neither empty.
    """
    points = np.concatenate([a, b])
    ranks = np.concatenate([np.arange(len(a)), np.arange(len(b))])
    order = np.lexsort((points[:, 0], points[:, 1], ranks))
    cluster = _leader_clusters(points[order], radius_px)
    size = np.bincount(cluster)
    of_a = np.bincount(cluster[order < len(a)], minlength=len(size)) / size
    share = np.stack([of_a, 1 - of_a])
    entropy = -(share * np.log2(np.where(share > 0, share, 1.0))).sum(axis=0)
    return float(1 - (entropy * size).sum() / size.sum())


def _in_raster_order(xy: _Points) -> _Points:
    return xy[np.lexsort((xy[:, 0], xy[:, 1]))]


@kernel
def _thinned(xy: _Points, apart_px: float) -> _Points:
    """Drop points closer than `apart_px` to a kept one before; xy in raster order."""
    kept = np.empty_like(xy)
    n_kept = oldest = 0
    for i in range(len(xy)):
        while oldest < n_kept and xy[i, 1] - kept[oldest, 1] >= apart_px:
            oldest += 1
        fresh = True
        for j in range(oldest, n_kept):
            dx, dy = xy[i, 0] - kept[j, 0], xy[i, 1] - kept[j, 1]
            if dx * dx + dy * dy < apart_px * apart_px:
                fresh = False
                break
        if fresh:
            kept[n_kept] = xy[i]
            n_kept += 1
    return kept[:n_kept]


@kernel
def _inverse_distances(x: NDArray[np.float32], y: NDArray[np.float32]) -> float:
    """Sum 1 / distance over unordered pairs; none may coincide."""
    sums = np.zeros(len(x), dtype=np.float64)
    for i in range(1, len(x)):
        for j in range(i):  # one sum per j, so that the loop runs on vectors
            dx, dy = x[i] - x[j], y[i] - y[j]
            sums[j] += np.float32(1.0) / np.sqrt(dx * dx + dy * dy)
    return float(sums.sum())


@kernel
def _count_alone(points: _Points, others: _Points, near_px: float) -> int:
    """Count points without any of `others` within `near_px`; both in raster order."""
    alone = first = 0
    for i in range(len(points)):
        while first < len(others) and others[first, 1] < points[i, 1] - near_px:
            first += 1
        found = False
        for j in range(first, len(others)):
            dx, dy = others[j, 0] - points[i, 0], others[j, 1] - points[i, 1]
            if dy > near_px:
                break
            if dx * dx + dy * dy <= near_px * near_px:
                found = True
                break
        if not found:
            alone += 1
    return alone


@kernel
def _leader_clusters(xy: _Points, radius_px: float) -> NDArray[np.int64]:
    """Join the nearest leader within the radius, the earlier if equal, or become one."""
    cluster = np.empty(len(xy), dtype=np.int64)
    leaders = np.empty_like(xy)
    n_leaders = 0
    for i in range(len(xy)):
        best, nearest = -1, radius_px * radius_px
        for j in range(n_leaders):
            dx, dy = xy[i, 0] - leaders[j, 0], xy[i, 1] - leaders[j, 1]
            squared = dx * dx + dy * dy
            if squared < nearest or (squared == nearest and best < 0):
                best, nearest = j, squared
        if best < 0:
            best = n_leaders
            leaders[n_leaders] = xy[i]
            n_leaders += 1
        cluster[i] = best
    return cluster
