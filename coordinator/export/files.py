"""Result files, written whole or not at all."""

from pathlib import Path

from contracts.errors import WrongInput
from geo.geojson import FeatureCollection, dumps
from index.files import write_bytes


def write_geojson(out: Path, collection: FeatureCollection) -> None:
    """Write the collection as UTF-8 GeoJSON.

    Raises
    ------
    WrongInput : `out` cannot be written.
    ValueError : a number is not finite.
    """
    write_whole(out, (dumps(collection) + "\n").encode())


def write_whole(out: Path, content: bytes) -> None:
    """Write `out` so that a reader sees the old file or the new one.

    Raises
    ------
    WrongInput : `out` cannot be written.
    """
    try:
        write_bytes(out, content)
    except OSError as error:
        raise WrongInput(
            f"cannot write {out}: {error.strerror}; name a file (not a folder) where there is "
            "room and leave to write (--out)"
        ) from error
