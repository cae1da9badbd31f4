"""The outline of a region, read from any vector file: GeoJSON, GeoPackage, Shapefile, …"""

import warnings
from pathlib import Path

import numpy as np
import pyogrio
import shapely
from numpy.typing import NDArray
from pyogrio.errors import DataLayerError, DataSourceError
from shapely.geometry.base import BaseGeometry

from contracts.errors import BadConfig
from geo.crs import ToWgs84
from geo.regions import MAX_VERTICES

GRID_DEG = 1e-7
"""A centimetre, to which the outline is rounded: it travels as text with every photo."""
_STEP_M = 1000.0
"""Along an edge of a projected file, which then lies at most 2 cm beside its chords."""
_MOST_STEPS = MAX_VERTICES // 4


def read_outline(path: Path) -> str:
    """The union of a file's polygons, as WKT in WGS 84 longitude and latitude.

    A file says its own system; GeoJSON without a `crs` member is WGS 84. Heights are left out. A
    ring that crosses itself is mended where it is clear what it encloses.

    Raises
    ------
    BadConfig : not a readable vector file, of several layers, without a coordinate system, empty,
        of anything but polygons, unclear, or of more than 10,000 vertices.
    UnknownCrs : its system cannot be converted, or its coordinates do not belong to it.
    """
    shapes, crs = _read(path)
    kinds = sorted({str(shape.geom_type) for shape in shapes if shape is not None})
    if not kinds:
        raise BadConfig(f"{path} holds no geometry; expected polygons")
    if not set(kinds) <= {"Polygon", "MultiPolygon"}:
        raise BadConfig(f"{path} holds {' and '.join(kinds)}; expected polygons alone")
    if crs is None:
        raise BadConfig(f"{path} does not say its coordinate system; save it with one")
    rings = shapely.get_parts([shape for shape in shapes if shape is not None])
    plane = shapely.union_all([_mended(path, each) for each in rings])
    region = shapely.set_precision(_in_degrees(path, plane, crs), GRID_DEG)
    if region.is_empty:
        raise BadConfig(f"{path} encloses nothing; expected polygons with an area")
    n_vertices = int(shapely.get_num_coordinates(region))
    if n_vertices > MAX_VERTICES:
        raise BadConfig(
            f"{path} has {n_vertices:,} vertices, at most {MAX_VERTICES:,} are taken; simplify it "
            "first, such as by QGIS: Vector, Geometry Tools, Simplify"
        )
    return str(shapely.to_wkt(region, rounding_precision=7))


def _read(path: Path) -> tuple[NDArray[np.object_], str | None]:
    """The shapes of the one layer that has any, and its coordinate system."""
    if not path.exists():
        raise BadConfig(f"{path} does not exist; name a file with polygons")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what GDAL mends itself
            layers = [str(name) for name, kind in pyogrio.list_layers(path) if kind is not None]
            if len(layers) != 1:
                found = ", ".join(layers) or "none"
                raise BadConfig(f"{path} has these layers: {found}; expected one, of polygons")
            meta, _, geometry, _ = pyogrio.raw.read(
                path, layer=layers[0], columns=[], force_2d=True
            )
        return np.asarray(shapely.from_wkb(geometry), dtype=object), meta["crs"]
    except (DataSourceError, DataLayerError, shapely.GEOSException, OSError) as error:
        why = str(error).partition("; It might help")[0].strip(" .")
        raise BadConfig(
            f"{path} cannot be read as a vector file ({why}); expected polygons, such as GeoJSON"
        ) from error


def _mended(path: Path, shape: BaseGeometry) -> BaseGeometry:
    """A valid polygon; refused where two ways of mending it do not enclose the same."""
    if shapely.is_valid(shape):
        return shape
    by_lines = _polygons(shapely.make_valid(shape, method="linework"))
    by_rings = _polygons(shapely.make_valid(shape, method="structure", keep_collapsed=False))
    differing = shapely.symmetric_difference(by_lines, by_rings).area
    if differing > 1e-6 * by_lines.area:
        raise BadConfig(
            f"{path}: a polygon crosses itself so that its inside is unclear "
            f"({shapely.is_valid_reason(shape)}); mend it, such as by QGIS: Fix Geometries"
        )
    return by_lines


def _polygons(shape: BaseGeometry) -> BaseGeometry:
    parts = shapely.get_parts(shapely.get_parts(shape))
    return shapely.union_all(parts[shapely.get_dimensions(parts) == 2])


def _in_degrees(path: Path, shape: BaseGeometry, crs: str) -> BaseGeometry:
    """In WGS 84; the edges of a projected shape are bent as the projection bends them."""
    x, y = shapely.get_coordinates(shape).T
    if not len(x):
        return shape
    system = ToWgs84.over(crs, x, y)
    if not system.crs.is_geographic:
        unit_m = system.crs.axis_info[0].unit_conversion_factor
        shape = shapely.segmentize(shape, max(_STEP_M / unit_m, shape.length / _MOST_STEPS))
    elif np.abs(x).max() > 360.0 or np.abs(y).max() > 90.0:
        raise BadConfig(
            f"{path} holds x {x[0]:g}, y {y[0]:g} as degrees; they must be of another coordinate "
            "system: save the file with that, or as WGS 84"
        )
    parts = [
        shapely.transform(part, lambda xy: np.column_stack(_unbroken(system, *xy.T)))
        for part in shapely.get_parts(shape)
    ]
    return shapely.union_all(parts)


def _unbroken(
    system: ToWgs84, x: NDArray[np.float64], y: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Longitudes, which run on past 180 where the shape does, and latitudes."""
    lon, lat = system.lon_lat(x, y)
    if system.crs.is_geographic:
        return lon + 360.0 * np.round((x - lon) / 360.0), lat
    leaps = np.abs(np.diff(lon)) > 180.0
    return np.where(leaps.any() & (lon < 0.0), lon + 360.0, lon), lat
