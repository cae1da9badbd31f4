"""The GeoPackage as other programs read it: GDAL through pyogrio, SQLite, Debian's own GDAL."""

import io
import shutil
import sqlite3
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pandas as pd
import pyogrio
import pytest
from made_results import (
    failed,
    made_estimate,
    made_index,
    made_match,
    posed,
)
from PIL import Image

from coordinator.export import batches
from coordinator.export.geopackage import write_geopackage
from coordinator.export.geopackage.layers import LAYERS
from coordinator.querying import Located
from geo.crs import ToWgs84
from geo.geojson import PlacedTarget, target_feature
from index.opened import OpenedIndex

LAMBERT_93 = ToWgs84("EPSG:2154")
STREET = [(652000.0 + 4 * n + 1 / 3, 6862000.0) for n in range(4)]


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    path = tmp_path / "post card.png"
    Image.new("RGB", (900, 600), (200, 30, 30)).save(path)
    return path


@pytest.fixture
def index(tmp_path: Path, photo: Path) -> OpenedIndex:
    """Four images along a street; the file of the first one is there."""
    images = [posed(f"{n:02d}.jpg", *place) for n, place in enumerate(STREET)]
    images[0] = replace(images[0], path=str(photo), quarter_turns=1)
    return made_index(tmp_path / "index", images, "EPSG:2154")


def lon_lat(number: int) -> tuple[float, float]:
    lon, lat = LAMBERT_93.lon_lat([STREET[number][0]], [STREET[number][1]])
    return float(lon[0]), float(lat[0])


def answered(query: str, n_matches: int = 4) -> Located:
    matches = [made_match(query, rank, *lon_lat(rank - 1)) for rank in range(1, n_matches + 1)]
    estimate = made_estimate(query, *lon_lat(1))
    target = target_feature(PlacedTarget(query, *lon_lat(2), 6.0, 3))
    return Located(query, (*matches, estimate, target), 0.25)


def layer(path: Path, name: str) -> pd.DataFrame:
    return pyogrio.read_dataframe(path, layer=name)


def test_every_layer_is_in_the_surveys_system(index: OpenedIndex, tmp_path: Path) -> None:
    out = tmp_path / "results.gpkg"
    write_geopackage(out, [answered("a.jpg"), failed("b.jpg")], index)
    found = dict(pyogrio.list_layers(out).tolist())
    assert found == {
        **{each.name: each.geometry_type for each in LAYERS},
        "layer_styles": None,
    }
    for each in LAYERS:
        info = pyogrio.read_info(out, layer=each.name)
        assert info["crs"] == "EPSG:2154"
        assert info["fields"].tolist() == [column.name for column in each.columns]
        assert info["capabilities"]["fast_spatial_filter"]
    counts = {each.name: len(layer(out, each.name)) for each in LAYERS}
    assert counts == {
        "queries": 2,
        "matches": 4,
        "estimates": 1,
        "targets": 1,
        "links": 4,
        "estimate_areas": 2,
        "views": 4,
    }


def test_matches_stand_exactly_where_they_were_surveyed(index: OpenedIndex, tmp_path: Path) -> None:
    write_geopackage(tmp_path / "r.gpkg", [answered("a.jpg")], index)
    matches = layer(tmp_path / "r.gpkg", "matches")
    assert [(point.x, point.y) for point in matches.geometry] == STREET
    estimate = layer(tmp_path / "r.gpkg", "estimates").geometry[0]
    assert estimate.distance(matches.geometry[1]) < 0.02  # 7 decimals of a degree


