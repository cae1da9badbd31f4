"""The checks that a generation's files must pass, each with the files that it reads."""

from collections.abc import Callable, Iterator
from dataclasses import astuple, dataclass
from functools import partial
from pathlib import Path

import numpy as np

from contracts.errors import BadIndex
from index.codebooks import codebook_paths, count_words
from index.files import map_array
from index.manifest import Generation, SegmentEntry
from index.segments import segment_paths
from index.soundness import (
    AGAIN,
    Tombstones,
    check_catalogue,
    check_codebook,
    check_postings,
    check_removed,
)
from index.tombstones import map_removed, tombstones_folder


@dataclass(frozen=True, slots=True)
class Check:
    """key : the same for the same check of another generation. files : relative to the index.

    run : raises BadIndex where something is wrong.
    """

    key: object
    files: tuple[str, ...]
    run: Callable[[], object]


def checks_of(root: Path, generation: Generation) -> Iterator[Check]:
    """Everything to be looked at in a generation."""
    for channel in generation.config.features.channels():
        yield _of_codebook(root, generation, channel)
    for entry in generation.segments:
        yield _of_catalogue(root, entry)
        if entry.tombstones is not None:
            yield _of_tombstones(root, entry)
        for channel in generation.config.features.channels():
            yield _of_postings(root, generation, entry, channel)
        yield _of_total(root, generation, entry)


def _of_codebook(root: Path, generation: Generation, channel: str) -> Check:
    paths = codebook_paths(root, generation.codebooks, channel)
    files = _names(root, *paths.values())
    search = _names(root, paths["search"])[0]
    sha256 = generation.files[search].sha256 if search in generation.files else ""
    key = ("codebook", files, sha256)
    return Check(key, files, partial(check_codebook, paths, channel, sha256))


def _of_catalogue(root: Path, entry: SegmentEntry) -> Check:
    path = root / "catalogue" / f"{entry.name}.parquet"
    key = ("catalogue", entry.name, entry.n_images)
    return Check(key, _names(root, path), partial(check_catalogue, path, entry.n_images))


def _of_tombstones(root: Path, entry: SegmentEntry) -> Check:
    def run() -> None:
        tombstones = _tombstones(root, entry)
        if tombstones is not None:
            check_removed(tombstones, entry)

    return Check(("tombstones", *_state(entry)), _removed_file(root, entry), run)


def _of_postings(root: Path, generation: Generation, entry: SegmentEntry, channel: str) -> Check:
    words = codebook_paths(root, generation.codebooks, channel)["words"]

    def run() -> None:
        n_words = count_words(root, generation.codebooks, channel)
        check_postings(root, entry, channel, n_words, _tombstones(root, entry))

    files = _names(root, words, *astuple(segment_paths(root, entry.name, channel)))
    if entry.tombstones is not None:
        left = tombstones_folder(root, entry.tombstones, entry.name) / f"{channel}.npy"
        files += (*_removed_file(root, entry), *_names(root, left))
    return Check(("postings", *_state(entry), channel, generation.codebooks), files, run)


def _of_total(root: Path, generation: Generation, entry: SegmentEntry) -> Check:
    channels = generation.config.features.channels()
    paths = [segment_paths(root, entry.name, channel).counts for channel in channels]

    def run() -> None:
        found = sum(int(map_array(path, np.uint32, 1).sum(dtype=np.int64)) for path in paths)
        if found != entry.n_postings:
            raise BadIndex(
                f"{root / 'segments' / entry.name} has {found} postings, its generation says "
                f"{entry.n_postings}. {AGAIN}"
            )

    return Check(("total", *_state(entry)), _names(root, *paths), run)


def _state(entry: SegmentEntry) -> tuple[object, ...]:
    return entry.name, entry.tombstones, entry.n_images, entry.n_removed, entry.n_postings


def _tombstones(root: Path, entry: SegmentEntry) -> Tombstones | None:
    if entry.tombstones is None:
        return None
    folder = tombstones_folder(root, entry.tombstones, entry.name)
    return Tombstones(folder, map_removed(folder, entry.n_images))


def _removed_file(root: Path, entry: SegmentEntry) -> tuple[str, ...]:
    if entry.tombstones is None:
        return ()
    return _names(root, tombstones_folder(root, entry.tombstones, entry.name) / "removed.npy")


def _names(root: Path, *paths: Path) -> tuple[str, ...]:
    return tuple(path.relative_to(root).as_posix() for path in paths)
