"""Writing a results GeoPackage in batches, through GDAL."""

from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import pyarrow as pa
import pyogrio

from coordinator.export.attribution import attributions
from coordinator.export.batches import in_batches
from coordinator.export.beside import writing_to, written_beside
from coordinator.export.columns import GEOMETRY
from coordinator.export.geopackage.layers import LAYERS, Layer
from coordinator.export.geopackage.places import layers_system, system_wkt
from coordinator.export.geopackage.rows import layer_tables
from coordinator.export.geopackage.styles import style_table
from coordinator.export.geopackage.thumbnails import Thumbnails
from coordinator.querying import Located
from geo.crs import ToWgs84
from index.opened import OpenedIndex

_VERSION = "1.2"
"""Of the GeoPackage standard: GDAL before 3.7, as in QGIS 3.22, warns of later ones."""


def write_geopackage(out: Path, answers: Iterable[Located], index: OpenedIndex) -> None:
    """Write answers as layers with QGIS styles, whole or not at all, in the survey's system.

    Parameters
    ----------
    out : the .gpkg file. answers : taken one batch at a time. index : that answered.

    Raises
    ------
    WrongInput : `out` cannot be written.
    UnknownCrs : the survey's system has no exact enough conversion to WGS 84.
    """
    system = layers_system(index)
    thumbnails = Thumbnails()
    credit = "; ".join(attributions(index.generation))
    written: Counter[str] = Counter()
    with written_beside(out) as part:
        for batch in in_batches(answers):
            for layer, table in layer_tables(batch, index, system, thumbnails):
                with writing_to(out):
                    _append(part, layer, table, system, None if layer.name in written else credit)
                written[layer.name] += len(table)
        styles = style_table(LAYERS, n_queries=written["queries"])
        # QGIS makes this table itself when a person stores a style, with these names.
        with writing_to(out):
            pyogrio.write_arrow(styles, part, layer="layer_styles", driver="GPKG", FID="id")


def _append(part: Path, layer: Layer, table: pa.Table, system: ToWgs84, credit: str | None) -> None:
    """Add rows to a layer. credit : of the survey, for a layer that is new; None: it is not."""
    options = {}
    if credit is not None:
        options["DESCRIPTION"] = ". ".join(filter(None, [layer.description, credit]))
    if not part.exists():
        options["VERSION"] = _VERSION
    pyogrio.write_arrow(
        table,
        part,
        layer=layer.name,
        driver="GPKG",
        geometry_name=GEOMETRY,
        geometry_type=layer.geometry_type,
        crs=system_wkt(system),
        append=credit is None,
        **options,
    )
