"""Inverted indices of 100,000 images take at most two bytes a posting."""

import numpy as np
import pytest

from contracts.records import Postings
from retrieval.packing import pack

N_IMAGES, WORDS_PER_IMAGE = 100_000, 800
SHARE = [0, 0.001, 0.01, 0.05, 0.1, 0.25, 0.5, 1]
FREQUENCY = [10, 6.13, 3.68, 2.45, 1.96, 1.23, 0.74, 0]
"""Document frequency as a multiple of its mean, of the words by descending frequency: that of
100,000 words in 250 images of Stereopolis and 199 of KTH (`python -m benchmarks index`)."""


@pytest.mark.parametrize("n_words", [20_000, 100_000, 1_000_000])
def test_a_posting_takes_at_most_two_bytes_with_all_that_belongs_to_it(n_words: int) -> None:
    """Lists of some 300 of the words. Images lie anywhere: in a street they lie together."""
    rng = np.random.default_rng(0)
    mean = N_IMAGES * WORDS_PER_IMAGE / n_words
    counts = np.rint(mean * np.interp(np.linspace(0, 1, 300), SHARE, FREQUENCY)).astype(np.int64)
    lists = [np.sort(rng.choice(N_IMAGES, n, replace=False)) for n in counts]
    indptr = np.concatenate([[0], np.cumsum(counts)])
    packed = pack(Postings(indptr, np.concatenate(lists).astype(np.uint32)))
    n_bytes = packed.packed.nbytes + packed.offsets.nbytes + packed.counts.nbytes
    words_per_image = 4 * packed.n_postings / WORDS_PER_IMAGE
    assert n_bytes + words_per_image <= 2 * packed.n_postings
