"""Means and spreads of directions, in degrees."""

import numpy as np
from numpy.typing import NDArray

_BIN_DEG = 10
_NEAR_DEG = 30.0
_SD_OF_MEDIAN_DEVIATION = 1.4826
"""Of a normal distribution: standard deviation over median absolute deviation."""


def wrapped(angles_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) the same directions within [-180, 180)."""
    return (angles_deg + 180.0) % 360.0 - 180.0


def circular_mean(angles_deg: NDArray[np.float64]) -> float:
    """Direction of the mean vector, [-180, 180]; Mardia & Jupp 2000, section 2.2."""
    radians = np.radians(angles_deg)
    return float(np.degrees(np.arctan2(np.sin(radians).mean(), np.cos(radians).mean())))


def main_direction(angles_deg: NDArray[np.float64]) -> float:
    """Mean of the directions that crowd together most, [-180, 180], whatever the others do.

    The fullest three of 36 neighbouring bins give a first direction; the mean is of all within
    30 degrees of it.
    """
    bins = (angles_deg % 360.0 // _BIN_DEG).astype(np.int64) % 36
    counts = np.bincount(bins, minlength=36)
    crowd = counts + np.roll(counts, 1) + np.roll(counts, -1)
    start = (int(np.argmax(crowd)) + 0.5) * _BIN_DEG
    near = np.abs(wrapped(angles_deg - start)) <= _NEAR_DEG
    return circular_mean(angles_deg[near])


def deviation(angles_deg: NDArray[np.float64], about_deg: float) -> float:
    """Median absolute difference from a direction, as the standard deviation of a normal one."""
    return _SD_OF_MEDIAN_DEVIATION * float(np.median(np.abs(wrapped(angles_deg - about_deg))))
