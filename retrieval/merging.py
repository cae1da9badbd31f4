"""Merging partial inverted indices: sets of keys, joined a range of words at a time.

The union of sets does not depend on their order, on how they were cut, or on one being there
twice, and neither does what is made of it.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from contracts.errors import BadIndex, WrongInput
from contracts.records import Postings
from retrieval.kernels import kernel, read_only
from retrieval.postings import IMAGE, IMAGE_BITS, posting_keys

__all__ = [
    "POSTINGS_AT_ONCE",
    "keys_of_words",
    "merge_keys",
    "posting_keys",
    "renumbered_keys",
    "word_ranges",
]

POSTINGS_AT_ONCE = 1 << 24
"""Of a range of words, about; merging takes 13 bytes each (measured), so 0.2 GB."""


def word_ranges(n_words: int, n_postings: int) -> tuple[tuple[int, int], ...]:
    """Cut a codebook into ranges of equally many words that are merged at a time.

    n_postings : of all words, or an upper bound.

    Returns
    -------
    (first, stop) of each range, ascending; none for a codebook without words.
    """
    n_ranges = min(max(-(-n_postings // POSTINGS_AT_ONCE), 1), n_words)
    bounds = [n_words * number // n_ranges for number in range(n_ranges + 1)] if n_ranges else []
    return tuple(pairwise(bounds))


def keys_of_words(keys: NDArray[np.uint64], first_word: int, stop_word: int) -> NDArray[np.uint64]:
    """Cut the keys of words first_word to stop_word - 1 from ascending keys."""
    bounds = np.array([first_word, stop_word], dtype=np.uint64) << IMAGE_BITS
    first, stop = np.searchsorted(keys, bounds)
    return keys[first:stop]


def renumbered_keys(
    postings: Postings, first_word: int, new_ids: NDArray[np.int64]
) -> NDArray[np.uint64]:
    """Turn the lists of words from first_word on into keys of images with new ids.

    Parameters
    ----------
    new_ids : (n_images,) int64, the new id of each image below 2**32; -1: left out.

    Raises
    ------
    WrongInput : a new id is out of bounds. BadIndex : an image has no new id.
    """
    if len(new_ids) and not -1 <= int(new_ids.min()) <= int(new_ids.max()) < 2**32:
        raise WrongInput(
            f"new image ids run from {new_ids.min()} to {new_ids.max()}, expected -1 to 2**32 - 1"
        )
    keys = np.empty(len(postings.image_ids), dtype=np.uint64)
    indptr, image_ids = (
        read_only(postings.indptr, np.int64),
        read_only(postings.image_ids, np.uint32),
    )
    n_keys = _renumber(indptr, image_ids, first_word, read_only(new_ids, np.int64), keys)
    if n_keys < 0:
        raise BadIndex(f"an inverted index names an image beyond the {len(new_ids)} of its segment")
    keys = keys[:n_keys]
    if np.any(keys[1:] < keys[:-1]):  # not where images keep their order
        keys.sort()
    return keys


def merge_keys(runs: Sequence[NDArray[np.uint64]], first_word: int, n_words: int) -> Postings:
    """Join the keys of words first_word to first_word + n_words - 1.

    Parameters
    ----------
    runs : each (P_i,) uint64 ascending; any order of runs, any repeats. Runs in the order of
        their images are joined fastest.

    Returns
    -------
    Postings of n_words words; its word 0 is first_word.

    Raises
    ------
    BadIndex : keys of other words, or out of order.
    """
    indptr = np.zeros(n_words + 1, dtype=np.int64)
    views = [read_only(run, np.uint64) for run in runs]
    for run in views:
        if not _count_words(run, first_word, indptr[1:]):
            raise BadIndex(
                f"a partial index is damaged: its keys of words {first_word} to "
                f"{first_word + n_words - 1} are of other words or out of order. Remove the job's "
                "folder and run the same command again."
            )
    np.cumsum(indptr, out=indptr)
    image_ids = np.empty(int(indptr[-1]), dtype=np.uint32)
    filled = indptr[:-1].copy()
    for run in views:
        _place(run, first_word, filled, image_ids)
    _sort_and_drop_repeats(indptr, image_ids)
    return Postings(indptr, image_ids[: indptr[-1]])


@kernel
def _renumber(
    indptr: NDArray[np.int64],
    image_ids: NDArray[np.uint32],
    first_word: int,
    new_ids: NDArray[np.int64],
    keys: NDArray[np.uint64],
) -> int:
    """Fill in the keys of images that are not left out; how many, or -1: an id is missing."""
    n_keys = 0
    for word in range(len(indptr) - 1):
        for i in range(indptr[word], indptr[word + 1]):
            if image_ids[i] >= len(new_ids):
                return -1
            new_id = new_ids[image_ids[i]]
            if new_id >= 0:
                keys[n_keys] = np.uint64(first_word + word) << IMAGE_BITS | np.uint64(new_id)
                n_keys += 1
    return n_keys


@kernel
def _count_words(keys: NDArray[np.uint64], first_word: int, counts: NDArray[np.int64]) -> bool:
    """Count the keys of each word; False if one is of another word, or below the one before."""
    previous = np.uint64(0)
    for i in range(len(keys)):
        word = np.int64(keys[i] >> IMAGE_BITS) - first_word
        if word < 0 or word >= len(counts) or keys[i] < previous:
            return False
        counts[word] += 1
        previous = keys[i]
    return True


@kernel
def _place(
    keys: NDArray[np.uint64],
    first_word: int,
    filled: NDArray[np.int64],
    image_ids: NDArray[np.uint32],
) -> None:
    """Append the images of keys that were counted to their words' lists."""
    for i in range(len(keys)):
        word = np.int64(keys[i] >> IMAGE_BITS) - first_word
        image_ids[filled[word]] = np.uint32(keys[i] & IMAGE)
        filled[word] += 1


@kernel
def _sort_and_drop_repeats(indptr: NDArray[np.int64], image_ids: NDArray[np.uint32]) -> None:
    """Compact both in place. Runs in the order of their images leave nothing to be sorted."""
    out, start = 0, indptr[0]
    for word in range(len(indptr) - 1):
        stop = indptr[word + 1]
        for i in range(start + 1, stop):
            if image_ids[i] < image_ids[i - 1]:
                image_ids[start:stop].sort()
                break
        first = out
        for i in range(start, stop):
            if out == first or image_ids[out - 1] != image_ids[i]:
                image_ids[out] = image_ids[i]
                out += 1
        start = stop
        indptr[word + 1] = out
