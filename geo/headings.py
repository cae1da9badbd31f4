"""Headings from one north to another, and angles within their turn."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contracts.config import North

Angle = TypeVar("Angle", float, NDArray[np.float64])


def true_headings_deg(
    heading_deg: ArrayLike,
    north: North | Sequence[North] | NDArray[np.str_],
    convergence_deg: ArrayLike,
    declination_deg: ArrayLike,
) -> NDArray[np.float64]:
    """Headings clockwise from true north.

    Parameters
    ----------
    heading_deg : (n,) degrees clockwise from `north`, any turn; NaN: not known.
    north : which north the headings start from, one for all or (n,).
    convergence_deg : (n,) or one, bearing of grid north from true north
        (`ToWgs84.convergence_deg`); looked at for grid north alone.
    declination_deg : (n,) or one, bearing of magnetic north from true north, east positive
        (`geo.magnetic.declination_deg`); NaN: not known; looked at for magnetic north alone.

    Returns
    -------
    headings : (n,) float64 in [0, 360), NaN where not known: none was given, or it is magnetic
    and the declination of that place and day is not known. A magnetic heading taken for a true
    one would be wrong by up to tens of degrees.

    Raises
    ------
    ValueError : the lengths differ, or no such north.
    """
    heading, norths = np.asarray(heading_deg, np.float64), np.asarray(north)
    strange = set(norths.ravel().tolist()) - {"true", "grid", "magnetic"}
    if strange:
        raise ValueError(f"north is {sorted(strange)}, expected true, grid or magnetic")
    convergence = np.asarray(convergence_deg, np.float64)
    declination = np.asarray(declination_deg, np.float64)
    shapes = [part.shape for part in (norths, convergence, declination)]
    if heading.ndim != 1 or any(shape not in ((), heading.shape) for shape in shapes):
        raise ValueError(f"{heading.shape} headings, but norths and their bearings are {shapes}")
    magnetic = np.where(norths == "magnetic", declination, 0.0)
    turn = np.where(norths == "grid", convergence, magnetic)
    return wrapped_360(heading + turn)


def wrapped_360(angle_deg: Angle) -> Angle:
    """The same direction within [0, 360) degrees, of one angle or an array; NaN stays NaN."""
    turned = angle_deg % 360.0
    # A tiny negative angle is rounded up to a whole turn.
    if isinstance(turned, np.ndarray):
        return np.where(turned == 360.0, 0.0, turned)
    return 0.0 if turned == 360.0 else turned


def wrapped_180(angle_deg: Angle) -> Angle:
    """The same turn within (-180, 180] degrees, of one angle or an array; NaN stays NaN."""
    turned = wrapped_360(angle_deg)
    if isinstance(turned, np.ndarray):
        return np.where(turned > 180.0, turned - 360.0, turned)
    return turned - 360.0 if turned > 180.0 else turned
