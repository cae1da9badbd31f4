"""Taking words over: every file is compared with its digest on the way, and copied once."""

import hashlib
import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import IO

from contracts.errors import BadIndex
from index.codebooks import Words, codebook_paths
from index.files import open_regular, sha256_of, write_atomic, write_bytes
from index.manifest import FileEntry
from index.word_sets import (
    AGAIN,
    MANIFEST,
    WordSet,
    WordSource,
    dimensions_of,
    file_names,
    read_manifest,
)

_BLOCK = 1 << 20


def import_folder(source: WordSource, out: Path) -> None:
    """Write words into a folder of their own; run again, it does what is missing.

    Raises
    ------
    BadIndex : `out` holds other things, or a file of `source` is damaged.
    """
    _refuse_foreign(out, source.words)
    for name in source.words.files:
        _copy(source, name, out / name)
    text = json.dumps(source.words.model_dump(mode="json"), indent=1, ensure_ascii=False)
    write_bytes(out / MANIFEST, text.encode("utf-8", "backslashreplace"))


def words_to_import(root: Path, source: WordSource, channels: Iterable[str]) -> Words:
    """What the words of some channels will be in the index `root`, once they are imported.

    Their folder has a number made of what is in it: the same words come to the same folder,
    whoever copies them and however often. Nothing is written.

    Raises
    ------
    BadIndex : a file of `source` is not what it was; names it.
    """
    channels = tuple(channels)
    name = _folder_name(source, channels)
    files: dict[str, dict[str, str]] = {}
    n_words: dict[str, int] = {}
    for channel in channels:
        for path, entry in _files(source, channel):
            if not _is_there(path, entry):
                raise _changed(path, entry)
        paths = codebook_paths(root, name, channel).values()
        files[channel] = {
            path.relative_to(root).as_posix(): source.words.files[path.name].sha256
            for path in paths
        }
        n_words[channel], dimensions = source.size_of(channel)
        if dimensions != (expected := dimensions_of(channel)):
            raise BadIndex(
                f"The words of {channel} in {source.folder} have {dimensions} dimensions, expected "
                f"{expected}. {AGAIN}"
            )
    return Words(name, source.words.digest_of(channels), files, n_words)


def import_words(root: Path, source: WordSource, words: Words) -> None:
    """Copy words into an index, as `words_to_import` said; what is there already stays.

    Raises
    ------
    BadIndex : a file of `source` is not what it was; none is left under its name.
    """
    for channel, files in words.files.items():
        for name, target in zip(file_names(channel).values(), files, strict=True):
            _copy(source, name, root / target)


def _files(source: WordSource, channel: str) -> Iterator[tuple[Path, FileEntry]]:
    for name in file_names(channel).values():
        yield source.folder / name, source.words.files[name]


def _folder_name(source: WordSource, channels: Iterable[str]) -> str:
    """Nine digits: counted names, of words that were trained in the index, are shorter."""
    digest = hashlib.sha256()
    for channel in sorted(channels):
        for path, entry in _files(source, channel):
            digest.update(f"{path.name} {entry.sha256}\n".encode())
    return f"{int(digest.hexdigest(), 16) % 10**9:09d}"


def _copy(source: WordSource, name: str, target: Path) -> None:
    path, entry = source.folder / name, source.words.files[name]
    if _is_there(target, entry):
        return
    if not path.is_file() or path.stat().st_size != entry.size:
        raise _changed(path, entry)

    def write(stream: IO[bytes]) -> None:
        digest = hashlib.sha256()
        with open_regular(path) as original:
            while block := original.read(_BLOCK):
                digest.update(block)
                stream.write(block)
        if digest.hexdigest() != entry.sha256:  # before anything has the target's name
            raise _changed(path, entry)

    write_atomic(target, write)


def _is_there(path: Path, entry: FileEntry) -> bool:
    return path.is_file() and path.stat().st_size == entry.size and sha256_of(path) == entry.sha256


def _refuse_foreign(out: Path, words: WordSet) -> None:
    if out.exists() and not out.is_dir():
        raise BadIndex(f"{out} is a file; words go into a folder. Name a new one.")
    there = {path.name for path in out.iterdir()} if out.exists() else set()
    strange = sorted(name for name in there - {MANIFEST, *words.files} if name[0] != ".")
    if strange:
        raise BadIndex(f"{out} is not empty (it has {strange[0]!r}). Name a new folder.")
    if MANIFEST in there and read_manifest(out / MANIFEST).files != words.files:
        raise BadIndex(f"{out} holds other words already. Name a new folder.")


def _changed(path: Path, entry: FileEntry) -> BadIndex:
    return BadIndex(
        f"{path} is not the file that was written ({entry.size} bytes, sha256 "
        f"{entry.sha256[:12]}…). {AGAIN}"
    )
