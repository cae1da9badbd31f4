import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyproj import CRS, Geod, Transformer
from pyproj.transformer import AreaOfInterest

from geo.crs import ToWgs84, grid_of

# Systems on WGS 84 or so near it that its geodesics serve as an oracle: metres, feet, degrees,
# Web Mercator, poles, longitude 180, axes north-east and towards the pole.
PLACES = [
    pytest.param("EPSG:2154", 2.35, 48.85, id="Lambert-93"),
    pytest.param("EPSG:3949", 7.0, 48.6, id="CC49"),
    pytest.param("EPSG:2193", 174.8, -41.3, id="New Zealand, northing first"),
    pytest.param("EPSG:2263", -73.97, 40.78, id="US feet"),
    pytest.param("EPSG:3857", 10.75, 59.91, id="Web Mercator, a metre is two"),
    pytest.param("EPSG:3857", 179.9999999, -16.8, id="Web Mercator beside 180"),
    pytest.param("EPSG:3832", -179.9999999, -16.8, id="Pacific Mercator beside 180"),
    pytest.param("EPSG:32701", 180.0, -16.8, id="UTM at 180"),
    pytest.param("EPSG:3413", 120.0, 89.99, id="near the north pole"),
    pytest.param("EPSG:3031", -60.0, -89.99, id="near the south pole"),
    pytest.param("EPSG:4326", 2.35, 48.85, id="degrees, latitude first"),
    pytest.param("EPSG:4326", 180.0, 60.0, id="degrees at 180"),
    pytest.param("EPSG:3035", 5.0, 50.0, id="equal area, not conformal"),
    pytest.param("EPSG:2049", 20.5, -30.0, id="westing and southing"),
]
GRS80 = Geod(ellps="GRS80")


def xy_of(crs: str, lon: float, lat: float) -> tuple[np.ndarray, np.ndarray]:
    """By PROJ without its datum: the place on the system's own ellipsoid."""
    to_crs = Transformer.from_crs(CRS(crs).geodetic_crs, crs, always_xy=True)
    x, y = to_crs.transform(lon, lat)
    return np.array([x]), np.array([y])


@pytest.mark.parametrize(("crs", "lon", "lat"), PLACES)
def test_a_lever_arm_is_as_long_and_turned_on_the_ground_as_was_said(
    crs: str, lon: float, lat: float
) -> None:
    x, y = xy_of(crs, lon, lat)
    grid = grid_of(crs)
    there = grid.moved(x, y, np.array([3.0]), np.array([-4.0]))
    lons, lats = grid.degrees(np.append(x, there[0]), np.append(y, there[1]))
    bearing, _, length = GRS80.inv(lons[0], lats[0], lons[1], lats[1])
    assert length == pytest.approx(5.0, abs=1e-3)
    turn = (bearing - math.degrees(math.atan2(3.0, -4.0)) + 180) % 360 - 180
    assert turn == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize(("crs", "lon", "lat"), PLACES)
def test_true_heading_is_grid_heading_plus_convergence_wherever_the_axes_point(
    crs: str, lon: float, lat: float
) -> None:
    if CRS(crs).is_geographic:
        return
    x, y = xy_of(crs, lon, lat)
    ahead_lon, ahead_lat, _ = GRS80.fwd(lon, lat, -33.0, 1.0)
    ahead_x, ahead_y = xy_of(crs, ahead_lon, ahead_lat)
    step_east, step_north = ahead_x - x, ahead_y - y
    if crs == "EPSG:2049":  # x is westing, y is southing
        step_east, step_north = -step_east, -step_north
    heading_grid = math.degrees(math.atan2(step_east[0], step_north[0]))
    found = heading_grid + ToWgs84(crs).convergence_deg(x, y)[0]
    # Exact on the meridian; a projection that is not conformal bends the other directions.
    bent = {"EPSG:3857": 0.2, "EPSG:3035": 0.5}.get(crs, 2e-3)
    assert (found + 33.0 + 180) % 360 - 180 == pytest.approx(0.0, abs=bent)


