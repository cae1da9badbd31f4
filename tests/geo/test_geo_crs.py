import math

import numpy as np
import pytest
from pyproj import Geod

from contracts.errors import UnknownCrs
from geo.crs import ToWgs84, parse_crs

ONE_CM_LON = 1.3e-7  # degrees, at the latitude of Paris
ONE_CM_LAT = 0.9e-7


def degrees(whole: int, minutes: int, seconds: float) -> float:
    return whole + minutes / 60 + seconds / 3600


# Two sites of the French geodetic network, RGF93, as printed on IGN's data sheets
# geodesie.ign.fr/fiches/pdf/7505601.pdf (Paris I, point d) and 7505602.pdf (Paris II, point b);
# read in open-source code that quotes the sheets, not on the sheets themselves.
IGN_SITES = [
    pytest.param(
        (658557.55, 6860084.00),
        (degrees(2, 26, 7.3236), degrees(48, 50, 22.1016)),
        id="Paris I d",
    ),
    pytest.param(
        (649583.441, 6862707.173),
        (degrees(2, 18, 46.06062), degrees(48, 51, 44.72301)),
        id="Paris II b",
    ),
    # The definition of Lambert-93: its false origin.
    pytest.param((700000.0, 6600000.0), (3.0, 46.5), id="origin"),
]


@pytest.mark.parametrize(("grid", "lon_lat"), IGN_SITES)
def test_lambert_93_agrees_with_ign_published_points_to_the_centimetre(
    grid: tuple[float, float], lon_lat: tuple[float, float]
) -> None:
    lon, lat = ToWgs84("EPSG:2154").lon_lat([grid[0]], [grid[1]])
    assert lon[0] == pytest.approx(lon_lat[0], abs=ONE_CM_LON)
    assert lat[0] == pytest.approx(lon_lat[1], abs=ONE_CM_LAT)
    easting, northing = ToWgs84("EPSG:2154").from_lon_lat([lon_lat[0]], [lon_lat[1]])
    assert easting[0] == pytest.approx(grid[0], abs=0.01)
    assert northing[0] == pytest.approx(grid[1], abs=0.01)


class Lambert:
    """IGN's own formulae, note technique NT/G 71, algorithms ALG0001 and ALG0003."""

    def __init__(self, e: float, n: float, c: float, lon0: float, xs: float, ys: float) -> None:
        self.e, self.n, self.c, self.lon0, self.xs, self.ys = e, n, c, lon0, xs, ys

    def project(self, lon: float, lat: float) -> tuple[float, float]:
        es = self.e * math.sin(lat)
        isometric = math.log(
            math.tan(math.pi / 4 + lat / 2) * ((1 - es) / (1 + es)) ** (self.e / 2)
        )
        r = self.c * math.exp(-self.n * isometric)
        angle = self.n * (lon - self.lon0)
        return self.xs + r * math.sin(angle), self.ys - r * math.cos(angle)

    def convergence_deg(self, lon: float) -> float:
        return math.degrees(self.n * (lon - self.lon0))


# The constants IGN publishes for Lambert-93 on the GRS 80 ellipsoid.
LAMBERT_93 = Lambert(
    e=math.sqrt(2 / 298.257222101 - 1 / 298.257222101**2),
    n=0.7256077650532670,
    c=11754255.426096,
    lon0=math.radians(3),
    xs=700000.0,
    ys=12655612.049876,
)


def test_the_oracle_repeats_the_worked_example_of_nt_g_71() -> None:
    # ALG0003, "jeu d'essai": Lambert zone I on Clarke 1880 IGN.
    zone = Lambert(0.0824832568, 0.760405966, 11603796.9767, 0.04079234433, 600000, 5657616.674)
    assert zone.project(0.145512099, 0.872664626) == pytest.approx(
        (1029705.0818, 272723.8510), abs=1e-4
    )


def test_lambert_93_agrees_with_ign_formulae_all_over_france() -> None:
    lons, lats = (a.ravel() for a in np.meshgrid(np.linspace(-5, 9, 15), np.linspace(41, 51, 11)))
    easting, northing = ToWgs84("EPSG:2154").from_lon_lat(lons, lats)
    expected = np.array(
        [
            LAMBERT_93.project(math.radians(lon), math.radians(lat))
            for lon, lat in zip(lons, lats, strict=True)
        ]
    )
    np.testing.assert_allclose(np.column_stack([easting, northing]), expected, rtol=0, atol=1e-4)
    back_lon, back_lat = ToWgs84("EPSG:2154").lon_lat(easting, northing)
    np.testing.assert_allclose(back_lon, lons, rtol=0, atol=1e-9)
    np.testing.assert_allclose(back_lat, lats, rtol=0, atol=1e-9)


def test_ntf_paris_in_grads_agrees_with_ign_circe() -> None:
    # IGN's program Circé: NTF (Paris) 0 gr, 50 gr -> WGS 84, shift (-168, -60, 320); as quoted
    # by CirceMetropoleComplianceTest of orbisgis/cts.
    lon, lat = ToWgs84("EPSG:4807").lon_lat([0.0], [50.0])
    assert lon[0] == pytest.approx(2.33655573, abs=ONE_CM_LON)
    assert lat[0] == pytest.approx(44.99997468, abs=ONE_CM_LAT)


