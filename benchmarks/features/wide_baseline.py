"""Which frames of two photographs of one place agree, where only hand-made points tell the truth.

Around a frame of the first photograph an affine map is fitted to its six nearest points by least
squares, the nearer weighing more. It counts as truth only inside the points' convex hull, and
where points left out of the fit are predicted within 1 % of the second photograph's diagonal
(root mean square, same weights). A frame of the second photograph is right if its centre
lies within 1 % of the diagonal of the predicted place and its radius within a factor of 2 of the
predicted one.

That is as precise as hand-made points allow, and forgiving: the share of frames found again has to
be read beside chance. Chance spreads frames evenly, so it is too high for detectors that crowd
theirs. A right nearest neighbour is hardly ever luck (one in a thousand or so).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, KDTree

from benchmarks.features.pairs import WidePair
from contracts.records import Frames
from retrieval.selection import mean_radius

_NEIGHBOURS = 6
_TOLERANCE = 0.01
_MAX_SCALE_RATIO = 2.0

Points = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Predicted:
    """Where frames of the first photograph lie in the second.

    rows : (n,) intp, the frames for which there is truth. xy (n, 2), radius (n,) : pixels of the
    second photograph. tolerance_px : how far from xy is right.
    """

    rows: NDArray[np.intp]
    xy: Points
    radius: Points
    tolerance_px: float


def predict(pair: WidePair, frames: Frames) -> Predicted:
    """Predict place and size in the second photograph of frames of the first."""
    height, width = pair.second.shape[:2]
    tolerance = _TOLERANCE * float(np.hypot(height, width))
    xy = frames.xy.astype(np.float64)
    rows = np.flatnonzero(Delaunay(pair.first_xy).find_simplex(xy) >= 0)
    distance, near = KDTree(pair.first_xy).query(xy[rows], _NEIGHBOURS)
    weight = np.exp(-0.5 * (distance / distance[:, 2:3]) ** 2)
    maps = fit_affine(pair.first_xy[near], pair.second_xy[near], weight)
    left_out = _left_out_error(pair.first_xy[near], pair.second_xy[near], weight)
    growth = np.abs(np.linalg.det(maps[:, :, :2]))
    sure = (left_out <= tolerance) & (growth > 0)
    rows, maps, growth = rows[sure], maps[sure], growth[sure]
    there = np.einsum("nij,nj->ni", maps[:, :, :2], xy[rows]) + maps[:, :, 2]
    inside = ((there >= 0) & (there <= (width - 1, height - 1))).all(axis=1)
    radius = np.sqrt(growth) * mean_radius(frames.shape)[rows]
    return Predicted(rows[inside], there[inside], radius[inside], tolerance)


def fit_affine(source: Points, target: Points, weight: Points) -> Points:
    """Fit affine maps by weighted least squares.

    Parameters
    ----------
    source, target : (n, k, 2). weight : (n, k).

    Returns
    -------
    (n, 2, 3) : target = map[:, :2] @ source + map[:, 2]; of least norm where k points do not
    determine it.
    """
    centre = source.mean(axis=1, keepdims=True)
    spread = np.maximum(np.abs(source - centre).max(axis=(1, 2), keepdims=True), 1e-9)
    ones = np.ones((*source.shape[:2], 1))
    root = np.sqrt(weight)[:, :, None]
    design = np.concatenate(((source - centre) / spread, ones), axis=2) * root
    solved = (np.linalg.pinv(design) @ (target * root)).transpose(0, 2, 1)
    linear = solved[:, :, :2] / spread
    shift = solved[:, :, 2:] - linear @ centre.transpose(0, 2, 1)
    return np.concatenate((linear, shift), axis=2)


def _left_out_error(source: Points, target: Points, weight: Points) -> Points:
    """Root of the weighted mean square of what each point is missed by when left out; (n,)."""
    squares = np.empty(weight.shape)
    for i in range(_NEIGHBOURS):
        others = [j for j in range(_NEIGHBOURS) if j != i]
        maps = fit_affine(source[:, others], target[:, others], weight[:, others])
        missed = np.einsum("nij,nj->ni", maps[:, :, :2], source[:, i]) + maps[:, :, 2]
        squares[:, i] = ((missed - target[:, i]) ** 2).sum(axis=1)
    return np.asarray(np.sqrt((weight * squares).sum(axis=1) / weight.sum(axis=1)))


def agreeing(predicted: Predicted, second: Frames) -> NDArray[np.bool_]:
    """Tell which frames of the second photograph are right for which predicted one; (n, m)."""
    apart = predicted.xy[:, None] - second.xy[None].astype(np.float64)
    near = (apart**2).sum(axis=2) <= predicted.tolerance_px**2
    ratio = mean_radius(second.shape)[None] / predicted.radius[:, None]
    agree: NDArray[np.bool_] = near & (np.abs(np.log(ratio)) <= np.log(_MAX_SCALE_RATIO))
    return agree


def scattered_within(frames: Frames, predicted: Predicted) -> Frames:
    """Put frames that lie where frames are predicted to random places there; leave the others.

    The region is the convex hull of the predicted places.
    """
    if len(predicted.rows) < _NEIGHBOURS:
        return frames
    hull = Delaunay(predicted.xy)
    rows = np.flatnonzero(hull.find_simplex(frames.xy.astype(np.float64)) >= 0)
    rng = np.random.default_rng(0)
    low, high = predicted.xy.min(axis=0), predicted.xy.max(axis=0)
    places = np.empty((0, 2))
    while len(places) < len(rows):
        drawn = rng.uniform(low, high, (max(len(rows), 100), 2))
        places = np.concatenate((places, drawn[hull.find_simplex(drawn) >= 0]))
    xy = frames.xy.copy()
    xy[rows] = places[: len(rows)]
    return Frames(xy, frames.shape, frames.response)
