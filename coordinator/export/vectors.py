"""Results as one layer of points, a row a feature: FlatGeobuf, GeoParquet or KML.

FlatGeobuf and GeoParquet are in the survey's own system, KML in WGS 84 as it has to be. Rows are
kept beside the file until all are there: a writer of FlatGeobuf cannot be interrupted and go on.
"""

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pyogrio
import shapely

from contracts.errors import WrongInput
from coordinator.export.batches import in_batches
from coordinator.export.beside import writing_to, written_beside
from coordinator.export.columns import GEOMETRY, TEXT, Column, table
from coordinator.export.geopackage.layers import ESTIMATES, MATCHES, QUERIES, TARGETS
from coordinator.export.geopackage.places import (
    WGS84,
    camera_points,
    feature_points,
    layers_system,
    system_wkt,
)
from coordinator.export.geopackage.rows import image_properties, named
from coordinator.querying import Located
from geo.antimeridian import Shapes
from geo.crs import ToWgs84
from geo.geojson import Feature
from index.opened import OpenedIndex

_OWN = (
    Column("kind", TEXT, "Kind", "match, estimate, target or error, as in the GeoJSON"),
    Column("label", TEXT, "Label", "the rank of a match, the name of the photo otherwise"),
)
COLUMNS = tuple(
    {
        column.name: column
        for column in (
            *_OWN,
            *MATCHES.columns,
            *ESTIMATES.columns,
            *TARGETS.columns,
            *(each for each in QUERIES.columns if each.name == "error"),
        )
        if column.name not in ("name", "thumbnail")
    }.values()
)
"""All columns of all kinds of features, without pictures and `name`: KML labels by it."""


def write_vectors(out: Path, answers: Iterable[Located], index: OpenedIndex) -> None:
    """Write the features of answers, whole or not at all.

    Parameters
    ----------
    out : its ending says the format: .fgb, .parquet or .kml. FlatGeobuf has no row without a
        place: photos that failed and matches without pose are left out there.
    answers : taken one batch at a time. index : that answered.

    Raises
    ------
    WrongInput : `out` cannot be written, or has another ending.
    UnknownCrs : the survey's system has no exact enough conversion to WGS 84.
    """
    write = _WRITERS.get(out.suffix.lower())
    if write is None:
        raise WrongInput(f"--out {out} ends in none of {', '.join(_WRITERS)}; name one of these")
    system = WGS84 if out.suffix.lower() == ".kml" else layers_system(index)
    with written_beside(out) as part:
        kept = part.with_suffix(".arrow")
        _keep(kept, out, answers, index, system)
        with writing_to(out), pa.OSFile(str(kept)) as stream, pa.ipc.open_stream(stream) as rows:
            write(part, rows, system)


def _keep(
    kept: Path, out: Path, answers: Iterable[Located], index: OpenedIndex, system: ToWgs84
) -> None:
    """Write the rows of all answers into an Arrow stream."""
    with writing_to(out):
        stream = pa.OSFile(str(kept), "wb")
        writer = pa.ipc.new_stream(stream, table(COLUMNS, [], []).schema)
    for batch in in_batches(answers):
        features = [feature for answer in batch for feature in answer.features]
        rows = _rows(features, index, system)
        with writing_to(out):
            writer.write_table(rows)
    # Not closed when it failed: closing writes, and would hide the failure behind its own.
    with writing_to(out):
        writer.close()
        stream.close()


def _rows(features: Sequence[Feature], index: OpenedIndex, system: ToWgs84) -> pa.Table:
    rows = [named(feature) for feature in features]
    points = feature_points(system, features)
    matches = [n for n, row in enumerate(rows) if row["kind"] == "match"]
    images = index.catalogue.rows([rows[n]["image_id"] for n in matches])
    for n, image in zip(matches, images, strict=True):
        rows[n] |= image_properties(image)
    if system != WGS84:  # exactly as surveyed, not by the rounded degrees of the features
        points[matches] = camera_points(images)
    for row in rows:
        row["label"] = str(row.get("rank", row["name"]))
    return table(COLUMNS, rows, points)


def _write_flatgeobuf(part: Path, rows: pa.RecordBatchReader, system: ToWgs84) -> None:
    placed = pa.RecordBatchReader.from_batches(
        rows.schema, (batch.filter(pc.is_valid(batch[GEOMETRY])) for batch in rows)
    )
    _write_with_gdal(part, placed, system, "FlatGeobuf")


def _write_kml(part: Path, rows: pa.RecordBatchReader, system: ToWgs84) -> None:
    _write_with_gdal(part, rows, system, "KML", dataset_options={"NameField": "label"})


def _write_with_gdal(
    part: Path, rows: pa.RecordBatchReader, system: ToWgs84, driver: str, **options: dict[str, str]
) -> None:
    pyogrio.write_arrow(
        rows,
        part,
        layer="results",
        driver=driver,
        geometry_name=GEOMETRY,
        geometry_type="Point",
        crs=system_wkt(system),
        **options,
    )


def _write_geoparquet(part: Path, rows: pa.RecordBatchReader, system: ToWgs84) -> None:
    """GeoParquet 1.1; its extent is written into the footer, when all rows were seen."""
    bounds = np.full(4, np.nan)
    with pq.ParquetWriter(part, rows.schema, compression="zstd") as writer:
        for batch in rows:
            writer.write_batch(batch)
            bounds = _joined(bounds, shapely.from_wkb(batch[GEOMETRY].to_pylist()))
        column: dict[str, Any] = {
            "encoding": "WKB",
            "geometry_types": ["Point"],
            "crs": system.crs.to_json_dict(),
        }
        if np.isfinite(bounds).all():
            column["bbox"] = bounds.tolist()
        described = {"version": "1.1.0", "primary_column": GEOMETRY, "columns": {GEOMETRY: column}}
        writer.add_key_value_metadata({"geo": json.dumps(described)})


def _joined(bounds: np.ndarray, points: Shapes) -> np.ndarray:
    """West, south, east and north around both; NaN: nothing yet."""
    west, south, east, north = shapely.total_bounds(points)
    return np.concatenate([np.fmin(bounds[:2], [west, south]), np.fmax(bounds[2:], [east, north])])


_WRITERS = {".fgb": _write_flatgeobuf, ".parquet": _write_geoparquet, ".kml": _write_kml}
