"""Inverted indices of one channel: (word, image) pairs as keys, lists made of them, and counts.

A key is word << 32 | image: a sorted set of keys is an inverted index, whatever it was made from.
"""

import numpy as np
from numpy.typing import NDArray

from contracts.errors import BadIndex, VocabularyMismatch, WrongInput
from contracts.records import Postings
from retrieval.kernels import kernel, read_only

IMAGE_BITS = np.uint64(32)
IMAGE = np.uint64(2**32 - 1)


def posting_keys(
    word_ids: NDArray[np.int32], image_ids: NDArray[np.uint32], n_words: int
) -> NDArray[np.uint64]:
    """List (word, image) pairs once each as keys; (P,) uint64, ascending.

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
    keys = np.sort(word_ids.astype(np.uint64) << IMAGE_BITS | image_ids.astype(np.uint64))
    first = np.ones(len(keys), dtype=np.bool_)  # and not np.unique, which takes four times as long
    first[1:] = keys[1:] != keys[:-1]
    return keys[first]


def build_postings(
    word_ids: NDArray[np.int32], image_ids: NDArray[np.uint32], n_words: int
) -> Postings:
    """Gather (word, image) pairs into word -> ascending unique image ids, all at once.

    Arguments and errors are those of `posting_keys`.
    """
    keys = posting_keys(word_ids, image_ids, n_words)
    counts = np.bincount((keys >> IMAGE_BITS).astype(np.int64), minlength=n_words)
    indptr = np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(counts)])
    return Postings(indptr, (keys & IMAGE).astype(np.uint32))


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
    if not _count_images(read_only(postings.image_ids, np.uint32), counts):
        raise BadIndex(
            f"an inverted index names an image beyond the catalogue's {n_images}; "
            "the index is damaged: restore it or index again"
        )
    return counts


@kernel
def _count_images(image_ids: NDArray[np.uint32], counts: NDArray[np.int64]) -> bool:
    for i in range(len(image_ids)):
        image = image_ids[i]
        if image >= len(counts):
            return False
        counts[image] += 1
    return True
