"""What a camera looked at and how sure a place is, as outlines on the ground.

They are drawn with geodesics on the WGS 84 ellipsoid from true north and only then taken into
the survey's system, so that they are right whatever its unit, its scale and its grid north.
"""

import numpy as np
import pyproj
from numpy.typing import ArrayLike, NDArray

from geo.antimeridian import Shapes, placed_polygons
from geo.crs import ToWgs84

ASSUMED_HFOV_DEG = 30.0
"""How wide a view is drawn when its angle is not known: narrow, an arrow rather than a view."""
_ARC_STEPS = 24
_CIRCLE_STEPS = 72
_GEOD = pyproj.Geod(ellps="WGS84")


def view_wedges(
    system: ToWgs84,
    lon_deg: ArrayLike,
    lat_deg: ArrayLike,
    heading_deg: ArrayLike,
    hfov_deg: ArrayLike,
    range_m: float,
) -> Shapes:
    """The ground within the horizontal angle of view and `range_m` metres of each camera.

    Parameters
    ----------
    system : what the outlines are wanted in.
    lon_deg, lat_deg : (n,) WGS 84 degrees of the cameras.
    heading_deg : (n,) degrees clockwise from true north, of the optical axis.
    hfov_deg : (n,) degrees, above 0; a whole turn (a panorama) or more is drawn as a circle.

    Returns
    -------
    (n,) shapely multipolygons in `system`, in two parts where longitude 180 tears it there.

    Raises
    ------
    UnknownCrs : a point has no position in `system`.
    """
    lon, lat, heading, hfov = (
        np.asarray(each, np.float64) for each in (lon_deg, lat_deg, heading_deg, hfov_deg)
    )
    shapes = np.empty(len(lon), dtype=object)
    around = hfov >= 360.0
    shapes[around] = circles(system, lon[around], lat[around], np.full(int(around.sum()), range_m))
    lon, lat, heading, hfov = (each[~around] for each in (lon, lat, heading, hfov))
    azimuth = heading[:, None] + hfov[:, None] * np.linspace(0.5, -0.5, _ARC_STEPS + 1)
    arc_lon, arc_lat = _forward(lon, lat, azimuth, np.full(len(lon), range_m))
    shapes[~around] = placed_polygons(
        system, np.column_stack([lon, arc_lon]), np.column_stack([lat, arc_lat])
    )
    return shapes


def circles(system: ToWgs84, lon_deg: ArrayLike, lat_deg: ArrayLike, radius_m: ArrayLike) -> Shapes:
    """The ground within (n,) `radius_m` metres of each point; all else as `view_wedges`."""
    lon, lat, radius = (np.asarray(each, np.float64) for each in (lon_deg, lat_deg, radius_m))
    azimuth = np.linspace(360.0, 0.0, _CIRCLE_STEPS, endpoint=False)
    ring_lon, ring_lat = _forward(lon, lat, np.tile(azimuth, (len(lon), 1)), radius)
    return placed_polygons(system, ring_lon, ring_lat)


def _forward(
    lon_deg: NDArray[np.float64],
    lat_deg: NDArray[np.float64],
    azimuth_deg: NDArray[np.float64],
    distance_m: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Longitudes and latitudes, (n, m) each, where geodesics of (n, m) azimuths end."""
    shape = azimuth_deg.shape
    lon, lat, distance = (
        np.broadcast_to(each[:, None], shape).ravel() for each in (lon_deg, lat_deg, distance_m)
    )
    end_lon, end_lat, _ = _GEOD.fwd(lon, lat, azimuth_deg.ravel(), distance)
    return np.asarray(end_lon).reshape(shape), np.asarray(end_lat).reshape(shape)
