"""Writing so that a file is whole or absent, and reading what was promised."""

import hashlib
import os
import tempfile
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from contracts.errors import BadIndex


def write_atomic(path: Path, write: Callable[[IO[bytes]], object]) -> str:
    """Write beside `path`, sync, rename into place; returns the sha256 of what is there.

    Two writers of the same name both leave a whole file. An error (a full disk, say) leaves the
    former file, or none, and removes the part that was written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as stream:
            write(stream)
            stream.flush()
            os.fsync(stream.fileno())
        Path(temporary).chmod(0o644)
        digest = sha256_of(Path(temporary))
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
    sync_folder(path.parent)
    return digest


def write_bytes(path: Path, content: bytes) -> str:
    """`write_atomic` of bytes at hand."""
    return write_atomic(path, lambda stream: stream.write(content))


def write_array(path: Path, array: NDArray[np.generic]) -> str:
    """`write_atomic` of one array in .npy format, never pickled."""
    return write_atomic(path, lambda stream: np.save(stream, array, allow_pickle=False))


def write_arrays(path: Path, arrays: Mapping[str, NDArray[np.generic]]) -> str:
    """`write_atomic` of several named arrays in .npz format, never pickled."""

    def write(stream: IO[bytes]) -> None:
        with zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED) as archive:
            for name, array in arrays.items():
                # A ZipInfo of its own: no time of day in what must be the same bytes again.
                with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w", force_zip64=True) as member:
                    np.lib.format.write_array(member, array, allow_pickle=False)

    return write_atomic(path, write)


def sync_folder(folder: Path) -> None:
    """Make renames in `folder` survive a power cut."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def sha256_of(path: Path) -> str:
    """Hex sha256 of a file's bytes, read in blocks."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def map_array(path: Path, dtype: type[np.generic], ndim: int) -> NDArray[np.generic]:
    """Memory-map a .npy file, read-only; its header must say what is expected.

    Raises
    ------
    BadIndex : missing, not .npy, truncated, or of another dtype or dimension.
    """
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise BadIndex(
            f"{path} cannot be read as an array ({error}). Restore the file or index again."
        ) from error
    if array.dtype != np.dtype(dtype) or array.ndim != ndim:
        raise BadIndex(
            f"{path} holds {array.ndim}-d {array.dtype}, expected {ndim}-d {np.dtype(dtype)}. "
            "Restore the file or index again."
        )
    return np.asarray(array)
