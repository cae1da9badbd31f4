"""The place where the photographer probably stood: the consensus of a ranking's positions.

RECONSTRUCTION: the paper ends at the ranking. Its precision falls quickly after the first place,
and wrong matches are scattered while right ones stand together, so

1. a match weighs (score / best score) / rank, so that a lone best match yields only to several
   agreeing ones further down;
2. the seed is the match with most weight around it, under the kernel (1 - (d / reach)^2)^2;
3. the support is every match within `REACH_M` of the seed;
4. the place is the support's weighted geometric median, which a minority of weight cannot drag
   (Weiszfeld's iteration as mended by Vardi & Zhang, PNAS 97(4), 2000).

How far from it the photographer may have stood, and whether they were there at all, is in
`geo.confidence`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geo.frames import LocalMetres

MOST_RANKS = 50
"""Matches ranked below this are not asked."""
REACH_M = 25.0
"""Two matches farther apart than this do not support each other."""
_MAX_STEPS = 200
_STEP_TOLERANCE_M = 1e-5


@dataclass(frozen=True, slots=True)
class Consensus:
    """Where most weight of a ranking stands together, in metres of the frame of its positions.

    support : matches that agree, of which several may share one position. share : their part of
    the weight of all placed matches, in (0, 1].
    """

    easting: float
    northing: float
    support: int
    share: float


@dataclass(frozen=True, slots=True)
class LonLatConsensus:
    """The same in WGS 84 degrees; see `Consensus`."""

    lon_deg: float
    lat_deg: float
    support: int
    share: float


def consensus(easting: ArrayLike, northing: ArrayLike, scores: ArrayLike) -> Consensus | None:
    """The robust consensus of matched camera positions, whatever their order.

    Parameters
    ----------
    easting, northing : (n,) float64 in metres on the ground; not finite: a match without pose,
        which keeps its rank but is otherwise passed over.
    scores : (n,) float64, higher = better. Matches that score nothing (<= 0) support nothing,
        unless none scores.

    Returns
    -------
    Consensus in the frame of the positions, or None when no match has a position.

    Raises
    ------
    ValueError : the lengths differ or a score is not finite.
    """
    xy = np.column_stack([np.asarray(easting, np.float64), np.asarray(northing, np.float64)])
    score = np.asarray(scores, np.float64)
    if xy.shape != (score.size, 2) or not np.isfinite(score).all():
        raise ValueError(
            f"consensus takes one finite score a position; got {xy.shape[0]} positions and "
            f"{score.size} scores, {int((~np.isfinite(score)).sum())} of them not finite"
        )
    weights = match_weights(score)
    used = np.isfinite(xy).all(axis=1) & (weights > 0.0)
    if not used.any():
        return None
    # Sums depend on the order of their terms; one order for all makes the result exactly the
    # same for every order of the matches.
    xy, weights = xy[used], weights[used]
    order = np.lexsort((xy[:, 1], xy[:, 0], -weights))
    xy, weights = xy[order], weights[order]
    seed = _densest(xy, weights)
    near = np.hypot(*(xy - xy[seed]).T) <= REACH_M
    # Relative to the seed, the rounding does not depend on where on Earth this is.
    offsets, pulls = xy[near] - xy[seed], weights[near]
    middle = _geometric_median(offsets, pulls)
    place = xy[seed] + middle
    return Consensus(
        easting=float(place[0]),
        northing=float(place[1]),
        support=len(pulls),
        share=float(pulls.sum() / weights.sum()),
    )


def consensus_lon_lat(
    lon_deg: ArrayLike, lat_deg: ArrayLike, scores: ArrayLike
) -> LonLatConsensus | None:
    """`consensus` of WGS 84 positions, worked out in metres around the best placed match.

    Parameters
    ----------
    lon_deg, lat_deg : (n,) float64 degrees; not finite: a match without pose.
    scores : (n,) float64, higher = better.

    Returns
    -------
    LonLatConsensus, or None when no match has a position.

    Raises
    ------
    ValueError : the lengths differ or a score is not finite.
    """
    lon, lat = np.asarray(lon_deg, np.float64), np.asarray(lat_deg, np.float64)
    score = np.asarray(scores, np.float64)
    if not lon.shape == lat.shape == score.shape:
        raise ValueError(
            f"consensus takes one score a position; got {lon.shape} longitudes, {lat.shape} "
            f"latitudes and {score.shape} scores"
        )
    placed = np.flatnonzero(np.isfinite(lon) & np.isfinite(lat))
    if placed.size == 0:
        return None
    best = placed[np.lexsort((lat[placed], lon[placed], -score[placed]))[0]]
    frame = LocalMetres(float(lon[best]), float(lat[best]))
    found = consensus(*frame.from_lon_lat(lon, lat), score)
    if found is None:
        return None
    lon_found, lat_found = frame.to_lon_lat([found.easting], [found.northing])
    return LonLatConsensus(float(lon_found[0]), float(lat_found[0]), found.support, found.share)


def match_weights(scores: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) weights, 0 below `MOST_RANKS`; equal scores share the better rank."""
    if scores.size == 0:
        return scores
    better = scores.size - np.searchsorted(np.sort(scores), scores, side="right")
    best = scores.max()
    relative = np.maximum(scores, 0.0) / best if best > 0.0 else np.ones_like(scores)
    return np.where(better < MOST_RANKS, relative / (1 + better), 0.0)


def _densest(xy: NDArray[np.float64], weights: NDArray[np.float64]) -> int:
    """The row with most weight around it; the earlier row of equal ones."""
    density = np.empty(len(xy))
    for row, place in enumerate(xy):
        squared = ((xy - place) ** 2).sum(axis=1) / REACH_M**2
        density[row] = (np.maximum(0.0, 1.0 - squared) ** 2 * weights).sum()
    return int(np.argmax(density))


def _geometric_median(xy: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """(2,) point of least weighted distance to the rows of `xy`, to a tenth of a millimetre."""
    # A heavy row is the median itself, and Weiszfeld's steps towards a row shrink before it.
    for row in xy:
        pull, _, held = _pull(xy, weights, row)
        if np.hypot(pull[0], pull[1]) <= held:
            return np.array(row)
    here = np.asarray(np.average(xy, axis=0, weights=weights), np.float64)
    for _ in range(_MAX_STEPS):
        pull, rate, held = _pull(xy, weights, here)
        strength = float(np.hypot(pull[0], pull[1]))
        if strength <= held:
            break
        step = pull / rate * (1.0 - held / strength)
        here = here + step
        if np.hypot(step[0], step[1]) < _STEP_TOLERANCE_M:
            break
    return here


def _pull(
    xy: NDArray[np.float64], weights: NDArray[np.float64], here: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float, float]:
    """How the rows elsewhere pull at `here`: their sum (2,), its rate, and the weight held here."""
    offsets = xy - here
    distances = np.hypot(offsets[:, 0], offsets[:, 1])
    apart = distances > 0.0
    pulls = weights[apart] / distances[apart]
    pull = (offsets[apart] * pulls[:, None]).sum(axis=0)
    return pull, float(pulls.sum()), float(weights[~apart].sum())
