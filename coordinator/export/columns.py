"""Columns of result layers: typed, with the name a person reads, filled from rows of properties."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np
import pyarrow as pa
import shapely
from numpy.typing import NDArray

GEOMETRY = "geom"

INTEGER, REAL, TEXT, YES_NO = pa.int32(), pa.float64(), pa.string(), pa.bool_()
MOMENT, JPEG = pa.timestamp("ms", tz="UTC"), pa.binary()

Row = Mapping[str, object]


@dataclass(frozen=True, slots=True)
class Column:
    """One column; `alias` is what QGIS shows for `name`, `meaning` says unit and convention."""

    name: str
    type: pa.DataType
    alias: str
    meaning: str


def table(
    columns: Sequence[Column], rows: Sequence[Row], shapes: Sequence[object] | NDArray[np.object_]
) -> pa.Table:
    """Rows with their geometry as Arrow; what a row lacks or what is not finite is null.

    Parameters
    ----------
    rows : properties by the name of their column; others are left out. Lists of names become
        text with commas, ISO 8601 moments become UTC, and a byte of a name that is not UTF-8 is
        written as its escape, as in the GeoJSON.
    shapes : a shapely geometry, or None, a row.
    """
    fields = [_field(column) for column in columns]
    arrays = [
        pa.array([_cell(row.get(column.name), column.type) for row in rows], column.type)
        for column in columns
    ]
    wkb = shapely.to_wkb(np.asarray(shapes, dtype=object)).tolist()
    geometry = pa.field(GEOMETRY, pa.binary(), metadata={"ARROW:extension:name": "geoarrow.wkb"})
    return pa.table([*arrays, pa.array(wkb, pa.binary())], schema=pa.schema([*fields, geometry]))


def _field(column: Column) -> pa.Field:
    # GDAL reads these keys, and writes them where the format has a place for them.
    described = {
        "GDAL:OGR:alternative_name": column.alias,
        "GDAL:OGR:comment": column.meaning,
    }
    return pa.field(column.name, column.type, metadata=described)


def _cell(value: object, kind: pa.DataType) -> object:
    if isinstance(value, list | tuple):
        value = ",".join(str(each) for each in value)
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, str):
        return datetime.fromisoformat(value) if kind == MOMENT else _writable(value)
    return value


def _writable(text: str) -> str:
    return text.encode("utf-8", "backslashreplace").decode()
