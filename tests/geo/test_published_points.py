"""Points that surveys and standards have published, place by place.

GN 7-2: IOGP publication 373-7-2, "Coordinate Conversions and Transformations including Formulas",
whose worked examples are quoted in PROJ's test/gie/builtins.gie and more_builtins.gie and, for all
methods, in boostorg/geometry pull request 1014. GIGS: IOGP's "Geospatial Integrity of Geoscience
Software" test data, version 2.1, series 5100 (IOGP-GIGS/GIGSTestDataset). Most compare formulae
alone, geographic and projected coordinates on one datum: shift grids are not on every machine.
"""

import math

import numpy as np
import pytest
from pyproj import Geod, Transformer

from contracts.errors import UnknownCrs
from contracts.records import Pose
from geo.crs import ToWgs84, grid_of
from geo.reprojection import reproject

WGS84 = Geod(ellps="WGS84")


def dms(degrees: int, minutes: int = 0, seconds: float = 0.0) -> float:
    return degrees + minutes / 60 + seconds / 3600


# system, (x, y) as published, (longitude from Greenwich, latitude), source; to half the last digit
# that was printed, in metres on the ground.
PUBLISHED = [
    ("EPSG:24200", (255966.58, 142493.51), (-dms(76, 56, 37.26), dms(17, 55, 55.80)), 0.01,
     "GN 7-2, Lambert conic conformal 1SP, Jamaica"),
    ("EPSG:32040", (2963503.91, 254759.80), (-96.0, 28.5), 0.01,
     "GN 7-2, Lambert conic conformal 2SP, Texas South Central, US feet"),
    ("EPSG:6201", (2308335.75, 160210.48), (-dms(83, 10), 43.75), 0.01,
     "GN 7-2, Lambert conic conformal 2SP Michigan, US feet"),
    ("EPSG:31370", (251763.20, 153034.13), (dms(5, 48, 26.533), dms(50, 40, 46.461)), 0.05,
     "GN 7-2, Lambert conic conformal 2SP Belgium, printed for EPSG:31300, which this supersedes"),
    ("EPSG:31370", (189652.853, 745291.184), (5.0, 56.0), 0.03, "GIGS 5103-03"),
    ("EPSG:27700", (577274.99, 69740.50), (0.5, 50.5), 0.01,
     "GN 7-2, transverse Mercator, British National Grid"),
    ("EPSG:27700", (651409.903, 313177.270), (dms(1, 43, 4.5177), dms(52, 39, 27.2531)), 0.001,
     "Ordnance Survey, A guide to coordinate systems in Great Britain, annexe C, Caister"),
    ("EPSG:2053", (71984.49, 2847342.74), (dms(28, 16, 57.479), -dms(25, 43, 55.302)), 0.02,
     "GN 7-2, transverse Mercator south orientated, South Africa: westing, southing"),
    ("EPSG:2049", (48243.449, 3320218.65), (20.5, -30.0), 0.03,
     "GIGS 5113-03, westing, southing"),
    ("EPSG:29873", (679245.73, 596562.78), (dms(115, 48, 19.8196), dms(5, 23, 14.1129)), 0.01,
     "GN 7-2, oblique Mercator B, Timbalai, Borneo"),
    ("EPSG:30200", (66644.94, 82536.22), (-62.0, 10.0), 0.01,
     "GN 7-2, Cassini-Soldner, Trinidad, Clarke's links"),
    ("EPSG:3139", (1601528.90, 1336966.01), (dms(179, 59, 39.6115), -dms(16, 50, 29.2435)), 0.01,
     "GN 7-2, hyperbolic Cassini-Soldner, Vanua Levu, printed in chains, beside longitude 180"),
    ("EPSG:5513", (1050538.64, 568991.00), (dms(16, 50, 59.179), dms(50, 12, 32.442)), 0.02,
     "GN 7-2, Krovak, Czechia: southing, westing"),
    ("EPSG:5514", (-568991.00, -1050538.64), (dms(16, 50, 59.179), dms(50, 12, 32.442)), 0.02,
     "GN 7-2, Krovak east north"),
    ("EPSG:3035", (3962799.45, 2999718.85), (5.0, 50.0), 0.01,
     "GN 7-2, Lambert azimuthal equal area, Europe, whose authority prints northing first"),
    ("EPSG:3035", (4127824.658, 5214090.649), (5.0, 70.0), 0.05, "GIGS 5110-01"),
    ("EPSG:3002", (5009726.58, 569150.82), (120.0, -3.0), 0.01,
     "GN 7-2, Mercator A, Makassar"),
    ("EPSG:3388", (165704.29, 5171848.07), (53.0, 53.0), 0.01,
     "GN 7-2, Mercator B, Caspian Sea"),
    ("EPSG:3857", (-11169055.58, 2800000.00), (-dms(100, 20), dms(24, 22, 54.433)), 0.02,
     "GN 7-2, Web Mercator"),
    ("EPSG:5041", (3320416.75, 632668.43), (44.0, 73.0), 0.01, "GN 7-2, polar stereographic A"),
    ("EPSG:3032", (7255380.79, 7053389.56), (120.0, -75.0), 0.01,
     "GN 7-2, polar stereographic B, Antarctica"),
    ("EPSG:28992", (196105.283, 557057.739), (6.0, 53.0), 0.001,
     "GN 7-2, oblique stereographic, Netherlands"),
    ("EPSG:3993", (37712.48, 35242.00), (dms(144, 38, 7.19295), dms(13, 20, 20.53846)), 0.02,
     "GN 7-2, Guam"),
    ("EPSG:3295", (42665.90, 65509.82), (138.19303001104092, 9.596525859439623), 0.01,
     "GN 7-2, modified azimuthal equidistant, Yap"),
    ("EPSG:5880", (5996378.70982, 9328349.94407), (-45.0, -6.0), 0.0001,
     "GN 7-2, American polyconic, Brazil"),
    ("EPSG:3174", (1466493.492, 702903.006), (-78.75, 42.75), 0.001,
     "GN 7-2, Albers, Great Lakes"),
    ("EPSG:3577", (832799.36, -2170181.926), (140.0, -20.0), 0.05, "GIGS 5109-04, Australia"),
    ("EPSG:6247", (80859.033, 122543.174), (-74.25, 4.8), 0.001, "GN 7-2, Colombia urban, Bogota"),
    ("EPSG:2056", (2679520.05, 1212273.44), (dms(8, 29, 11.11127154), dms(47, 3, 28.95659233)),
     0.01, "swisstopo, Formulas and constants for the Swiss map projection, Rigi"),
    ("EPSG:27561", (1029705.0818, 272723.8510),
     (math.degrees(0.145512099), math.degrees(0.872664626)), 0.005,
     "IGN, NT/G 71, ALG0003, Lambert zone I, from the meridian of Paris"),
    ("EPSG:27200", (2487100.638, 6751049.719), (172.739194, -34.444066), 0.1,
     "LINZ, test points of the New Zealand Map Grid, northing first"),
    ("EPSG:27200", (2216746.425, 5388508.765), (169.172062, -46.651295), 0.1,
     "LINZ, as above, the other end of the country"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("crs", "xy", "lon_lat", "tolerance_m"),
    [pytest.param(*case[:4], id=f"{case[0]} {case[4]}") for case in PUBLISHED],
)
def test_a_published_point_is_found(
    crs: str, xy: tuple[float, float], lon_lat: tuple[float, float], tolerance_m: float
) -> None:
    grid = grid_of(crs)
    x, y = (np.array([value]) for value in xy)
    lon, lat = grid.degrees(x, y)
    lon = lon + grid.prime_meridian_deg
    assert WGS84.inv(lon[0], lat[0], *lon_lat)[2] == pytest.approx(0.0, abs=tolerance_m)
    still = np.zeros(1)
    np.testing.assert_allclose(np.stack(grid.moved(x, y, still, still)), [x, y], atol=1e-5)


def test_the_ordnance_survey_example_of_seven_parameters_is_found() -> None:
    # A guide to coordinate systems in Great Britain: the Helmert transformation of Caister.
    place = ToWgs84.over("EPSG:27700", [651409.903], [313177.270])
    if place.operation.missing_grids != ("uk_os_OSTN15_NTv2_OSGBtoETRS.tif",):
        pytest.skip("a shift grid is installed, so the seven parameters are not used")
    lon, lat = place.lon_lat([651409.903], [313177.270])
    there = dms(1, 42, 57.787), dms(52, 39, 28.723)
    assert WGS84.inv(lon[0], lat[0], *there)[2] == pytest.approx(0.0, abs=0.02)


class ConicZone:
    """A zone CC42 to CC50 by IGN's formulae, NT/G 71, algorithms ALG0001, ALG0019 and ALG0054."""

    def __init__(self, latitude: int) -> None:
        flattening = 1 / 298.257222101
        self.e = math.sqrt(2 * flattening - flattening**2)
        self.east, self.north = 1_700_000.0, (latitude - 42) * 1_000_000.0 + 1_200_000.0
        low, high = (math.radians(latitude + turn) for turn in (-0.75, 0.75))
        self.n = math.log(self._radius(high) / self._radius(low)) / (
            self._isometric(low) - self._isometric(high)
        )
        self.c = self._radius(low) / self.n * math.exp(self.n * self._isometric(low))
        self.pole = self.north + self._r(math.radians(latitude))

    def project(self, lon_deg: float, lat_deg: float) -> tuple[float, float]:
        r, angle = self._r(math.radians(lat_deg)), self.n * math.radians(lon_deg - 3.0)
        return self.east + r * math.sin(angle), self.pole - r * math.cos(angle)

    def _r(self, lat: float) -> float:
        return self.c * math.exp(-self.n * self._isometric(lat))

    def _radius(self, lat: float) -> float:
        return 6378137.0 / math.sqrt(1 - (self.e * math.sin(lat)) ** 2) * math.cos(lat)

    def _isometric(self, lat: float) -> float:
        es = self.e * math.sin(lat)
        return math.log(math.tan(math.pi / 4 + lat / 2) * ((1 - es) / (1 + es)) ** (self.e / 2))


@pytest.mark.parametrize("latitude", range(42, 51))
def test_the_nine_french_zones_agree_with_ign_formulae(latitude: int) -> None:
    zone, crs = ConicZone(latitude), f"EPSG:{3900 + latitude}"
    for lon, lat in ((3.0, float(latitude)), (-1.5, latitude + 0.9), (7.7, latitude - 0.8)):
        x, y = zone.project(lon, lat)
        found = grid_of(crs).degrees(np.array([x]), np.array([y]))
        assert WGS84.inv(found[0][0], found[1][0], lon, lat)[2] == pytest.approx(0.0, abs=1e-3)
        convergence = grid_of(crs).convergence_deg(np.array([x]), np.array([y]))[0]
        assert convergence == pytest.approx(zone.n * (lon - 3.0), abs=1e-6)


def test_a_projection_that_proj_computes_wrongly_is_refused() -> None:
    # GN 7-2 has 251763.20, 153034.13 for this point; PROJ is 745 m off.
    with pytest.raises(UnknownCrs, match="EPSG:31370"):
        ToWgs84("EPSG:31300")


def test_a_projection_that_proj_cannot_compute_is_refused_by_name() -> None:
    with pytest.raises(UnknownCrs, match=r"Polar Stereographic \(variant C\)"):
        ToWgs84("EPSG:2985")


def test_gda94_becomes_gda2020_as_in_its_technical_manual() -> None:
    # ICSM, Geocentric Datum of Australia 2020 Technical Manual, version 1.0 (2017): Alice Springs.
    found = reproject([Pose(133.88551329, -23.67012389, "EPSG:4283")], "EPSG:7844")
    pose = found.poses[0]
    off_m = WGS84.inv(pose.easting, pose.northing, 133.8855216, -23.67011014)[2]
    assert off_m == pytest.approx(0.0, abs=0.002)
    assert found.operations["EPSG:4283"].accuracy_m is not None


# AdV's test points of BeTA2007, from PROJ's test/gie/DHDN_ETRS89.gie: DHDN, then ETRS89.
BETA2007 = [
    ((7.483333333333, 53.500000000000), (7.482506019176, 53.498461143331)),
    ((10.333333333333, 48.833333333333), (10.332117283303, 48.832327188640)),
    ((8.000000000000, 50.083333333333), (7.999097344043, 50.082172046476)),
    ((10.016666666667, 51.033333333333), (10.015460839103, 51.032075951188)),
    ((10.466666666667, 54.333333333333), (10.465373788153, 54.331696254077)),
    ((10.550000000000, 47.750000000000), (10.548775945187, 47.749120260296)),
    ((7.466666666667, 50.500000000000), (7.465834308888, 50.498791390585)),
]


@pytest.mark.parametrize(("dhdn", "etrs89"), BETA2007)
def test_gauss_kruger_is_as_near_to_beta2007_as_the_operation_says(
    dhdn: tuple[float, float], etrs89: tuple[float, float]
) -> None:
    zone = f"EPSG:{31466 + round(dhdn[0] / 3) - 2}"
    grid_points = Transformer.from_crs("EPSG:4314", zone, always_xy=True).transform(*dhdn)
    place = ToWgs84.over(zone, [grid_points[0]], [grid_points[1]])
    lon, lat = place.lon_lat([grid_points[0]], [grid_points[1]])
    assert place.operation.accuracy_m is not None
    off_m = WGS84.inv(lon[0], lat[0], *etrs89)[2]
    assert off_m <= place.operation.accuracy_m
