"""Longitudes on their circle: within a turn, and the narrowest arc that holds many."""

import numpy as np
from numpy.typing import NDArray


def within_180(lon_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same longitudes within [-180, 180]; NaN stays NaN."""
    outside = np.abs(lon_deg) > 180.0
    return np.where(outside, (lon_deg + 180.0) % 360.0 - 180.0, lon_deg)


def narrowest_span_deg(lon_deg: NDArray[np.float64]) -> tuple[float, float]:
    """West and east of the shortest arc that holds every longitude; west > east across 180.

    lon_deg : (n,), n > 0, within [-180, 180].
    """
    ordered = np.unique(lon_deg)
    gaps = np.diff(ordered, append=ordered[0] + 360.0)
    widest = int(np.argmax(gaps))
    return float(ordered[(widest + 1) % len(ordered)]), float(ordered[widest])
