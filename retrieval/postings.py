"""Inverted indices of one channel: built per shard, joined exactly, counted after the join."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from contracts.errors import BadIndex, VocabularyMismatch, WrongInput
from contracts.records import Postings
from retrieval.kernels import kernel

Scalar = TypeVar("Scalar", bound=np.generic)

_IN_ORDER = 0
_OUT_OF_BOUNDS = -1


def build_postings(
    word_ids: NDArray[np.int32], image_ids: NDArray[np.uint32], n_words: int
) -> Postings:
    """Gather (word, image) pairs into word -> ascending unique image ids.

    Parameters
    ----------
    word_ids : (n,) int32, the nearest word of every descriptor.
    image_ids : (n,) uint32, the image of every descriptor, in any order.
    n_words : size of the codebook.

    Raises
    ------
    WrongInput : the two arrays differ in length.
    VocabularyMismatch : a word id lies outside the codebook.
    """
    if len(word_ids) != len(image_ids):
        raise WrongInput(
            f"postings need one image id per word id; got {len(word_ids)} word ids and "
            f"{len(image_ids)} image ids"
        )
    if len(word_ids) and not 0 <= int(word_ids.min()) <= int(word_ids.max()) < n_words:
        raise VocabularyMismatch(
            f"word ids run from {word_ids.min()} to {word_ids.max()} but the codebook has "
            f"{n_words} words; assign the features again with this codebook"
        )
    if np.any(image_ids[1:] < image_ids[:-1]):
        order = np.argsort(image_ids, kind="stable")
        word_ids, image_ids = word_ids[order], image_ids[order]
    indptr = np.zeros(n_words + 1, dtype=np.int64)
    np.cumsum(np.bincount(word_ids, minlength=n_words), out=indptr[1:])
    placed = np.empty(len(image_ids), dtype=np.uint32)
    words, images = read_only(word_ids, np.int32), read_only(image_ids, np.uint32)
    _place_by_word(words, images, indptr[:-1], placed)
    return _unique_within_words(indptr, placed)


def merge_postings(parts: Sequence[Postings]) -> Postings:
    """Join partial postings; the order of `parts` does not matter, a repeated pair counts once.

    Parameters
    ----------
    parts : at least one, each with indptr (V+1,) int64 and image_ids (P,) uint32, ascending
        within a word.

    Raises
    ------
    WrongInput : there is no part.
    VocabularyMismatch : the parts were built from different codebooks.
    BadIndex : a part's indptr does not fit its image ids.
    """
    if not parts:
        raise WrongInput("nothing to merge: at least one partial index is needed")
    sizes = sorted({part.n_words for part in parts})
    if len(sizes) > 1:
        raise VocabularyMismatch(
            f"partial indices of codebooks with {sizes} words cannot be merged; "
            "assign all shards with one codebook"
        )
    for part in parts:
        _check_offsets(part)
    indptr = np.zeros(sizes[0] + 1, dtype=np.int64)
    for part in parts:
        indptr += part.indptr
    merged = np.empty(int(indptr[-1]), dtype=np.uint32)
    filled = indptr[:-1].copy()
    for part in sorted(parts, key=_first_image):  # shards are id ranges: already ascending
        offsets, images = read_only(part.indptr, np.int64), read_only(part.image_ids, np.uint32)
        _append(offsets, images, filled, merged)
    return _unique_within_words(indptr, merged)


def document_frequency(
    postings: Postings, removed: NDArray[np.bool_] | None = None
) -> NDArray[np.int64]:
    """Count the images of every word, without the removed ones; (V,) int64.

    Parameters
    ----------
    removed : (n_images,) bool, or None when none is.

    Raises
    ------
    BadIndex : an image id lies outside `removed`, or indptr does not fit the image ids.
    """
    _check_offsets(postings)
    if removed is None:
        return np.diff(postings.indptr)
    df = np.zeros(postings.n_words, dtype=np.int64)
    offsets, images = (
        read_only(postings.indptr, np.int64),
        read_only(postings.image_ids, np.uint32),
    )
    if _count_kept(offsets, images, read_only(removed, np.bool_), df) == _OUT_OF_BOUNDS:
        raise _beyond_catalogue(len(removed))
    return df


def inverse_document_frequency(df: NDArray[np.int64], n_images: int) -> NDArray[np.float64]:
    """idf = ln(N / df) of every word, 0 for a word without images; (V,) float64.

    `df` and `n_images` must both leave removed images out (Sparck Jones 1972).
    """
    idf = np.zeros(len(df), dtype=np.float64)
    used = df > 0
    idf[used] = np.log(n_images / df[used])
    return idf


def distinct_words(postings: Postings, n_images: int) -> NDArray[np.int64]:
    """Count the distinct words of every image; (n_images,) int64.

    Raises
    ------
    BadIndex : an image id is not below `n_images`.
    """
    counts = np.zeros(n_images, dtype=np.int64)
    if _count_images(read_only(postings.image_ids, np.uint32), counts) == _OUT_OF_BOUNDS:
        raise _beyond_catalogue(n_images)
    return counts


def read_only(array: NDArray[Scalar], dtype: type[Scalar]) -> NDArray[Scalar]:
    """Give a read-only plain view: memory maps and fresh arrays then share one compiled kernel."""
    view = np.ascontiguousarray(array, dtype=dtype).view()
    view.flags.writeable = False
    return view


def _check_offsets(postings: Postings) -> None:
    indptr = postings.indptr
    n_postings = len(postings.image_ids)
    if indptr[0] != 0 or indptr[-1] != n_postings or np.any(indptr[1:] < indptr[:-1]):
        raise BadIndex(
            f"the offsets of a partial index run from {indptr[0]} to {indptr[-1]} for "
            f"{n_postings} postings; they must ascend from 0 to that number. Index again."
        )


def _beyond_catalogue(n_images: int) -> BadIndex:
    return BadIndex(
        f"an inverted index names an image beyond the catalogue's {n_images}; "
        "the index is damaged: restore it or index again"
    )


def _first_image(part: Postings) -> int:
    return int(part.image_ids.min()) if len(part.image_ids) else -1


def _unique_within_words(indptr: NDArray[np.int64], image_ids: NDArray[np.uint32]) -> Postings:
    kept = np.zeros_like(indptr)
    _sort_and_drop_repeats(indptr, image_ids, kept)
    return Postings(kept, image_ids[: kept[-1]].copy() if kept[-1] < len(image_ids) else image_ids)


@kernel
def _place_by_word(
    word_ids: NDArray[np.int32],
    image_ids: NDArray[np.uint32],
    starts: NDArray[np.int64],
    out: NDArray[np.uint32],
) -> None:
    filled = starts.copy()
    for i in range(len(word_ids)):
        word = word_ids[i]
        out[filled[word]] = image_ids[i]
        filled[word] += 1


@kernel
def _append(
    indptr: NDArray[np.int64],
    image_ids: NDArray[np.uint32],
    filled: NDArray[np.int64],
    out: NDArray[np.uint32],
) -> None:
    for word in range(len(indptr) - 1):
        at = filled[word]
        for i in range(indptr[word], indptr[word + 1]):
            out[at] = image_ids[i]
            at += 1
        filled[word] = at


@kernel
def _sort_and_drop_repeats(
    indptr: NDArray[np.int64], image_ids: NDArray[np.uint32], kept: NDArray[np.int64]
) -> None:
    """Compact `image_ids` in place; `kept` becomes the new offsets."""
    at = 0
    for word in range(len(indptr) - 1):
        start, stop = indptr[word], indptr[word + 1]
        for i in range(start + 1, stop):
            if image_ids[i] < image_ids[i - 1]:
                image_ids[start:stop].sort()
                break
        first = at
        for i in range(start, stop):
            image = image_ids[i]
            if at == first or image_ids[at - 1] != image:
                image_ids[at] = image
                at += 1
        kept[word + 1] = at


@kernel
def _count_kept(
    indptr: NDArray[np.int64],
    image_ids: NDArray[np.uint32],
    removed: NDArray[np.bool_],
    df: NDArray[np.int64],
) -> int:
    for word in range(len(indptr) - 1):
        for i in range(indptr[word], indptr[word + 1]):
            image = image_ids[i]
            if image >= len(removed):
                return _OUT_OF_BOUNDS
            if not removed[image]:
                df[word] += 1
    return _IN_ORDER


@kernel
def _count_images(image_ids: NDArray[np.uint32], counts: NDArray[np.int64]) -> int:
    for i in range(len(image_ids)):
        image = image_ids[i]
        if image >= len(counts):
            return _OUT_OF_BOUNDS
        counts[image] += 1
    return _IN_ORDER
