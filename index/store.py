"""An index in an object store, where a file's name is its digest: none is ever overwritten.

    URL/CURRENT                  the number of the live generation, as in a folder
    URL/generations/000003.json  as in a folder
    URL/files/<sha256>           every file of every generation that was published
    URL/models/choice.json       the index's own model, if it has one

They are written in the order files, model, generation, CURRENT, so that whoever reads sees a whole
index, the former one or the new one, wherever a writer stops. docs/index-format.md has all of it.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from contracts.errors import BadIndex, TaskFailed
from contracts.places import store_errors
from contracts.progress import Progress
from index.files import MAX_TEXT_BYTES, check_files, read_text_file, sha256_of
from index.manifest import FileEntry, Generation, generation_path, read_generation
from index.models import model_path

if TYPE_CHECKING:
    from upath import UPath

CURRENT = "CURRENT"
MODEL = model_path(Path()).as_posix()
AT_ONCE = 4
"""Files on their way: enough that small ones do not wait for answers one after another."""
_PIECE_BYTES = 1 << 24
"""Of a large file; a store's library holds ten pieces of each file on its way."""


@dataclass(frozen=True, slots=True)
class Published:
    """What a publication did. n_sent, bytes_sent : files that the store did not have."""

    generation: int
    n_files: int
    n_bytes: int
    n_sent: int
    bytes_sent: int


@dataclass(frozen=True, slots=True)
class Store:
    """Where an index is published."""

    place: "UPath"

    def __str__(self) -> str:
        return str(self.place).rstrip("/")

    def live_number(self) -> int:
        """The number of the live generation.

        Raises
        ------
        BadIndex : there is no index, or CURRENT holds something else. OSError : no answer.
        """
        content = self.read(CURRENT)
        if content is None:
            raise BadIndex(
                f"{self} is no published index (no CURRENT in it). Check the URL, or publish one "
                f"with: flaneur publish INDEX {self}"
            )
        text = content.decode("ascii", errors="replace").strip()
        if not re.fullmatch("[0-9]{1,9}", text):
            raise BadIndex(
                f"{self}/{CURRENT} holds {text[:40]!r}, expected the number of a generation. "
                "Publish the index again."
            )
        return int(text)

    def read(self, name: str) -> bytes | None:
        """A small object, None if there is none.

        Raises
        ------
        BadIndex : larger than a text of an index is. OSError : the store does not answer.
        """
        path = self._path(name)
        try:
            with store_errors(f"{self}/{name}"):
                size = self.place.fs.info(path).get("size") or 0
                if size > MAX_TEXT_BYTES:
                    raise BadIndex(f"{self}/{name} is {size} bytes long, too long to be true.")
                return bytes(self.place.fs.cat_file(path))
        except FileNotFoundError:
            return None

    def get(self, entry: FileEntry, target: Path) -> None:
        """Copy a file of the index to `target`.

        Raises
        ------
        BadIndex : it is another than was published. OSError : it is not there, or the store does
            not answer.
        """
        path = self._path(_file(entry.sha256))
        with store_errors(f"{self}/{_file(entry.sha256)}"):
            size = self.place.fs.info(path).get("size")
            if size in (None, entry.size):  # or what is there may fill the disk
                self.place.fs.get_file(path, str(target))
                size = target.stat().st_size
        if size != entry.size or sha256_of(target) != entry.sha256:
            raise BadIndex(
                f"{self}/{_file(entry.sha256)} is damaged: {size} bytes, expected {entry.size} of "
                "the digest that is its name. Remove that object and publish the index again."
            )

    def sizes(self) -> dict[str, int]:
        """Bytes of each file that is there, by its digest; one listing."""
        with store_errors(self):
            try:
                found = self.place.fs.find(self._path("files"), detail=True)
            except FileNotFoundError:
                return {}
        return {name.rpartition("/")[2]: int(each["size"]) for name, each in found.items()}

    def put(self, name: str, content: bytes) -> None:
        with store_errors(f"{self}/{name}"):
            self.place.fs.pipe_file(self._path(name), content)

    def put_file(self, source: Path, sha256: str) -> None:
        with store_errors(f"{self}/{_file(sha256)}"):
            path = self._path(_file(sha256))
            self.place.fs.put_file(str(source), path, chunksize=_PIECE_BYTES)

    def remove(self, name: str) -> None:
        with store_errors(f"{self}/{name}"):
            self.place.fs.rm_file(self._path(name))

    def _path(self, name: str) -> str:
        return f"{self.place.path.rstrip('/')}/{name}"