def test_lambert_93_convergence_is_negative_west_of_its_meridian() -> None:
    paris, strasbourg = (2.35, 48.85), (7.75, 48.58)
    for lon, lat in (paris, strasbourg):
        easting, northing = ToWgs84("EPSG:2154").from_lon_lat([lon], [lat])
        found = ToWgs84("EPSG:2154").convergence_deg(easting, northing)[0]
        assert found == pytest.approx(LAMBERT_93.convergence_deg(math.radians(lon)), abs=1e-6)
    assert ToWgs84("EPSG:2154").convergence_deg([652301.565], [6861302.726])[0] == pytest.approx(
        -0.4716, abs=1e-4
    )


@pytest.mark.parametrize(
    ("crs", "lon", "lat"),
    [
        ("EPSG:2154", 2.35, 48.85),
        ("EPSG:27572", 2.35, 48.85),  # its longitudes start in Paris
        ("EPSG:32631", 5.5, 43.3),
        ("EPSG:32756", 151.2, -33.9),
        ("EPSG:2056", 8.5, 47.4),
        ("EPSG:2263", -74.2, 40.7),  # its unit is the US foot
        ("EPSG:3413", 10.0, 75.0),
    ],
)
def test_true_heading_is_grid_heading_plus_convergence(crs: str, lon: float, lat: float) -> None:
    heading_true = 33.0
    ahead = Geod(ellps="WGS84").fwd(lon, lat, heading_true, 10.0)
    easting, northing = ToWgs84(crs).from_lon_lat([lon, ahead[0]], [lat, ahead[1]])
    heading_grid = math.degrees(math.atan2(np.diff(easting)[0], np.diff(northing)[0]))
    convergence = ToWgs84(crs).convergence_deg(easting, northing)[0]
    turn = (heading_grid + convergence - heading_true + 180) % 360 - 180
    assert turn == pytest.approx(0.0, abs=2e-3)  # NTF's ellipsoid is turned a little


def test_a_geographic_system_has_no_convergence() -> None:
    assert ToWgs84("EPSG:4326").convergence_deg([2.35, 7.0], [48.85, 47.0]).tolist() == [0.0, 0.0]


def test_easting_comes_before_northing_whatever_the_authority_prints() -> None:
    lon, lat = ToWgs84("EPSG:4326").lon_lat([2.35], [48.85])
    assert (lon[0], lat[0]) == (2.35, 48.85)


def test_longitudes_stay_within_180() -> None:
    lon, _ = ToWgs84("EPSG:4326").lon_lat([190.0, -180.0, 180.0, -200.0], [0.0] * 4)
    assert lon.tolist() == [-170.0, -180.0, 180.0, 160.0]


def test_of_a_compound_system_the_horizontal_part_counts() -> None:
    assert parse_crs("EPSG:2154+5720").equals(parse_crs("EPSG:2154"))
    assert parse_crs("EPSG:4979").equals(parse_crs("EPSG:4326"))


def test_a_bound_system_keeps_its_own_shift() -> None:
    text = "+proj=longlat +a=6378249.2 +b=6356515 +towgs84=-168,-60,320 +no_defs"
    lon, lat = ToWgs84(text).lon_lat([2.5], [45.0])
    expected = ToWgs84("EPSG:4275").lon_lat([2.5], [45.0])  # NTF, the same shift by its code
    assert (lon[0], lat[0]) == pytest.approx((expected[0][0], expected[1][0]), abs=1e-9)
    assert abs(lon[0] - 2.5) > 1e-4


@pytest.mark.parametrize(
    "text",
    [
        "EPSG:999999",
        "",
        "nowhere",
        "EPSG:5720",  # a height
        "EPSG:4978",  # geocentric
        'LOCAL_CS["site",UNIT["metre",1]]',
    ],
)
def test_what_gives_no_position_on_the_earth_is_refused_by_name(text: str) -> None:
    with pytest.raises(UnknownCrs, match="EPSG:2154") as caught:
        parse_crs(text)
    assert repr(text) in str(caught.value)


def test_a_ballpark_conversion_is_refused() -> None:
    # An ellipsoid alone says nothing of where its centre is.
    nameless = "+proj=lcc +lat_0=46.5 +lon_0=3 +lat_1=49 +lat_2=44 +ellps=intl +units=m"
    with pytest.raises(UnknownCrs, match="ballpark"):
        ToWgs84(nameless)


@pytest.mark.parametrize("easting", [math.nan, math.inf])
def test_a_point_without_position_is_refused_by_number(easting: float) -> None:
    with pytest.raises(UnknownCrs, match="number 1"):
        ToWgs84("EPSG:2154").lon_lat([652000.0, easting], [6861000.0, 6861000.0])
    with pytest.raises(UnknownCrs, match="number 0"):
        ToWgs84("EPSG:4326").lon_lat([2.0], [95.0])


def test_a_better_grid_that_is_missing_is_named() -> None:
    assert ToWgs84("EPSG:2154").missing_grids == ()
    missing = ToWgs84("EPSG:27700").missing_grids
    assert not missing or missing == ("uk_os_OSTN15_NTv2_OSGBtoETRS.tif",)


def test_no_points_are_no_error() -> None:
    lon, lat = ToWgs84("EPSG:2154").lon_lat([], [])
    assert lon.shape == lat.shape == (0,)
    assert ToWgs84("EPSG:2154").convergence_deg([], []).shape == (0,)
