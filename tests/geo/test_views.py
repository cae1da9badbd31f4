"""Views and circles on the ground, held against a flat frame in metres and against areas."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from geo.antimeridian import placed_lines
from geo.crs import ToWgs84
from geo.frames import LocalMetres
from geo.views import circles, view_wedges

WGS84 = ToWgs84("EPSG:4326")
LAMBERT_93 = ToWgs84("EPSG:2154")
BREST = (-4.4861, 48.3904)


def bearings_and_distances(
    shape: shapely.MultiPolygon, lon: float, lat: float
) -> tuple[np.ndarray, np.ndarray]:
    """Of every vertex but the camera's, degrees from north and metres."""
    x, y = LocalMetres(lon, lat).from_lon_lat(*shapely.get_coordinates(shape).T)
    distances = np.hypot(x, y)
    away = distances > 1e-3
    return np.degrees(np.arctan2(x[away], y[away])) % 360, distances[away]


@given(
    lon=st.floats(-179, 179),
    lat=st.floats(-85, 85),
    heading=st.floats(-720, 720),
    hfov=st.floats(1, 350),
)
def test_a_wedge_spans_its_angle_about_its_heading(
    lon: float, lat: float, heading: float, hfov: float
) -> None:
    wedge = view_wedges(WGS84, [lon], [lat], [heading], [hfov], 40.0)[0]
    bearings, distances = bearings_and_distances(wedge, lon, lat)
    off = (bearings - heading + 180) % 360 - 180
    assert off.min() == pytest.approx(-hfov / 2, abs=0.01)
    assert off.max() == pytest.approx(hfov / 2, abs=0.01)
    assert distances == pytest.approx(np.full(len(distances), 40.0), abs=1e-3)


def test_a_wedge_is_turned_from_true_to_grid_north() -> None:
    easting, northing = LAMBERT_93.from_lon_lat([BREST[0]], [BREST[1]])
    wedge = view_wedges(LAMBERT_93, [BREST[0]], [BREST[1]], [0.0], [60.0], 40.0)[0]
    middle = wedge.centroid
    grid = math.degrees(math.atan2(middle.x - easting[0], middle.y - northing[0]))
    # Grid north lies 5.43 degrees west of true north there,
    # the sine of its cone (IGN: 0.7256077650) times the longitude from 3 E.
    assert grid == pytest.approx(0.7256077650 * (3.0 + 4.4861), abs=0.01)


def test_a_wedge_has_the_area_of_its_sector() -> None:
    wedge = view_wedges(LAMBERT_93, [2.34], [48.85], [120.0], [60.0], 40.0)[0]
    assert wedge.is_valid
    assert wedge.area == pytest.approx(math.pi * 40**2 / 6, rel=0.002)


def test_ranges_are_metres_in_a_survey_in_feet() -> None:
    new_york = ToWgs84("EPSG:2263")
    circle = circles(new_york, [-73.98], [40.75], [30.0])[0]
    west, _, east, _ = circle.bounds
    assert east - west == pytest.approx(60 / 0.3048, rel=0.001)


def test_a_panorama_looks_all_around() -> None:
    around = view_wedges(LAMBERT_93, [2.34, 2.34], [48.85, 48.85], [0.0, 0.0], [360.0, 90.0], 40.0)
    assert around[0].is_valid
    assert around[0].area == pytest.approx(4 * around[1].area, rel=0.002)
    assert around[0].contains(shapely.Point(*np.ravel(LAMBERT_93.from_lon_lat([2.34], [48.85]))))


def test_degrees_are_torn_at_longitude_180_and_cover_the_same_ground() -> None:
    fiji = (179.9999, -17.0)
    torn = view_wedges(WGS84, [fiji[0]], [fiji[1]], [90.0], [60.0], 40.0)[0]
    whole = view_wedges(WGS84, [170.0], [fiji[1]], [90.0], [60.0], 40.0)[0]
    assert len(torn.geoms) == 2
    assert torn.is_valid
    assert torn.area == pytest.approx(whole.area, rel=0.01)
    for part in torn.geoms:
        west, _, east, _ = part.bounds
        assert east - west < 0.001
        assert -180 <= west <= east <= 180


def test_web_mercator_is_torn_but_a_utm_zone_is_not() -> None:
    place = ([179.9999], [-17.0])
    mercator = circles(ToWgs84("EPSG:3857"), *place, [40.0])[0]
    utm = circles(ToWgs84("EPSG:32760"), *place, [40.0])[0]
    assert len(mercator.geoms) == 2
    assert len(utm.geoms) == 1
    assert utm.area == pytest.approx(math.pi * 40**2, rel=0.01)


def test_a_line_across_longitude_180_does_not_go_around_the_earth() -> None:
    line = placed_lines(WGS84, np.array([[179.999, -179.999]]), np.array([[1.0, 1.0]]))[0]
    assert len(line.geoms) == 2
    assert line.length == pytest.approx(0.002, abs=1e-5)


def test_a_camera_near_the_pole_has_a_view() -> None:
    stereographic = ToWgs84("EPSG:3031")
    wedge = view_wedges(stereographic, [12.0], [-89.9999], [0.0], [60.0], 40.0)[0]
    assert wedge.is_valid
    # The scale of this system at the pole is 0.9728.
    assert wedge.area == pytest.approx(math.pi * 40**2 / 6 * 0.9728**2, rel=0.01)


def test_no_cameras_have_no_views() -> None:
    assert len(view_wedges(LAMBERT_93, [], [], [], [], 40.0)) == 0
    assert len(circles(WGS84, [], [], [])) == 0
