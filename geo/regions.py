"""Regions of the Earth: a box or polygons in WGS 84, and which places lie in them.

An edge is straight in longitude and latitude (RFC 7946, section 3.1.1), and places on it belong
to the region.
"""

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from pyproj.transformer import AreaOfInterest
from shapely.affinity import translate
from shapely.geometry.base import BaseGeometry

from contracts.errors import BadConfig
from geo.crs import ToWgs84

MAX_VERTICES = 10_000
"""A polygon travels with every photo that is searched for."""

_TURNS = (-360.0, 0.0, 360.0)
_WIDER_DEG = 0.02
"""By how much is looked around: areas leave out the datum, and edges bend in a projection."""
_STEP_DEG = 0.05
"""Along an edge, which then lies at most 0.3 m beside its chords."""


@dataclass(frozen=True, slots=True)
class Rectangle:
    """A part of a survey's grid, in the axis unit of its system."""

    x: tuple[float, float]
    y: tuple[float, float]

    def holds(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which points lie in it, (n,) bool; NaN never does."""
        in_x, in_y = (self.x[0] <= x) & (x <= self.x[1]), (self.y[0] <= y) & (y <= self.y[1])
        return np.asarray(in_x & in_y, np.bool_)


EVERYWHERE = Rectangle((-np.inf, np.inf), (-np.inf, np.inf))


def box_region(west: float, south: float, east: float, north: float) -> BaseGeometry:
    """The box between meridians and parallels, degrees; west may lie east of east, across 180."""
    return shapely.box(west, south, east if west <= east else east + 360.0, north)


def polygon_region(wkt: str) -> BaseGeometry:
    """The polygon or polygons that a WKT text in longitude and latitude describes.

    Raises
    ------
    BadConfig : no WKT, no polygon, an empty or invalid one, or one of too many vertices.
    """
    try:
        region = shapely.from_wkt(wkt)
    except shapely.errors.GEOSException as error:
        raise BadConfig(f"the polygon {wkt[:40]!r} is no WKT ({error})") from error
    if region.geom_type not in {"Polygon", "MultiPolygon"} or region.is_empty:
        raise BadConfig(f"the region is {wkt[:40]!r}; expected a polygon with an area")
    n_vertices = int(shapely.get_num_coordinates(region))
    if n_vertices > MAX_VERTICES:
        raise BadConfig(
            f"the polygon has {n_vertices:,} vertices, at most {MAX_VERTICES:,} are taken; "
            "simplify it first"
        )
    if not shapely.is_valid(region):
        raise BadConfig(f"the polygon does not hold: {shapely.is_valid_reason(region)}")
    return region


def places_within(
    region: BaseGeometry, lon_deg: NDArray[np.float64], lat_deg: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Which places lie in a region or on its edge, (n,) bool.

    Parameters
    ----------
    region : its longitudes may run past 180; a place is in it by whichever turn it is written.
    lon_deg, lat_deg : (n,) WGS 84; NaN is in no region.
    """
    shapely.prepare(region)
    west, south, east, north = region.bounds
    within = np.zeros(len(lon_deg), dtype=np.bool_)
    for turn in _TURNS:
        turned = lon_deg + turn
        near = np.flatnonzero(
            (west <= turned) & (turned <= east) & (south <= lat_deg) & (lat_deg <= north)
        )
        within[near] |= shapely.intersects_xy(region, turned[near], lat_deg[near])
    return within


def rectangle_around(
    region: BaseGeometry, system: ToWgs84, area: AreaOfInterest
) -> Rectangle | None:
    """A part of a survey's grid outside which none of its images is in a region.

    So that of a large survey only the images nearby must be converted. None: the region lies
    outside the survey's area.

    Parameters
    ----------
    area : where the survey's images are, WGS 84; west > east across 180.

    Raises
    ------
    UnknownCrs : the area has no place in the survey's system.
    """
    turn = 360.0 if area.east_lon_degree < area.west_lon_degree else 0.0
    around = _widened_box(
        area.west_lon_degree,
        area.south_lat_degree,
        area.east_lon_degree + turn,
        area.north_lat_degree,
    )
    turned = [translate(region, xoff=turn) for turn in _TURNS]
    shared = shapely.intersection(turned, around)
    bounds = shapely.total_bounds(shared).tolist()
    if not np.isfinite(bounds).all():
        return None
    if system.crs.is_geographic or not -180.0 < bounds[0] <= bounds[2] < 180.0:
        return EVERYWHERE  # cheap to convert, or perhaps in two pieces
    outline = shapely.segmentize(_widened_box(*bounds), _STEP_DEG)
    x, y = system.from_lon_lat(*shapely.get_coordinates(outline).T)
    return Rectangle((float(x.min()), float(x.max())), (float(y.min()), float(y.max())))


def _widened_box(west: float, south: float, east: float, north: float) -> BaseGeometry:
    south, north = max(south - _WIDER_DEG, -90.0), min(north + _WIDER_DEG, 90.0)
    return shapely.box(west - _WIDER_DEG, south, east + _WIDER_DEG, north)
