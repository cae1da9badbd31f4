"""Against the test values that NOAA and BGS publish with each World Magnetic Model.

WMM2010testvalues.pdf, WMM2015v2testvalues.pdf, WMM2020_TEST_VALUES.txt and WMM2025_TEST_VALUES.txt
of ngdc.noaa.gov; a few rows of each, as the pygeomag project keeps them.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pygeomag import GeoMag
from pygeomag.wmm.wmm_2020 import WMM_2020

from geo.magnetic import FIRST_YEAR, LAST_YEAR, decimal_years, declination_deg

# decimal year, height in km, latitude, longitude, declination in degrees
NOAA = [
    (2010.0, 0, 80, 0, -6.13),
    (2010.0, 0, 0, 120, 0.97),
    (2010.0, 0, -80, 240, 70.21),
    (2010.0, 100, 80, 0, -6.57),
    (2012.5, 100, 0, 120, 0.86),
    (2012.5, 100, -80, 240, 69.45),
    (2015.0, 0, 80, 0, -3.90),
    (2015.0, 100, 0, 120, 0.54),
    (2017.5, 0, -80, 240, 69.59),
    (2017.5, 100, 80, 0, -3.01),
    (2020.0, 54, 82, 87, 51.30),
    (2020.0, 65, 43, 93, 0.71),
    (2020.0, 39, -59, -8, -15.79),
    (2020.5, 22, -37, 140, 9.15),
    (2021.5, 12, -82, -68, 30.36),
    (2023.0, 71, 5, -13, -7.26),
    (2024.5, 51, -76, 40, -55.63),
    (2025.0, 48, 80, -96, -29.91),
    (2025.0, 66, 14, 143, -0.19),
    (2025.5, 50, -70, -133, 57.21),
    (2026.5, 12, -79, 115, -137.58),
    (2028.0, 49, 20, 167, 5.10),
    (2029.5, 31, 13, -132, 9.04),
]


def test_declinations_agree_with_noaa_s_test_values() -> None:
    year, height_km, lat, lon, expected = np.array(NOAA).T
    found = declination_deg(lon, lat, 1000.0 * height_km, year)
    np.testing.assert_allclose(found, expected, rtol=0, atol=0.0051)


def test_points_of_one_town_differ_from_the_model_by_less_than_a_fiftieth_of_a_degree() -> None:
    rng = np.random.default_rng(0)
    lon, lat = 2.35 + rng.uniform(-0.1, 0.1, 50), 48.85 + rng.uniform(-0.1, 0.1, 50)
    height, year = rng.uniform(-50.0, 900.0, 50), rng.uniform(2020.0, 2025.0, 50)
    model = GeoMag(coefficients_data=WMM_2020)
    expected = [
        model.calculate(glat=at[1], glon=at[0], alt=at[2] / 1000, time=at[3]).d
        for at in zip(lon, lat, height, year, strict=True)
    ]
    found = declination_deg(lon, lat, height, year)
    np.testing.assert_allclose(found, expected, rtol=0, atol=0.02)


@pytest.mark.parametrize("year", [1999.0, FIRST_YEAR - 0.001, LAST_YEAR, 2031.5, np.nan])
def test_a_date_that_no_model_covers_has_no_declination(year: float) -> None:
    assert np.isnan(declination_deg([2.35, 2.35], [48.85, 48.85], [0.0, 0.0], [year, 2020.5])[0])
    assert np.isfinite(declination_deg([2.35, 2.35], [48.85] * 2, [0.0] * 2, [year, 2020.5])[1])


def test_a_model_is_used_from_its_own_new_year() -> None:
    # WMM2015v2 replaced WMM2010's forecast, which was wrong by a few hundredths by then.
    before, after = declination_deg([0.0] * 2, [80.0] * 2, [0.0] * 2, [2014.999, 2015.0])
    assert after == pytest.approx(-3.90, abs=0.005)
    assert before != after


def test_an_unknown_height_is_taken_for_the_sea() -> None:
    found = declination_deg([2.35, 2.35], [48.85, 48.85], [np.nan, 0.0], [2020.5, 2020.5])
    assert found[0] == found[1]


def test_an_unknown_place_has_no_declination() -> None:
    found = declination_deg([np.nan, 0.0], [0.0, np.nan], [0.0, 0.0], [2020.0, 2020.0])
    assert np.isnan(found).all()


def test_beside_a_magnetic_pole_a_compass_is_not_believed() -> None:
    # H is 1510.0 nT in WMM2020_TEST_VALUES.txt, below the 2000 nT of the blackout zone.
    assert np.isnan(declination_deg([-121.0], [89.0], [28_000.0], [2020.0])[0])


@given(st.floats(-1e4, 1e4), st.floats(-90, 90), st.floats(2010.0, 2029.99))
def test_a_declination_lies_within_half_a_turn_or_is_unknown(
    lon: float, lat: float, year: float
) -> None:
    found = declination_deg([lon], [lat], [0.0], [year])[0]
    assert np.isnan(found) or -180.0 <= found <= 180.0


def test_what_one_point_gets_does_not_depend_on_the_others() -> None:
    lon, lat = np.linspace(-179.0, 179.0, 40), np.linspace(-70.0, 70.0, 40)
    height, year = np.linspace(0.0, 4000.0, 40), np.linspace(2011.0, 2029.0, 40)
    together = declination_deg(lon, lat, height, year)
    alone = [
        declination_deg(*([v] for v in at))[0] for at in zip(lon, lat, height, year, strict=True)
    ]
    np.testing.assert_array_equal(together, alone)


def test_lengths_that_differ_are_refused() -> None:
    with pytest.raises(ValueError, match="alike"):
        declination_deg([1.0, 2.0], [1.0], [0.0], [2020.0])


def test_no_points_are_no_error() -> None:
    assert declination_deg([], [], [], []).shape == (0,)
    assert decimal_years([]).shape == (0,)


def test_a_date_becomes_a_year_and_its_fraction() -> None:
    # pygeomag's own documentation: 2020-07-02 is 2020.5, leap day and all.
    found = decimal_years(
        ["2020-07-02T10:00:00+02:00", "2019-01-01", None, "2023-12-31T23:59:59Z", "2020-02-29"]
    )
    assert found[0] == 2020.5
    assert found[1] == 2019.0
    assert np.isnan(found[2])
    assert found[3] == pytest.approx(2023 + 364 / 365)
    assert found[4] == pytest.approx(2020 + 59 / 366)


def test_a_time_that_is_none_is_refused() -> None:
    with pytest.raises(ValueError, match="Error parsing"):
        decimal_years(["yesterday"])
