"""Shapes from WGS 84 into a survey's system, in two pieces where longitude 180 tears them."""

from collections.abc import Callable

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.affinity import translate
from shapely.geometry.base import BaseGeometry

from geo.crs import ToWgs84

# Clipped a centimetre short of the meridian: its own points belong to both sides, and PROJ would
# put them on either.
_EDGE_DEG = 180.0 - 1e-7
_BESIDE_DEG = 180.0 - 1e-6
_TORN_FROM = 1000.0

Shapes = NDArray[np.object_]
Build = Callable[[NDArray[np.float64]], Shapes]


def placed_polygons(
    system: ToWgs84, lon_deg: NDArray[np.float64], lat_deg: NDArray[np.float64]
) -> Shapes:
    """Multipolygons in `system`, (n,) shapely, of WGS 84 rings.

    Parameters
    ----------
    lon_deg, lat_deg : (n, m) float64, one ring a row; none is as wide as half the Earth.

    Raises
    ------
    UnknownCrs : a point has no position in `system`.
    """
    return _placed(system, lon_deg, lat_deg, shapely.polygons, shapely.multipolygons)


def placed_lines(
    system: ToWgs84, lon_deg: NDArray[np.float64], lat_deg: NDArray[np.float64]
) -> Shapes:
    """Multilinestrings in `system`, (n,) shapely, of WGS 84 lines (n, m); else as polygons."""
    return _placed(system, lon_deg, lat_deg, shapely.linestrings, shapely.multilinestrings)


def _placed(
    system: ToWgs84,
    lon_deg: NDArray[np.float64],
    lat_deg: NDArray[np.float64],
    build: Build,
    gather: Callable[..., Shapes],
) -> Shapes:
    shapes = np.empty(len(lon_deg), dtype=object)
    if not len(shapes):
        return shapes
    first = lon_deg[:, :1]
    unbroken = first + (lon_deg - first + 180.0) % 360.0 - 180.0
    torn = np.zeros(len(shapes), dtype=bool)
    for row in np.flatnonzero((np.abs(unbroken) > 180.0).any(axis=1)):
        torn[row] = _is_torn(system, float(lat_deg[row, 0]))
    whole = np.flatnonzero(~torn)
    x, y = system.from_lon_lat(lon_deg[whole].ravel(), lat_deg[whole].ravel())
    simple = build(np.stack([x, y], axis=-1).reshape(len(whole), lon_deg.shape[1], 2))
    shapes[whole] = gather(simple, indices=np.arange(len(whole)))
    for row in np.flatnonzero(torn):
        pieces = _split(build(np.stack([unbroken[row], lat_deg[row]], axis=-1)[None])[0])
        shapes[row] = gather([_in_system(system, piece) for piece in pieces])
    return shapes


def _is_torn(system: ToWgs84, lat_deg: float) -> bool:
    """Whether the two sides of longitude 180 lie far apart in this system."""
    x, y = system.from_lon_lat([_BESIDE_DEG, -_BESIDE_DEG], [lat_deg, lat_deg])
    apart = float(np.hypot(x[1] - x[0], y[1] - y[0]))
    return system.crs.is_geographic or apart > _TORN_FROM


def _split(shape: BaseGeometry) -> list[BaseGeometry]:
    """The parts within [-180, 180] degrees of a shape whose longitudes run past them."""
    parts: list[BaseGeometry] = []
    for turn in (-360.0, 0.0, 360.0):
        window = shapely.box(-_EDGE_DEG - turn, -90.0, _EDGE_DEG - turn, 90.0)
        inside = translate(shapely.intersection(shape, window), xoff=turn)
        parts += [
            part
            for part in shapely.get_parts(inside)
            if not part.is_empty and shapely.get_dimensions(part) == shapely.get_dimensions(shape)
        ]
    return parts


def _in_system(system: ToWgs84, shape: BaseGeometry) -> BaseGeometry:
    return shapely.transform(
        shape, lambda lon_lat: np.column_stack(system.from_lon_lat(*lon_lat.T))
    )
