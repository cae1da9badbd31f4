"""Segments on disk: one inverted index a channel.

`segments/<segment>/<channel>/` holds indptr.npy (V + 1,) int64, image_ids.npy (P,) uint32
ascending within a word, and words_per_image.npy (n_images,) uint32.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from contracts.errors import BadIndex
from contracts.records import Postings
from index.files import map_array, write_array, write_atomic
from retrieval.postings import distinct_words, merge_postings

NAMES = ("indptr.npy", "image_ids.npy", "words_per_image.npy")


def segment_paths(root: Path, segment: str, channel: str) -> tuple[Path, Path, Path]:
    """(indptr, image ids, distinct words of each image)."""
    folder = root / "segments" / segment / channel
    return folder / NAMES[0], folder / NAMES[1], folder / NAMES[2]


def write_segment(
    paths: tuple[Path, Path, Path],
    parts: Sequence[tuple[Path, Path]],
    n_words: int,
    n_images: int,
    words_at_once: int,
) -> tuple[dict[Path, str], int]:
    """Merge partial indices (indptr, ids) of all words, a range of words at a time.

    Memory is bounded by the postings of `words_at_once` words, not by the index.
    Returns path -> sha256 and the number of postings.
    """
    mapped = [map_postings(indptr, ids, n_words) for indptr, ids in parts]
    lengths = np.zeros(n_words, dtype=np.int64)
    words_per_image = np.zeros(n_images, dtype=np.int64)
    ranges = [
        (start, min(start + words_at_once, n_words)) for start in range(0, n_words, words_at_once)
    ]

    def merged_ranges(sink: Callable[[NDArray[np.uint32]], object]) -> None:
        for start, stop in ranges:
            merged = merge_postings([_words(part, start, stop) for part in mapped])
            lengths[start:stop] = np.diff(merged.indptr)
            words_per_image[:] += distinct_words(merged, n_images)
            sink(merged.image_ids)

    # The length of the .npy header is not known before the ranges are merged, so the ids go into
    # a headerless file first and are given their header as they are copied to their name.
    scratch = paths[1].with_suffix(".part")
    scratch.parent.mkdir(parents=True, exist_ok=True)
    try:
        with scratch.open("wb") as stream:
            merged_ranges(lambda ids: stream.write(ids.tobytes()))
        n_postings = int(lengths.sum())
        ids: NDArray[np.uint32] = np.zeros(0, dtype=np.uint32)
        if n_postings:
            ids = np.memmap(scratch, dtype=np.uint32, mode="r", shape=(n_postings,))
        indptr = np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(lengths)])
        written = {
            paths[0]: write_array(paths[0], indptr),
            paths[1]: write_atomic(paths[1], lambda out: np.save(out, ids, allow_pickle=False)),
            paths[2]: write_array(paths[2], words_per_image.astype(np.uint32)),
        }
    finally:
        scratch.unlink(missing_ok=True)
    return written, n_postings


def map_postings(indptr_path: Path, ids_path: Path, n_words: int | None = None) -> Postings:
    """Map postings read-only and check that sizes agree; ids are checked by the kernels."""
    indptr = map_array(indptr_path, np.int64, 1).astype(np.int64, copy=False)
    ids = map_array(ids_path, np.uint32, 1).astype(np.uint32, copy=False)
    if len(indptr) == 0 or indptr[0] != 0 or indptr[-1] != len(ids):
        raise BadIndex(
            f"{indptr_path} and {ids_path.name} do not fit each other. Restore them or index again."
        )
    if n_words is not None and len(indptr) != n_words + 1:
        raise BadIndex(
            f"{indptr_path} is for {len(indptr) - 1} words; the codebook has {n_words}. "
            "Remove the job's folder and index again."
        )
    return Postings(indptr, ids)


def _words(part: Postings, start: int, stop: int) -> Postings:
    first, last = int(part.indptr[start]), int(part.indptr[stop])
    return Postings(part.indptr[start : stop + 1] - first, part.image_ids[first:last])
