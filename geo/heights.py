"""From what the altitudes of a system count, and their heights above the WGS 84 ellipsoid."""

from dataclasses import dataclass

import numpy as np
import pyproj
from numpy.typing import NDArray
from pyproj.transformer import AreaOfInterest

from contracts.errors import UnknownCrs
from geo.operations import Converter, best_converter, missing_grids

_WGS84_3D = pyproj.CRS("EPSG:4979")


@dataclass(frozen=True, slots=True)
class Heights:
    """What becomes of a system's altitudes.

    converter : to WGS 84 with heights; None: there is none. unit_m : metres of the system's
    vertical unit. missing_grids : geoid grids for want of which there is none, sorted. why_not :
    the same in words, "" where heights are known.
    """

    converter: Converter | None
    unit_m: float
    missing_grids: tuple[str, ...] = ()
    why_not: str = ""

    def above_ellipsoid_m(
        self, x: NDArray[np.float64], y: NDArray[np.float64], altitude_m: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Heights above the WGS 84 ellipsoid, (n,) metres; NaN: not known.

        x, y : (n,) in the axis unit of the system. altitude_m : (n,) in metres whatever the
        system's unit; NaN: not known.
        """
        height = np.full(x.shape, np.nan)
        known = np.isfinite(altitude_m)
        if self.converter is None or not known.any():
            return height
        in_unit = altitude_m[known] / self.unit_m
        found = np.asarray(self.converter.transformer.transform(x[known], y[known], in_unit)[2])
        height[known] = np.where(np.isfinite(found), found, np.nan)
        return height


def vertical_reference(full: pyproj.CRS) -> pyproj.CRS | None:
    """From what the altitudes of a system count; None: it does not say.

    Of a compound system its vertical part; of a three-dimensional one, whose altitudes are
    heights above its ellipsoid, the same in degrees.
    """
    own = full.source_crs if full.is_bound and full.source_crs is not None else full
    if own.is_compound:
        return own.sub_crs_list[1]
    return own.geodetic_crs if len(own.axis_info) == 3 else None


def heights_of(full: pyproj.CRS, area: AreaOfInterest | None) -> Heights:
    """How the altitudes of a system become heights above the WGS 84 ellipsoid, if they can.

    A ballpark operation is never taken: without its geoid a height would be wrong by up to 100 m.
    """
    reference = vertical_reference(full)
    if reference is None:
        return Heights(
            None,
            1.0,
            why_not=f"{full.name} does not say from what altitudes count; name a compound system "
            "such as EPSG:2154+5720 (--crs)",
        )
    unit_m = float(full.axis_info[-1].unit_conversion_factor)
    try:
        return Heights(best_converter(full, _WGS84_3D, area, allow_ballpark=False), unit_m)
    except UnknownCrs:
        grids = missing_grids(full, _WGS84_3D, area)
        how = f"install {', '.join(grids)} (pyproj sync)" if grids else "PROJ knows no geoid for it"
        return Heights(
            None, unit_m, grids, f"{reference.name}: no height above the ellipsoid; {how}"
        )