def test_krovak_has_one_convergence_in_both_its_orders_of_axes() -> None:
    south_west = ToWgs84("EPSG:5513").convergence_deg([1050538.64], [568991.00])
    east_north = ToWgs84("EPSG:5514").convergence_deg([-568991.00], [-1050538.64])
    assert south_west[0] == pytest.approx(east_north[0], abs=1e-6)
    # Krovak's own rule of thumb: C = 0.008257 Y + 2.373 Y / X, in kilometres and degrees.
    rule = 0.008257 * 568.991 + 2.373 * 568.991 / 1050.539
    assert -east_north[0] == pytest.approx(rule, abs=0.02)


def test_convergence_at_the_pole_is_known_and_finite() -> None:
    for crs in ("EPSG:3413", "EPSG:3031", "EPSG:5041"):
        x, y = xy_of(crs, 0.0, -90.0 if crs == "EPSG:3031" else 90.0)
        assert np.isfinite(ToWgs84(crs).convergence_deg(x, y)).all()


def test_feet_and_metres_are_told_apart() -> None:
    x, y = xy_of("EPSG:2263", -73.97, 40.78)
    there = grid_of("EPSG:2263").moved(x, y, np.array([0.3048006096]), np.array([0.0]))
    assert math.hypot(there[0][0] - x[0], there[1][0] - y[0]) == pytest.approx(1.0, abs=1e-4)


def test_grads_from_paris_are_moved_too() -> None:
    there = grid_of("EPSG:4807").moved(np.zeros(1), np.array([54.0]), np.zeros(1), np.array([10.0]))
    metres_a_grad = 100_000.0  # to a thousandth: what the metre was made for
    assert (there[1][0] - 54.0) * metres_a_grad == pytest.approx(10.0, rel=2e-3)


def test_what_has_no_place_moves_nowhere() -> None:
    grid = grid_of("EPSG:2154")
    one = np.ones(2)
    x, y = grid.moved(np.array([np.nan, 652e3]), np.array([6.861e6] * 2), one, one)
    assert np.isnan([x[0], y[0]]).all()
    assert np.isfinite([x[1], y[1]]).all()


ROUND_TRIPS = {
    "EPSG:2154": (-4.0, 8.0, 42.0, 51.0),
    "EPSG:27572": (-4.0, 8.0, 42.5, 51.0),
    "EPSG:27700": (-6.0, 1.5, 50.0, 58.5),
    "EPSG:31467": (7.6, 10.4, 47.4, 55.0),
    "EPSG:2056": (6.0, 10.4, 45.9, 47.8),
    "EPSG:2193": (167.0, 178.5, -47.0, -34.5),
    "EPSG:2263": (-74.2, -72.0, 40.5, 41.2),
    "EPSG:3857": (-180.0, 180.0, -85.0, 85.0),
    "EPSG:3413": (-180.0, 180.0, 60.0, 90.0),
    "EPSG:3031": (-180.0, 180.0, -90.0, -60.0),
    "EPSG:32760": (174.1, 179.9, -79.0, -1.0),
    "EPSG:4258": (-10.0, 30.0, 35.0, 70.0),
    "EPSG:4807": (-4.0, 8.0, 42.5, 51.0),
    "EPSG:5514": (12.2, 22.4, 47.9, 51.0),
}


@given(st.sampled_from(sorted(ROUND_TRIPS)), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_every_place_comes_back_from_every_system(crs: str, east: float, north: float) -> None:
    west_deg, east_deg, south_deg, north_deg = ROUND_TRIPS[crs]
    lon = west_deg + east * (east_deg - west_deg)
    lat = south_deg + north * (north_deg - south_deg)
    place = ToWgs84(crs, AreaOfInterest(west_deg, south_deg, east_deg, north_deg))
    x, y = place.from_lon_lat([lon], [lat])
    back_lon, back_lat = place.lon_lat(x, y)
    assert GRS80.inv(lon, lat, back_lon[0], back_lat[0])[2] == pytest.approx(0.0, abs=0.02)
    assert abs(back_lon[0]) <= 180.0
