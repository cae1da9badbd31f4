"""A large survey's use of words, as it was measured on a small one: how often, and together."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import gcd

import numpy as np
from numpy.typing import NDArray

from benchmarks.fusion.word_use import WordUse
from contracts.records import Postings

_EQUAL = 1.1
"""Words whose document frequencies differ by less than this factor may change places."""


@dataclass(frozen=True, slots=True)
class SimulatedChannel:
    """One channel of a survey that is copies of the real streets, each with words of its own.

    Within a copy, images share what they share in reality. From copy to copy, words of about
    equal document frequency change places, and a rank stands for the same part of a larger
    vocabulary: so every word keeps its frequency, and copies share words only by chance.
    """

    use: WordUse
    n_images: int
    n_words: int
    seed: int

    @property
    def n_copies(self) -> int:
        return -(-self.n_images // self.use.n_images)

    @property
    def _stride(self) -> int:
        """By which ranks are scattered: about the golden section of the words, prime to them."""
        return next(
            stride
            for stride in range(round(0.618 * self.n_words), 2 * self.n_words)
            if gcd(stride, self.n_words) == 1
        )

    def words_of(self, copy: int) -> NDArray[np.int32]:
        """The word that each real one is in this copy, all different; (V,) int32."""
        frequency = self.use.frequency
        rng = np.random.default_rng((self.seed, copy))
        level = np.floor(np.log(np.maximum(frequency, 0.5)) / np.log(_EQUAL))
        place = np.argsort(-level + rng.random(len(level)))
        edges = np.arange(len(place) + 1) * self.n_words // len(place)
        ranks = rng.integers(edges[place], edges[place + 1])
        # A codebook does not have its words in the order of their frequency.
        words: NDArray[np.int32] = (ranks * self._stride % self.n_words).astype(np.int32)
        return words

    def pairs(self, copy: int) -> tuple[NDArray[np.int32], NDArray[np.uint32]]:
        """(word, image) of every posting of a copy's images."""
        word_ids = np.repeat(self.words_of(copy), self.use.frequency)
        image_ids = self.use.postings.image_ids.astype(np.int64) + copy * self.use.n_images
        there = image_ids < self.n_images
        return word_ids[there], image_ids[there].astype(np.uint32)

    def keys(self, copy: int) -> NDArray[np.uint64]:
        """The same as the partial inverted index of a shard, word << 32 | image ascending."""
        word_ids, image_ids = self.pairs(copy)
        keys = word_ids.astype(np.uint64) << np.uint64(32) | image_ids
        keys.sort()  # and not `posting_keys`: no pair is there twice
        return keys

    def photo(self, number: int, copy: int) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """Words and squared distances of a photo's keypoints, taken where the copy is."""
        words, sq_dist = self.use.photo(number)
        return self.words_of(copy)[words], sq_dist

    def lists(self, words: NDArray[np.int32]) -> Postings:
        """The images of some words, in their order; all others are never made."""
        place = np.full(self.n_words, -1, dtype=np.int64)
        place[words] = np.arange(len(words))
        keys = np.concatenate(list(self._keys_at(place)))
        keys.sort()
        indptr = np.searchsorted(keys, np.arange(len(words) + 1) << 32)
        return Postings(indptr, keys.astype(np.uint32))

    def _keys_at(self, place: NDArray[np.int64]) -> Iterator[NDArray[np.int64]]:
        """By copy, place << 32 | image of the words that have a place."""
        starts, frequency = self.use.postings.indptr[:-1], self.use.frequency
        for copy in range(self.n_copies):
            at = place[self.words_of(copy)]
            asked = np.flatnonzero(at >= 0)
            lengths = frequency[asked]
            firsts = np.cumsum(lengths) - lengths
            chosen = np.arange(lengths.sum()) + np.repeat(starts[asked] - firsts, lengths)
            images = self.use.postings.image_ids[chosen] + np.int64(copy * self.use.n_images)
            keys = np.repeat(at[asked] << 32, lengths) | images
            yield keys[images < self.n_images]


def copies_asked(channel: SimulatedChannel, n_photos: int) -> Sequence[int]:
    """The copies in which photos are taken: spread over the survey, whole ones."""
    last = max(channel.n_images // channel.use.n_images - 1, 0)
    return [round(share * last) for share in np.linspace(0, 1, n_photos)]
