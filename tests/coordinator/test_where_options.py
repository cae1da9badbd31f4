"""What is typed to say which images are meant."""

import json
from collections.abc import Sequence
from pathlib import Path

import pytest

from contracts.config import IndexConfig, Where
from contracts.errors import BadConfig
from coordinator.cli.where_options import where_of
from index.manifest import Generation, SegmentEntry, SurveyEntry


def a_generation(surveys: Sequence[str] = ("", "2019")) -> Generation:
    entries = tuple(SurveyEntry(name=name, path="/s", format="t", n_images=1) for name in surveys)
    segment = SegmentEntry(
        name="0001",
        jobs=(),
        n_images=2,
        n_postings=0,
        n_skipped=0,
        surveys=entries,
        quantisation={},
    )
    return Generation(
        number=1,
        made_by="index",
        created_at="2026-01-01T00:00:00+00:00",
        config=IndexConfig(),
        config_digest="",
        crs=None,
        codebooks="0001",
        codebooks_digest="",
        segments=(segment,),
        files={},
    )


def test_nothing_typed_is_no_condition() -> None:
    assert where_of(a_generation()) == Where()


@pytest.mark.parametrize("text", ["180±45", "180 ± 45", "180+-45", "180+/-45", "180,45", "180, 45"])
def test_a_heading_is_a_direction_and_a_reach(text: str) -> None:
    assert where_of(a_generation(), heading=text).heading == (180.0, 45.0)


def test_a_box_is_four_numbers() -> None:
    assert where_of(a_generation(), bbox="179.5,-18,-179.5,-16").bbox == (179.5, -18, -179.5, -16)


@pytest.mark.parametrize(
    ("typed", "says"),
    [
        ({"bbox": "1,2,3"}, "--bbox takes 4 numbers such as .*; got '1,2,3'"),
        ({"bbox": "a,2,3,4"}, "--bbox takes 4 numbers"),
        ({"bbox": "1,9,3,4"}, "a box takes west,south,east,north"),
        ({"heading": "180"}, "--heading takes 2 numbers such as 180±45 or 180,45; got '180'"),
        ({"heading": "10±-5"}, "0 to 180 degrees to either side"),
        ({"since": "last year"}, "'last year' is no date"),
        ({"surveys": ["2020"]}, "the index has no such survey; it has main, 2019"),
    ],
)
def test_what_does_not_hold_is_refused_by_option(typed: dict, says: str) -> None:
    with pytest.raises(BadConfig, match=says):
        where_of(a_generation(), **typed)


def test_main_is_the_survey_without_a_name_unless_one_is_called_so() -> None:
    assert where_of(a_generation(), surveys=["main", "2019"]).surveys == ("", "2019")
    assert where_of(a_generation(("", "main")), surveys=["main"]).surveys == ("main",)
    assert where_of(a_generation(("", "main")), surveys=[""]).surveys == ("",)


def test_a_polygon_is_read_from_its_file(tmp_path: Path) -> None:
    ring = [[2, 48], [3, 48], [3, 49], [2, 48]]
    path = tmp_path / "region.geojson"
    path.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    polygon = where_of(a_generation(), within=path).polygon
    assert polygon is not None
    assert polygon.startswith("POLYGON ((")
