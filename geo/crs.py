"""Coordinate reference systems: read one, and place its coordinates in WGS 84.

Every easting and northing is x before y (`always_xy`), whatever order the authority prints.
"""

import functools
from dataclasses import dataclass
from typing import Self

import numpy as np
import pyproj
from numpy.typing import ArrayLike, NDArray
from pyproj.exceptions import CRSError
from pyproj.transformer import AreaOfInterest

from contracts.errors import UnknownCrs
from geo.grids import MapGrid, map_grid
from geo.heights import Heights, heights_of
from geo.operations import Converter, Operation, best_converter
from geo.spans import narrowest_span_deg, within_180

_WGS84 = pyproj.CRS("EPSG:4326")


@functools.lru_cache(maxsize=256)
def parse_full_crs(text: str) -> pyproj.CRS:
    """The coordinate reference system that `text` names, heights included.

    Parameters
    ----------
    text : what PROJ understands: an authority's code such as `EPSG:2154`, two of them joined
        (`EPSG:2154+5720`), WKT, PROJJSON or a PROJ string.

    Raises
    ------
    UnknownCrs : not known, or without a horizontal position on the Earth (engineering, vertical
        or geocentric).
    """
    try:
        named = pyproj.CRS.from_user_input(text)
    except CRSError as error:
        raise UnknownCrs(
            f"coordinate system {text!r} is not known to PROJ {pyproj.proj_version_str}; "
            "give an authority's code such as EPSG:2154, WKT or a PROJ string"
        ) from error
    horizontal = _horizontal(named)
    if not (horizontal.is_projected or horizontal.is_geographic):
        raise UnknownCrs(
            f"coordinate system {text!r} ({named.name}) is a {named.type_name}, which gives no "
            "easting and northing on the Earth; give a projected or geographic one, such as "
            "EPSG:2154 or EPSG:4326"
        )
    return named


@functools.lru_cache(maxsize=256)
def parse_crs(text: str) -> pyproj.CRS:
    """The horizontal coordinate reference system that `text` names.

    Of a compound or three-dimensional system (see `parse_full_crs`) the horizontal part is kept;
    a bound one keeps its own shift to WGS 84.

    Raises
    ------
    UnknownCrs : as `parse_full_crs`.
    """
    return _horizontal(parse_full_crs(text))


@functools.lru_cache(maxsize=64)
def grid_of(text: str) -> MapGrid:
    """The grid of a system's horizontal part: convergence, and places so many metres away."""
    return map_grid(parse_crs(text))


def area_of(text: str, easting: ArrayLike, northing: ArrayLike) -> AreaOfInterest | None:
    """The part of the Earth where points lie, which may cross longitude 180; None: no points.

    Parameters
    ----------
    easting, northing : (n,) in the axis unit of the system, x before y; NaN is passed over.

    Notes
    -----
    The datum is left out: it moves a place by less than 0.01 degrees.
    """
    grid = grid_of(text)
    lon, lat = grid.degrees(*_two_vectors(easting, northing))
    known = np.isfinite(lon)
    if not known.any():
        return None
    west, east = narrowest_span_deg(within_180(lon[known] + grid.prime_meridian_deg))
    return AreaOfInterest(west, float(lat[known].min()), east, float(lat[known].max()))


