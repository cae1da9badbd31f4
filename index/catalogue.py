"""The catalogue: one row an indexed image, as GeoParquet 1.1 in the survey's own CRS.

image_id is the row number: dense, in the order of the NFC bytes of the uri.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from contracts.config import North
from contracts.errors import BadIndex
from contracts.records import PosedImage
from geo.crs import parse_crs
from index.files import write_bytes


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
_COLUMNS = tuple(CatalogueRow.__dataclass_fields__)


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


def write_catalogue(path: Path, rows: Sequence[CatalogueRow], crs: str | None) -> str:
    """Write rows as GeoParquet; returns the sha256.

    crs : of the poses; the geometry (null where there is no pose) has its horizontal part.
    """
    import geopandas as gpd  # slow to import, and only the writer needs it
    import numpy as np
    import shapely

    table = {
        name: pa.array([getattr(row, name) for row in rows], type=_TYPES.get(name, pa.string()))
        for name in _COLUMNS
    }
    xy = np.array([(row.easting, row.northing) for row in rows], dtype=np.float64).reshape(-1, 2)
    posed = np.isfinite(xy).all(axis=1)
    geometry = np.full(len(rows), None, dtype=object)
    geometry[posed] = shapely.points(xy[posed])
    horizontal = None if crs is None else parse_crs(crs)
    frame = gpd.GeoDataFrame(pa.table(table).to_pandas(), geometry=geometry, crs=horizontal)
    buffer = BytesIO()
    frame.to_parquet(buffer, index=False, schema_version="1.1.0")
    return write_bytes(path, buffer.getvalue())


class Catalogue:
    """Rows of a written catalogue, read as they are asked for."""

    def __init__(self, path: Path) -> None:
        try:
            self._table = pq.read_table(path, columns=list(_COLUMNS))
        except (OSError, pa.ArrowException) as error:
            raise BadIndex(
                f"{path} cannot be read as a catalogue ({error}). Restore it or index again."
            ) from error

    def __len__(self) -> int:
        return int(self._table.num_rows)

    def rows(self, image_ids: Sequence[int]) -> list[CatalogueRow]:
        """The rows of some images, in the order asked for."""
        taken = self._table.take(pa.array(image_ids, type=pa.int64())).to_pylist()
        return [CatalogueRow(**row) for row in taken]

    def column(self, name: str) -> list[str]:
        """One text column (`uri`, `sha256`, …) of all images."""
        values: list[str] = self._table.column(name).to_pylist()
        return values

    def positions(self) -> list[tuple[float, float]]:
        """(easting, northing) of every posed image, in the order of ids."""
        pairs = zip(
            self._table.column("easting").to_pylist(),
            self._table.column("northing").to_pylist(),
            strict=True,
        )
        return [(x, y) for x, y in pairs if x is not None and y is not None]
