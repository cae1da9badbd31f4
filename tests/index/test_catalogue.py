"""A catalogue is read as it is asked for, and a damaged one is an error that names it."""

from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from made_places import ROW
from pyarrow import parquet

from contracts.errors import BadIndex
from index import catalogue as catalogue_module
from index.catalogue import Catalogue, CatalogueRow, write_catalogue

ROWS = [
    replace(
        ROW,
        image_id=number,
        uri=f"run/{number:04d} é.jpg",
        sha256=f"{number:064x}",
        easting=652000.0 + number,
        captured_at=None if number % 3 else f"2014-06-16T10:00:{number % 60:02d}.5+02:00",
    )
    for number in range(60)
]
ROWS[7] = replace(
    ROWS[7], easting=None, northing=None, altitude_m=None, heading_deg=None, north=None
)


@pytest.fixture
def paths(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Two segments of 40 and 20 images, in row groups of 8."""
    monkeypatch.setattr(catalogue_module, "GROUP_ROWS", 8)
    paths = [tmp_path / "0001.parquet", tmp_path / "0002.parquet"]
    local = [replace(row, image_id=at) for at, row in enumerate(ROWS[40:])]
    for path, rows in zip(paths, (ROWS[:40], local), strict=True):
        write_catalogue(path, rows, "EPSG:2154")
    return paths


def opened(paths: list[Path]) -> Catalogue:
    return Catalogue(paths, [40, 20])


def test_rows_come_as_written_in_the_order_asked_over_groups_and_segments(
    paths: list[Path],
) -> None:
    ids = [59, 0, 41, 8, 7, 8, 39, 40]
    assert opened(paths).rows(ids) == [ROWS[number] for number in ids]
    assert opened(paths).rows(range(60)) == ROWS
    assert opened(paths).rows([]) == []


def test_columns_are_those_of_the_rows(paths: list[Path]) -> None:
    catalogue = opened(paths)
    assert len(catalogue) == 60
    assert catalogue.column("uri") == [row.uri for row in ROWS]
    some = np.array([59, 7, 0])
    assert catalogue.texts("north", some) == [ROWS[number].north for number in some]
    easting = [np.nan if row.easting is None else row.easting for row in ROWS]
    np.testing.assert_array_equal(catalogue.numbers("easting"), easting)
    np.testing.assert_array_equal(catalogue.numbers("width_px"), [1920.0] * 60)
    assert np.flatnonzero(catalogue.is_among("uri", [ROWS[3].uri, ROWS[50].uri, "x"])).tolist() == [
        3,
        50,
    ]


def test_moments_are_in_utc_and_none_is_not_a_time(paths: list[Path]) -> None:
    moments = opened(paths).moments()
    assert moments[3] == np.datetime64("2014-06-16T08:00:03.5")
    assert np.isnat(moments[[1, 2, 59]]).all()


def test_moments_of_zones_with_seconds_are_read_too(tmp_path: Path) -> None:
    times = ["1899-06-16T10:00:00+00:09:21", "2014-06-16T10:00:00Z", None, "1899"]
    rows = [replace(ROW, image_id=at, captured_at=time) for at, time in enumerate(times)]
    write_catalogue(tmp_path / "c.parquet", rows, "EPSG:2154")
    moments = Catalogue([tmp_path / "c.parquet"], [4]).moments()
    assert (
        moments[:2].tolist()
        == np.array(["1899-06-16T09:50:39", "2014-06-16T10:00:00"], "datetime64[us]").tolist()
    )
    assert np.isnat(moments[2:]).all()


def test_nothing_is_read_before_it_is_asked_for(tmp_path: Path) -> None:
    catalogue = Catalogue([tmp_path / "gone.parquet"], [40])
    assert len(catalogue) == 40
    with pytest.raises(BadIndex, match=r"gone\.parquet cannot be read as a catalogue"):
        catalogue.rows([0])


@pytest.mark.parametrize("image_id", [-1, 60])
def test_an_image_that_is_not_there_is_refused(paths: list[Path], image_id: int) -> None:
    with pytest.raises(BadIndex, match=f"image {image_id} was asked for; the catalogue has 60"):
        opened(paths).rows([0, image_id])


def test_a_catalogue_of_another_segment_is_refused(paths: list[Path]) -> None:
    with pytest.raises(BadIndex, match=r"0001\.parquet has 40 rows; its segment has 41 images"):
        Catalogue(paths, [41, 20]).rows([0])


def test_the_same_rows_are_the_same_bytes(paths: list[Path], tmp_path: Path) -> None:
    again = tmp_path / "again.parquet"
    write_catalogue(again, ROWS[:40], "EPSG:2154")
    assert again.read_bytes() == paths[0].read_bytes()


def everything(path: Path) -> list[CatalogueRow]:
    catalogue = Catalogue([path], [40])
    catalogue.moments(), catalogue.numbers("easting"), catalogue.column("sha256")
    return catalogue.rows(range(40))


def test_an_image_without_a_uri_is_refused_where_all_are_asked_for(paths: list[Path]) -> None:
    table = parquet.read_table(paths[1])
    uris = pa.array([None, *table["uri"].to_pylist()[1:]], pa.string())
    at = table.schema.get_field_index("uri")
    parquet.write_table(table.set_column(at, "uri", uris), paths[1])
    with pytest.raises(BadIndex, match=r"1 of the 60 images .* have no uri; `flaneur verify`"):
        opened(paths).column("uri")


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9, 0.999])
def test_a_truncated_file_is_refused_by_name(paths: list[Path], share: float) -> None:
    content = paths[0].read_bytes()
    paths[0].write_bytes(content[: int(len(content) * share)])
    with pytest.raises(BadIndex, match=r"0001\.parquet"):
        everything(paths[0])


def test_changed_bytes_are_refused_or_change_nothing(paths: list[Path]) -> None:
    content = paths[0].read_bytes()
    rng = np.random.default_rng(0)
    # Half of them in the footer, which no checksum guards.
    places = [
        *rng.integers(4, len(content), 50),
        *rng.integers(len(content) - 9000, len(content), 50),
    ]
    refused = 0
    for place in places:
        changed = bytearray(content)
        changed[place] ^= 1 << int(rng.integers(8))
        paths[0].write_bytes(changed)
        try:
            found = everything(paths[0])
        except BadIndex:
            refused += 1
        else:
            assert [asdict(row) for row in found] == [asdict(row) for row in ROWS[:40]]
    assert refused > 20
