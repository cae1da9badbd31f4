"""Numbers that are not known exactly: a likely value between two that it will hardly leave."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

_ERRORS = 2.0
"""Standard errors to either side: about 95 %."""
_UNKNOWN = 2.0
"""One value alone tells nothing of its spread: half to twice as much."""


@dataclass(frozen=True, slots=True)
class Range:
    """low <= likely <= high, all of one unit."""

    low: float
    likely: float
    high: float

    def __add__(self, other: "Range") -> "Range":
        return Range(self.low + other.low, self.likely + other.likely, self.high + other.high)

    def times(self, factor: float) -> "Range":
        """So many of it; factor is not negative."""
        return Range(self.low * factor, self.likely * factor, self.high * factor)

    def within(self, factor: float) -> "Range":
        """Less sure: `factor` times less and more; factor is at least 1."""
        return Range(self.low / factor, self.likely, self.high * factor)


def exactly(value: float) -> Range:
    """A number that is known."""
    return Range(value, value, value)


def total(ranges: Iterable[Range]) -> Range:
    """Their sum, as if all erred to the same side."""
    return sum(ranges, exactly(0.0))


def mean_of(totals: Sequence[float], sizes: Sequence[int], n_all: int) -> Range:
    """The mean of one of `n_all`, from groups drawn of them: two standard errors to either side.

    The ratio estimator of cluster sampling (Cochran, Sampling Techniques, 1977, eq. 2.47 and
    9A.1), with the correction for a finite number.

    Parameters
    ----------
    totals, sizes : of each group drawn, the sum of the values and how many there were; the
        groups hold one member at least.
    """
    of_groups, members = np.array(totals, dtype=np.float64), np.array(sizes, dtype=np.float64)
    n_drawn = float(members.sum())
    mean = float(of_groups.sum()) / n_drawn
    if n_drawn >= n_all:
        return exactly(mean)
    if len(members) < 2:
        return exactly(mean).within(_UNKNOWN)
    rests = of_groups - mean * members
    variance = float(rests @ rests) / (len(members) - 1)
    unseen = 1.0 - n_drawn / n_all
    error = math.sqrt(unseen * variance / len(members)) / float(members.mean())
    return Range(max(mean - _ERRORS * error, 0.0), mean, mean + _ERRORS * error)


def share_of(n_found: int, n_drawn: int) -> Range:
    """The share of all, from how many of those drawn: Wilson's interval (1927), about 95 %."""
    share, square = n_found / n_drawn, _ERRORS**2
    middle = (share + square / (2 * n_drawn)) / (1 + square / n_drawn)
    spread = (
        _ERRORS
        * math.sqrt(share * (1 - share) / n_drawn + square / (4 * n_drawn**2))
        / (1 + square / n_drawn)
    )
    return Range(max(middle - spread, 0.0), share, min(middle + spread, 1.0))
