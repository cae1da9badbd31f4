"""Files that a library writes by name: beside `out`, then renamed into place."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pyogrio.errors import DataLayerError, DataSourceError, FeatureError, FieldError

from coordinator.export.files import cannot_write
from index.files import sync_folder

# pyarrow raises OSError.
_WRITING_FAILED = (OSError, DataLayerError, DataSourceError, FeatureError, FieldError)


@contextmanager
def written_beside(out: Path) -> Iterator[Path]:
    """A path to write to; when the block ends well, `out` is what was written there.

    It lies in a folder of its own beside `out`, which takes journals with it when it goes.
    Writing itself is done within `writing_to`.

    Raises
    ------
    WrongInput : `out` cannot be written.
    """
    with writing_to(out):
        out.parent.mkdir(parents=True, exist_ok=True)
        folder = tempfile.TemporaryDirectory(dir=out.parent, prefix=".flaneur-out-")
    with folder as name:
        part = Path(name, "results" + out.suffix.lower())
        yield part
        with writing_to(out):
            with part.open("rb+") as stream:
                os.fsync(stream.fileno())
            part.chmod(0o644)
            part.replace(out)
            sync_folder(out.parent)


@contextmanager
def writing_to(out: Path) -> Iterator[None]:
    """What fails within is the user's to mend: no room, no leave to write, not a file."""
    try:
        yield
    except _WRITING_FAILED as error:
        reason = getattr(error, "strerror", None) or error
        raise cannot_write(out, reason) from error
