"""Polygons from vector files: what is taken, converted, mended and refused."""

import json
from pathlib import Path
from typing import Any

import geopandas as gpd
import numpy as np
import pytest
import shapely

from contracts.errors import BadConfig, UnknownCrs
from coordinator.outlines import read_outline
from geo.crs import ToWgs84

SQUARE = [[2.0, 48.0], [3.0, 48.0], [3.0, 49.0], [2.0, 49.0], [2.0, 48.0]]
HOLE = [[2.2, 48.2], [2.2, 48.4], [2.4, 48.4], [2.4, 48.2], [2.2, 48.2]]
OTHER = [[2.5, 48.5], [4.0, 48.5], [4.0, 50.0], [2.5, 50.0], [2.5, 48.5]]
IN_LAMBERT = [[652000, 6862000], [653000, 6862000], [653000, 6863000], [652000, 6862000]]


def polygon(*rings: object) -> dict[str, Any]:
    return {"type": "Polygon", "coordinates": list(rings)}


def features(*geometries: object, **members: object) -> dict[str, Any]:
    made = [{"type": "Feature", "properties": {}, "geometry": each} for each in geometries]
    return {"type": "FeatureCollection", "features": made, **members}


def crs_member(name: str) -> dict[str, Any]:
    return {"type": "name", "properties": {"name": name}}


def outline(tmp_path: Path, content: object) -> shapely.Geometry:
    path = tmp_path / "region.geojson"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    region = shapely.from_wkt(read_outline(path))
    assert shapely.is_valid(region)
    return region


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (polygon(SQUARE), shapely.Polygon(SQUARE)),
        (features(polygon(SQUARE))["features"][0], shapely.Polygon(SQUARE)),
        (polygon(SQUARE, HOLE), shapely.Polygon(SQUARE, [HOLE])),
        (polygon([[*at, 35.0] for at in SQUARE]), shapely.Polygon(SQUARE)),
        (
            {"type": "MultiPolygon", "coordinates": [[SQUARE, HOLE], [HOLE]]},
            shapely.Polygon(SQUARE),
        ),
        (
            features(polygon(SQUARE), None, polygon(OTHER)),
            shapely.union(shapely.Polygon(SQUARE), shapely.Polygon(OTHER)),
        ),
        (
            features(polygon(SQUARE), crs=crs_member("urn:ogc:def:crs:OGC:1.3:CRS84")),
            shapely.Polygon(SQUARE),
        ),
        (
            polygon([[179, -17], [181, -17], [181, -16], [179, -16], [179, -17]]),
            shapely.box(179, -17, 181, -16),
        ),
    ],
)
def test_any_form_of_geojson_is_the_union_of_its_polygons(
    tmp_path: Path, content: object, expected: shapely.Geometry
) -> None:
    assert outline(tmp_path, content).equals(expected)


def test_a_ring_that_crosses_itself_is_mended_where_its_inside_is_clear(tmp_path: Path) -> None:
    bow_tie = [[2, 48], [3, 49], [3, 48], [2, 49], [2, 48]]
    spike = [[2, 48], [3, 48], [3, 50], [3, 49], [2, 49], [2, 48]]
    assert outline(tmp_path, polygon(bow_tie)).area == pytest.approx(0.5)
    assert outline(tmp_path, polygon(spike)).equals(shapely.Polygon(SQUARE))


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ({"type": "LineString", "coordinates": SQUARE}, "holds LineString; expected polygons"),
        (features(polygon(SQUARE), {"type": "Point", "coordinates": [2, 48]}), "Point and Polygon"),
        (features(), "holds no geometry"),
        (features(None), "holds no geometry"),
        (polygon(), "encloses nothing"),
        (polygon([[2, 48], [3, 48], [2, 48], [2, 48]]), "encloses nothing"),
        (polygon(IN_LAMBERT), "as degrees; they must be of another coordinate system"),
        (
            polygon([[0, 0], [4, 0], [4, 4], [1, 4], [1, 1], [3, 1], [3, 3], [0, 3], [0, 0]]),
            "its inside is unclear",
        ),
        (
            shapely.to_geojson(shapely.Point(2, 48).buffer(1, quad_segs=5000)),
            "20,001 vertices, at most 10,000 are taken",
        ),
        ("no json", "cannot be read as a vector file"),
        ('{"type": "Polygon", "coordinates": [[[2', "cannot be read as a vector file"),
    ],
)
def test_what_is_no_region_is_refused_by_name(tmp_path: Path, content: object, says: str) -> None:
    with pytest.raises(BadConfig, match=says) as refused:
        outline(tmp_path, content)
    assert "region.geojson" in str(refused.value)


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadConfig, match=r"gone\.gpkg does not exist"):
        read_outline(tmp_path / "gone.gpkg")


