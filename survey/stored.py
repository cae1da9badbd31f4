"""Surveys in object stores: what lies there, and opening it.

A store is listed once, when a survey is begun to be read, and not asked about each object.
"""

import io
import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePath
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, BinaryIO, TypeVar, cast

from contracts.errors import BadConfig, BadSurvey, TaskFailed
from contracts.places import Place, is_url, place_of, store_errors

if TYPE_CHECKING:
    from fsspec import AbstractFileSystem
    from upath import UPath

READ_AHEAD_BYTES = 1 << 18
"""Of an object that is read in part: room for a header with its EXIF."""

PATIENCE_S = 60.0
"""How long a store may be away before a task gives up."""
_RETRY_S = 2.0

Answer = TypeVar("Answer")

_MARKS = ("ETag", "etag", "md5Hash", "LastModified", "last_modified", "mtime", "created")
"""What stores call that which changes with an object, the best first."""


@dataclass(frozen=True, slots=True)
class State:
    """What tells a file from a changed one. mark : time of change, or what a store has for it."""

    size: int
    mark: str


_LISTED: dict[str, dict[str, State]] = {}
"""By survey, its objects: kept from reading it to planning the job, which wants their states."""


def list_anew(root: Place) -> None:
    """List a survey in a store; a path has nothing to be listed yet.

    Raises
    ------
    BadSurvey : nothing is there, or the store cannot be listed.
    """
    if isinstance(root, Path):
        return
    _LISTED.pop(_key(root), None)
    try:
        found = objects_below(root)
    except OSError as error:
        raise BadSurvey(
            f"survey {root} cannot be listed: {error.strerror}. Check the URL, and the variables "
            "of the store (such as AWS_ACCESS_KEY_ID, AWS_ENDPOINT_URL)"
        ) from error
    if not found:
        raise BadSurvey(f"survey {root} does not exist: no object's name begins so; check the URL")


def objects_below(root: "UPath") -> Mapping[str, State]:
    """Names relative to `root`, in order, and states of all objects; "" of an object itself.

    Raises
    ------
    OSError : the store cannot be listed.
    """
    key = _key(root)
    if key not in _LISTED:
        with store_errors(root):
            base = root.path.rstrip("/")
            found = root.fs.find(base, detail=True)
        _LISTED[key] = {
            name.removeprefix(base).removeprefix("/"): _state(found[name])
            for name in sorted(found, key=_bytes)
            if not name.endswith("/")  # what stands for a folder
        }
    return _LISTED[key]


def _key(root: "UPath") -> str:
    return str(root).rstrip("/")


def is_file(place: Place) -> bool:
    """Whether a survey is one file or object, and not a folder of them."""
    return place.is_file() if isinstance(place, Path) else "" in objects_below(place)


def state_of(path: str) -> State:
    """The state of a file or an object; of an object of a survey that was listed, by then.

    Raises
    ------
    OSError : it is not there, or cannot be looked up. ValueError : no name of a file.
    TaskFailed : the store does not answer.
    """
    if not is_url(path):
        found = os.stat(path)  # noqa: PTH116  (a Path for each of 100,000 is slow)
        return State(found.st_size, str(found.st_mtime_ns))
    at = path.rfind("/")
    while at > path.find("://") + 2:
        if (listed := _LISTED.get(path[:at])) and path[at + 1 :] in listed:
            return listed[path[at + 1 :]]
        at = path.rfind("/", 0, at)
    store, name = _store(path)
    return _state(_asked(path, lambda: store.info(name)))


def open_object(path: str, read_ahead_bytes: int = READ_AHEAD_BYTES) -> BinaryIO:
    """Open an object by its URL; it can be read anywhere, and is asked for in large pieces.

    Raises
    ------
    FileNotFoundError : there is no such object. TaskFailed : the store does not answer, now or
        when it is read. BadConfig : as `place_of`.
    """
    store, name = _store(path)
    opened = _asked(path, lambda: store.open(name, "rb", block_size=read_ahead_bytes))
    return cast("BinaryIO", _Object(path, cast("BinaryIO", opened)))


class _Object(io.RawIOBase):
    """An object as a file. No error of its store can be taken for one of its content."""

    def __init__(self, path: str, file: BinaryIO) -> None:
        self._path, self._file = path, file

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        return self._file.tell()

    def read(self, size: int | None = -1) -> bytes:
        return _asked(self._path, lambda: self._file.read(-1 if size is None else size))

    def close(self) -> None:
        self._file.close()
        super().close()


def _asked(path: str, ask: Callable[[], Answer]) -> Answer:
    """Ask a store, and again for a while if it does not answer: a job may take weeks."""
    gives_up_at = time.monotonic() + PATIENCE_S
    while True:
        try:
            with store_errors(path):
                return ask()
        except FileNotFoundError:
            raise
        except OSError as error:
            if isinstance(error, PermissionError) or time.monotonic() > gives_up_at:
                raise TaskFailed(
                    f"{path} cannot be read: {error.strerror}. Check that the store is up and "
                    "that this machine has the variables for it (such as AWS_ACCESS_KEY_ID), and "
                    "run the same command again."
                ) from error
        time.sleep(_RETRY_S)


def forget_listings() -> None:
    """Give the memory back: a million objects take 270 MB."""
    _LISTED.clear()


def open_place(place: Place | str, read_ahead_bytes: int = READ_AHEAD_BYTES) -> BinaryIO:
    """Open a file or an object for reading.

    Raises
    ------
    OSError : it cannot be. TaskFailed : as `open_object`.
    """
    if isinstance(place, Path):
        return place.open("rb")
    text = str(place)
    return open_object(text, read_ahead_bytes) if is_url(text) else Path(text).open("rb")


@contextmanager
def local_copy(place: Place) -> Iterator[Path]:
    """A file as one that can be opened by its name; of a store, a copy for as long.

    Files beside it that share its stem, as those of a Shapefile do, are there too.

    Raises
    ------
    OSError : it cannot be copied.
    """
    if isinstance(place, Path):
        yield place
        return
    with TemporaryDirectory(prefix="flaneur-") as folder:
        with store_errors(place):
            for each in place.fs.ls(place.parent.path, detail=False):
                name = PurePath(each).name
                if PurePath(name).stem == place.stem and not each.endswith("/"):
                    place.fs.get_file(each, str(Path(folder, name)))
        yield Path(folder, place.name)


def _store(path: str) -> "tuple[AbstractFileSystem, str]":
    """The store of a URL, and what it calls the object there; any letters may be in that."""
    protocol, _, rest = path.partition("://")
    root = place_of(f"{protocol}://{rest.partition('/')[0]}")
    if isinstance(root, Path):
        raise BadConfig(f"{path!r} is no URL of a store; give a path without {protocol}://")
    return root.fs, root.fs._strip_protocol(path)


def _state(told: Mapping[str, object]) -> State:
    size = told.get("size")
    mark = next((told[name] for name in _MARKS if told.get(name)), "")
    return State(size if isinstance(size, int) else 0, str(mark).strip('"'))


def _bytes(name: str) -> bytes:
    return name.encode(errors="surrogatepass")
