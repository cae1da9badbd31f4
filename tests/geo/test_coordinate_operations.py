import numpy as np
import pyproj
import pytest
from pyproj.transformer import AreaOfInterest

from contracts.errors import UnknownCrs
from geo.crs import ToWgs84, area_of

SPAIN = ([440_000.0, 441_000.0], [4_474_000.0, 4_475_000.0])  # Madrid, UTM 30
SCOTLAND = ([400_000.0], [6_200_000.0])
NAMELESS = "+proj=lcc +lat_0=46.5 +lon_0=3 +lat_1=49 +lat_2=44 +ellps=intl +units=m"


def test_the_operation_is_the_best_for_the_points_and_not_for_the_whole_system() -> None:
    spain, scotland = (ToWgs84.over("EPSG:23030", *points) for points in (SPAIN, SCOTLAND))
    # ED50: "mean for Western Europe" is good to 10 m, Spain's own parameters to 1.5 m.
    assert spain.operation.accuracy_m is not None
    assert scotland.operation.accuracy_m is not None
    assert spain.operation.accuracy_m <= 1.5
    assert spain.operation.name != scotland.operation.name


def test_without_an_area_no_more_is_said_than_of_the_worst_choice() -> None:
    anywhere = ToWgs84("EPSG:23030").operation
    here = ToWgs84.over("EPSG:23030", *SPAIN).operation
    assert anywhere.accuracy_m is not None
    assert here.accuracy_m is not None
    assert anywhere.accuracy_m > here.accuracy_m
    assert here.name in anywhere.name


def test_what_a_point_gets_does_not_depend_on_the_points_beside_it() -> None:
    place = ToWgs84.over("EPSG:23030", *SPAIN)
    together = np.stack(place.lon_lat(*SPAIN))
    alone = [place.lon_lat([x], [y]) for x, y in zip(*SPAIN, strict=True)]
    np.testing.assert_array_equal(together, np.hstack(alone))


def test_a_projection_alone_is_exact_and_says_so() -> None:
    operation = ToWgs84("EPSG:32631").operation
    assert operation.accuracy_m == 0.0
    assert operation.missing_grids == ()
    assert operation.better_accuracy_m is None
    assert not operation.ballpark
    assert operation.name == "Inverse of UTM zone 31N"


def test_the_definition_is_what_proj_computes() -> None:
    place = ToWgs84.over("EPSG:27572", [600_000.0], [2_428_000.0])
    pipeline = pyproj.Transformer.from_pipeline(place.operation.definition)
    expected = pipeline.transform([600_000.0], [2_428_000.0])
    np.testing.assert_allclose(np.stack(place.lon_lat([600_000.0], [2_428_000.0])), expected)
    assert place.operation.accuracy_m == 2.0  # NTF to WGS 84 (1), EPSG:1193


def test_a_missing_grid_is_named_with_what_it_would_be_worth() -> None:
    operation = ToWgs84.over("EPSG:27700", [530_000.0], [180_000.0]).operation
    if not operation.missing_grids:
        pytest.skip("the Ordnance Survey's shift grid is installed")
    assert operation.missing_grids == ("uk_os_OSTN15_NTv2_OSGBtoETRS.tif",)
    assert operation.better_accuracy_m == 1.0
    assert operation.accuracy_m == 2.0


def test_a_ballpark_conversion_is_taken_only_where_it_is_allowed() -> None:
    with pytest.raises(UnknownCrs, match="--allow-ballpark"):
        ToWgs84(NAMELESS)
    allowed = ToWgs84(NAMELESS, allow_ballpark=True)
    assert allowed.operation.ballpark
    assert allowed.operation.accuracy_m is None
    lon, lat = allowed.lon_lat([0.0], [0.0])
    assert (lon[0], lat[0]) == pytest.approx((3.0, 46.5))


def test_allowing_the_ballpark_changes_nothing_where_better_is_known() -> None:
    x, y = [652_000.0], [6_861_000.0]
    strict, loose = (ToWgs84("EPSG:2154", None, allowed) for allowed in (False, True))
    assert strict.operation == loose.operation
    np.testing.assert_array_equal(strict.lon_lat(x, y), loose.lon_lat(x, y))


def test_the_area_of_points_is_their_box() -> None:
    area = area_of("EPSG:4326", [2.0, np.nan, 2.5], [48.0, 50.0, 49.0])
    assert area == AreaOfInterest(2.0, 48.0, 2.5, 49.0)
    paris = area_of("EPSG:27572", [600_000.0], [2_428_000.0])  # 0 grad is 2.337 degrees
    assert paris is not None
    assert paris.west_lon_degree == pytest.approx(2.3372, abs=1e-3)


def test_the_area_of_points_on_both_sides_of_longitude_180_is_small() -> None:
    area = area_of("EPSG:4326", [179.0, -179.5, 178.0], [-17.0, -16.0, -18.0])
    assert area == AreaOfInterest(178.0, -18.0, -179.5, -16.0)
    pacific = area_of("EPSG:3832", [3_000_000.0, 3_400_000.0], [0.0, 0.0])  # from 150 E
    assert pacific is not None
    assert pacific.west_lon_degree > 170.0
    assert pacific.east_lon_degree < -170.0
    lon, _ = ToWgs84.over("EPSG:3832", [3_000_000.0, 3_400_000.0], [0.0, 0.0]).lon_lat(
        [3_400_000.0], [0.0]
    )
    assert lon[0] == pytest.approx(pacific.east_lon_degree)


def test_no_points_have_no_area() -> None:
    assert area_of("EPSG:2154", [], []) is None
    assert area_of("EPSG:2154", [np.nan], [1.0]) is None