def test_values_keep_their_types(index: OpenedIndex, tmp_path: Path) -> None:
    write_geopackage(tmp_path / "r.gpkg", [answered("dir/a.jpg")], index)
    match = layer(tmp_path / "r.gpkg", "matches").iloc[0]
    assert match["query"] == "dir/a.jpg"
    assert match["name"] == "a.jpg"
    assert match["detectors"] == "hesaff,mser"
    assert match["captured_at"] == datetime(2024, 6, 12, 7, 32, 16, 250_000, UTC)
    assert match["roll_deg"] is None or np.isnan(match["roll_deg"])
    assert match["altitude_m"] == 37.5
    assert not match["heading_derived"]
    estimate = layer(tmp_path / "r.gpkg", "estimates").iloc[0]
    assert (estimate["radius_m"], estimate["radius_95_m"]) == (12.0, 25.0)
    assert estimate["in_survey"]
    kinds = dict(
        zip(*(pyogrio.read_info(tmp_path / "r.gpkg", layer="estimates")[key].tolist()
              for key in ("fields", "dtypes")), strict=True)
    )  # fmt: skip
    assert kinds["support"] == "int32"
    assert kinds["confidence"] == "float64"
    assert kinds["in_survey"] == "bool"


def test_a_query_sums_up_its_answer(index: OpenedIndex, tmp_path: Path) -> None:
    write_geopackage(tmp_path / "r.gpkg", [answered("a.jpg"), failed("b.jpg", "gone")], index)
    first, second = (row for _, row in layer(tmp_path / "r.gpkg", "queries").iterrows())
    assert (first["n_matches"], first["best_score"], first["best_image"]) == (4, 100.0, "00.jpg")
    assert (first["confidence"], first["k"], first["in_survey"]) == (0.875, 5, True)
    assert pd.isna(first["error"])
    assert first.geometry is not None
    assert (second["n_matches"], second["error"], second.geometry) == (0, "gone", None)


def test_thumbnails_are_small_upright_jpegs(
    index: OpenedIndex, tmp_path: Path, photo: Path
) -> None:
    write_geopackage(tmp_path / "r.gpkg", [answered(str(photo))], index)
    of_photo = layer(tmp_path / "r.gpkg", "queries")["thumbnail"][0]
    with Image.open(io.BytesIO(of_photo)) as picture:
        assert picture.format == "JPEG"
        assert picture.size == (200, 133)
    turned, *gone = layer(tmp_path / "r.gpkg", "matches")["thumbnail"]
    with Image.open(io.BytesIO(turned)) as picture:
        assert picture.size == (133, 200)
    assert gone == [None, None, None]


def test_areas_links_and_views_are_as_large_as_they_say(index: OpenedIndex, tmp_path: Path) -> None:
    write_geopackage(tmp_path / "r.gpkg", [answered("a.jpg")], index)
    areas = layer(tmp_path / "r.gpkg", "estimate_areas").set_index("percent")
    assert areas.geometry[68].area == pytest.approx(np.pi * 12**2, rel=0.01)
    assert areas.geometry[95].area == pytest.approx(np.pi * 25**2, rel=0.01)
    links = layer(tmp_path / "r.gpkg", "links")
    assert links["distance_m"].tolist() == pytest.approx(links.length.tolist(), abs=0.02)
    views = layer(tmp_path / "r.gpkg", "views")
    assert views.area.tolist() == pytest.approx([np.pi * 30**2 * 82 / 360] * 4, rel=0.01)


def test_an_unknown_field_of_view_is_drawn_narrow_and_marked(
    index: OpenedIndex, tmp_path: Path
) -> None:
    matches = (
        made_match("a.jpg", 1, *lon_lat(0), hfov_deg=None, heading_derived=True),
        made_match("a.jpg", 2, *lon_lat(1), heading_deg=None),
    )
    write_geopackage(tmp_path / "r.gpkg", [Located("a.jpg", matches, 0.1)], index)
    views = layer(tmp_path / "r.gpkg", "views")
    assert views["rank"].tolist() == [1]  # without a heading there is no view
    assert views["assumed_hfov"].tolist() == [True]
    assert views["hfov_deg"].tolist() == [30.0]
    assert views["heading_derived"].tolist() == [True]


