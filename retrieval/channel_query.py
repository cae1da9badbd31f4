"""What a photo asks of one channel, brought to the arrays that the kernels of fusion take."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contracts.errors import BadIndex
from contracts.records import Postings


@dataclass(frozen=True, slots=True)
class ChannelQuery:
    """The nearest words of a photo's keypoints in one channel, and that channel's postings.

    word_ids : (n, k) int32, words of `postings`, nearest first.
    sq_dist : (n, k) float32, squared L2, ascending.
    dmin, dmax : the codebook's smallest 1-NN and largest k-NN distance, squared.
    idf : (V,) float64, ln(N / df) of each of these postings' words; None if unused.
    """

    word_ids: NDArray[np.int32]
    sq_dist: NDArray[np.float32]
    dmin: float
    dmax: float
    postings: Postings
    idf: NDArray[np.float64] | None = None


def word_distances(channels: Sequence[ChannelQuery]) -> NDArray[np.float64]:
    """d' = (d - dmin) / (dmax - dmin) within [0, 1], of METHOD section 3; (n, L, k) float64.

    Where a codebook has fewer than k words, 1 fills up.
    """
    distances = np.ones(_shape(channels), dtype=np.float64)
    for at, channel in enumerate(channels):
        above = channel.sq_dist.astype(np.float64) - channel.dmin
        span = channel.dmax - channel.dmin
        # A codebook whose sample sits at one distance has no span: only what is farther is far.
        scaled = above / span if span > 0 else above > 0
        distances[:, at, : scaled.shape[1]] = np.clip(scaled, 0.0, 1.0)
    return distances


def word_factors(channels: Sequence[ChannelQuery], *, use_idf: bool) -> NDArray[np.float64]:
    """Give the factor of each word's votes, its idf squared or 1; (n, L, k) float64."""
    factors = np.ones(_shape(channels), dtype=np.float64)
    for at, channel in enumerate(channels):
        if use_idf and channel.idf is not None:
            squared = np.square(channel.idf[channel.word_ids])
            factors[:, at, : squared.shape[1]] = squared
    return factors


def word_spans(channels: Sequence[ChannelQuery]) -> NDArray[np.int64]:
    """Find start and stop of each word's postings; (n, L, k, 2) int64, empty where no word is.

    Raises
    ------
    BadIndex : a word outside the codebook, or offsets outside the image ids.
    """
    spans = np.zeros((*_shape(channels), 2), dtype=np.int64)
    for at, channel in enumerate(channels):
        words, postings = channel.word_ids, channel.postings
        if words.size == 0:
            continue
        if not 0 <= int(words.min()) <= int(words.max()) < postings.n_words:
            raise BadIndex(
                f"word ids from {words.min()} to {words.max()} were looked up in postings of "
                f"{postings.n_words} words; codebook and postings must be of one index"
            )
        starts, stops = postings.indptr[words], postings.indptr[words + 1]
        if starts.min() < 0 or np.any(stops < starts) or stops.max() > len(postings.image_ids):
            raise BadIndex(
                f"offsets of postings do not ascend from 0 to {len(postings.image_ids)}; "
                "the index is damaged: restore it or index again"
            )
        spans[:, at, : words.shape[1], 0] = starts
        spans[:, at, : words.shape[1], 1] = stops
    return spans


def _shape(channels: Sequence[ChannelQuery]) -> tuple[int, int, int]:
    k = max(channel.word_ids.shape[1] for channel in channels)
    return len(channels[0].word_ids), len(channels), k
