"""FlatGeobuf, GeoParquet and KML as other programs read them."""

import json
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

import geopandas as gpd
import pyarrow.parquet as pq
import pyogrio
import pytest
from made_results import failed, made_estimate, made_index, made_match, posed

from contracts.errors import WrongInput
from coordinator.export import batches
from coordinator.export.vectors import COLUMNS, write_vectors
from coordinator.querying import Located
from geo.crs import ToWgs84
from geo.geojson import PlacedTarget, target_feature
from index.opened import OpenedIndex

FORMATS = (".fgb", ".parquet", ".kml")
LON_LAT = (2.346, 48.856)


@pytest.fixture
def index(tmp_path: Path) -> OpenedIndex:
    easting, northing = ToWgs84("EPSG:2154").from_lon_lat([LON_LAT[0]], [LON_LAT[1]])
    image = posed("00.jpg", float(easting[0]), float(northing[0]))
    return made_index(tmp_path / "index", [image], "EPSG:2154")


def answered(query: str) -> Located:
    features = (
        made_match(query, 1, *LON_LAT),
        made_estimate(query, *LON_LAT, in_survey=False),
        target_feature(PlacedTarget(query, *LON_LAT, 6.0, 3)),
    )
    return Located(query, features, 0.25)


def read(path: Path) -> gpd.GeoDataFrame:
    if path.suffix == ".parquet":
        return gpd.read_parquet(path)
    return pyogrio.read_dataframe(path)


@pytest.mark.parametrize("suffix", FORMATS)
def test_every_feature_is_a_row_at_its_place(
    index: OpenedIndex, tmp_path: Path, suffix: str
) -> None:
    out = tmp_path / f"r{suffix}"
    write_vectors(out, [answered("a.jpg"), answered("b.jpg")], index)
    rows = read(out)
    assert rows["kind"].tolist() == ["match", "estimate", "target"] * 2
    assert rows["query"].tolist() == ["a.jpg"] * 3 + ["b.jpg"] * 3
    assert rows.crs == ("EPSG:4326" if suffix == ".kml" else "EPSG:2154")
    for point in rows.to_crs("EPSG:4326").geometry:
        assert (point.x, point.y) == pytest.approx(LON_LAT, abs=1e-6)
    assert rows["radius_m"].dropna().tolist() == [12.0, 6.0] * 2
    assert float(rows["score"][0]) == 100.0


def test_what_has_no_place_is_kept_where_the_format_can(index: OpenedIndex, tmp_path: Path) -> None:
    counts = {}
    for suffix in FORMATS:
        write_vectors(tmp_path / f"r{suffix}", [answered("a.jpg"), failed("b.jpg")], index)
        counts[suffix] = len(read(tmp_path / f"r{suffix}"))
    assert counts == {".fgb": 3, ".parquet": 4, ".kml": 4}


def test_flatgeobuf_has_a_spatial_index(index: OpenedIndex, tmp_path: Path) -> None:
    write_vectors(tmp_path / "r.fgb", [answered("a.jpg")], index)
    assert pyogrio.read_info(tmp_path / "r.fgb")["capabilities"]["fast_spatial_filter"]


def test_geoparquet_says_what_the_specification_asks(index: OpenedIndex, tmp_path: Path) -> None:
    write_vectors(tmp_path / "r.parquet", [answered("a.jpg"), failed("b.jpg")], index)
    described = json.loads(pq.read_metadata(tmp_path / "r.parquet").metadata[b"geo"])
    column = described["columns"][described["primary_column"]]
    assert described["version"] == "1.1.0"
    assert column["encoding"] == "WKB"
    assert column["geometry_types"] == ["Point"]
    assert column["crs"]["id"] == {"authority": "EPSG", "code": 2154}
    rows = gpd.read_parquet(tmp_path / "r.parquet")
    assert column["bbox"] == pytest.approx(rows.total_bounds.tolist())
    assert str(rows["captured_at"].dtype) == "datetime64[ms, UTC]"
    assert rows["in_survey"].dropna().tolist() == [False]


