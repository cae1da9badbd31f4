"""Coordinate reference systems: read one, and place its coordinates in WGS 84.

Every easting and northing is x before y (`always_xy`), whatever order the authority prints.
"""

import functools
import math
import warnings
from dataclasses import dataclass

import numpy as np
import pyproj
from numpy.typing import ArrayLike, NDArray
from pyproj.exceptions import CRSError, ProjError
from pyproj.transformer import TransformerGroup

from contracts.errors import UnknownCrs

_WGS84 = "EPSG:4326"


def parse_crs(text: str) -> pyproj.CRS:
    """The horizontal coordinate reference system that `text` names.

    Parameters
    ----------
    text : what PROJ understands: an authority's code such as `EPSG:2154`, WKT, PROJJSON or a
        PROJ string. Of a compound or three-dimensional system the horizontal part is kept; a
        bound one keeps its own shift to WGS 84.

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
    return horizontal


def _horizontal(crs: pyproj.CRS) -> pyproj.CRS:
    if crs.is_compound:
        if crs.is_bound and crs.source_crs is not None:
            crs = crs.source_crs
        return _horizontal(crs.sub_crs_list[0])
    if crs.is_vertical or crs.is_geocentric or crs.is_engineering:
        return crs
    return crs.to_2d() if len(crs.axis_info) == 3 else crs


@dataclass(frozen=True, slots=True)
class ToWgs84:
    """From one coordinate system to WGS 84 and back, the best operation for every point.

    Raises
    ------
    UnknownCrs : when built, if `crs_text` is not a horizontal system (see `parse_crs`) or PROJ
        has only a ballpark conversion, whose error nobody knows.
    """

    crs_text: str

    def __post_init__(self) -> None:
        _transformer(self.crs_text)

    @property
    def crs(self) -> pyproj.CRS:
        """The horizontal system that is converted from."""
        return _cached_crs(self.crs_text)

    @property
    def missing_grids(self) -> tuple[str, ...]:
        """Names of shift grids that would convert better but are not on this machine, sorted."""
        return _missing_grids(self.crs_text)

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
        lon, lat = _transformer(self.crs_text).transform(x, y)
        lon_deg, lat_deg = np.asarray(lon, np.float64), np.asarray(lat, np.float64)
        good = np.isfinite(lon_deg) & np.isfinite(lat_deg) & (np.abs(lat_deg) <= 90.0)
        self._refuse_unless(good, x, y)
        return _within_180(lon_deg), lat_deg

    def from_lon_lat(
        self, lon_deg: ArrayLike, lat_deg: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Easting and northing, (n,) float64 each, of WGS 84 points; errors as `lon_lat`."""
        lon, lat = _two_vectors(lon_deg, lat_deg)
        x, y = _transformer(self.crs_text).transform(lon, lat, direction="INVERSE")
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
        if self.crs.is_geographic or x.size == 0:
            return np.zeros_like(x)
        projection = _projection(self.crs_text)
        lon, lat = projection(x, y, inverse=True)
        self._refuse_unless(np.isfinite(lon) & np.isfinite(lat), x, y)
        try:
            # PROJ gives longitudes from Greenwich but takes them here from the system's own
            # prime meridian.
            factors = projection.get_factors(
                np.asarray(lon) - _prime_meridian_deg(self.crs), lat, errcheck=True
            )
        except ProjError as error:
            raise UnknownCrs(
                f"{self.crs.name}: no meridian convergence at some of the {x.size} points, "
                f"easting {x.min():g} to {x.max():g}, northing {y.min():g} to {y.max():g}; "
                "check that the coordinates belong to this system (--crs)"
            ) from error
        return np.asarray(factors.meridian_convergence, np.float64)

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


def _within_180(lon_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    outside = np.abs(lon_deg) > 180.0
    return np.where(outside, (lon_deg + 180.0) % 360.0 - 180.0, lon_deg)


@functools.cache
def _cached_crs(crs_text: str) -> pyproj.CRS:
    return parse_crs(crs_text)


@functools.cache
def _projection(crs_text: str) -> pyproj.Proj:
    with warnings.catch_warnings():
        # A PROJ string drops the name and the datum of the system: here only its formulae count.
        warnings.simplefilter("ignore", UserWarning)
        return pyproj.Proj(_cached_crs(crs_text))


def _prime_meridian_deg(crs: pyproj.CRS) -> float:
    meridian = crs.prime_meridian
    if meridian is None:
        return 0.0
    return math.degrees(meridian.longitude * float(meridian.unit_conversion_factor))


@functools.cache
def _operations(crs_text: str) -> TransformerGroup:
    crs = _cached_crs(crs_text)
    with warnings.catch_warnings():
        # A better grid that is missing is reported by `missing_grids`.
        warnings.simplefilter("ignore", UserWarning)
        return TransformerGroup(crs, _WGS84, always_xy=True, allow_ballpark=False)


@functools.cache
def _missing_grids(crs_text: str) -> tuple[str, ...]:
    operations = _operations(crs_text)
    if operations.best_available:
        return ()
    grids = operations.unavailable_operations[0].grids
    return tuple(sorted(grid.short_name for grid in grids if not grid.available))


@functools.cache
def _transformer(crs_text: str) -> pyproj.Transformer:
    crs = _cached_crs(crs_text)
    if not _operations(crs_text).transformers:
        raise UnknownCrs(
            f"coordinate system {crs_text!r} ({crs.name}) has no conversion to WGS 84 of known "
            "accuracy, only a ballpark one; name it by its authority's code, or give its shift "
            "(+towgs84 or a bound system), or install the shift grid its survey uses"
        )
    return pyproj.Transformer.from_crs(crs, _WGS84, always_xy=True, allow_ballpark=False)
