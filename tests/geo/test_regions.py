"""Which places lie in a region, against a slow ray and by every way to write a longitude."""

from collections.abc import Sequence

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj.transformer import AreaOfInterest

from contracts.errors import BadConfig
from geo.crs import ToWgs84
from geo.regions import (
    MAX_VERTICES,
    box_region,
    places_within,
    polygon_region,
    rectangle_around,
)

Ring = Sequence[tuple[float, float]]
PARIS = (2.35, 48.85)
FIJI = (180.0, -17.0)


def in_ring(ring: Ring, lon: float, lat: float) -> bool:
    """A ray to the east crosses the ring an odd number of times."""
    inside = False
    for (x1, y1), (x2, y2) in zip(ring, [*ring[1:], ring[0]], strict=True):
        if (y1 > lat) != (y2 > lat) and lon < (x2 - x1) * (lat - y1) / (y2 - y1) + x1:
            inside = not inside
    return inside


def star(centre: tuple[float, float], radii: Sequence[float]) -> list[tuple[float, float]]:
    """A ring that sees its centre from everywhere, never crossing itself."""
    turns = np.linspace(0.0, 2.0 * np.pi, len(radii), endpoint=False)
    return [
        (centre[0] + radius * np.cos(turn), centre[1] + radius * np.sin(turn))
        for radius, turn in zip(radii, turns, strict=True)
    ]


def around(centre: tuple[float, float], count: int = 200) -> tuple[np.ndarray, np.ndarray]:
    """Places at random, with longitudes that run on past 180."""
    offsets = np.random.default_rng(0).uniform(-0.3, 0.3, (2, count))
    return centre[0] + offsets[0], centre[1] + offsets[1]


def turned(lon_deg: np.ndarray) -> np.ndarray:
    """As surveys write them, within [-180, 180)."""
    return (lon_deg + 180.0) % 360.0 - 180.0


@settings(max_examples=40, deadline=None)
@given(
    centre=st.sampled_from([PARIS, FIJI, (-179.95, 10.0), (0.0, 0.0)]),
    radii=st.lists(st.floats(0.02, 0.3), min_size=3, max_size=12),
    hole=st.booleans(),
)
def test_places_in_a_polygon_are_those_that_a_ray_finds(
    centre: tuple[float, float], radii: list[float], hole: bool
) -> None:
    outer = star(centre, radii)
    inner = star(centre, [0.3 * min(radii)] * 5)
    region = shapely.Polygon(outer, [inner] if hole else [])
    lon, lat = around(centre)
    expected = [
        in_ring(outer, x, y) and not (hole and in_ring(inner, x, y))
        for x, y in zip(lon, lat, strict=True)
    ]
    assert places_within(region, turned(lon), lat).tolist() == expected


@pytest.mark.parametrize(
    ("box", "inside", "outside"),
    [
        ((2.0, 48.0, 3.0, 49.0), [(2.0, 48.0), (2.5, 48.5), (3.0, 49.0)], [(3.1, 48.5)]),
        ((179.0, -18.0, -179.0, -16.0), [(180.0, -17.0), (-180.0, -17.0), (-179.0, -16.0)],
         [(178.9, -17.0), (-178.9, -17.0), (0.0, -17.0)]),
        ((-180.0, -90.0, 180.0, 90.0), [(0.0, 90.0), (180.0, 0.0), (-180.0, -90.0)], []),
        ((2.0, 48.0, 2.0, 49.0), [(2.0, 48.5)], [(2.0000001, 48.5)]),
    ],
)  # fmt: skip
def test_a_box_holds_its_edges_and_may_cross_longitude_180(
    box: tuple[float, float, float, float], inside: Ring, outside: Ring
) -> None:
    region = box_region(*box)
    for places, expected in ((inside, True), (outside, False)):
        for lon, lat in places:
            found = places_within(region, np.array([lon]), np.array([lat]))
            assert found.tolist() == [expected], (lon, lat)


def test_a_polygon_in_two_parts_at_180_is_one_region() -> None:
    two = shapely.MultiPolygon([shapely.box(179, -18, 180, -16), shapely.box(-180, -18, -179, -16)])
    lon, lat = around(FIJI)
    everywhere = places_within(two, turned(lon), lat)
    np.testing.assert_array_equal(
        everywhere, places_within(shapely.box(179, -18, 181, -16), turned(lon), lat)
    )
    assert everywhere.all()


def test_what_is_not_known_lies_nowhere() -> None:
    unknown = np.array([np.nan, 2.0])
    assert not places_within(box_region(-180, -90, 180, 90), unknown, unknown[::-1]).any()


@settings(max_examples=60, deadline=None)
@given(
    crs=st.sampled_from(["EPSG:2154", "EPSG:32631", "EPSG:3857", "EPSG:4326", "EPSG:3035"]),
    west=st.floats(-1.0, 3.0),
    south=st.floats(-1.0, 3.0),
    width=st.floats(0.0, 2.0),
    height=st.floats(0.0, 2.0),
)
def test_no_image_of_a_region_is_outside_the_rectangle_around_it(
    crs: str, west: float, south: float, width: float, height: float
) -> None:
    area = AreaOfInterest(2.0, 48.0, 3.0, 50.0)
    rng = np.random.default_rng(1)
    lon, lat = rng.uniform(2.0, 3.0, 300), rng.uniform(48.0, 50.0, 300)
    system = ToWgs84(crs, area)
    region = box_region(2.0 + west, 48.0 + south, 2.0 + west + width, 48.0 + south + height)
    within = places_within(region, lon, lat)
    rectangle = rectangle_around(region, system, area)
    near = (
        np.zeros(300, np.bool_)
        if rectangle is None
        else rectangle.holds(*system.from_lon_lat(lon, lat))
    )
    assert not (within & ~near).any()


@pytest.mark.parametrize("crs", ["EPSG:3460", "EPSG:3857", "EPSG:32701", "EPSG:4326"])
def test_a_rectangle_across_longitude_180_loses_nobody(crs: str) -> None:
    area = AreaOfInterest(178.0, -18.0, -178.0, -16.0)
    system = ToWgs84(crs, area)
    lon, lat = around(FIJI)
    rectangle = rectangle_around(box_region(179.0, -18.0, -179.0, -16.0), system, area)
    assert rectangle is not None
    assert rectangle.holds(*system.from_lon_lat(turned(lon), lat)).all()


def test_only_the_neighbourhood_of_a_small_region_is_looked_at() -> None:
    area = AreaOfInterest(-4.0, 43.0, 8.0, 51.0)
    system = ToWgs84("EPSG:2154", area)
    rectangle = rectangle_around(box_region(2.34, 48.85, 2.35, 48.86), system, area)
    assert rectangle is not None
    assert rectangle.x[1] - rectangle.x[0] < 6_000.0
    assert rectangle_around(box_region(20.0, 48.0, 21.0, 49.0), system, area) is None


@pytest.mark.parametrize(
    ("wkt", "says"),
    [
        ("POLYGON ((0 0, 1", "is no WKT"),
        ("POINT (1 2)", "expected a polygon with an area"),
        ("POLYGON EMPTY", "expected a polygon with an area"),
        ("POLYGON ((0 0, 1 1, 1 0, 0 1, 0 0))", "does not hold: Self-intersection"),
        (shapely.Point(0, 0).buffer(1, quad_segs=MAX_VERTICES).wkt, "at most 10,000 are taken"),
    ],
)
def test_a_polygon_that_cannot_be_used_is_refused(wkt: str, says: str) -> None:
    with pytest.raises(BadConfig, match=says):
        polygon_region(wkt)
