"""The box against a slow oracle: every arc from one longitude to the next but one around."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from geo.bounds import Bounds

LONGITUDES = st.one_of(st.floats(-180, 180), st.integers(-180, 180).map(float))


def bbox(lons: list[float]) -> list[float]:
    bounds = Bounds()
    for lon in lons:
        bounds.add((lon, 0.0))
    box = bounds.bbox()
    assert box is not None
    return box


def narrowest_width(lons: list[float]) -> float:
    """Degrees of the shortest arc around: all of the Earth but the widest gap."""
    ordered = sorted(set(lons))
    following = [*ordered[1:], ordered[0] + 360.0]
    return 360.0 - max(right - left for left, right in zip(ordered, following, strict=True))


@pytest.mark.parametrize(
    ("lons", "west", "east"),
    [
        ([2.0, 3.0], 2.0, 3.0),
        ([5.0], 5.0, 5.0),
        ([2.25, 2.5, 2.75], 2.25, 2.75),
        ([179.0, -179.0], 179.0, -179.0),
        ([180.0, -180.0], 180.0, -180.0),
        ([170.0, -160.0, 175.0], 170.0, -160.0),
        ([-74.0, 2.0, 139.0], -74.0, 139.0),
        ([-90.0, 90.0], -90.0, 90.0),
    ],
)
def test_the_box_takes_the_short_way_round(lons: list[float], west: float, east: float) -> None:
    assert bbox(lons) == [west, 0.0, east, 0.0]


@given(st.lists(LONGITUDES, min_size=1, max_size=12))
def test_the_box_holds_every_place_and_is_the_narrowest(lons: list[float]) -> None:
    west, _, east, _ = bbox(lons)
    width = east - west if east >= west else east - west + 360.0
    for lon in lons:
        assert (west <= lon <= east) if west <= east else (lon >= west or lon <= east)
    assert width == pytest.approx(narrowest_width(lons), abs=1e-9)


def test_a_box_around_the_whole_earth_holds_it() -> None:
    lons = [number / 2 - 180.0 for number in range(720)]
    west, _, east, _ = bbox(lons)
    assert east - west >= 359.0


@given(st.lists(st.tuples(st.floats(-90, 90), st.floats(-500, 9000)), min_size=1, max_size=8))
def test_latitudes_and_heights_are_the_extremes(places: list[tuple[float, float]]) -> None:
    bounds = Bounds()
    for lat, height in places:
        bounds.add((2.0, lat, height))
    lats, heights = [each[0] for each in places], [each[1] for each in places]
    expected = [2.0, min(lats), min(heights), 2.0, max(lats), max(heights)]
    assert bounds.bbox() == expected


def test_nothing_has_no_box() -> None:
    assert Bounds().bbox() is None