def test_fields_have_aliases_and_meanings(index: OpenedIndex, tmp_path: Path) -> None:
    write_geopackage(tmp_path / "r.gpkg", [answered("a.jpg")], index)
    with sqlite3.connect(tmp_path / "r.gpkg") as file:
        described = file.execute(
            "select name, description from gpkg_data_columns "
            "where table_name = 'matches' and column_name = 'heading_deg'"
        ).fetchone()
        layers = file.execute(
            "select description from gpkg_contents where table_name = 'links'"
        ).fetchone()
    file.close()
    assert described == ("Heading (°)", "degrees clockwise from true north")
    assert layers == ("From each estimate to its matches. © A survey",)


NAMES = [
    'it\'s "quoted", with commas; DROP TABLE matches;--',
    "two\nlines\tand a tab",
    "巴黎の絵葉書.jpg",
    "ü" * 5000,
    "<b>&amp;</b>.jpg",
    "'",
]


def test_names_come_back_as_they_were(index: OpenedIndex, tmp_path: Path) -> None:
    answers = [*(answered(name) for name in NAMES), *(failed("gone", name) for name in NAMES)]
    write_geopackage(tmp_path / "r.gpkg", answers, index)
    assert layer(tmp_path / "r.gpkg", "matches")["query"].unique().tolist() == NAMES
    queries = layer(tmp_path / "r.gpkg", "queries")
    assert queries["query"].tolist() == [*NAMES, *(["gone"] * len(NAMES))]
    assert queries["error"].dropna().tolist() == NAMES


def test_a_name_that_is_not_utf_8_is_escaped(index: OpenedIndex, tmp_path: Path) -> None:
    write_geopackage(tmp_path / "r.gpkg", [answered("caf\udce9.jpg")], index)
    assert layer(tmp_path / "r.gpkg", "matches")["query"][0] == "caf\\udce9.jpg"


def test_scores_that_are_no_number_are_null(index: OpenedIndex, tmp_path: Path) -> None:
    scores = (float("nan"), float("inf"), -float("inf"))
    matches = tuple(
        made_match("a.jpg", rank, *lon_lat(rank), score=score)
        for rank, score in enumerate(scores, 1)
    )
    write_geopackage(tmp_path / "r.gpkg", [Located("a.jpg", matches, 0.1)], index)
    assert layer(tmp_path / "r.gpkg", "matches")["score"].isna().all()


def test_no_answers_make_a_file_of_empty_layers(index: OpenedIndex, tmp_path: Path) -> None:
    write_geopackage(tmp_path / "r.gpkg", [], index)
    assert [len(layer(tmp_path / "r.gpkg", each.name)) for each in LAYERS] == [0] * len(LAYERS)
    assert len(pyogrio.read_dataframe(tmp_path / "r.gpkg", layer="layer_styles")) == len(LAYERS)


def test_all_photos_failing_leaves_their_reasons(index: OpenedIndex, tmp_path: Path) -> None:
    write_geopackage(tmp_path / "r.gpkg", [failed("a"), failed("b", "truncated")], index)
    assert layer(tmp_path / "r.gpkg", "queries")["error"].tolist() == ["no such file", "truncated"]
    assert len(layer(tmp_path / "r.gpkg", "matches")) == 0


def test_a_survey_without_system_has_matches_without_place(tmp_path: Path) -> None:
    images = [replace(posed("00.jpg", 0, 0), pose=None)]
    index = made_index(tmp_path / "index", images, None)
    answer = Located("a.jpg", (made_match("a.jpg", 1, None, None),), 0.1)
    write_geopackage(tmp_path / "r.gpkg", [answer], index)
    matches = layer(tmp_path / "r.gpkg", "matches")
    assert matches.crs == "EPSG:4326"
    assert matches.geometry.tolist() == [None]
    assert len(layer(tmp_path / "r.gpkg", "views")) == len(layer(tmp_path / "r.gpkg", "links")) == 0


