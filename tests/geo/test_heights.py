import struct
from pathlib import Path

import numpy as np
import pytest
from pyproj import CRS, Transformer

from geo.crs import ToWgs84, parse_crs, parse_full_crs
from geo.heights import vertical_reference

PARIS = ([2.35], [48.85])


@pytest.fixture
def geoid(tmp_path: Path) -> Path:
    """A geoid 44.5 m above the ellipsoid around Paris, in NOAA's GTX format."""
    path = tmp_path / "level.gtx"
    header = struct.pack(">ddddii", 48.0, 2.0, 0.5, 0.5, 3, 3)
    path.write_bytes(header + np.full((3, 3), 44.5, ">f4").tobytes())
    return path


def test_altitudes_above_a_geoid_become_heights_above_the_ellipsoid(geoid: Path) -> None:
    place = ToWgs84(f"+proj=longlat +datum=WGS84 +geoidgrids={geoid} +vunits=m +type=crs")
    _, _, height = place.positions(*PARIS, [35.0])
    assert height[0] == pytest.approx(79.5, abs=1e-3)
    assert place.heights.missing_grids == ()
    assert place.heights.why_not == ""


def test_altitudes_are_metres_even_in_a_system_of_feet(geoid: Path) -> None:
    place = ToWgs84(f"+proj=longlat +datum=WGS84 +geoidgrids={geoid} +vunits=us-ft +type=crs")
    _, _, height = place.positions(*PARIS, [35.0])
    assert height[0] == pytest.approx(79.5, abs=1e-3)


def test_outside_the_geoid_the_height_is_not_known_but_the_place_is(geoid: Path) -> None:
    place = ToWgs84(f"+proj=longlat +datum=WGS84 +geoidgrids={geoid} +vunits=m +type=crs")
    lon, lat, height = place.positions([2.35, 7.0], [48.85, 48.85], [35.0, 35.0])
    assert np.isfinite(lon).all()
    assert np.isfinite(lat).all()
    assert np.isnan(height).tolist() == [False, True]


def test_a_three_dimensional_system_has_ellipsoidal_heights() -> None:
    lon, lat, height = ToWgs84("EPSG:4979").positions(*PARIS, [79.5])
    assert (lon[0], lat[0], height[0]) == (2.35, 48.85, 79.5)
    etrs89 = ToWgs84("EPSG:4937").positions(*PARIS, [79.5])
    assert etrs89[2][0] == pytest.approx(79.5, abs=1e-3)


def test_heights_above_another_ellipsoid_are_shifted_with_it() -> None:
    # DHDN to WGS 84 (2), EPSG:1777, position vector, written out from its seven parameters.
    shift = np.array([598.1, 73.7, 418.2])
    turn = np.radians(np.array([0.202, 0.045, -2.455]) / 3600)
    on_bessel = Transformer.from_crs("+proj=longlat +ellps=bessel", "+proj=geocent +ellps=bessel")
    x = np.array(on_bessel.transform(9.0, 50.0, 100.0))
    moved = shift + (1 + 6.7e-6) * (x + np.cross(turn, x))
    to_wgs84 = Transformer.from_crs("EPSG:4978", "EPSG:4979", always_xy=True)
    lon, lat, height = ToWgs84(CRS("EPSG:4314").to_3d().to_wkt()).positions([9.0], [50.0], [100.0])
    assert (lon[0], lat[0]) == pytest.approx(to_wgs84.transform(*moved)[:2], abs=1e-6)
    assert height[0] == pytest.approx(to_wgs84.transform(*moved)[2], abs=0.01)


def test_heights_of_unknown_reference_are_not_known() -> None:
    place = ToWgs84("EPSG:2154")
    lon, _, height = place.positions([652_000.0], [6_861_000.0], [80.0])
    assert np.isfinite(lon[0])
    assert np.isnan(height[0])
    assert "EPSG:2154+5720" in place.heights.why_not


def test_a_missing_geoid_is_named() -> None:
    place = ToWgs84("EPSG:4326+5773")  # EGM96
    _, _, height = place.positions(*PARIS, [35.0])
    if not place.heights.missing_grids:
        pytest.skip("the geoid EGM96 is installed")
    assert np.isnan(height[0])
    assert place.heights.missing_grids == ("us_nga_egm96_15.tif",)
    assert "us_nga_egm96_15.tif" in place.heights.why_not


def test_an_unknown_altitude_stays_unknown_beside_a_known_one() -> None:
    _, _, height = ToWgs84("EPSG:4979").positions([2.0, 3.0], [48.0, 49.0], [np.nan, 10.0])
    assert np.isnan(height[0])
    assert height[1] == 10.0


def test_the_horizontal_part_of_a_compound_system_is_placed_as_if_alone() -> None:
    x, y = [652_000.0], [6_861_000.0]
    alone, compound = ToWgs84("EPSG:2154"), ToWgs84("EPSG:2154+5720")
    np.testing.assert_array_equal(alone.lon_lat(x, y), compound.lon_lat(x, y))
    np.testing.assert_array_equal(alone.convergence_deg(x, y), compound.convergence_deg(x, y))


def test_the_vertical_reference_is_told_from_the_horizontal_one() -> None:
    levelled = vertical_reference(parse_full_crs("EPSG:5698"))
    assert levelled is not None
    assert levelled.to_epsg() == 5720
    assert vertical_reference(parse_full_crs("EPSG:2154")) is None
    assert vertical_reference(parse_full_crs("EPSG:4979")) is not None
    assert parse_crs("EPSG:5698").to_epsg() == 2154


def test_lengths_that_differ_are_refused() -> None:
    with pytest.raises(ValueError, match="alike"):
        ToWgs84("EPSG:4979").positions([2.0], [48.0], [1.0, 2.0])
