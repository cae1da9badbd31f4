"""A table as a layer of points: GeoPackage, Shapefile, FlatGeobuf, GeoJSON, GeoParquet."""

import importlib
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from contracts.errors import BadSurvey
from contracts.places import Place
from survey.poses import crs_name
from survey.stored import local_copy, open_place
from survey.tables.profile import Profile
from survey.tables.profiles import NOT_RESULTS, of_results, recognised
from survey.tables.table import Column, Faults, Table

if TYPE_CHECKING:
    import pandas

_MAGIC = {
    b"SQLite format 3\0": "GPKG",
    b"\x00\x00\x27\x0a": "ESRI Shapefile",
    b"fgb": "FlatGeobuf",
    b"PAR1": "Parquet",
}
SUFFIXES = frozenset(
    {".gpkg", ".shp", ".fgb", ".parquet", ".geoparquet", ".geojson", ".geojsonl", ".ndjson"}
)
_JSON_SUFFIXES = frozenset({".geojson", ".geojsonl", ".ndjson", ".json"})
_START_BYTES = 4096


def vector_format(path: Place) -> str | None:
    """The format of a file of points by its first bytes, or None.

    GDAL is handed nothing else: it has formats that name further files to open.
    """
    try:
        with open_place(path) as file:
            start = file.read(_START_BYTES)
    except OSError:
        return None
    for magic, name in _MAGIC.items():
        if start.startswith(magic):
            return name
    text = start.removeprefix(b"\xef\xbb\xbf").lstrip(b"\x1e \r\n\t")
    if path.suffix.lower() in _JSON_SUFFIXES and text.startswith(b"{"):
        return "GeoJSON"
    return None


def holds_poses(path: Place) -> bool:
    """Whether a file of points has a layer with a file column; reads no features."""
    try:
        layers = _layers(path)
    except BadSurvey:
        return False
    return any(recognised(layer.fields, layer.has_points) for layer in layers)


def read_vector(path: Place, profile: Profile | None) -> Table:
    """All features of the layer with a file column; geometries give the positions.

    profile : of a mapping; None: whichever profile knows the layer's columns.

    Raises
    ------
    BadSurvey : unreadable, or not one such layer. UnknownCrs : its system is not known.
    """
    frame = _frame(path, _pose_layer(path, profile))
    geometry = frame.geometry.name if isinstance(frame, _geopandas().GeoDataFrame) else None
    names = tuple(str(name) for name in frame.columns if name != geometry)
    columns = tuple(_column(frame[name]) for name in names)
    table = Table(path, names, columns, range(1, len(frame) + 1), row_word="feature")
    if geometry is None:
        return table
    xyz, faults = _points(table, frame.geometry.to_numpy())
    crs = None if frame.crs is None else crs_name(frame.crs.to_string())
    return replace(table, xyz=xyz, crs=crs, faults=faults)


@dataclass(frozen=True, slots=True)
class _Layer:
    """name : None where a file has one layer without a name."""

    name: str | None
    fields: tuple[str, ...]
    has_points: bool


def _pose_layer(path: Place, profile: Profile | None) -> _Layer:
    layers = _layers(path)
    fits = recognised if profile is None else profile.fits
    good = [layer for layer in layers if fits(layer.fields, layer.has_points)]
    if len(good) == 1:
        return good[0]
    if not good and any(of_results(layer.fields) for layer in layers):
        raise BadSurvey(f"pose table {path}: {NOT_RESULTS}")
    named = "; ".join(
        f"{layer.name or path.stem} ({', '.join(layer.fields) or 'no columns'})"
        for layer in good or layers
    )
    raise BadSurvey(
        f"pose table {path}: {len(good)} layers have a column for the image file (file, image, "
        f"path) and a position, expected one; found {named}"
    )


def _layers(path: Place) -> list[_Layer]:
    with _reading(path) as here:
        if vector_format(path) == "Parquet":
            import pyarrow.parquet

            schema = pyarrow.parquet.read_schema(here)
            has_points = b"geo" in (schema.metadata or {})
            return [_Layer(None, tuple(schema.names), has_points)]
        import pyogrio

        layers = []
        for name, geometry_type in pyogrio.list_layers(here):
            fields = pyogrio.read_info(here, layer=name)["fields"]
            layers.append(
                _Layer(str(name), tuple(map(str, fields)), _may_hold_points(geometry_type))
            )
        return layers


def _may_hold_points(geometry_type: str | None) -> bool:
    """A layer that says of what it is made is taken at its word."""
    return geometry_type is not None and ("Point" in geometry_type or geometry_type == "Unknown")


def _frame(path: Place, layer: _Layer) -> "pandas.DataFrame":
    with _reading(path) as here:
        if layer.name is not None:
            import pyogrio

            return pyogrio.read_dataframe(here, layer=layer.name, datetime_as_string=True)
        if layer.has_points:
            return _geopandas().read_parquet(here)
        import pyarrow.parquet

        return pyarrow.parquet.read_table(here).to_pandas()


def _geopandas() -> ModuleType:
    """Imported when a layer is read: workers, which read none, do without it."""
    return importlib.import_module("geopandas")


@contextmanager
def _reading(path: Place) -> Iterator[Path]:
    """Where the file can be opened by its name.

    What GDAL, Arrow and GEOS raise on a damaged file becomes one error.
    """
    from pyproj.exceptions import ProjError
    from shapely.errors import ShapelyError

    try:
        with warnings.catch_warnings(), local_copy(path) as here:
            warnings.simplefilter("ignore")  # whatever matters is raised as well
            yield here
    except (
        *(ArithmeticError, AttributeError, KeyError, OSError, RuntimeError, TypeError),
        *(ValueError, ProjError, ShapelyError),
    ) as error:
        if vector_format(path) == "GeoJSON" and not _is_utf8(path):
            raise BadSurvey(f"pose table {path} is not UTF-8; save it as UTF-8") from error
        first_line = (str(error).strip() or type(error).__name__).splitlines()[0]
        raise BadSurvey(f"pose table {path} cannot be read: {first_line}") from error


def _is_utf8(path: Place) -> bool:
    try:
        path.read_bytes().decode()
    except UnicodeDecodeError:
        return False
    return True


def _column(cells: "pandas.Series") -> Column:
    """Numbers stay numbers; times become ISO 8601; all else is text, "" where there is none."""
    kind = cells.dtype.kind
    if kind in "iuf":
        return np.asarray(cells.to_numpy(np.float64, na_value=np.nan), np.float64)
    missing = cells.isna().to_numpy()
    return [
        "" if none else value.isoformat() if kind == "M" else str(value)
        for value, none in zip(cells, missing, strict=True)
    ]


def _points(table: Table, geometries: NDArray[np.object_]) -> tuple[NDArray[np.float64], Faults]:
    """(n, 3) positions, NaN where there is none, and why there is none."""
    import shapely

    points = shapely.get_type_id(geometries) == shapely.GeometryType.POINT
    xyz = np.full((len(table), 3), np.nan)
    found, at = shapely.get_coordinates(geometries[points], include_z=True, return_index=True)
    xyz[np.flatnonzero(points)[at]] = found
    faults: Faults = {}
    for row in np.flatnonzero(~np.isfinite(xyz[:, :2]).all(axis=1)):
        geometry = geometries[row]
        what = "none"
        if geometry is not None:
            what = f"an empty {geometry.geom_type}" if geometry.is_empty else geometry.wkt[:60]
        faults[int(row)] = (
            f"{table.row(int(row))}: image without pose: its geometry is {what}, expected a point"
        )
    return xyz, faults
