"""The coordinate system of the layers, and the places of answers in it."""

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from geo.antimeridian import Shapes
from geo.crs import ToWgs84
from geo.geojson import Feature
from index.catalogue import CatalogueRow
from index.opened import OpenedIndex

WGS84 = ToWgs84("EPSG:4326")


def layers_system(index: OpenedIndex) -> ToWgs84:
    """The survey's system with the conversion its answers were placed by; WGS 84 if it has none."""
    return index.to_wgs84 or WGS84


def system_wkt(system: ToWgs84) -> str:
    """The horizontal part of a system for GDAL, which finds its authority's code in it."""
    text: str = system.crs.to_wkt()
    return text


def camera_points(rows: Sequence[CatalogueRow]) -> Shapes:
    """(n,) points where cameras stood, exactly as surveyed; None without a pose."""
    xy = np.array([(row.easting, row.northing) for row in rows], np.float64).reshape(-1, 2)
    posed = np.isfinite(xy).all(axis=1)
    points = np.full(len(rows), None, dtype=object)
    points[posed] = shapely.points(xy[posed])
    return points


def feature_points(system: ToWgs84, features: Sequence[Feature]) -> Shapes:
    """(n,) points in `system` of features by their longitude and latitude; None without a place."""
    points = np.full(len(features), None, dtype=object)
    lon, lat = lon_lat(features)
    placed = np.isfinite(lon)
    points[placed] = shapely.points(np.column_stack(system.from_lon_lat(lon[placed], lat[placed])))
    return points


def lon_lat(features: Sequence[Feature]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """WGS 84 longitudes and latitudes, (n,) degrees each; NaN without a place."""
    places = [
        each["geometry"]["coordinates"][:2] if each["geometry"] else (np.nan, np.nan)
        for each in features
    ]
    lon, lat = np.array(places, np.float64).reshape(-1, 2).T
    return lon, lat
