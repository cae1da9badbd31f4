"""Late fusion: joining the finished rankings of several systems, blind to how each was made.

The baselines that fusion of inverted indices is measured against; METHOD section 4. All are
symmetric in their systems, and an image that no system touched stays untouched, with 0.
"""

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from contracts.errors import WrongInput
from retrieval.fusion import Scores, full_ranking

LateFusion = Literal["comb_sum", "comb_mnz", "borda", "reciprocal_rank"]

_MAY_BE_RIGHT = 10

RRF_CONSTANT = 60
"""Keeps the first ranks of one system from outvoting all others; Cormack et al.'s own value."""


def comb_sum(systems: Sequence[Scores]) -> Scores:
    """Add up min-max normalised scores.

    A system's worst touched image gets 0 and its best 1; where all its scores are equal each
    gets 1, since a touched image is an answer and stands above the untouched ones, which get 0.
    Fox & Shaw, "Combination of multiple searches", TREC-2, 1994.

    Parameters
    ----------
    systems : one or more, of the same n_images.

    Raises
    ------
    WrongInput : no system is given, or they score different numbers of images.
    """
    check_systems(systems)
    return Scores(_sum(systems), _touched(systems))


def comb_mnz(systems: Sequence[Scores]) -> Scores:
    """Multiply `comb_sum` by the number of systems that touched the image.

    Fox & Shaw, TREC-2, 1994. Parameters and errors as `comb_sum`.
    """
    check_systems(systems)
    n_touching = np.sum([system.touched for system in systems], axis=0)
    return Scores(_sum(systems) * n_touching, _touched(systems))


def borda(systems: Sequence[Scores]) -> Scores:
    """Add up points: of n_images, a system gives n to its first, n - 1 to its second, and so on.

    The u images that it did not touch would have had the points u, u - 1, ... 1: they share them
    equally, (u + 1) / 2 each, less than any touched image gets. Ties within a system are broken
    by image id. Aslam & Montague, "Models for metasearch", SIGIR 2001. Parameters and errors as
    `comb_sum`.
    """
    check_systems(systems)
    points = np.zeros(len(systems[0].values), dtype=np.float64)
    for system in systems:
        n_untouched = np.count_nonzero(~system.touched)
        mine = len(points) + 1 - _ranks(system)
        points += np.where(system.touched, mine, (n_untouched + 1) / 2)
    touched = _touched(systems)
    return Scores(np.where(touched, points, 0.0), touched)


def reciprocal_rank(systems: Sequence[Scores]) -> Scores:
    """Add up 1 / (60 + rank) over the systems that touched the image; the first has rank 1.

    Ties within a system are broken by image id. Cormack, Clarke & Buettcher, "Reciprocal rank
    fusion outperforms Condorcet and individual rank learning methods", SIGIR 2009. Parameters
    and errors as `comb_sum`.
    """
    check_systems(systems)
    values = np.zeros(len(systems[0].values), dtype=np.float64)
    for system in systems:
        values += np.where(system.touched, 1.0 / (RRF_CONSTANT + _ranks(system)), 0.0)
    return Scores(values, _touched(systems))


LATE_FUSIONS: Mapping[LateFusion, Callable[[Sequence[Scores]], Scores]] = MappingProxyType(
    {
        "comb_sum": comb_sum,
        "comb_mnz": comb_mnz,
        "borda": borda,
        "reciprocal_rank": reciprocal_rank,
    }
)


def check_systems(systems: Sequence[Scores]) -> None:
    """Refuse systems that cannot be fused.

    Raises
    ------
    WrongInput : no system is given, or they score different numbers of images.
    """
    if not systems:
        raise WrongInput("late fusion was given no system; give it one or more")
    sizes = {len(array) for system in systems for array in (system.values, system.touched)}
    if len(sizes) > 1:
        raise WrongInput(
            f"the systems to fuse score {sorted(sizes)} images; all must score the same ones: "
            "take them from one index"
        )


def standardised(system: Scores) -> Scores:
    """Scores in standard deviations above the median of the crowd.

    Unlike a min-max, the scale does not hang on the best image: the ten best, at most a quarter,
    are left out of the deviation, for they may be right. An untouched image counts with 0 before
    it is standardised. Two rankings of a choice are joined by the sum of these.
    """
    values = system.values
    n_crowd = len(values) - min(_MAY_BE_RIGHT, len(values) // 4)
    if n_crowd == 0:
        return system
    deviation = float(np.partition(values, n_crowd - 1)[:n_crowd].std())
    above = values - np.median(values)
    return Scores(above / deviation if deviation > 0 else above, system.touched)


def standardised_sum(systems: Sequence[Scores]) -> Scores:
    """Add up `standardised` scores. Parameters and errors as `comb_sum`."""
    check_systems(systems)
    values = np.sum([standardised(system).values for system in systems], axis=0)
    return Scores(values, _touched(systems))


def _sum(systems: Sequence[Scores]) -> NDArray[np.float64]:
    total = np.zeros(len(systems[0].values), dtype=np.float64)
    for system in systems:
        total[system.touched] += _min_max(system.values[system.touched])
    return total


def _min_max(values: NDArray[np.float64]) -> NDArray[np.float64]:
    if not len(values):
        return values
    lowest, highest = values.min(), values.max()
    if lowest == highest:
        return np.ones_like(values)
    return np.asarray((values - lowest) / (highest - lowest), dtype=np.float64)


def _ranks(system: Scores) -> NDArray[np.int64]:
    """Rank of each image, 1 = best; (n_images,)."""
    ranks = np.empty(len(system.values), dtype=np.int64)
    ranks[full_ranking(system)] = np.arange(1, len(ranks) + 1)
    return ranks


def _touched(systems: Sequence[Scores]) -> NDArray[np.bool_]:
    return np.asarray(np.any([system.touched for system in systems], axis=0), dtype=np.bool_)
