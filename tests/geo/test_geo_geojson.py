import json
import math
from dataclasses import replace
from pathlib import Path

import geojson_pydantic
import pydantic
import pyogrio
import pytest
from hypothesis import given
from hypothesis import strategies as st

from geo.geojson import (
    PlacedEstimate,
    PlacedMatch,
    dumps,
    error_feature,
    estimate_feature,
    feature_collection,
    match_feature,
)

MATCH = PlacedMatch(
    query="cartes/été 1910.jpg",
    rank=1,
    score=0.75,
    image="run1/a.jpg",
    uri="file:///survey/run1/a.jpg",
    image_id=7,
    lon_deg=2.33655573123,
    lat_deg=44.99997468456,
    heading_deg=359.99999999,
    pitch_deg=-1.5,
    roll_deg=0.25,
    hfov_deg=None,
    captured_at="2014-06-16T10:00:00+02:00",
    detectors=("hesaff", "star"),
    k=2,
    predicted_map=math.nan,
    generation=3,
)
ESTIMATE = PlacedEstimate(
    "cartes/été 1910.jpg", 2.3365, 45.0, 12.3456, 4, ("hesaff", "star"), 2, "default: no model"
)


def placed(lon: float, lat: float = 0.0) -> PlacedMatch:
    return replace(MATCH, lon_deg=lon, lat_deg=lat)


def everything() -> str:
    features = [
        match_feature(MATCH),
        match_feature(replace(MATCH, rank=2, lon_deg=None, lat_deg=math.nan)),
        estimate_feature(ESTIMATE),
        error_feature("broken.jpg", "no image data"),
    ]
    return dumps(feature_collection(features))


def test_an_independent_model_of_rfc_7946_accepts_the_collection() -> None:
    geojson_pydantic.FeatureCollection.model_validate_json(everything())
    assert json.loads(everything())["bbox"] == [2.3365, 44.9999747, 2.3365557, 45.0]
    assert "crs" not in json.loads(everything())


def test_that_model_refuses_what_is_wrong() -> None:
    wrong = everything().replace('"Point"', '"Pint"', 1)
    with pytest.raises(pydantic.ValidationError):
        geojson_pydantic.FeatureCollection.model_validate_json(wrong)


def test_gdal_reads_the_collection_in_wgs_84(tmp_path: Path) -> None:
    path = tmp_path / "results.geojson"
    path.write_text(everything(), "utf-8")
    frame = pyogrio.read_dataframe(path)
    assert frame.crs.to_epsg() == 4326
    assert list(frame["kind"]) == ["match", "match", "estimate", "error"]
    assert frame.geometry.isna().tolist() == [False, True, False, True]
    assert frame.geometry[0].x == pytest.approx(2.3365557, abs=1e-12)
    assert frame["query"][0] == "cartes/été 1910.jpg"


def test_a_match_has_the_fields_of_the_design() -> None:
    feature = match_feature(MATCH)
    assert feature["geometry"] == {"type": "Point", "coordinates": [2.3365557, 44.9999747]}
    assert feature["properties"] == {
        "kind": "match",
        "query": "cartes/été 1910.jpg",
        "rank": 1,
        "score": 0.75,
        "image": "run1/a.jpg",
        "uri": "file:///survey/run1/a.jpg",
        "image_id": 7,
        "heading_deg": 0.0,
        "pitch_deg": -1.5,
        "roll_deg": 0.25,
        "hfov_deg": None,
        "captured_at": "2014-06-16T10:00:00+02:00",
        "detectors": ["hesaff", "star"],
        "k": 2,
        "predicted_map": None,
        "choice": None,
        "generation": 3,
    }


def test_an_estimate_has_the_fields_of_the_design() -> None:
    assert estimate_feature(ESTIMATE)["properties"] == {
        "kind": "estimate",
        "query": "cartes/été 1910.jpg",
        "radius_m": 12.35,
        "support": 4,
        "detectors": ["hesaff", "star"],
        "k": 2,
        "choice": "default: no model",
    }


def test_an_error_has_no_place_and_says_why() -> None:
    feature = error_feature("x.jpg", "truncated")
    assert feature["geometry"] is None
    assert feature["properties"] == {"kind": "error", "query": "x.jpg", "error": "truncated"}


def test_ids_differ_by_query_kind_and_rank_and_by_nothing_else() -> None:
    features = [
        match_feature(MATCH),
        match_feature(replace(MATCH, rank=2)),
        match_feature(replace(MATCH, query="b.jpg")),
        estimate_feature(ESTIMATE),
        error_feature(MATCH.query, "why"),
    ]
    ids = [feature["id"] for feature in features]
    assert len(set(ids)) == len(ids)
    assert all(int(identity, 16) >= 0 for identity in ids)
    assert match_feature(replace(MATCH, score=0.1, image="c.jpg"))["id"] == ids[0]


def test_an_ellipsoidal_height_is_the_third_coordinate() -> None:
    geometry = match_feature(replace(MATCH, height_m=80.12345))["geometry"]
    assert geometry is not None
    assert geometry["coordinates"][2] == 80.123


@pytest.mark.parametrize(
    ("lons", "west", "east"),
    [
        ([2.0, 3.0], 2.0, 3.0),
        ([5.0], 5.0, 5.0),
        ([179.0, -179.0], 179.0, -179.0),
        ([170.0, -160.0, 175.0], 170.0, -160.0),
        ([-74.0, 2.0, 139.0], -74.0, 139.0),
        ([-90.0, 90.0], -90.0, 90.0),
    ],
)
def test_the_box_takes_the_short_way_round(lons: list[float], west: float, east: float) -> None:
    features = [match_feature(placed(lon, lat)) for lat, lon in enumerate(lons)]
    assert feature_collection(features)["bbox"] == [west, 0.0, east, float(len(lons) - 1)]


@given(st.lists(st.floats(-180, 180), min_size=1, max_size=6))
def test_every_place_is_inside_the_box(lons: list[float]) -> None:
    features = [match_feature(placed(lon)) for lon in lons]
    west, _, east, _ = feature_collection(features)["bbox"]
    width = (east - west) % 360.0
    for feature in features:
        assert feature["geometry"] is not None
        lon = feature["geometry"]["coordinates"][0]
        assert west <= lon <= east or (lon - west) % 360.0 <= width + 1e-9


def test_without_any_place_there_is_no_box() -> None:
    assert feature_collection([error_feature("a.jpg", "why")]) == {
        "type": "FeatureCollection",
        "features": [error_feature("a.jpg", "why")],
    }
    assert dumps(feature_collection([])) == '{"type":"FeatureCollection","features":[]}'


def test_a_number_that_is_none_is_never_written() -> None:
    with pytest.raises(ValueError, match="JSON"):
        dumps(feature_collection([match_feature(replace(MATCH, score=math.nan))]))


def test_coordinates_of_another_system_are_refused() -> None:
    with pytest.raises(ValueError, match="ToWgs84"):
        match_feature(placed(652000.0, 6861000.0))


def test_a_file_name_that_is_no_utf_8_comes_back_the_same() -> None:
    name = b"caf\xe9.jpg".decode("utf-8", "surrogateescape")
    written = dumps(feature_collection([error_feature(name, "why")])).encode("utf-8")
    assert json.loads(written)["features"][0]["properties"]["query"] == name