def publish(root: Path, place: "UPath", progress: Progress) -> Published:
    """Bring the live generation of an index into a store; what is there already stays as it is.

    Raises
    ------
    BadIndex : not an index, files missing or damaged, or another index is published there.
    TaskFailed : the store cannot be written; what was published there before is still whole.
    """
    generation = read_generation(root)
    check_files(root, generation.sizes)
    store = Store(place)
    told = read_text_file(generation_path(root, generation.number))
    try:
        _refuse_another(store, generation.number, told)
        sent = _send_files(root, store, generation, progress)
        _send_model(root, store)
        store.put(_generation(generation.number), told)
        store.put(CURRENT, f"{generation.number:06d}\n".encode())
    except OSError as error:
        if error.filename is not None and Path(str(error.filename)).is_relative_to(root):
            raise
        raise TaskFailed(
            f"{error.filename} could not be written: {error.strerror}. What was published before "
            "can still be read. Check the bucket and your rights there, and run it again."
        ) from error
    bytes_sent = sum(entry.size for entry in sent)
    files = {entry.sha256: entry.size for entry in generation.files.values()}
    return Published(generation.number, len(files), sum(files.values()), len(sent), bytes_sent)


def read_stored_generation(store: Store, number: int) -> bytes:
    """A generation's file as it is in the store.

    Raises
    ------
    BadIndex : it is not there. OSError : the store does not answer.
    """
    content = store.read(_generation(number))
    if content is None:
        raise BadIndex(f"{store} has no generation {number}. Publish the index again.")
    return content


def _refuse_another(store: Store, number: int, told: bytes) -> None:
    there = store.read(_generation(number))
    if there is not None and there != told:
        raise BadIndex(
            f"{store} holds another index: its generation {number} is not this one's. Publish to "
            "a URL of its own."
        )


def _send_files(
    root: Path, store: Store, generation: Generation, progress: Progress
) -> list[FileEntry]:
    """Send what the store does not have or not whole; equal files are sent once."""
    there = store.sizes()
    of_digest = {entry.sha256: (name, entry) for name, entry in generation.files.items()}
    missing = [each for each in of_digest.values() if there.get(each[1].sha256) != each[1].size]
    progress.begin("publish", len(of_digest), len(of_digest) - len(missing))

    def send(each: tuple[str, FileEntry]) -> None:
        name, entry = each
        if sha256_of(root / name) != entry.sha256:
            raise BadIndex(
                f"{root / name} is not what was written. `flaneur verify {root}` says what mends it"
            )
        store.put_file(root / name, entry.sha256)

    for _ in at_once(send, missing):
        progress.advance("publish")
    return [entry for _, entry in missing]


def _send_model(root: Path, store: Store) -> None:
    try:
        model = read_text_file(root / MODEL)
    except FileNotFoundError:
        if store.read(MODEL) is not None:
            store.remove(MODEL)
        return
    if store.read(MODEL) != model:
        store.put(MODEL, model)


def at_once(
    work: Callable[[tuple[str, FileEntry]], None], files: Sequence[tuple[str, FileEntry]]
) -> Iterator[None]:
    """Call `work` for some files at a time; the first error ends it."""
    with ThreadPoolExecutor(AT_ONCE) as pool:
        yield from pool.map(work, files)


def _generation(number: int) -> str:
    return generation_path(Path(), number).as_posix()


def _file(sha256: str) -> str:
    return f"files/{sha256}"
