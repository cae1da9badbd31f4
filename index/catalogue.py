"""The catalogue: one row an indexed image, as GeoParquet 1.1 in the survey's own CRS.

image_id is the row number: dense, in the order of the NFC bytes of the uri.
"""

import json
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import islice
from pathlib import Path
from typing import IO, Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray

from contracts.config import North
from contracts.dates import utc_instant
from contracts.errors import BadIndex
from contracts.records import PosedImage
from geo.crs import parse_crs
from index.catalogue_file import MEND, CatalogueFile
from index.files import write_atomic

GROUP_ROWS = 4096
"""Rows that are read together where one of them is asked for."""


@dataclass(frozen=True, slots=True)
class CatalogueRow:
    """What the index knows of one image; `heading_deg` is clockwise from `north`."""

    image_id: int
    uri: str
    path: str
    fragment: str
    survey: str
    sha256: str
    easting: float | None
    northing: float | None
    altitude_m: float | None
    heading_deg: float | None
    heading_derived: bool
    north: North | None
    pitch_deg: float | None
    roll_deg: float | None
    position_error_m: float | None
    camera: str
    hfov_deg: float | None
    width_px: int
    height_px: int
    captured_at: str | None
    quarter_turns: int


_TYPES = {
    "image_id": pa.uint32(),
    "easting": pa.float64(),
    "northing": pa.float64(),
    "altitude_m": pa.float64(),
    "heading_deg": pa.float64(),
    "heading_derived": pa.bool_(),
    "pitch_deg": pa.float64(),
    "roll_deg": pa.float64(),
    "position_error_m": pa.float64(),
    "hfov_deg": pa.float64(),
    "width_px": pa.int32(),
    "height_px": pa.int32(),
    "quarter_turns": pa.int8(),
}
SCHEMA = pa.schema(
    [(name, _TYPES.get(name, pa.string())) for name in CatalogueRow.__dataclass_fields__]
)
_FILE_SCHEMA = SCHEMA.append(pa.field("geometry", pa.binary()))


def catalogue_row(
    image_id: int, survey: str, image: PosedImage, sha256: str, width_px: int, height_px: int
) -> CatalogueRow:
    """Join what the survey said of an image with what decoding it showed."""
    pose = image.pose
    return CatalogueRow(
        image_id=image_id,
        uri=image.uri,
        path=image.path,
        fragment=image.fragment,
        survey=survey,
        sha256=sha256,
        easting=pose.easting if pose else None,
        northing=pose.northing if pose else None,
        altitude_m=pose.altitude_m if pose else None,
        heading_deg=pose.heading_deg if pose else None,
        heading_derived=pose.heading_derived if pose else False,
        north=pose.north if pose else None,
        pitch_deg=pose.pitch_deg if pose else None,
        roll_deg=pose.roll_deg if pose else None,
        position_error_m=pose.position_error_m if pose else None,
        camera=image.camera.name,
        hfov_deg=image.camera.hfov_deg,
        width_px=width_px,
        height_px=height_px,
        captured_at=image.captured_at,
        quarter_turns=image.quarter_turns,
    )


def write_catalogue(path: Path, rows: Iterable[CatalogueRow], crs: str | None) -> str:
    """Write rows as GeoParquet, a group at a time, however many there are; returns the sha256.

    crs : of the poses; the geometry (null where there is no pose) has its horizontal part.
    """

    def write(stream: IO[bytes]) -> None:
        bounds = np.empty((0, 2))
        left = iter(rows)
        with pq.ParquetWriter(stream, _FILE_SCHEMA, write_page_checksum=True) as writer:
            while group := list(islice(left, GROUP_ROWS)):
                xy = np.array([(row.easting, row.northing) for row in group], dtype=np.float64)
                posed = np.isfinite(xy[:, 0]) & np.isfinite(xy[:, 1])
                writer.write_table(_table(group, xy, posed))
                if posed.any():
                    within = np.concatenate([bounds, xy[posed]])
                    bounds = np.array([within.min(axis=0), within.max(axis=0)])
            writer.add_key_value_metadata({"geo": json.dumps(_geometry(crs, bounds))})

    return write_atomic(path, write)


def _table(
    group: Sequence[CatalogueRow], xy: NDArray[np.float64], posed: NDArray[np.bool_]
) -> pa.Table:
    import shapely  # slow to import, and only the writer needs it

    points = np.full(len(group), None, dtype=object)
    points[posed] = shapely.to_wkb(shapely.points(xy[posed]), flavor="iso")
    columns = [
        pa.array([getattr(row, field.name) for row in group], type=field.type) for field in SCHEMA
    ]
    return pa.table([*columns, pa.array(points, type=pa.binary())], schema=_FILE_SCHEMA)


