"""`results.geojson`: features are written as they come, and the whole file or none."""

from collections.abc import Iterable, Iterator, Mapping
from importlib.metadata import version
from pathlib import Path

from coordinator.export.attribution import attributions
from coordinator.export.files import write_pieces
from geo.geojson import Feature, collection_text, sequence_text
from index.opened import OpenedIndex


def write_geojson(
    out: Path, features: Iterable[Feature], about: Mapping[str, object] | None = None
) -> None:
    """Write a feature collection as UTF-8 GeoJSON, one feature a line.

    Parameters
    ----------
    features : written as they come; memory does not grow with their number.
    about : the collection's foreign member `flaneur` (`provenance`).

    Raises
    ------
    WrongInput : `out` cannot be written.
    ValueError : a number is not finite.
    """
    write_pieces(out, encoded(features, about))


def encoded(
    features: Iterable[Feature], about: Mapping[str, object] | None = None
) -> Iterator[bytes]:
    """The bytes of the file, piece by piece; errors as `write_geojson`."""
    return (piece.encode() for piece in collection_text(features, about))


def sequence(features: Iterable[Feature]) -> Iterator[bytes]:
    """The bytes of a GeoJSON text sequence (RFC 8142), record by record; errors as `write_geojson`.

    Each record stands for itself: what was written before an end that came early can be read.
    """
    return (record.encode() for record in sequence_text(features))


def provenance(index: OpenedIndex) -> dict[str, object]:
    """Where results come from, and by which operation their coordinates (`geo.operations`).

    attribution : whose images the surveys are, as each asks to be named.
    accuracy_m : of the operation, as its authority states it; None: not stated.
    """
    about: dict[str, object] = {
        "version": version("flaneur"),
        "index": index.place,
        "generation": index.generation.number,
        "crs": index.generation.crs,
        "attribution": attributions(index.generation),
    }
    if index.to_wgs84 is None:
        return about
    operation = index.to_wgs84.operation
    return {
        **about,
        "operation": operation.name,
        "accuracy_m": operation.accuracy_m,
        "missing_grids": list(operation.missing_grids),
        "ballpark": operation.ballpark,
    }
