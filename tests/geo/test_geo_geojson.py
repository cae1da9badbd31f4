import json
import math
from collections.abc import Iterator
from dataclasses import replace

import geojson_pydantic
import pytest
from made_features import ESTIMATE, MATCH, TARGET, features, text

from geo.geojson import (
    Feature,
    PlacedMatch,
    collection_text,
    error_feature,
    estimate_feature,
    feature_collection,
    match_feature,
    target_feature,
)


def placed(lon: float, lat: float = 0.0) -> PlacedMatch:
    return replace(MATCH, lon_deg=lon, lat_deg=lat)


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
        "heading_derived": False,
        "pitch_deg": -1.5,
        "roll_deg": 0.25,
        "hfov_deg": None,
        "position_error_m": None,
        "captured_at": "2014-06-16T10:00:00+02:00",
        "detectors": ["hesaff", "star"],
        "k": 2,
        "predicted_map": None,
        "choice": None,
        "generation": 3,
    }


def test_what_is_known_of_a_pose_is_told() -> None:
    match = replace(MATCH, heading_derived=True, position_error_m=1.23456)
    properties = match_feature(match)["properties"]
    assert properties["heading_derived"] is True
    assert properties["position_error_m"] == 1.23


def test_an_estimate_has_the_fields_of_the_design() -> None:
    assert estimate_feature(ESTIMATE)["properties"] == {
        "kind": "estimate",
        "query": "cartes/été 1910.jpg",
        "radius_m": 12.35,
        "radius_95_m": None,
        "support": 4,
        "confidence": None,
        "in_survey": None,
        "detectors": ["hesaff", "star"],
        "k": 2,
        "choice": "default: no model",
    }
    sure = replace(ESTIMATE, radius_95_m=40.123, confidence=0.875, in_survey=True)
    properties = estimate_feature(sure)["properties"]
    assert [properties[each] for each in ("radius_95_m", "confidence", "in_survey")] == [
        40.12,
        0.875,
        True,
    ]


def test_a_target_is_a_point_with_its_support() -> None:
    feature = target_feature(TARGET)
    assert feature["geometry"] == {"type": "Point", "coordinates": [2.3364, 45.0001]}
    assert feature["properties"] == {
        "kind": "target",
        "query": "cartes/été 1910.jpg",
        "radius_m": 3.46,
        "support": 3,
    }


@pytest.mark.parametrize("nowhere", [math.nan, None])
def test_an_estimate_or_a_target_nowhere_is_refused(nowhere: float) -> None:
    with pytest.raises(ValueError, match="estimate of 'cartes"):
        estimate_feature(replace(ESTIMATE, lon_deg=nowhere))
    with pytest.raises(ValueError, match="target of 'cartes"):
        target_feature(replace(TARGET, lat_deg=nowhere))


def test_an_error_has_no_place_and_says_why() -> None:
    feature = error_feature("x.jpg", "truncated")
    assert feature["geometry"] is None
    assert feature["properties"] == {"kind": "error", "query": "x.jpg", "error": "truncated"}


def test_ids_differ_by_query_kind_and_rank_and_by_nothing_else() -> None:
    told = [
        match_feature(MATCH),
        match_feature(replace(MATCH, rank=2)),
        match_feature(replace(MATCH, query="b.jpg")),
        estimate_feature(ESTIMATE),
        target_feature(TARGET),
        error_feature(MATCH.query, "why"),
    ]
    ids = [feature["id"] for feature in told]
    assert len(set(ids)) == len(ids)
    assert all(int(identity, 16) >= 0 for identity in ids)
    assert match_feature(replace(MATCH, score=0.1, image="c.jpg"))["id"] == ids[0]


def test_an_ellipsoidal_height_is_the_third_coordinate() -> None:
    geometry = match_feature(replace(MATCH, height_m=80.12345))["geometry"]
    assert geometry is not None
    assert geometry["coordinates"][2] == 80.123


def test_heights_make_the_box_three_dimensional() -> None:
    """Section 5: a box has as many dimensions as the geometries in it."""
    low, high = replace(MATCH, height_m=80.0), replace(MATCH, rank=2, height_m=90.5)
    flat = replace(MATCH, rank=3, lon_deg=2.5)
    told = [match_feature(each) for each in (high, flat, low)]
    bbox = [2.3365557, 44.9999747, 80.0, 2.5, 44.9999747, 90.5]
    assert feature_collection(told)["bbox"] == bbox
    geojson_pydantic.FeatureCollection.model_validate_json(text(told))


def test_across_longitude_180_the_box_is_as_the_rfc_has_it() -> None:
    told = [match_feature(placed(177.0, -20.0)), match_feature(placed(-178.0, -16.0))]
    assert feature_collection(told)["bbox"] == [177.0, -20.0, -178.0, -16.0]  # section 5.2
    with pytest.warns(UserWarning, match="crossing the Antimeridian"):
        geojson_pydantic.FeatureCollection.model_validate_json(text(told))


def test_without_any_place_there_is_no_box() -> None:
    assert feature_collection([error_feature("a.jpg", "why")]) == {
        "type": "FeatureCollection",
        "features": [error_feature("a.jpg", "why")],
    }
    assert json.loads(text([])) == {"type": "FeatureCollection", "features": []}


def test_the_text_is_that_of_the_collection_one_feature_a_line() -> None:
    told = features()
    assert json.loads(text(told)) == feature_collection(told)
    assert len(text(told).splitlines()) == len(told) + 2


def test_features_are_written_as_they_come() -> None:
    asked: list[int] = []

    def coming() -> Iterator[Feature]:
        for number in range(3):
            asked.append(number)
            yield error_feature(f"{number}.jpg", "why")

    pieces = collection_text(coming())
    for piece in pieces:
        if "0.jpg" in piece:
            break
    assert asked == [0]


def test_a_number_that_is_none_is_never_written() -> None:
    with pytest.raises(ValueError, match="JSON"):
        text([match_feature(replace(MATCH, score=math.nan))])
    with pytest.raises(ValueError, match="JSON"):
        text([estimate_feature(replace(ESTIMATE, radius_m=math.nan))])
    with pytest.raises(ValueError, match="JSON"):
        text([], {"accuracy_m": math.inf})


def test_coordinates_of_another_system_are_refused() -> None:
    with pytest.raises(ValueError, match="ToWgs84"):
        match_feature(placed(652000.0, 6861000.0))


@pytest.mark.parametrize(
    "name",
    [
        b"caf\xe9.jpg".decode("utf-8", "surrogateescape"),
        "明信片/巴黎.jpg",
        "x" * 5000 + ".jpg",
        '"\\\u2028\n</script>.jpg',
        "\ud800",
    ],
)
def test_any_file_name_comes_back_the_same(name: str) -> None:
    written = text([error_feature(name, "why")]).encode("utf-8")
    assert json.loads(written)["features"][0]["properties"]["query"] == name