@dataclass(frozen=True, slots=True)
class ToWgs84:
    """From one coordinate system to WGS 84 and back.

    crs_text : see `parse_full_crs`.
    area : where the points of the survey lie (`area_of`; or let `over` find it): one operation is
        chosen for all of it, the best. None: PROJ chooses for each point.
    allow_ballpark : whether a conversion is taken whose error nobody knows.

    Raises
    ------
    UnknownCrs : when built, if `crs_text` is not a horizontal system, or PROJ has only a ballpark
        conversion and that is not allowed.
    """

    crs_text: str
    area: AreaOfInterest | None = None
    allow_ballpark: bool = False

    def __post_init__(self) -> None:
        grid_of(self.crs_text)
        self._converter()

    @classmethod
    def over(
        cls, crs_text: str, easting: ArrayLike, northing: ArrayLike, allow_ballpark: bool = False
    ) -> Self:
        """For a survey with these points, (n,) in the axis unit of the system, x before y."""
        return cls(crs_text, area_of(crs_text, easting, northing), allow_ballpark)

    @property
    def crs(self) -> pyproj.CRS:
        """The horizontal system that is converted from."""
        return parse_crs(self.crs_text)

    @property
    def operation(self) -> Operation:
        """How longitudes and latitudes are come by, to be told with every result."""
        return self._converter().operation

    @property
    def missing_grids(self) -> tuple[str, ...]:
        """Names of shift grids that would convert better but are not on this machine, sorted."""
        return self.operation.missing_grids

    @property
    def heights(self) -> Heights:
        """Whether `positions` knows heights, and if not, why."""
        return _heights(self.crs_text, self.area)

    def lon_lat(
        self, easting: ArrayLike, northing: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """WGS 84 longitude and latitude of points.

        Parameters
        ----------
        easting, northing : (n,) in the axis unit of the system, x before y.

        Returns
        -------
        lon_deg, lat_deg : (n,) float64, longitude within [-180, 180].

        Raises
        ------
        UnknownCrs : a point has no position on the Earth in this system.
        """
        x, y = _two_vectors(easting, northing)
        lon, lat = self._converter().transformer.transform(x, y)
        lon_deg, lat_deg = np.asarray(lon, np.float64), np.asarray(lat, np.float64)
        good = np.isfinite(lon_deg) & np.isfinite(lat_deg) & (np.abs(lat_deg) <= 90.0)
        self._refuse_unless(good, x, y)
        return within_180(lon_deg), lat_deg

    def positions(
        self, easting: ArrayLike, northing: ArrayLike, altitude_m: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """WGS 84 longitude, latitude and height above its ellipsoid of points.

        Parameters
        ----------
        easting, northing : (n,) in the axis unit of the system, x before y.
        altitude_m : (n,) metres, whatever the system's unit; NaN: not known.

        Returns
        -------
        lon_deg, lat_deg : (n,) float64 as `lon_lat`. height_m : (n,) float64, NaN where it is not
        known: the system does not say from what altitudes count, a geoid grid is missing
        (`heights` names it) or has no value there.

        Raises
        ------
        UnknownCrs : a point has no position on the Earth in this system.
        """
        x, y = _two_vectors(easting, northing)
        altitude = _two_vectors(x, altitude_m)[1]
        lon, lat = self.lon_lat(x, y)
        return lon, lat, self.heights.above_ellipsoid_m(x, y, altitude)

    def from_lon_lat(
        self, lon_deg: ArrayLike, lat_deg: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Easting and northing, (n,) float64 each, of WGS 84 points; errors as `lon_lat`."""
        lon, lat = _two_vectors(lon_deg, lat_deg)
        x, y = self._converter().transformer.transform(lon, lat, direction="INVERSE")
        easting, northing = np.asarray(x, np.float64), np.asarray(y, np.float64)
        self._refuse_unless(np.isfinite(easting) & np.isfinite(northing), lon, lat)
        return easting, northing

    def convergence_deg(self, easting: ArrayLike, northing: ArrayLike) -> NDArray[np.float64]:
        """Meridian convergence: true heading = grid heading + convergence.

        The bearing of grid north from true north, clockwise: negative west of the central
        meridian in the northern hemisphere (Lambert-93 in Paris, 0.65 degrees west of 3 E:
        -0.47). Zero for a geographic system.

        Parameters
        ----------
        easting, northing : (n,) in the axis unit of the system, x before y.

        Returns
        -------
        convergence_deg : (n,) float64.

        Raises
        ------
        UnknownCrs : a point has no position on the Earth in this system.
        """
        x, y = _two_vectors(easting, northing)
        convergence = grid_of(self.crs_text).convergence_deg(x, y)
        self._refuse_unless(np.isfinite(convergence), x, y)
        return convergence

    def _converter(self) -> Converter:
        return _wgs84_converter(self.crs_text, self.area, self.allow_ballpark)

    def _refuse_unless(
        self, good: NDArray[np.bool_], x: NDArray[np.float64], y: NDArray[np.float64]
    ) -> None:
        if good.all():
            return
        first = int(np.argmin(good))
        raise UnknownCrs(
            f"{int((~good).sum())} of {good.size} points cannot be converted between "
            f"{self.crs_text} ({self.crs.name}) and WGS 84; the first is number {first}, "
            f"x {x[first]}, y {y[first]}; check that the coordinates belong to this system, x "
            "(easting or longitude) before y, and name the right one (--crs)"
        )


def _two_vectors(x: ArrayLike, y: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    first = np.atleast_1d(np.asarray(x, np.float64))
    second = np.atleast_1d(np.asarray(y, np.float64))
    if first.ndim != 1 or first.shape != second.shape:
        raise ValueError(f"x and y must be (n,) alike; got {first.shape} and {second.shape}")
    return first, second


def _horizontal(crs: pyproj.CRS) -> pyproj.CRS:
    if crs.is_compound:
        if crs.is_bound and crs.source_crs is not None:
            crs = crs.source_crs
        return _horizontal(crs.sub_crs_list[0])
    if crs.is_vertical or crs.is_geocentric or crs.is_engineering:
        return crs
    return crs.to_2d() if len(crs.axis_info) == 3 else crs


@functools.lru_cache(maxsize=64)
def _wgs84_converter(crs_text: str, area: AreaOfInterest | None, allow_ballpark: bool) -> Converter:
    return best_converter(parse_crs(crs_text), _WGS84, area, allow_ballpark)


@functools.lru_cache(maxsize=64)
def _heights(crs_text: str, area: AreaOfInterest | None) -> Heights:
    return heights_of(parse_full_crs(crs_text), area)
