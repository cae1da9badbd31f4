"""Writing so that a file is whole or absent, and reading only what was promised.

What is read may have been cut, edited or swapped for something else: it is a regular file, a
header is compared and never evaluated, and nothing is unpickled or inflated.
"""

import errno
import hashlib
import math
import mmap
import os
import re
import stat
import struct
import tempfile
import zipfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from io import BufferedReader
from pathlib import Path, PurePosixPath
from typing import IO, TypeVar

import numpy as np
from numpy.typing import NDArray

from contracts.errors import BadIndex

Scalar = TypeVar("Scalar", bound=np.generic)

READ_AHEAD_BYTES = 1 << 28
"""A smaller file is sooner read as a whole than page by page."""

MAX_TEXT_BYTES = 32 * 2**20
"""Of a JSON file that is read at once: room for the files of some two thousand segments."""

_MAGIC = b"\x93NUMPY\x01\x00"
_HEADER = re.compile(
    r"\{'descr': '(.{2,9})', 'fortran_order': (\w+), 'shape': (\([\d, ]*\)), \} *\n"
)
_ALIGNMENT = 16


def write_atomic(path: Path, write: Callable[[IO[bytes]], object]) -> str:
    """Write beside `path`, sync, rename into place; returns the sha256 of what is there.

    Two writers of the same name both leave a whole file. An error leaves the former file, or
    none, and removes the part that was written.

    Raises
    ------
    OSError : the disk is full, say; names `path`.
    """
    try:
        _make_folder(path.parent)
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
    except OSError as error:
        # The system names no file, or the temporary one.
        if error.filename is None or Path(str(error.filename)).parent == path.parent:
            raise OSError(error.errno, error.strerror or str(error), str(path)) from error
        raise
    return digest


def write_bytes(path: Path, content: bytes) -> str:
    """`write_atomic` of bytes at hand."""
    return write_atomic(path, lambda stream: stream.write(content))


def write_array(path: Path, array: NDArray[np.generic]) -> str:
    """`write_atomic` of one array in .npy format, never pickled."""
    return write_atomic(path, lambda stream: _write_npy(stream, array))


def write_arrays(path: Path, arrays: Mapping[str, NDArray[np.generic]]) -> str:
    """`write_atomic` of several named arrays in .npz format, never pickled."""

    def write(stream: IO[bytes]) -> None:
        with zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED) as archive:
            for name, array in arrays.items():
                # A ZipInfo of its own: no time of day in what must be the same bytes again.
                with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w", force_zip64=True) as member:
                    _write_npy(member, array)

    return write_atomic(path, write)


def sync_folder(folder: Path) -> None:
    """Make renames in `folder` survive a power cut."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def open_regular(path: Path) -> BufferedReader:
    """Open for reading a file, and not a pipe or a device that would keep the reader waiting.

    Raises
    ------
    OSError : it is missing, may not be read, or is something else.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise OSError(errno.EINVAL, "Not a regular file", str(path))
    return os.fdopen(descriptor, "rb")


def read_text_file(path: Path, max_bytes: int = MAX_TEXT_BYTES) -> bytes:
    """All bytes of a small file, such as JSON.

    Raises
    ------
    OSError : it cannot be opened (`open_regular`), or is larger.
    """
    with open_regular(path) as stream:
        size = os.fstat(stream.fileno()).st_size
        if size > max_bytes:
            raise OSError(errno.EFBIG, f"Larger than {max_bytes} bytes", str(path))
        return stream.read(size)  # and not max_bytes, for which memory would be set aside


def is_shown(path: Path) -> bool:
    """Whether a file is there, as the server of a shared folder knows it.

    A client remembers for a minute which files are not there (NFS), unless the folder that they
    would be in was opened since.
    """
    for folder in (path.parent.parent, path.parent):
        with suppress(OSError):
            os.close(os.open(folder, os.O_RDONLY | os.O_DIRECTORY))
    return path.is_file()


def sha256_of(path: Path) -> str:
    """Hex sha256 of a file's bytes, read in blocks."""
    with open_regular(path) as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def is_inside(name: str) -> bool:
    """Whether a name, relative to a folder, stays in it by its letters (links: `check_files`)."""
    path = PurePosixPath(name)
    outside = path.is_absolute() or ".." in path.parts or "\0" in name
    return bool(path.parts) and not outside


def check_files(root: Path, sizes: Mapping[str, int]) -> None:
    """Check that files of an index are there, by their sizes in bytes; `sizes` is by name.

    Raises
    ------
    BadIndex : one is missing, of another size, no file, or lies outside the index by a link.
    """
    inside = root.resolve()
    for folder in {(root / name).parent for name in sizes}:
        if not folder.resolve().is_relative_to(inside):
            raise BadIndex(
                f"{folder} leads out of the index to {folder.resolve()}. Put the folder itself "
                "there, or index again."
            )
    for name, size in sizes.items():
        path = root / name
        try:
            found = path.lstat()
        except (OSError, ValueError):
            found = None
        if found is None or not stat.S_ISREG(found.st_mode) or found.st_size != size:
            what = "missing" if found is None else _what_it_is(found)
            raise BadIndex(
                f"{path} is {what}, expected a file of {size} bytes. Restore it, go back with "
                "`flaneur rollback`, or index again."
            )


