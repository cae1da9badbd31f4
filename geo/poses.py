"""Poses of many images as arrays, in their survey's own coordinates."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geo.crs import ToWgs84
from geo.headings import true_headings_deg
from geo.magnetic import decimal_years, declination_deg


@dataclass(frozen=True, slots=True)
class Poses:
    """n poses; NaN: not known.

    easting, northing : (n,) float64, in the axis unit of the survey's system. altitude_m,
    heading_deg : (n,) float64. norths : (n,) str, from which the headings count. captured_at :
    (n,) ISO 8601 with a zone, or None.
    """

    easting: NDArray[np.float64]
    northing: NDArray[np.float64]
    altitude_m: NDArray[np.float64]
    heading_deg: NDArray[np.float64]
    norths: NDArray[np.str_]
    captured_at: tuple[str | None, ...]


def true_headings_of(poses: Poses, to_wgs84: ToWgs84) -> NDArray[np.float64]:
    """Headings clockwise from true north, (n,) float64 in [0, 360); NaN: not known.

    Raises
    ------
    UnknownCrs : a position has no place on the Earth in the survey's system.
    """
    convergence, declination = np.full((2, len(poses.easting)), np.nan)
    grid = np.flatnonzero(poses.norths == "grid")
    convergence[grid] = to_wgs84.convergence_deg(poses.easting[grid], poses.northing[grid])
    magnetic = np.flatnonzero(poses.norths == "magnetic")
    places = to_wgs84.positions(
        poses.easting[magnetic], poses.northing[magnetic], poses.altitude_m[magnetic]
    )
    years = decimal_years([poses.captured_at[at] for at in magnetic.tolist()])
    declination[magnetic] = declination_deg(*places, years)
    return true_headings_deg(poses.heading_deg, poses.norths, convergence, declination)
