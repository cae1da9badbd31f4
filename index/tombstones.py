"""Which images of a segment have been removed, and what its words are worth without them.

`tombstones/<generation>/<segment>/` holds removed.npy (n_images,) uint8, 1 = removed, and for each
channel <channel>.npy (V,) uint32, the images of each word that are left, so that idf stays exact.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from contracts.errors import BadIndex
from index.files import map_array, write_array
from retrieval.merging import word_ranges
from retrieval.packing import Part, unpack


def tombstones_folder(root: Path, name: str, segment: str) -> Path:
    return root / "tombstones" / name / segment


def count_left(part: Part, removed: NDArray[np.bool_]) -> NDArray[np.uint32]:
    """Images of each word that are not removed; (V,) uint32.

    The lists are read a range of words at a time, so that memory stays that of a range.

    Parameters
    ----------
    part : a segment by itself, its first image 0. removed : (n_images,) bool.

    Raises
    ------
    BadIndex : the segment's postings are damaged.
    """
    packed = part.packed
    left = np.array(packed.counts, dtype=np.uint32)
    for first, stop in word_ranges(packed.n_words, packed.n_postings):
        gone = unpack([part], np.arange(first, stop), removed)
        left[first:stop] -= np.diff(gone.indptr).astype(np.uint32)
    return left


def write_tombstones(
    folder: Path, removed: NDArray[np.bool_], counts: Mapping[str, NDArray[np.uint32]]
) -> dict[Path, str]:
    """Write who is removed and, by channel, the counts that are left; returns path -> sha256."""
    path = folder / "removed.npy"
    written = {path: write_array(path, removed.astype(np.uint8))}
    for channel, left in counts.items():
        path = folder / f"{channel}.npy"
        written[path] = write_array(path, left)
    return written


def map_removed(folder: Path, n_images: int) -> NDArray[np.bool_]:
    """Which images of a segment are removed; (n_images,) bool.

    Raises
    ------
    BadIndex : the file is missing, damaged or of another segment.
    """
    path = folder / "removed.npy"
    removed = map_array(path, np.uint8, 1)
    if len(removed) != n_images:
        raise BadIndex(
            f"{path} is of {len(removed)} images; the segment has {n_images}. Restore it, or go "
            "back with `flaneur rollback`."
        )
    return removed.astype(np.bool_)


def map_counts(folder: Path, channel: str, n_words: int) -> NDArray[np.uint32]:
    """Images of each word that are not removed; (n_words,) uint32.

    Raises
    ------
    BadIndex : the file is missing, damaged or of other words.
    """
    path = folder / f"{channel}.npy"
    counts = map_array(path, np.uint32, 1)
    if len(counts) != n_words:
        raise BadIndex(
            f"{path} is of {len(counts)} words; the codebook has {n_words}. Restore it, or go "
            "back with `flaneur rollback`."
        )
    return counts