def map_array(
    path: Path, dtype: type[Scalar], ndim: int, *, scattered: bool = False
) -> NDArray[Scalar]:
    """Memory-map a .npy file, read-only; its header must say what is expected, and no more.

    scattered : parts of it will be read, here and there: in a large file the system shall not
    read ahead of them.

    Raises
    ------
    BadIndex : missing, not .npy as numpy writes it, shorter or longer than its header says, or
        of another dtype or dimension.
    """
    try:
        with open_regular(path) as stream:
            shape = _read_header(stream, np.dtype(dtype), ndim)
            start, size = stream.tell(), os.fstat(stream.fileno()).st_size
            _check_size(size - start, shape, np.dtype(dtype))
            mapped = mmap.mmap(stream.fileno(), size, access=mmap.ACCESS_READ)
        if scattered and size > READ_AHEAD_BYTES and hasattr(mmap, "MADV_RANDOM"):
            mapped.madvise(mmap.MADV_RANDOM)
        return np.frombuffer(mapped, dtype, offset=start).reshape(shape)
    except (OSError, ValueError) as error:
        raise BadIndex(
            f"{path} cannot be read as an array ({error}). Restore the file or index again."
        ) from error


def read_member(path: Path, name: str, dtype: type[Scalar], ndim: int) -> NDArray[Scalar]:
    """Read one array of those that `write_arrays` wrote; read-only.

    Raises
    ------
    BadIndex : missing, damaged, compressed, or of another dtype or dimension.
    """
    try:
        with open_regular(path) as stream, zipfile.ZipFile(stream) as archive:
            info = archive.getinfo(f"{name}.npy")
            if info.compress_type != zipfile.ZIP_STORED:
                raise ValueError(f"{name} is compressed")
            with archive.open(info) as member:
                shape = _read_header(member, np.dtype(dtype), ndim)
                content = member.read()
        _check_size(len(content), shape, np.dtype(dtype))
        return np.frombuffer(content, dtype).reshape(shape)
    except _ZIP_FAULTS as error:
        raise BadIndex(
            f"{path} does not hold {name} as it was written ({error}). Restore the file or index "
            "again."
        ) from error


_ZIP_FAULTS = (
    *(OSError, ValueError, KeyError, EOFError, struct.error),
    *(zipfile.BadZipFile, RuntimeError),  # the latter of encrypted members
)


def _write_npy(stream: IO[bytes], array: NDArray[np.generic]) -> None:
    # Not np.save: it writes around the stream, and of a full disk it does not say so.
    if array.dtype.hasobject:
        raise TypeError(f"an array of {array.dtype} would have to be pickled")
    whole = np.ascontiguousarray(array)
    np.lib.format.write_array_header_1_0(stream, np.lib.format.header_data_from_array_1_0(whole))
    stream.write(whole.reshape(-1).view(np.uint8).data)


def _read_header(stream: IO[bytes], dtype: np.dtype[Scalar], ndim: int) -> tuple[int, ...]:
    """The shape of the array that follows. numpy would evaluate the header; here it is matched."""
    magic = stream.read(len(_MAGIC) + 2)
    if len(magic) < len(_MAGIC) + 2 or not magic.startswith(_MAGIC):
        raise ValueError("it does not begin like one")
    size = int.from_bytes(magic[-2:], "little")
    found = _HEADER.fullmatch(stream.read(size).decode("latin-1"))
    if found is None or (len(magic) + size) % _ALIGNMENT:
        raise ValueError("its header is damaged")
    descr, fortran, shape = found[1], found[2], tuple(map(int, re.findall(r"\d+", found[3])))
    if descr != np.lib.format.dtype_to_descr(dtype) or len(shape) != ndim:
        raise ValueError(f"it is {len(shape)}-d {descr!r}, expected {ndim}-d {dtype}")
    if fortran != "False":
        raise ValueError("it is in Fortran order")
    return shape


def _check_size(n_bytes: int, shape: tuple[int, ...], dtype: np.dtype[Scalar]) -> None:
    promised = math.prod(shape) * dtype.itemsize
    if n_bytes != promised:
        raise ValueError(f"{n_bytes} bytes follow its header, which promises {promised}")


def _what_it_is(found: os.stat_result) -> str:
    if stat.S_ISREG(found.st_mode):
        return f"{found.st_size} bytes long"
    return "a link" if stat.S_ISLNK(found.st_mode) else "not a file"


def _make_folder(folder: Path) -> None:
    """Make a folder and those above it so that they survive a power cut, as their files do."""
    if folder.is_dir():
        return
    _make_folder(folder.parent)
    folder.mkdir(exist_ok=True)
    sync_folder(folder.parent)
