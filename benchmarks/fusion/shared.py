"""Words that images have in common: in the real streets, and in their simulated copies."""

from collections.abc import Mapping, Sequence

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from benchmarks.fusion.simulated import SimulatedChannel
from benchmarks.fusion.word_use import WordUse
from benchmarks.table import print_table

_COPIES = 3
_HEADER = ("channel", "", "the next", "half the survey on", "of a photo")


def print_shared(channels: Mapping[str, WordUse], n_words: int) -> None:
    """Print what share of an image's words other images have, real ones and simulated ones."""
    rows = []
    for name, use in channels.items():
        copies = SimulatedChannel(use, _COPIES * use.n_images, n_words, seed=0)
        pairs = [copies.pairs(copy) for copy in range(_COPIES)]
        simulated = _matrix(
            np.concatenate([words for words, _ in pairs]),
            np.concatenate([images for _, images in pairs]),
            n_words,
        )
        word_ids = np.repeat(np.arange(len(use.frequency)), use.frequency)
        real = _matrix(word_ids, use.postings.image_ids, len(use.frequency))
        rows += [
            (name, "real", *_shares(real, [use.photo(n)[0] for n in range(use.n_photos)])),
            ("", "copies", *_shares(simulated, _photos(copies))),
        ]
    print("Share of an image's words that another image has; of a photo's, the image with most\n")
    print_table(_HEADER, rows)


def _photos(copies: SimulatedChannel) -> list[NDArray[np.int32]]:
    return [copies.photo(number, 1)[0] for number in range(copies.use.n_photos)]


def _matrix(words: NDArray[np.generic], images: NDArray[np.uint32], n_words: int) -> sp.csr_array:
    """Images x words, 1 where the image has the word."""
    shape = (int(images.max()) + 1, n_words)
    return sp.coo_array((np.ones(len(words)), (images, words)), shape=shape).tocsr()


def _shares(has: sp.csr_array, photos: Sequence[NDArray[np.int32]]) -> list[str]:
    common = (has @ has.T).toarray()
    n = len(common)
    words_per_image = np.trace(common) / n
    nearest = [np.unique(words[:, 0]) for words in photos]
    found = [has[:, words].sum(axis=1).max() / max(len(words), 1) for words in nearest]
    return [
        f"{share:.3f}"
        for share in (
            np.diagonal(common, 1).mean() / words_per_image,
            common[np.arange(n), np.roll(np.arange(n), n // 2)].mean() / words_per_image,
            np.mean(found),
        )
    ]
