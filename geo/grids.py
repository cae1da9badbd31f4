"""The grid of a coordinate system: where its north lies, and how far a metre reaches on it.

Only the formulae of the projection count here, not the datum: places are degrees on the system's
own ellipsoid, from its own prime meridian.
"""

import math
from dataclasses import dataclass

import numpy as np
import pyproj
from numpy.typing import NDArray
from pyproj.crs import GeographicCRS
from pyproj.exceptions import ProjError

from contracts.errors import UnknownCrs

_STEP_DEG = 1e-5
"""About a metre along the meridian: the grid's curvature and rounding both stay below 1e-7."""
_BELGIAN = "Lambert Conic Conformal (2SP Belgium)"
"""EPSG 9803: PROJ leaves out its turn of 29.2985 seconds of arc."""
_TOWARDS = {"east": (1.0, 0.0), "west": (-1.0, 0.0), "north": (0.0, 1.0), "south": (0.0, -1.0)}

Vectors = tuple[NDArray[np.float64], NDArray[np.float64]]


@dataclass(frozen=True, slots=True)
class MapGrid:
    """The lines of equal x and y of one horizontal system.

    to_degrees : from x and y to degrees on `ellipsoid`. axes : (2, 2), east and north of the grid
    from its x and y. is_geographic : x and y are themselves longitude and latitude.
    prime_meridian_deg : east of Greenwich.
    """

    to_degrees: pyproj.Transformer
    ellipsoid: pyproj.Geod
    axes: NDArray[np.float64]
    is_geographic: bool
    prime_meridian_deg: float

    def convergence_deg(
        self, x: NDArray[np.float64], y: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Bearing of grid north from true north, clockwise, (n,) degrees in [-180, 180].

        x, y : (n,) in the axis unit of the system; NaN comes of a point the projection has no
        place for. Found from a step of a metre along the meridian: PROJ's own factors do not heed
        axes that point west or south (Krovak, South Africa). Zero for a geographic system.
        """
        if self.is_geographic:
            return np.where(np.isfinite(x) & np.isfinite(y), 0.0, np.nan)
        lon, lat = self.degrees(x, y)
        towards_equator = np.where(lat > 0.0, -_STEP_DEG, _STEP_DEG)  # never across a pole
        ahead = np.stack(self._from_degrees(lon, lat + towards_equator))
        start = np.stack(self._from_degrees(lon, lat))
        east, north = self.axes @ (np.sign(towards_equator) * (ahead - start))
        return np.asarray(-np.degrees(np.arctan2(east, north)), np.float64)

    def moved(
        self,
        x: NDArray[np.float64],
        y: NDArray[np.float64],
        east_m: NDArray[np.float64],
        north_m: NDArray[np.float64],
    ) -> Vectors:
        """Coordinates of what lies so many metres on the ground, true east and north, from points.

        x, y : (n,) in the axis unit of the system. east_m, north_m : (n,). Along the geodesic, so
        that it holds in degrees, feet and Web Mercator, across longitude 180 and near the poles
        alike. Height is left out: 1.6e-4 of the way for each kilometre above the ellipsoid.
        """
        lon, lat = self.degrees(x, y)
        bearing_deg = np.degrees(np.arctan2(east_m, north_m))
        there = self.ellipsoid.fwd(lon, lat, bearing_deg, np.hypot(east_m, north_m))
        return self._from_degrees(np.asarray(there[0]), np.asarray(there[1]))

    def degrees(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> Vectors:
        """Longitude from the system's prime meridian, and latitude, (n,); NaN where none."""
        return _finite(self.to_degrees.transform(x, y))

    def _from_degrees(self, lon: NDArray[np.float64], lat: NDArray[np.float64]) -> Vectors:
        return _finite(self.to_degrees.transform(lon, lat, direction="INVERSE"))


def map_grid(crs: pyproj.CRS) -> MapGrid:
    """The grid of a horizontal system, projected or geographic, bound or not.

    Raises
    ------
    UnknownCrs : PROJ cannot compute its projection, or computes it wrongly.
    """
    own = crs.source_crs if crs.is_bound and crs.source_crs is not None else crs
    operation = own.coordinate_operation
    if operation is not None and operation.method_name == _BELGIAN:
        raise UnknownCrs(
            f"{crs.name} is defined by the method {_BELGIAN!r}, which PROJ takes for another: "
            "places would be off by 745 m; EPSG:31370 is the same grid within 5 cm, by a method "
            "that it knows"
        )
    ellipsoid = own.get_geod()
    if ellipsoid is None:
        raise UnknownCrs(f"{crs.name} is a {crs.type_name} without an ellipsoid; name another")
    try:
        to_degrees = pyproj.Transformer.from_crs(
            own, GeographicCRS(datum=own.datum), always_xy=True
        )
    except ProjError as error:
        method = "" if operation is None else f" {operation.method_name!r}"
        raise UnknownCrs(
            f"PROJ {pyproj.proj_version_str} cannot compute the projection{method} of {crs.name}; "
            "convert the survey into another coordinate system first"
        ) from error
    return MapGrid(
        to_degrees=to_degrees,
        ellipsoid=ellipsoid,
        axes=_axes(own),
        is_geographic=own.is_geographic,
        prime_meridian_deg=_prime_meridian_deg(own),
    )


def _axes(crs: pyproj.CRS) -> NDArray[np.float64]:
    """(2, 2): east and north of the grid from its x and y.

    Polar systems name both axes by one direction, towards the pole or away from it: there y is
    the north of the grid.
    """
    directions = [axis.direction for axis in crs.axis_info[:2]]
    if directions == ["north", "east"]:  # the one order that PROJ turns round
        directions = ["east", "north"]
    if len(set(directions)) < 2 or not set(directions) <= _TOWARDS.keys():
        return np.eye(2)
    return np.array([_TOWARDS[direction] for direction in directions]).T


def _prime_meridian_deg(crs: pyproj.CRS) -> float:
    meridian = crs.prime_meridian
    if meridian is None:
        return 0.0
    return math.degrees(meridian.longitude * float(meridian.unit_conversion_factor))


def _finite(found: tuple[NDArray[np.float64], ...]) -> Vectors:
    first, second = (np.asarray(values, np.float64) for values in found)
    known = np.isfinite(first) & np.isfinite(second)
    return np.where(known, first, np.nan), np.where(known, second, np.nan)
