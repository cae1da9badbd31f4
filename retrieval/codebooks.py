"""Visual words: training them from a sample, finding the nearest.

Descriptors and words are uint8, so that every squared distance is a whole number below 2**24,
exact in float32: see docs/decisions/0002-integer-descriptors-and-words.md.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contracts.config import MAX_NEIGHBOURS, CodebookConfig, DistanceScale
from contracts.errors import VocabularyMismatch, WrongInput
from retrieval.clustering import flat_kmeans, kmeans
from retrieval.word_search import WordLists, lists_around, nearest_words, one_list

_EXHAUSTIVE_WORDS = 4_096
"""Up to here a descriptor is compared with every word; above, with those of the nearest lists."""

_LISTS_PER_ROOT_WORD = 3.5
"""Lists of the search structure, as a multiple of sqrt(V): see docs/decisions/0022."""

_WORDS_PER_LIST_SAMPLED = 32
"""Words that centres are made from, as a multiple of their number."""

DISTANCE_SAMPLE = 10_000

_OTHER_STREETS = 1.5
_OWN_POINTS = 6.5
"""How much farther from their words descriptors of other streets of a survey may lie."""


@dataclass(frozen=True, slots=True)
class Codebook:
    """The visual words of one channel, and the distances that scale its votes.

    words : (V, D) uint8. dmin : smallest squared distance of a sample point to its nearest word.
    dmax : (MAX_NEIGHBOURS,) float32, at k-1 the largest squared distance to the k-th nearest.
    d99 : the same of the 99th percentile, the least that 99 % of the sample do not exceed.
    """

    words: NDArray[np.uint8]
    dmin: float
    dmax: NDArray[np.float32]
    d99: NDArray[np.float32]

    def farthest(self, k: int, scale: DistanceScale) -> float:
        """The squared distance at which d' of a search for k words is 1."""
        return float((self.d99 if scale == "percentile" else self.dmax)[k - 1])


class WordSearcher:
    """Finds the nearest words of descriptors, the same for any batch, order or machine.

    Parameters
    ----------
    codebook : the words.
    lists : what `build_search` gave for them, perhaps stored in between.

    Raises
    ------
    VocabularyMismatch : the lists are of other words.
    """

    def __init__(self, codebook: Codebook, lists: WordLists) -> None:
        n_words, dimensions = codebook.words.shape
        self.codebook = codebook
        self._lists = lists
        starts = lists.starts
        whole = len(starts) == len(lists.centres) + 1 and starts[0] == 0 and starts[-1] == n_words
        if (
            (len(lists.word_ids), lists.centres.shape[1]) != (n_words, dimensions)
            or not whole
            or np.any(np.diff(starts) < 0)
        ):
            raise VocabularyMismatch(
                f"a search structure of {len(lists.word_ids)} words in {lists.centres.shape[1]} "
                f"dimensions was opened for a codebook of {n_words} words in {dimensions}; "
                "build it from these words"
            )

    def nearest(
        self, descriptors: NDArray[np.uint8], k: int
    ) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """Find the k nearest words, by (distance, word id).

        Parameters
        ----------
        descriptors : (n, D) uint8.
        k : at least 1; k' = min(k, V) words are given.

        Returns
        -------
        word_ids : (n, k') int32. sq_dist : (n, k') float32, squared L2.

        Raises
        ------
        VocabularyMismatch : the descriptors have not the words' dimension.
        """
        n_words, dimensions = self.codebook.words.shape
        if descriptors.ndim != 2 or descriptors.shape[1] != dimensions:
            raise VocabularyMismatch(
                f"descriptors of shape {descriptors.shape} were looked up among words of "
                f"{dimensions} dimensions; describe with the index's own settings"
            )
        words = self.codebook.words
        return nearest_words(descriptors, words, self._lists, min(k, n_words))


