"""Fusion of inverted indices: what the words of a photo's keypoints say about every image.

METHOD section 3, after Bhowmik, Weng, Gouet-Brunet & Soheilian, JURSE 2017.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contracts.config import DESCRIPTORS, SearchConfig
from contracts.errors import BadConfig, VocabularyMismatch, WrongInput
from contracts.records import Match
from retrieval import fusion_kernels as kernels
from retrieval.channel_query import ChannelQuery, word_distances, word_factors, word_spans
from retrieval.fusion_kernels import Tally, Words
from retrieval.fusion_walk import walked_votes
from retrieval.fusion_words import beyond_catalogue, kept_words, union_votes
from retrieval.kernels import read_only

__all__ = ["ChannelQuery", "Scores", "full_ranking", "fuse", "rank"]

_RANGE_IMAGES = 1 << 17
"""Images that are voted for at a time: the tallies of so many stay in the cache."""


@dataclass(frozen=True, slots=True)
class Scores:
    """What every image got. values : (n_images,) float64, 0 where untouched.

    touched : (n_images,) bool, a vote was given; a vote may be negative or nothing.
    """

    values: NDArray[np.float64]
    touched: NDArray[np.bool_]


def fuse(
    detectors: Sequence[Sequence[ChannelQuery]],
    n_images: int,
    config: SearchConfig,
    distinct_words: NDArray[np.int64] | None = None,
) -> Scores:
    """Score all images by the votes of all keypoints of one detector or more.

    An image that is no candidate is in no list: scores are those of an index that never held it.

    Memory is that of the result, of the words asked for, and of a range of images.

    Parameters
    ----------
    detectors : for each detector used its channels, all with the same n keypoints in one order.
    config : `vote`, `weights`, `max_images` (the T of the walk) and `union_distance` are used.
    distinct_words : (n_images,) int64, summed over the channels used; needed by `norm` alone.

    Raises
    ------
    BadConfig : the vote needs more descriptors, or a weight what was not given.
    WrongInput : channels of one detector, or `distinct_words` and images, differ in number.
    BadIndex : word or offset out of bounds, or images of a word out of bounds or order.
    VocabularyMismatch : an idf does not fit its postings.
    """
    _check(detectors, n_images, config, distinct_words)
    asked = [_words(channels, config, n_images) for channels in detectors]
    scores = Scores(np.zeros(n_images, dtype=np.float64), np.zeros(n_images, dtype=np.bool_))
    tally = _tally(min(n_images, _RANGE_IMAGES))
    for first in range(0, n_images, _RANGE_IMAGES):
        images = slice(first, min(first + _RANGE_IMAGES, n_images))
        for words in asked:
            _vote(words, images, tally, config, scores)
        if "norm" in config.weights and distinct_words is not None:
            scores.values[images] /= np.sqrt(np.maximum(distinct_words[images], 1))
    if any(np.any(words.cursor < words.stop) for words in asked):
        raise beyond_catalogue(n_images)
    return scores


def rank(scores: Scores, top: int | None) -> tuple[Match, ...]:
    """List the best `top` touched images (None: all), ties by image id."""
    wanted = scores.touched
    if top is not None:
        wanted = wanted & (scores.values >= kernels.least_of_best(scores.values, wanted, top))
    images = np.flatnonzero(wanted)
    best = images[np.argsort(-scores.values[images], kind="stable")[:top]]
    return tuple(
        Match(int(image), place, float(scores.values[image]))
        for place, image in enumerate(best, start=1)
    )


def full_ranking(scores: Scores) -> NDArray[np.int64]:
    """Order all images: touched ones by score, then the untouched by id; (n_images,) int64."""
    ids = np.arange(len(scores.values))
    return np.lexsort((ids, -np.where(scores.touched, scores.values, 0.0), ~scores.touched))


def _words(channels: Sequence[ChannelQuery], config: SearchConfig, n_images: int) -> Words:
    """List the words of a detector's keypoints that vote, and their votes."""
    lists = _lists(channels)
    spans = word_spans(channels)
    distances = word_distances(channels)
    if config.vote == "intersection":
        # Whoever lacks a descriptor's images gives no vote anyway.
        taken, votes = spans[..., 0] < spans[..., 1], 1.0 - distances
    else:
        taken = kept_words(lists, spans, n_images)
        if config.vote == "pairwise":
            votes = 1.0 - distances
        elif config.max_images is None:
            votes = union_votes(distances, taken, config.union_distance)
        else:
            votes, taken = walked_votes(
                lists, spans, distances, taken, config.max_images, n_images, config.union_distance
            )
    votes = votes * word_factors(channels, use_idf="idf" in config.weights)
    point, descriptor, _ = np.nonzero(taken)
    token = (1 + point * len(channels) + descriptor).astype(np.int32)
    start, stop = spans[taken].T
    return Words(lists, len(channels), descriptor, token, start.copy(), stop.copy(), votes[taken])


