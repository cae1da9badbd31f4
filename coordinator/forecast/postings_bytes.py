"""How many bytes packed postings will take: lists as long as they will be, packed for once."""

from itertools import pairwise

import numpy as np

from contracts.records import Postings
from retrieval.packing import pack

RELATIVE_FREQUENCY = (
    *(2.43, 1.86, 1.64, 1.49, 1.38, 1.28, 1.19, 1.12, 1.04, 0.97),
    *(0.90, 0.84, 0.77, 0.70, 0.62, 0.55, 0.47, 0.37, 0.27, 0.13),
)
"""Images a word, as a multiple of the mean, of each twentieth of a channel's words by descending
frequency. Mean of 24 channels of 20,000 words over 400 and 500 real images; no channel's first
twentieth is above 3.3, none's last above 0.3."""

_WORDS_PACKED = 16
"""Of each twentieth."""
_LONGEST = 1_024
"""A longer list is packed so far and taken to go on likewise."""


def packed_bytes(n_postings: float, n_words: int, n_images: int) -> float:
    """The bytes of a channel's packed lists.

    Images come in any order here. Those of a real street share words, so that a block has small
    gaps and a few large ones, which decide its width: 2 to 9 % more bytes on real indices.
    """
    if not n_words or not n_images:
        return 0.0
    rng = np.random.default_rng(0)
    share = n_words / len(RELATIVE_FREQUENCY)
    n_bytes = 0.0
    for relative in RELATIVE_FREQUENCY:
        mean = min(relative * n_postings / n_words, n_images)
        n_bytes += share * _bytes_a_word(rng, mean, n_images)
    return n_bytes


def _bytes_a_word(rng: np.random.Generator, mean: float, n_images: int) -> float:
    """Bytes of the list of a word that `mean` images have, of `n_images`."""
    lengths = rng.poisson(min(mean, _LONGEST), _WORDS_PACKED)
    indptr = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
    gaps = rng.geometric(min(mean / n_images, 1.0), indptr[-1])
    image_ids = np.concatenate([np.cumsum(gaps[start:stop]) for start, stop in pairwise(indptr)])
    packed = pack(Postings(indptr, image_ids.astype(np.uint32)))
    return mean * len(packed.packed) / max(len(image_ids), 1)
