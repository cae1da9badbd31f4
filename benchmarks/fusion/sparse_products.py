"""The vote `union` with a library's sparse matrices: each channel's postings one CSR matrix."""

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from retrieval.channel_query import word_distances, word_factors
from retrieval.fusion import ChannelQuery


def as_matrix(channel: ChannelQuery, n_images: int) -> sp.csr_array:
    """Words x images, 1 where the image has the word."""
    postings = channel.postings
    ones = np.ones(len(postings.image_ids))
    images = postings.image_ids.astype(np.int32)
    return sp.csr_array((ones, images, postings.indptr), shape=(postings.n_words, n_images))


def best_of_union(
    detectors: Sequence[Sequence[ChannelQuery]],
    matrices: Sequence[Sequence[sp.csr_array]],
    distinct_words: NDArray[np.int64],
    top: int,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Give the best images and all scores of `union` with `idf` and `norm`, for k = 2.

    The closed form of METHOD section 3, literally.
    """
    scores = np.zeros(len(distinct_words))
    for channels, tables in zip(detectors, matrices, strict=True):
        distances = word_distances(channels)
        factors = word_factors(channels, use_idf=True)
        rows = []
        for channel, table in zip(channels, tables, strict=True):
            first, second = table[channel.word_ids[:, 0]], table[channel.word_ids[:, 1]]
            rows.append((first, second - second.multiply(first)))
        kept = np.array([[np.diff(row.tocsr().indptr) > 0 for row in pair] for pair in rows])
        kept = kept.transpose(2, 0, 1)
        n_kept = kept.sum(axis=2)
        complete = (n_kept > 0).all(axis=1)
        n_cells = n_kept.prod(axis=1)
        totals = (distances * kept).sum(axis=2)
        for at, pair in enumerate(rows):
            others = sum(
                n_cells / np.maximum(n_kept[:, at] * n_kept[:, j], 1) * totals[:, j]
                for j in range(len(rows))
                if j != at
            )
            for rank, row in enumerate(pair):
                near = n_cells / np.maximum(n_kept[:, at], 1) * (1 - distances[:, at, rank])
                scores += (complete * (near - others) * factors[:, at, rank]) @ row
    scores /= np.sqrt(distinct_words)
    best = np.argpartition(-scores, top)[:top]
    return best[np.lexsort((best, -scores[best]))], scores