def _lists(channels: Sequence[ChannelQuery]) -> tuple[NDArray[np.uint32], ...]:
    """The channels' image ids, and empty lists up to a length that kernels are compiled for."""
    lists = [read_only(channel.postings.image_ids, np.uint32) for channel in channels]
    missing = len(DESCRIPTORS) - len(lists)
    return (*lists, *[read_only(np.zeros(0, dtype=np.uint32), np.uint32)] * missing)


def _tally(size: int) -> Tally:
    return Tally(
        seen=np.zeros(size, dtype=np.int32),
        running=np.zeros(size, dtype=np.float64),
        score=np.zeros(size, dtype=np.float64),
        voters=np.zeros(size, dtype=np.int32),
    )


def _vote(words: Words, images: slice, tally: Tally, config: SearchConfig, scores: Scores) -> None:
    """Add one detector's votes for a range of images to their scores."""
    size = images.stop - images.start
    seen, running, score, voters = tally
    tally = Tally(seen[:size], running[:size], score[:size], voters[:size])
    for array in (tally.seen, tally.score, tally.voters):
        array[:] = 0
    is_burst = "burst" in config.weights
    if config.vote == "union":
        kernels.vote_union(words, images.start, tally, is_burst)
    elif config.vote == "intersection":
        kernels.vote_intersection(words, images.start, tally)
    else:
        kernels.vote_pairwise(words, images.start, tally)
    if is_burst:
        tally.score[:] /= np.sqrt(np.maximum(tally.voters, 1))
    scores.values[images] += tally.score
    scores.touched[images] |= tally.voters > 0


def _check(
    detectors: Sequence[Sequence[ChannelQuery]],
    n_images: int,
    config: SearchConfig,
    distinct_words: NDArray[np.int64] | None,
) -> None:
    for channels in detectors:
        if not channels:
            raise WrongInput("a detector without descriptors cannot vote; give it at least one")
        if config.vote == "pairwise" and len(channels) < 2:
            raise BadConfig("the vote `pairwise` needs two descriptors or more; got one")
        lengths = {len(array) for one in channels for array in (one.word_ids, one.sq_dist)}
        if len(lengths) > 1:
            raise WrongInput(
                f"channels of one detector describe {sorted(lengths)} keypoints; "
                "they must describe the same ones"
            )
        if "idf" in config.weights and any(channel.idf is None for channel in channels):
            raise BadConfig("the weight `idf` needs every channel's idf; give it or drop `idf`")
        for channel in channels:
            if channel.idf is not None and len(channel.idf) != channel.postings.n_words:
                raise VocabularyMismatch(
                    f"idf of {len(channel.idf)} words was given for postings of "
                    f"{channel.postings.n_words}; take both from one index"
                )
    if "norm" in config.weights and distinct_words is None:
        raise BadConfig("the weight `norm` needs the images' distinct words; give them or drop it")
    if distinct_words is not None and len(distinct_words) != n_images:
        raise WrongInput(f"distinct_words has {len(distinct_words)} entries for {n_images} images")