def _geometry(crs: str | None, bounds: NDArray[np.float64]) -> dict[str, object]:
    """What GeoParquet 1.1 says of the column. bounds : (2, 2) least and most; (0, 2): no pose."""
    column: dict[str, object] = {
        "encoding": "WKB",
        "crs": None if crs is None else parse_crs(crs).to_json_dict(),
        "geometry_types": ["Point"] if len(bounds) else [],
    }
    if len(bounds):
        column["bbox"] = bounds.ravel().tolist()
    return {"version": "1.1.0", "primary_column": "geometry", "columns": {"geometry": column}}


class Catalogue:
    """Rows of the written catalogues of an index's segments, read as they are asked for.

    A row's image_id is that of the whole index: its segment's rows follow those before. Methods
    raise BadIndex for a damaged file.
    """

    def __init__(self, paths: Sequence[Path], n_rows: Sequence[int]) -> None:
        self._files = [
            CatalogueFile(path, count, SCHEMA) for path, count in zip(paths, n_rows, strict=True)
        ]
        self._begins = np.cumsum([0, *n_rows], dtype=np.int64)

    def __len__(self) -> int:
        return int(self._begins[-1])

    def rows(self, image_ids: Sequence[int] | NDArray[np.int64]) -> list[CatalogueRow]:
        """The rows of some images, in the order asked for.

        Raises
        ------
        BadIndex : there is no such image.
        """
        ids = np.asarray(image_ids, dtype=np.int64)
        wrong = ids[(ids < 0) | (ids >= len(self))]
        if len(wrong):
            raise BadIndex(f"image {wrong[0]} was asked for; the catalogue has {len(self)} images")
        rows: list[dict[str, Any]] = [{}] * len(ids)
        segments = np.searchsorted(self._begins, ids, side="right") - 1
        for segment in np.unique(segments).tolist():
            mine = np.flatnonzero(segments == segment)
            found = self._files[segment].rows(ids[mine] - self._begins[segment])
            for at, row in zip(mine.tolist(), found, strict=True):
                rows[at] = row
        return [
            CatalogueRow(**{**row, "image_id": image_id})
            for row, image_id in zip(rows, ids.tolist(), strict=True)
        ]

    def column(self, name: str) -> list[str]:
        """A text column that every image has (`uri`, `sha256`, …), of all images."""
        column = self._column(name)
        if column.null_count:
            raise BadIndex(
                f"{column.null_count} of the {len(self)} images of the catalogue have no {name}; "
                f"`flaneur verify` names the file. {MEND}"
            )
        values: list[str] = column.to_pylist()
        return values

    def texts(self, name: str, image_ids: NDArray[np.int64]) -> list[str | None]:
        """A text column that not every image has (`north`, `captured_at`), of some images."""
        values: list[str | None] = self._column(name).take(pa.array(image_ids)).to_pylist()
        return values

    def numbers(self, name: str) -> NDArray[np.float64]:
        """One column of numbers of all images, (n_images,) float64; NaN: not known."""
        return np.asarray(self._column(name).cast(pa.float64()), np.float64)

    def moments(self) -> NDArray[np.datetime64]:
        """When each image was taken, (n_images,) datetime64[us] in UTC; NaT: not known."""
        column = self._column("captured_at")
        try:
            return np.asarray(column.cast(pa.timestamp("us", "UTC")))
        except pa.ArrowInvalid:  # zones of a century ago had odd seconds: one by one
            return np.array([_instant(text) for text in column.to_pylist()], "datetime64[us]")

    def counts(self, name: str) -> Counter[str]:
        """How many images have each value of a text column."""
        found = pc.value_counts(self._column(name)).to_pylist()
        return Counter({each["values"]: each["counts"] for each in found})

    def is_among(self, name: str, values: Sequence[str]) -> NDArray[np.bool_]:
        """Whose text column has one of these values; (n_images,) bool."""
        column = self._column(name)
        return np.array(pc.is_in(column, pa.array(values, column.type)), dtype=np.bool_)

    def _column(self, name: str) -> pa.ChunkedArray:
        empty = pa.chunked_array([], SCHEMA.field(name).type)
        chunks = [chunk for file in self._files for chunk in file.column(name).chunks]
        return pa.chunked_array(chunks, empty.type)


def _instant(text: str | None) -> np.datetime64:
    try:
        return np.datetime64("NaT") if text is None else utc_instant(datetime.fromisoformat(text))
    except (ValueError, OverflowError):
        return np.datetime64("NaT")
