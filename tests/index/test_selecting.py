"""Which images are meant: by brute force over made-up places, and as results would show them."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_places import ROW, index_of_places

from contracts.config import Where
from contracts.errors import BadConfig
from geo.crs import ToWgs84
from index.catalogue import CatalogueRow
from index.opened import OpenedIndex
from index.selecting import candidates, n_selected, selected
from workers.stages.spots import ground_of, spots_of

UNPOSED = replace(
    ROW, uri="lost.jpg", easting=None, northing=None, altitude_m=None, heading_deg=None, north=None
)
TRIANGLE = [(2.342, 48.852), (2.352, 48.853), (2.346, 48.861)]


def meant(index: OpenedIndex, **conditions: object) -> list[int]:
    return np.flatnonzero(selected(index, Where.of(**conditions))).tolist()


def wkt(ring: Sequence[tuple[float, float]]) -> str:
    return f"POLYGON (({', '.join(f'{lon} {lat}' for lon, lat in [*ring, ring[0]])}))"


def left_of_all_edges(ring: Sequence[tuple[float, float]], lon: float, lat: float) -> bool:
    """In a convex ring, counter-clockwise."""
    edges = zip(ring, [*ring[1:], ring[0]], strict=True)
    return all((x2 - x1) * (lat - y1) - (y2 - y1) * (lon - x1) >= 0 for (x1, y1), (x2, y2) in edges)


def places(crs: str, lon: np.ndarray, lat: np.ndarray) -> list[CatalogueRow]:
    x, y = ToWgs84(crs).from_lon_lat(lon, lat)
    return [
        replace(ROW, uri=f"{n:03d}.jpg", easting=float(x[n]), northing=float(y[n]))
        for n in range(len(x))
    ]


@pytest.fixture(scope="module")
def scattered(tmp_path_factory: pytest.TempPathFactory) -> tuple[OpenedIndex, np.ndarray]:
    """300 images in Paris, in Lambert-93 and two segments; (300, 2) degrees."""
    rng = np.random.default_rng(4)
    lon, lat = rng.uniform(2.335, 2.360, 300), rng.uniform(48.850, 48.863, 300)
    rows = places("EPSG:2154", lon, lat)
    root = tmp_path_factory.mktemp("scattered")
    return index_of_places(root, [rows[:120], rows[120:]], "EPSG:2154"), np.column_stack([lon, lat])


def test_a_polygon_means_the_images_in_it(scattered: tuple[OpenedIndex, np.ndarray]) -> None:
    index, at = scattered
    expected = [n for n, (lon, lat) in enumerate(at) if left_of_all_edges(TRIANGLE, lon, lat)]
    assert 20 < len(expected) < 200
    assert meant(index, polygon=wkt(TRIANGLE)) == expected


def test_a_box_means_the_images_in_it_and_conditions_add_up(
    scattered: tuple[OpenedIndex, np.ndarray],
) -> None:
    index, at = scattered
    west, south, east, north = box = (2.34, 48.852, 2.35, 48.858)
    inside = (west <= at[:, 0]) & (at[:, 0] <= east) & (south <= at[:, 1]) & (at[:, 1] <= north)
    assert meant(index, bbox=box) == np.flatnonzero(inside).tolist()
    both = [n for n in np.flatnonzero(inside) if left_of_all_edges(TRIANGLE, *at[n])]
    assert meant(index, bbox=box, polygon=wkt(TRIANGLE)) == both
    assert meant(index, bbox=(20.0, 48.0, 21.0, 49.0)) == []


@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:3460", "EPSG:3857"])
def test_a_box_may_cross_longitude_180(tmp_path: Path, crs: str) -> None:
    lon = np.array([179.2, 179.8, 180.0, -179.8, -179.2, 178.0])
    index = index_of_places(tmp_path, [places(crs, lon, np.full(6, -17.0))], crs)
    assert meant(index, bbox=(179.5, -18.0, -179.5, -16.0)) == [1, 2, 3]
    assert meant(index, bbox=(-179.5, -18.0, 179.5, -16.0)) == [0, 4, 5]


def test_removed_images_and_those_that_do_not_say_are_never_meant(tmp_path: Path) -> None:
    rows = [replace(ROW, uri=f"{n}.jpg") for n in range(4)]
    rows += [UNPOSED, replace(ROW, uri="undated.jpg", captured_at=None)]
    index = index_of_places(tmp_path, [rows[:3], rows[3:]], "EPSG:2154", removed=[1, 3])
    assert meant(index) == [0, 2, 4, 5]
    assert meant(index, bbox=(-180.0, -90.0, 180.0, 90.0)) == [0, 2, 5]
    assert meant(index, since="1900") == [0, 2, 4]
    assert meant(index, heading=(0.0, 180.0)) == [0, 2, 5]
    among = candidates(index, Where())
    assert among.ids.tolist() == [0, 2, 4, 5]
    assert among.of(np.arange(6) * 10).tolist() == [0, 20, 40, 50]
    assert among.places([5, 2, 3]) == (1, 3)


@pytest.mark.parametrize(
    ("conditions", "expected"),
    [
        ({"since": "2014"}, [1, 2, 3]),
        ({"until": "2014"}, [0, 1, 2]),
        ({"since": "2014-06-16", "until": "2014-06-16"}, [1, 2]),  # the 16th of UTC
        ({"since": "2014-06-16T22:00Z"}, [2, 3]),
        ({"until": "2014-06-16T23:59:59+02:00"}, [0, 1]),
        ({"since": "2014-06-16T23:59:59+02:00", "until": "2014-06-16T21:59:59"}, [1]),
        ({"since": "2030"}, []),
    ],
)
def test_dates_count_in_their_own_zones_and_to_their_ends(
    tmp_path: Path, conditions: dict, expected: list[int]
) -> None:
    times = ["2013-12-31T23:00:00Z", "2014-06-16T23:59:59+02:00", "2014-06-17T00:30:00+02:00",
             "2015-01-01T00:00:00.000001Z", None]  # fmt: skip
    rows = [replace(ROW, uri=f"{n}.jpg", captured_at=time) for n, time in enumerate(times)]
    assert meant(index_of_places(tmp_path, [rows], "EPSG:2154"), **conditions) == expected


@pytest.mark.parametrize("middle", [0.0, 90.0, 355.0, -90.0])
def test_headings_count_from_true_north_as_results_tell_them(tmp_path: Path, middle: float) -> None:
    rng = np.random.default_rng(2)
    rows = [
        replace(
            ROW,
            uri=f"{n}.jpg",
            easting=700000.0 + 400000.0 * float(rng.uniform(-1, 1)),
            heading_deg=float(rng.uniform(0, 360)),
            north=("grid", "true", "magnetic")[n % 3],
        )
        for n in range(90)
    ]
    index = index_of_places(tmp_path, [rows], "EPSG:2154")
    told = spots_of(index.catalogue.rows(range(90)), ground_of(index)).heading_deg
    expected = [
        n
        for n, heading in enumerate(told)
        if math.cos(math.radians(heading - middle)) >= math.cos(math.radians(30.0))
    ]
    assert 5 < len(expected) < 30
    assert meant(index, heading=(middle, 30.0)) == expected


def test_surveys_and_uris_are_meant_by_name(tmp_path: Path) -> None:
    uris = ["a/1.jpg", "a/b/1.jpg", "2.jpg", "x[1].jpg", "old/1.jpg"]
    rows = [replace(ROW, uri=uri, survey="old" if "old" in uri else "") for uri in uris]
    index = index_of_places(tmp_path, [rows], "EPSG:2154")
    assert meant(index, surveys=("",)) == [0, 1, 2, 3]
    assert meant(index, surveys=("old", "")) == [0, 1, 2, 3, 4]
    assert meant(index, uris=("a/*",)) == [0, 1]
    assert meant(index, uris=("1.jp?",)) == [0, 1, 4]
    assert meant(index, uris=("1.jpg",)) == []  # a name without a glob is a whole uri
    assert meant(index, uris=("2.jpg", "x[1].jpg")) == [2, 3]
    assert meant(index, uris=("*.jpg",), surveys=("old",)) == [4]


def test_none_meant_says_what_each_condition_leaves(tmp_path: Path) -> None:
    rows = [replace(ROW, uri=f"{n}.jpg") for n in range(5)]
    index = index_of_places(tmp_path, [rows], "EPSG:2154", removed=[4])
    assert n_selected(index, Where(since="2014", uris=("[01].jpg",))) == 2
    with pytest.raises(BadConfig) as refused:
        n_selected(index, Where(since="2030", heading=(90.0, 10.0), uris=("[01].jpg",)))
    assert str(refused.value) == (
        "No image is meant: --uri [01].jpg leaves 2 of 4 images; --since 2030 leaves 0 of 4 images;"
        " --heading 90±10 leaves 4 of 4 images; together they leave none. Ask for less."
    )


def test_an_index_without_poses_has_no_places(tmp_path: Path) -> None:
    index = index_of_places(tmp_path, [[UNPOSED]], None)
    assert meant(index, bbox=(-180.0, -90.0, 180.0, 90.0)) == []
    assert meant(index, heading=(0.0, 180.0)) == []


def test_a_choice_is_made_once_for_all_photos(scattered: tuple[OpenedIndex, np.ndarray]) -> None:
    index, _ = scattered
    where = Where(polygon=wkt(TRIANGLE))
    assert candidates(index, where) is candidates(index, Where(polygon=wkt(TRIANGLE)))
