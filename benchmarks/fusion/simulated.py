"""Postings of a large survey, with the frequencies that were measured on a small one."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.fusion.measured import PAIR, K, WordUse
from contracts.config import DESCRIPTORS
from contracts.records import Postings
from retrieval.fusion import ChannelQuery

N_KEYPOINTS = 1000


@dataclass(frozen=True, slots=True)
class Size:
    """A survey to simulate, and what fusing one pair may take.

    words_per_image : of one channel; None: as measured.
    """

    n_images: int
    n_words: int
    words_per_image: float | None
    bar_ms: float


def simulated_photo(
    channels: Mapping[str, WordUse], size: Size, seed: int
) -> list[list[ChannelQuery]]:
    """Draw a photo's keypoints in every channel of the pair, and the postings of their words.

    Channels are drawn independently: fewer images are found by several than in a real survey.
    """
    rng = np.random.default_rng(seed)
    return [
        [simulated_channel(channels[f"{detector}-{name}"], size, rng) for name in DESCRIPTORS]
        for detector in PAIR
    ]


def simulated_channel(use: WordUse, size: Size, rng: np.random.Generator) -> ChannelQuery:
    """Draw keypoints by their words' rank, and each word's images by its document frequency.

    A rank stands for the same part of a larger vocabulary. Only words that are asked for are
    given their postings, one after the other: what is not asked for is not read.
    """
    keypoints = rng.integers(0, len(use.ranks), N_KEYPOINTS)
    stretch = size.n_words / len(use.frequency)
    ranks = ((use.ranks[keypoints] + rng.random((N_KEYPOINTS, K))) * stretch).astype(np.int64)
    for later in range(1, K):
        taken = (ranks[:, :later] == ranks[:, later : later + 1]).any(axis=1)
        ranks[taken, later] = (ranks[taken, later] + 1) % size.n_words
    words = np.unique(ranks)
    per_image = size.words_per_image or use.words_per_image
    mean = size.n_images * per_image / size.n_words
    wanted = use.relative_frequency()[(words / stretch).astype(np.int64)] * mean
    lists = [_some_images(rng, size.n_images, max(round(count), 1)) for count in wanted]
    frequency = np.zeros(size.n_words, dtype=np.int64)
    frequency[words] = [len(images) for images in lists]
    idf = np.zeros(size.n_words)
    idf[words] = np.log(size.n_images / frequency[words])
    return ChannelQuery(
        ranks.astype(np.int32),
        use.sq_dist[keypoints],
        float(use.sq_dist[:, 0].min()),
        float(use.sq_dist.max()),
        Postings(np.concatenate([[0], np.cumsum(frequency)]), np.concatenate(lists)),
        idf,
    )


def _some_images(rng: np.random.Generator, n_images: int, count: int) -> NDArray[np.uint32]:
    """Draw ascending images; draws that hit one twice are made up for by as many more."""
    count = min(count, n_images)
    images = np.unique(rng.integers(0, n_images, count))
    while len(images) < count:
        images = np.union1d(images, rng.integers(0, n_images, count - len(images)))
    return images.astype(np.uint32)