@pytest.mark.parametrize(
    ("crs", "expected"),
    [
        ("EPSG:2154+5720", "EPSG:2154"),
        ("EPSG:4979", "EPSG:4326"),
        ("EPSG:4171", "EPSG:4171"),
        ("+proj=tmerc +lon_0=2 +x_0=500000 +datum=WGS84 +units=m", None),
    ],
)
def test_systems_are_written_as_their_horizontal_part(
    tmp_path: Path, crs: str, expected: str | None
) -> None:
    system = ToWgs84(crs)
    easting, northing = system.from_lon_lat([2.34], [48.85])
    index = made_index(
        tmp_path / "index", [posed("00.jpg", float(easting[0]), float(northing[0]), crs)], crs
    )
    answer = Located("a.jpg", (made_match("a.jpg", 1, 2.34, 48.85),), 0.1)
    write_geopackage(tmp_path / "r.gpkg", [answer], index)
    matches = layer(tmp_path / "r.gpkg", "matches")
    if expected is not None:
        assert matches.crs == expected
    placed = matches.to_crs("EPSG:4326").geometry[0]
    assert (placed.x, placed.y) == pytest.approx((2.34, 48.85), abs=1e-6)


def test_views_and_links_across_longitude_180_stay_small(tmp_path: Path) -> None:
    images = [posed("00.jpg", 179.9999, -17.0), posed("01.jpg", -179.9999, -17.0)]
    index = made_index(tmp_path / "index", images, "EPSG:4326")
    matches = [made_match("a.jpg", 1, 179.9999, -17.0), made_match("a.jpg", 2, -179.9999, -17.0)]
    estimate = made_estimate("a.jpg", 179.99995, -17.0)
    write_geopackage(tmp_path / "r.gpkg", [Located("a.jpg", (*matches, estimate), 0.1)], index)
    for name in ("views", "estimate_areas", "links"):
        for shape in layer(tmp_path / "r.gpkg", name).geometry:
            assert all(part.bounds[2] - part.bounds[0] < 0.01 for part in shape.geoms), name
    assert layer(tmp_path / "r.gpkg", "links")["distance_m"].max() < 30


def test_batches_are_taken_as_they_come(
    index: OpenedIndex, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(batches, "BATCH", 2)
    parts = tmp_path.glob

    def answers() -> Iterator[Located]:
        for number in range(5):
            if number == 4:  # two batches are on the disk by now
                (part,) = parts(".flaneur-out-*/results.gpkg")
                assert len(layer(part, "queries")) == 4
            yield answered(f"{number}.jpg")

    write_geopackage(tmp_path / "r.gpkg", answers(), index)
    assert layer(tmp_path / "r.gpkg", "queries")["name"].tolist() == [f"{n}.jpg" for n in range(5)]
    assert len(layer(tmp_path / "r.gpkg", "matches")) == 20


@pytest.mark.skipif(shutil.which("ogrinfo") is None, reason="no ogrinfo (gdal-bin) here")
def test_ogrinfo_of_debian_reads_every_layer(index: OpenedIndex, tmp_path: Path) -> None:
    write_geopackage(tmp_path / "r.gpkg", [answered("a.jpg")], index)
    said = subprocess.run(
        ["ogrinfo", "-al", "-so", tmp_path / "r.gpkg"], capture_output=True, text=True, check=True
    )
    assert "ERROR" not in said.stderr
    assert "Warning" not in said.stderr
    assert said.stdout.count('ID["EPSG",2154]') == len(LAYERS)


VALIDATE = """
import sys
from osgeo import gdal
from osgeo_utils.samples.validate_gpkg import check
gdal.UseExceptions()
check(sys.argv[1], abort_at_first_error=True, extra_checks=True, warning_as_error=True)
"""


def test_the_file_is_a_valid_geopackage_to_gdals_validator(
    index: OpenedIndex, tmp_path: Path
) -> None:
    python = Path("/usr/bin/python3")
    has_validator = [python, "-c", "from osgeo_utils.samples import validate_gpkg"]
    if not python.exists() or subprocess.run(has_validator, capture_output=True).returncode:
        pytest.skip("no validate_gpkg (python3-gdal) for /usr/bin/python3")
    write_geopackage(tmp_path / "r.gpkg", [answered("a.jpg"), failed("b.jpg")], index)
    said = subprocess.run(
        [python, "-c", VALIDATE, tmp_path / "r.gpkg"], capture_output=True, text=True
    )
    assert said.returncode == 0, said.stderr
