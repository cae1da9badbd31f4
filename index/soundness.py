"""Whether what is in an index's files makes sense, and agrees: each check gives what is wrong.

Digests say that files are those that were written; these checks, that what was written is right.
They trust no file: whatever is in it, they end, in bounded memory.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from contracts.errors import BadIndex
from contracts.records import Postings
from index.catalogue import SCHEMA
from index.catalogue_file import CatalogueFile
from index.codebooks import read_searcher
from index.files import map_array, read_member
from index.manifest import SegmentEntry
from index.segments import map_segment, segment_paths
from index.tombstones import map_counts
from index.word_sets import dimensions_of
from retrieval.packing import Part, unpack

_POSTINGS_AT_ONCE = 1 << 22
_WORDS_LOOKED_UP = 256
_LEAST_FOUND = 0.9
"""Share of words that the search structure must find at distance 0; it may be approximate."""

AGAIN = "Restore it or index again."


@dataclass(frozen=True, slots=True)
class Tombstones:
    """Who is removed from a segment. removed : (n_images,) bool."""

    folder: Path
    removed: NDArray[np.bool_]


def check_postings(
    root: Path, entry: SegmentEntry, channel: str, n_words: int, tombstones: Tombstones | None
) -> None:
    """Unpack every list of a channel of a segment, and compare what else is said of them.

    Raises
    ------
    BadIndex : lists, counts, words of each image or tombstones do not agree.
    """
    paths = segment_paths(root, entry.name, channel)
    packed = map_segment(paths, n_words, entry.n_images)
    left = None if tombstones is None else map_counts(tombstones.folder, channel, n_words)
    words_per_image = np.zeros(entry.n_images, dtype=np.int64)
    part = Part(packed, 0, entry.n_images)
    for first, stop in _ranges(packed.counts):
        try:
            lists = unpack([part], np.arange(first, stop))
        except BadIndex as error:
            raise BadIndex(
                f"{paths.packed}: the lists of words {first} to {stop - 1} cannot be unpacked, or "
                f"are not as long as {paths.counts.name} says. {AGAIN}"
            ) from error
        if not _ascends(lists):
            raise BadIndex(
                f"{paths.packed}: a list of words {first} to {stop - 1} does not ascend. {AGAIN}"
            )
        words_per_image += np.bincount(lists.image_ids, minlength=entry.n_images)
        if tombstones is not None and left is not None:
            _check_left(tombstones, channel, first, lists, left[first:stop])
    _check_words_per_image(paths.words_per_image, words_per_image)


def check_removed(each: Tombstones, entry: SegmentEntry) -> None:
    """Compare the number of removed images with what the generation says.

    Raises
    ------
    BadIndex : they differ, or the file holds more than 0 and 1.
    """
    path = each.folder / "removed.npy"
    if len(raw := map_array(path, np.uint8, 1)) and raw.max() > 1:
        raise BadIndex(f"{path} holds {raw.max()}, expected 0 and 1. {AGAIN}")
    found = int(each.removed.sum())
    if found != entry.n_removed:
        raise BadIndex(
            f"{path} removes {found} images, the generation says {entry.n_removed}. {AGAIN}"
        )


def check_catalogue(path: Path, n_images: int) -> None:
    """Read the columns that number and name the images.

    Raises
    ------
    BadIndex : rows are not numbered from 0, or uris do not ascend by their bytes.
    """
    file = CatalogueFile(path, n_images, SCHEMA)
    ids = file.column("image_id").to_numpy()
    if not np.array_equal(ids, np.arange(n_images)):
        raise BadIndex(f"{path}: image_id is not the number of the row. {AGAIN}")
    uris = file.column("uri").cast(pa.binary()).combine_chunks()
    ascends = len(uris) < 2 or pc.all(pc.less(uris[:-1], uris[1:])).as_py()
    if uris.null_count or not ascends:
        raise BadIndex(f"{path}: uris are missing, twice there, or out of order. {AGAIN}")


def check_codebook(paths: dict[str, Path], channel: str, search_sha256: str) -> None:
    """Open a codebook and look some of its own words up.

    Raises
    ------
    BadIndex : words, search structure and distances do not belong to this channel, or together.
    """
    searcher = read_searcher(paths, search_sha256)
    book = searcher.codebook
    n_words, dimensions = book.words.shape
    if dimensions != dimensions_of(channel):
        raise BadIndex(
            f"{paths['words']} has {dimensions} dimensions, expected {dimensions_of(channel)} for "
            f"{channel}. {AGAIN}"
        )
    distances = np.array([[book.dmin] * len(book.dmax), book.d99, book.dmax])
    if not (np.isfinite(distances).all() and (distances >= 0).all()):
        raise BadIndex(f"{paths['distances']} holds distances that are none. {AGAIN}")
    in_lists = np.sort(read_member(paths["search"], "word_ids", np.int32, 1))
    if not np.array_equal(in_lists, np.arange(n_words)):
        raise BadIndex(f"{paths['search']} does not list each of {n_words} words once. {AGAIN}")
    if n_words:
        some = np.linspace(0, n_words - 1, min(n_words, _WORDS_LOOKED_UP)).astype(np.int64)
        _, sq_dist = searcher.nearest(np.ascontiguousarray(book.words[some]), 1)
        found = float(np.mean(sq_dist == 0))
        if found < _LEAST_FOUND:
            raise BadIndex(
                f"{paths['search']} finds {found:.0%} of its own words, expected "
                f"{_LEAST_FOUND:.0%} or more: it is of other words. {AGAIN}"
            )


def _ranges(counts: NDArray[np.uint32]) -> Iterator[tuple[int, int]]:
    """Cut words into ranges of some millions of postings, or of a single word that has more."""
    ends = np.cumsum(counts, dtype=np.int64)
    first = 0
    while first < len(counts):
        before = int(ends[first - 1]) if first else 0
        stop = int(np.searchsorted(ends, before + _POSTINGS_AT_ONCE, side="right"))
        stop = max(stop, first + 1)
        yield first, stop
        first = stop


def _ascends(lists: Postings) -> bool:
    if not len(lists.image_ids):
        return True
    begins = np.zeros(len(lists.image_ids), dtype=np.bool_)
    begins[lists.indptr[:-1][np.diff(lists.indptr) > 0]] = True
    return bool((begins[1:] | (lists.image_ids[1:] > lists.image_ids[:-1])).all())


def _check_left(
    each: Tombstones, channel: str, first: int, lists: Postings, counts: NDArray[np.uint32]
) -> None:
    kept = np.concatenate([[0], np.cumsum(~each.removed[lists.image_ids])])
    expected = kept[lists.indptr[1:]] - kept[lists.indptr[:-1]]
    wrong = np.flatnonzero(expected != counts)
    if len(wrong):
        raise BadIndex(
            f"{each.folder / f'{channel}.npy'} leaves {counts[wrong[0]]} images of word "
            f"{first + wrong[0]}, its list {expected[wrong[0]]}. {AGAIN}"
        )


def _check_words_per_image(path: Path, expected: NDArray[np.int64]) -> None:
    wrong = np.flatnonzero(map_array(path, np.uint32, 1) != expected)
    if len(wrong):
        raise BadIndex(
            f"{path} gives image {wrong[0]} another number of words than the {expected[wrong[0]]} "
            f"lists that it is in ({len(wrong)} images in all). {AGAIN}"
        )
