"""No bytes whatever make a table reader raise anything but an error of ours."""

import csv
import io
import json
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pictured import AS_IT_IS, L93, pictured

from contracts.errors import FlaneurError
from survey import read_survey

MAGIC = [b"", b"PAR1", b"SQLite format 3\0", b"\x00\x00\x27\x0a", b"fgb\x03fgb\x00", b"{", b"["]
CELLS = st.one_of(
    st.sampled_from(["a.jpg", "652000", "6862000", "file", "x", "y", "lon", "crs", "EPSG:2154"]),
    st.text(max_size=8),
    st.floats().map(str),
)


@contextmanager
def survey_with(data: bytes, name: str) -> Iterator[Path]:
    with TemporaryDirectory() as folder:
        path = pictured(Path(folder), "a.jpg") / name
        path.write_bytes(data)
        yield path


def tried(data: bytes, name: str) -> None:
    with survey_with(data, name) as path, suppress(FlaneurError):
        read_survey(path, replace(AS_IT_IS, format="table"))


@settings(max_examples=50, deadline=None)
@given(st.binary(max_size=300))
def test_any_bytes_are_a_table_or_an_error(data: bytes) -> None:
    tried(data, "poses.csv")


@settings(max_examples=100, deadline=None)
@given(st.lists(st.lists(CELLS, max_size=6), max_size=6), st.sampled_from(",;\t| "))
def test_any_rows_are_a_table_or_an_error(rows: list[list[str]], separator: str) -> None:
    header = separator.join(["file", "x", "y", "heading", "time", "hfov"])
    text = "\n".join([header, *(separator.join(row) for row in rows)])
    tried(text.encode("utf-8", "surrogatepass"), "poses.csv")


@settings(max_examples=5, deadline=None)
@given(st.lists(st.text(max_size=12), min_size=1, max_size=3))
def test_any_systems_are_known_or_an_error(systems: list[str]) -> None:
    rows = [f"{at}.jpg,652000,6862000,{name}" for at, name in enumerate(systems)]
    tried("\n".join(["file,x,y,crs", *rows]).encode("utf-8", "surrogatepass"), "poses.csv")


@pytest.mark.parametrize("magic", MAGIC)
@pytest.mark.parametrize("name", ["p.gpkg", "p.parquet", "p.geojson", "p.json"])
def test_any_file_of_points_is_a_table_or_an_error(magic: bytes, name: str) -> None:
    for rest in (b"", b"\0" * 200, b"garbage" * 40, b'"type": "FeatureCollection"', b"1, 2]"):
        tried(magic + rest, name)


@settings(max_examples=100, deadline=None)
@given(st.lists(st.recursive(CELLS, lambda inner: st.lists(inner, max_size=3), max_leaves=4)))
def test_any_json_is_a_table_or_an_error(entries: list[object]) -> None:
    records = [{"filename": entry, "MAPLatitude": entry, "MAPLongitude": 2} for entry in entries]
    tried(json.dumps(records).encode(), "p.json")
    tried(json.dumps(entries).encode(), "p.json")


@settings(max_examples=60, deadline=None)
@given(st.binary(max_size=200))
def test_any_bytes_are_a_mapping_or_an_error(data: bytes) -> None:
    with survey_with(b"file,x,y\na.jpg,652000,6862000\n", "poses.csv") as path:
        mapping = path.parent / "mapping.toml"
        mapping.write_bytes(data)
        with pytest.raises(FlaneurError, match=r"mapping\.toml"):
            read_survey(path, replace(L93, mapping=mapping))


NUMBER = st.floats(-80, 80).map(lambda number: round(number, 6))


@settings(max_examples=60, deadline=None)
@given(
    st.permutations(["file", "lon", "lat", "z", "heading", "pitch", "roll", 'note, "quoted"']),
    st.lists(st.tuples(*[NUMBER] * 6), min_size=1, max_size=4),
    st.sampled_from(",;\t|"),
    st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "latin-1"]),
    st.sampled_from([csv.QUOTE_MINIMAL, csv.QUOTE_ALL, csv.QUOTE_NONNUMERIC]),
)
def test_what_was_written_is_read_however_it_was_written(
    columns: list[str],
    numbers: list[tuple[float, ...]],
    separator: str,
    encoding: str,
    quoting: Literal[0, 1, 2],
) -> None:
    names = [f"é{at}.jpg" for at in range(len(numbers))]
    text = io.StringIO()
    writer = csv.writer(text, delimiter=separator, quoting=quoting)
    writer.writerow(columns)
    for name, (lon, lat, z, heading, pitch, roll) in zip(names, numbers, strict=True):
        cells = {"file": name, "lon": lon, "lat": lat, "z": z, "heading": heading}
        cells |= {"pitch": pitch, "roll": roll}
        writer.writerow([cells.get(column, f"a{separator} b") for column in columns])
    with TemporaryDirectory() as folder:
        path = pictured(Path(folder), *names) / "poses.csv"
        path.write_bytes(text.getvalue().encode(encoding))
        images = read_survey(path, AS_IT_IS).images
    assert [image.uri for image in images] == names
    for image, (lon, lat, z, heading, pitch, roll) in zip(images, numbers, strict=True):
        pose = image.pose
        assert pose is not None
        assert (pose.easting, pose.northing, pose.altitude_m) == (lon, lat, z)
        assert pose.heading_deg == pytest.approx(heading % 360)
        assert (pose.pitch_deg, pose.roll_deg) == pytest.approx((pitch, roll))