def build_search(words: NDArray[np.uint8]) -> WordLists:
    """Group (V, D) uint8 words for the search; the same lists for any order of the words."""
    n_lists = n_lists_for(len(words))
    if n_lists == 1:
        return one_list(words)
    sample = np.unique(words, axis=0)
    sample = sample[:: max(len(sample) // (n_lists * _WORDS_PER_LIST_SAMPLED), 1)]
    return lists_around(flat_kmeans(sample, n_lists, seed=0), words)


def n_lists_for(n_words: int) -> int:
    """Into how many lists so many words are grouped; 1: a descriptor is compared with every one."""
    if n_words <= _EXHAUSTIVE_WORDS:
        return 1
    return round(_LISTS_PER_ROOT_WORD * math.sqrt(n_words))


def n_words_for(n_points: int, config: CodebookConfig) -> int:
    """Size a codebook for a channel with `n_points` descriptors (METHOD section 2)."""
    wanted = max(round(config.codebook_ratio * n_points), 1)
    return min(wanted, config.max_words, config.max_train_points, n_points)


def outgrown(
    before: Mapping[str, float],
    now: Mapping[str, float],
    points_per_word: Mapping[str, float] | None = None,
) -> tuple[str, ...]:
    """Channels whose words no longer fit what is described.

    Words lie nearer to the points they were made from than to any others, the more so the fewer
    there were to a word: that much growth says nothing (measured: docs/decisions/0022).

    Parameters
    ----------
    before, now : by channel, the mean squared distance of descriptors to their nearest word: of
        those that an index was built from, and of those that come to it. A channel without a
        distance above 0 before says nothing.
    points_per_word : by channel, of those that the index was built from; where it is not known, as
        few as there can be when a fifth as many words as points are made.

    Returns
    -------
    channels : those in which it grew by more than a survey's own streets make it grow, in the
        order of `now`.
    """
    points = points_per_word or {}
    return tuple(
        channel
        for channel, sq_dist in now.items()
        if 0 < before.get(channel, 0) * _usual_growth(points.get(channel, 5.0)) < sq_dist
    )


def _usual_growth(points_per_word: float) -> float:
    return max(_OTHER_STREETS, 1 + _OWN_POINTS / math.sqrt(points_per_word))


def train_codebook(
    sample: NDArray[np.uint8], n_words: int, seed: int, n_threads: int = 1
) -> Codebook:
    """Make words by k-means; the same sample, number and seed give the same words.

    Words equal after rounding are kept once, so fewer than `n_words` may come back. They come
    list after list of their search structure: what is searched together is read in one go.
    A channel in which the survey has no descriptor gets a codebook without words.

    Parameters
    ----------
    sample : (n, D) uint8, in canonical order, as `SampleReservoir.sample` (sampling.py) gives it.
    n_words : at most n. n_threads : that share the work; the words do not depend on them.

    Raises
    ------
    WrongInput : more words than points are asked, or none from points.
    """
    if n_words > len(sample) or (n_words < 1 and len(sample)):
        raise WrongInput(
            f"{n_words} words cannot be trained from {len(sample)} descriptors; "
            "ask for at least one and at most as many as there are"
        )
    if not len(sample):
        nowhere = np.zeros(MAX_NEIGHBOURS, dtype=np.float32)
        return Codebook(sample.copy(), 0.0, nowhere, nowhere)
    words = np.unique(kmeans(sample, n_words, seed, n_threads), axis=0)
    words = words[build_search(words).word_ids]
    return Codebook(words, *_distance_range(sample[:DISTANCE_SAMPLE], words))


def _distance_range(
    sample: NDArray[np.uint8], words: NDArray[np.uint8]
) -> tuple[float, NDArray[np.float32], NDArray[np.float32]]:
    """dmin, dmax and d99 by exhaustive search; the last k stands in for more than V words."""
    width = min(MAX_NEIGHBOURS, len(words))
    _, sq_dist = nearest_words(sample, words, one_list(words), width)
    of_k = np.minimum(np.arange(MAX_NEIGHBOURS), width - 1)
    percentile = np.percentile(sq_dist, 99, axis=0, method="inverted_cdf").astype(np.float32)
    return float(sq_dist[:, 0].min()), sq_dist.max(axis=0)[of_k], percentile[of_k]