def test_a_crs_member_is_heeded(tmp_path: Path) -> None:
    content = features(polygon(IN_LAMBERT), crs=crs_member("urn:ogc:def:crs:EPSG::2154"))
    lon, lat = ToWgs84("EPSG:2154").lon_lat(*np.array(IN_LAMBERT, np.float64).T)
    expected = shapely.Polygon(np.column_stack([lon, lat]))
    assert outline(tmp_path, content).hausdorff_distance(expected) < 1e-6


@pytest.mark.parametrize("suffix", [".gpkg", ".shp", ".fgb"])
def test_other_vector_files_are_converted_from_their_own_system(
    tmp_path: Path, suffix: str
) -> None:
    path = tmp_path / f"region{suffix}"
    frame = gpd.GeoDataFrame({"name": ["a"]}, geometry=[shapely.Polygon(IN_LAMBERT)], crs=2154)
    frame.to_file(path)
    region = shapely.from_wkt(read_outline(path))
    assert region.centroid.x == pytest.approx(2.3550, abs=1e-3)
    assert region.centroid.y == pytest.approx(48.8593, abs=1e-3)


def test_long_edges_are_bent_as_their_projection_bends_them(tmp_path: Path) -> None:
    wide = shapely.box(100_000, 6_400_000, 1_100_000, 6_900_000)
    frame = gpd.GeoDataFrame(geometry=[wide], crs=2154)
    frame.to_file(tmp_path / "wide.gpkg")
    region = shapely.from_wkt(read_outline(tmp_path / "wide.gpkg"))
    x = np.linspace(100_000, 1_100_000, 101)
    system = ToWgs84("EPSG:2154")
    for metres, inside in ((5.0, True), (-5.0, False)):
        lon, lat = system.lon_lat(x, np.full(101, 6_400_000 + metres))
        assert (shapely.intersects_xy(region, lon, lat)[1:-1] == inside).all()


def test_a_projected_region_may_cross_longitude_180(tmp_path: Path) -> None:
    x, y = ToWgs84("EPSG:3460").from_lon_lat(
        [179.0, -179.0, -179.0, 179.0], [-18.0, -18.0, -16.0, -16.0]
    )
    frame = gpd.GeoDataFrame(geometry=[shapely.Polygon(np.column_stack([x, y]))], crs=3460)
    frame.to_file(tmp_path / "fiji.gpkg")
    region = shapely.from_wkt(read_outline(tmp_path / "fiji.gpkg"))
    assert region.bounds == pytest.approx((179.0, -18.0, 181.0, -16.0), abs=0.02)


def test_a_file_of_several_layers_or_of_no_system_is_refused(tmp_path: Path) -> None:
    frame = gpd.GeoDataFrame(geometry=[shapely.Polygon(SQUARE)], crs=4326)
    frame.to_file(tmp_path / "two.gpkg", layer="north")
    frame.to_file(tmp_path / "two.gpkg", layer="south")
    with pytest.raises(BadConfig, match="has these layers: north, south; expected one"):
        read_outline(tmp_path / "two.gpkg")
    frame.to_file(tmp_path / "bare.shp")
    (tmp_path / "bare.prj").unlink()
    with pytest.raises(BadConfig, match="does not say its coordinate system"):
        read_outline(tmp_path / "bare.shp")


def test_coordinates_that_their_system_cannot_have_are_refused(tmp_path: Path) -> None:
    content = features(
        polygon([[1e9, 1e9], [2e9, 1e9], [2e9, 2e9], [1e9, 1e9]]),
        crs=crs_member("urn:ogc:def:crs:EPSG::32631"),
    )
    with pytest.raises(UnknownCrs, match="cannot be converted"):
        outline(tmp_path, content)
