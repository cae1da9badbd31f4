"""How sure a mean over queries is: bootstrap intervals.

Percentile intervals of 95 %, after Efron & Tibshirani, "An Introduction to the Bootstrap", 1993,
chapters 8 and 13. Queries of one place are not independent: where groups are given, whole groups
are drawn (the cluster bootstrap; Davison & Hinkley 1997, section 3.8). A draw is held as how
often each group came up, so that a block of resamples is one product of matrices.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contracts.errors import WrongInput

Groups = Sequence[str] | Sequence[int] | NDArray[np.int64] | NDArray[np.str_]
"""The place of each value: equal labels are drawn together."""

_TAIL = 0.025
_BLOCK_DRAWS = 1 << 20
"""Draws held at a time: 8 MB each of draws, of counts and of their floats."""


@dataclass(frozen=True, slots=True)
class Interval:
    """A statistic of the sample as it is, and its 95 % interval.

    low and high are nan where the sample is a single value or a single group: one place says
    nothing about how places differ, and an interval of no width would claim that it does.
    """

    mean: float
    low: float
    high: float


def bootstrap_mean(
    values: NDArray[np.float64],
    groups: Groups | None = None,
    n_resamples: int = 10_000,
    seed: int = 0,
) -> Interval:
    """Mean of the values and its interval.

    Parameters
    ----------
    values : (n,) finite, one a query.
    groups : (n,) labels, or None if the values are independent. With groups a resample draws as
        many groups as there are, with replacement, and averages over all their values.

    Raises
    ------
    WrongInput : no value, one that is not finite, labels or resamples that do not fit.
    """
    return weighted_mean(values, np.ones(values.shape), groups, n_resamples, seed)


def weighted_mean(
    values: NDArray[np.float64],
    weights: NDArray[np.float64],
    groups: Groups | None = None,
    n_resamples: int = 10_000,
    seed: int = 0,
) -> Interval:
    """Weighted mean and its interval; every resample is divided by the weights it drew.

    Parameters
    ----------
    values, weights : (n,) finite, the weights positive. groups : as for `bootstrap_mean`.

    Raises
    ------
    WrongInput : as `bootstrap_mean`.
    """
    _check_pair(values, weights)
    _check(values, groups, n_resamples)
    # Constant values must give an interval of no width, whatever the order of the additions.
    origin = float(values[0])
    shifted = bootstrap_ratio((values - origin) * weights, weights, groups, n_resamples, seed)
    return Interval(origin + shifted.mean, origin + shifted.low, origin + shifted.high)


def bootstrap_difference(
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    groups: Groups | None = None,
    n_resamples: int = 10_000,
    seed: int = 0,
) -> Interval:
    """Mean of a - b, paired: both systems answer the same queries in every resample.

    Parameters
    ----------
    a, b : (n,) finite, in one order of queries. groups : as for `bootstrap_mean`.

    Raises
    ------
    WrongInput : a and b differ in length, or as `bootstrap_mean`.
    """
    _check_pair(a, b)
    return bootstrap_mean(a - b, groups, n_resamples, seed)


def bootstrap_ratio(
    numerators: NDArray[np.float64],
    denominators: NDArray[np.float64],
    groups: Groups | None = None,
    n_resamples: int = 10_000,
    seed: int = 0,
) -> Interval:
    """Mean of the numerators over mean of the denominators, as the share of the oracle's room.

    A ratio means nothing unless its denominator is positive. If the sample's is not, all of the
    interval is nan. A resample whose denominator is not positive could stand for any ratio, so it
    counts as minus infinity for the low end and as infinity for the high one: where more than one
    in forty is such, the interval is infinite, which says that the data do not bound the ratio.

    Parameters
    ----------
    numerators, denominators : (n,) finite, in one order of queries; single ones may be 0 or
        negative. groups : as for `bootstrap_mean`.

    Raises
    ------
    WrongInput : the two differ in length, or as `bootstrap_mean`.
    """
    _check_pair(numerators, denominators)
    _check(numerators, groups, n_resamples)
    _check(denominators, groups, n_resamples)
    if denominators.sum() <= 0:
        return Interval(np.nan, np.nan, np.nan)
    ratio = float(numerators.sum() / denominators.sum())
    totals = _group_totals(np.column_stack([numerators, denominators]), groups)
    if len(totals) == 1:
        return Interval(ratio, np.nan, np.nan)
    above, below = _resample(totals, n_resamples, seed).T
    defined = below > 0
    ratios = above / np.where(defined, below, 1.0)
    return Interval(
        ratio,
        _low(np.where(defined, ratios, -np.inf)),
        _high(np.where(defined, ratios, np.inf)),
    )


def _group_totals(columns: NDArray[np.float64], groups: Groups | None) -> NDArray[np.float64]:
    """Sum the rows (n, c) of each group: (n_groups, c), groups in order of their labels."""
    if groups is None:
        return columns
    labels, member_of = np.unique(np.asarray(groups), return_inverse=True)
    totals = np.zeros((len(labels), columns.shape[1]), dtype=np.float64)
    np.add.at(totals, member_of, columns)
    return totals


def _resample(totals: NDArray[np.float64], n_resamples: int, seed: int) -> NDArray[np.float64]:
    """Sums of drawn groups: (n_groups, c) -> (n_resamples, c)."""
    return np.concatenate(
        [counts.astype(np.float64) @ totals for counts in _counts(len(totals), n_resamples, seed)]
    )


def _counts(n_groups: int, n_resamples: int, seed: int) -> Iterator[NDArray[np.int64]]:
    """How often each group was drawn, a block of resamples at a time: (block, n_groups)."""
    rng = np.random.default_rng(seed)
    block = max(1, _BLOCK_DRAWS // n_groups)
    for start in range(0, n_resamples, block):
        size = min(block, n_resamples - start)
        draws = rng.integers(n_groups, size=(size, n_groups))
        draws += n_groups * np.arange(size)[:, np.newaxis]
        yield np.bincount(draws.ravel(), minlength=size * n_groups).reshape(size, n_groups)


# A resample is picked and never interpolated: between a number and infinity there is nothing.
def _low(statistics: NDArray[np.float64]) -> float:
    return float(np.quantile(statistics, _TAIL, method="lower"))


def _high(statistics: NDArray[np.float64]) -> float:
    return float(np.quantile(statistics, 1 - _TAIL, method="higher"))


def _check_pair(a: NDArray[np.float64], b: NDArray[np.float64]) -> None:
    if a.shape != b.shape:
        raise WrongInput(
            f"paired values have shapes {a.shape} and {b.shape}; give one of each a query"
        )


def _check(values: NDArray[np.float64], groups: Groups | None, n_resamples: int) -> None:
    if values.ndim != 1 or not len(values):
        raise WrongInput(
            f"values to resample have shape {values.shape}; expected (n,) with one query or more"
        )
    if not np.isfinite(values).all():
        at = int(np.flatnonzero(~np.isfinite(values))[0])
        raise WrongInput(f"value {at} to resample is {values[at]}; leave out what has no score")
    if groups is not None and len(groups) != len(values):
        raise WrongInput(f"{len(groups)} group labels were given for {len(values)} values")
    if n_resamples < 1:
        raise WrongInput(f"n_resamples is {n_resamples}; it must be 1 or more, better 10,000")