def test_a_kml_mark_is_labelled_with_its_rank(index: OpenedIndex, tmp_path: Path) -> None:
    write_vectors(tmp_path / "r.kml", [answered("dir/a.jpg")], index)
    names = ET.parse(tmp_path / "r.kml").iter("{http://www.opengis.net/kml/2.2}Placemark")  # noqa: S314
    assert [mark.findtext("{http://www.opengis.net/kml/2.2}name") for mark in names] == [
        "1",
        "a.jpg",
        "a.jpg",
    ]


@pytest.mark.parametrize("suffix", FORMATS)
def test_odd_names_come_back_as_they_were(index: OpenedIndex, tmp_path: Path, suffix: str) -> None:
    names = ['it\'s "one", <b>&amp;', "巴黎\nの絵葉書", "x" * 5000]
    write_vectors(tmp_path / f"r{suffix}", [answered(name) for name in names], index)
    assert read(tmp_path / f"r{suffix}")["query"].unique().tolist() == names


@pytest.mark.parametrize("suffix", FORMATS)
def test_names_that_are_not_utf_8_and_controls_break_no_file(
    index: OpenedIndex, tmp_path: Path, suffix: str
) -> None:
    write_vectors(tmp_path / f"r{suffix}", [answered("\udce9\x01.jpg")], index)
    assert read(tmp_path / f"r{suffix}")["query"][0].startswith("\\udce9")


@pytest.mark.parametrize("suffix", FORMATS)
def test_no_answers_make_an_empty_layer(index: OpenedIndex, tmp_path: Path, suffix: str) -> None:
    write_vectors(tmp_path / f"r{suffix}", [], index)
    rows = read(tmp_path / f"r{suffix}")
    assert len(rows) == 0
    if suffix != ".kml":
        assert {column.name for column in COLUMNS} <= set(rows.columns)


@pytest.mark.parametrize("suffix", FORMATS)
def test_batches_follow_one_another(
    index: OpenedIndex, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str
) -> None:
    monkeypatch.setattr(batches, "BATCH", 2)
    write_vectors(tmp_path / f"r{suffix}", (answered(f"{n}.jpg") for n in range(5)), index)
    rows = read(tmp_path / f"r{suffix}")
    matches = rows[rows["kind"] == "match"]
    assert sorted(matches["query"]) == [f"{n}.jpg" for n in range(5)]


def test_another_ending_is_refused(index: OpenedIndex, tmp_path: Path) -> None:
    with pytest.raises(WrongInput, match=r"--out .*r\.shp ends in none of \.fgb, \.parquet, \.kml"):
        write_vectors(tmp_path / "r.shp", [], index)


@pytest.mark.parametrize("suffix", FORMATS)
def test_what_ends_the_answers_comes_through_and_leaves_no_file(
    index: OpenedIndex, tmp_path: Path, suffix: str
) -> None:
    def answers() -> Iterator[Located]:
        yield answered("a.jpg")
        raise ConnectionError("the broker went away")

    with pytest.raises(ConnectionError, match="the broker went away"):
        write_vectors(tmp_path / "out" / f"r{suffix}", answers(), index)
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.skipif(shutil.which("ogrinfo") is None, reason="no ogrinfo (gdal-bin) here")
@pytest.mark.parametrize("suffix", [".fgb", ".kml"])
def test_ogrinfo_of_debian_reads_it(index: OpenedIndex, tmp_path: Path, suffix: str) -> None:
    write_vectors(tmp_path / f"r{suffix}", [answered("a.jpg")], index)
    said = subprocess.run(
        ["ogrinfo", "-al", "-so", tmp_path / f"r{suffix}"], capture_output=True, text=True
    )
    assert said.returncode == 0
    assert "Feature Count: 3" in said.stdout
    assert "ERROR" not in said.stderr
