"""Published indices on this machine: a copy of each generation that is searched here.

`$XDG_CACHE_HOME/flaneur/indices/<url>/<generation>/` is an index folder like others. Any number
of processes may fetch and read: who fetches holds a lock, who reads shares it, and what nobody
holds is removed once a later generation is here. Locks are the system's, as in index/commits.py.
"""

import fcntl
import hashlib
import os
import re
import shutil
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from contracts.errors import BadIndex
from contracts.places import Place
from contracts.progress import Progress
from index.files import check_files, sync_folder, write_bytes
from index.manifest import FileEntry, generation_path, read_generation
from index.store import CURRENT, MODEL, Store, at_once, read_stored_generation

_PARTS = ".parts"


class Held:
    """An index folder on this machine; a fetched one is not removed while this lives.

    root : the folder. lock : descriptor that shares its lock, or None.
    """

    def __init__(self, root: Path, lock: int | None = None) -> None:
        self.root = root
        if lock is not None:
            weakref.finalize(self, os.close, lock)


def at_hand(place: Place, number: int | None = None, progress: Progress | None = None) -> Held:
    """An index as a folder of this machine; one in a store is fetched as far as it is missing.

    number : of the generation; None: the live one.

    Raises
    ------
    BadIndex : no index is published there, it is damaged, or the store does not answer.
    """
    if isinstance(place, Path):
        return Held(place)
    store = Store(place)
    try:
        number = store.live_number() if number is None else number
        told = read_stored_generation(store, number)
        copy = _Copy.of(store, number, told)
        held = copy.hold(progress)
        _refresh_model(store, held.root)
    except OSError as error:
        named = error.filename or store
        raise BadIndex(
            f"{named} cannot be read: {error.strerror}. Check the URL, and the variables of the "
            "store (such as AWS_ACCESS_KEY_ID, AWS_ENDPOINT_URL)."
        ) from error
    copy.remove_earlier()
    return held


@dataclass(frozen=True, slots=True)
class _Copy:
    """One generation of a published index, on this machine. told : its file's content."""

    store: Store
    number: int
    told: bytes
    tree: Path

    @classmethod
    def of(cls, store: Store, number: int, told: bytes) -> "_Copy":
        digest = hashlib.sha256(told).hexdigest()
        tree = _folder_of(str(store)) / f"{number:06d}-{digest[:16]}"
        tree.parent.mkdir(parents=True, exist_ok=True)
        return cls(store, number, told, tree)

    def hold(self, progress: Progress | None) -> Held:
        """Have it here as a whole, and keep it from being removed."""
        lock = _opened_lock(self.tree)
        held = Held(self.tree, lock)
        fcntl.flock(lock, fcntl.LOCK_SH)
        if not self._is_whole():
            with _alone(self.tree.with_suffix(".fetching")):
                if not self._is_whole():  # another process may have fetched it meanwhile
                    self._fetch(progress)
        return held

    def remove_earlier(self) -> None:
        """Remove copies of earlier generations that no process holds."""
        for tree in self._others():
            if _number_of(tree) > self.number:
                continue
            lock = _opened_lock(tree)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(tree)
            except OSError:  # somebody reads it; or it is being removed by another
                continue
            finally:
                os.close(lock)

    def _is_whole(self) -> bool:
        """By sizes: a file is put there under its name only once its digest was right."""
        try:
            check_files(self.tree, read_generation(self.tree).sizes)
        except BadIndex:
            return False
        return True

    def _fetch(self, progress: Progress | None) -> None:
        parts = self.tree / _PARTS
        shutil.rmtree(parts, ignore_errors=True)
        write_bytes(generation_path(self.tree, self.number), self.told)
        try:
            generation = read_generation(self.tree, self.number)
        except BadIndex as error:
            raise BadIndex(f"{self.store}, as it was fetched: {error}") from error
        parts.mkdir()
        here = self._known_files()
        missing = [each for each in generation.files.items() if not self._has(*each)]
        if progress is not None:
            progress.begin("fetch", len(generation.files), len(generation.files) - len(missing))

        def fetch(each: tuple[str, FileEntry]) -> None:
            name, entry = each
            (self.tree / name).parent.mkdir(parents=True, exist_ok=True)
            if not _linked(here.get(entry.sha256), self.tree / name, entry.size):
                self._download(entry, parts / name.replace("/", "-"), self.tree / name)

        for _ in at_once(fetch, missing):
            if progress is not None:
                progress.advance("fetch")
        for folder in {(self.tree / name).parent for name, _ in missing}:
            sync_folder(folder)
        shutil.rmtree(parts)
        write_bytes(self.tree / CURRENT, f"{self.number:06d}\n".encode())

    def _has(self, name: str, entry: FileEntry) -> bool:
        path = self.tree / name
        return path.is_file() and path.stat().st_size == entry.size

    def _download(self, entry: FileEntry, part: Path, target: Path) -> None:
        self.store.get(entry, part)
        with part.open("rb") as stream:
            os.fsync(stream.fileno())
        part.replace(target)

    def _known_files(self) -> dict[str, Path]:
        """Files of other generations that are here, by digest: most are the same."""
        known: dict[str, Path] = {}
        for tree in self._others():
            try:
                generation = read_generation(tree, _number_of(tree))
            except BadIndex:
                continue
            known |= {entry.sha256: tree / name for name, entry in generation.files.items()}
        return known

    def _others(self) -> Iterator[Path]:
        for tree in sorted(self.tree.parent.glob("[0-9]*-*[0-9a-f]")):
            if tree != self.tree and tree.is_dir():
                yield tree


def cache_folder() -> Path:
    """Where fetched indices are kept."""
    named = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return (named if named.is_absolute() else Path.home() / ".cache") / "flaneur" / "indices"


def _folder_of(url: str) -> Path:
    """A folder for a URL, with a name that a person recognises."""
    slug = re.sub("[^A-Za-z0-9]+", "-", url).strip("-")[-40:]
    return cache_folder() / f"{slug}-{hashlib.sha256(url.encode()).hexdigest()[:16]}"


def _number_of(tree: Path) -> int:
    return int(tree.name.partition("-")[0])


def _refresh_model(store: Store, root: Path) -> None:
    """The index's own model, which changes without a generation, as it is now."""
    model, path = store.read(MODEL), root / MODEL
    if model is None:
        path.unlink(missing_ok=True)
    elif not path.is_file() or path.read_bytes() != model:
        write_bytes(path, model)


def _linked(source: Path | None, target: Path, size: int) -> bool:
    """Have a file of another generation under `target` too; False: it is not there."""
    if source is None:
        return False
    try:
        target.hardlink_to(source)
    except OSError:  # removed meanwhile, or the file system has no links
        return False
    if target.stat().st_size == size:
        return True
    target.unlink()
    return False


def _opened_lock(tree: Path) -> int:
    return os.open(tree.with_suffix(".lock"), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)


@contextmanager
def _alone(path: Path) -> Iterator[None]:
    with path.open("a") as stream:
        fcntl.flock(stream, fcntl.LOCK_EX)
        yield
