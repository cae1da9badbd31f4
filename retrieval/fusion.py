"""Fusion of inverted indices: what the words of a photo's keypoints say about every image.

METHOD section 3, after Bhowmik, Weng, Gouet-Brunet & Soheilian, JURSE 2017.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise, starmap

import numpy as np
from numpy.typing import NDArray

from contracts.config import SearchConfig
from contracts.errors import BadConfig, BadIndex, VocabularyMismatch, WrongInput
from contracts.records import Match
from retrieval import fusion_kernels as kernels
from retrieval.channel_query import ChannelQuery, word_distances, word_factors, word_spans
from retrieval.fusion_walk import vote_union_walk
from retrieval.postings import read_only

__all__ = ["ChannelQuery", "Scores", "full_ranking", "fuse", "rank"]

_BLOCK_POSTINGS = 1 << 18
"""Postings gathered at a time: a megabyte, so that votes find them in the cache."""

_LAST_TOKEN = 2**31 - 1


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
    removed: NDArray[np.bool_] | None = None,
) -> Scores:
    """Score all images by the votes of all keypoints of one or two detectors.

    Parameters
    ----------
    detectors : for each detector used its channels, all with the same n keypoints in one order.
    config : `vote`, `weights` and `max_images` (the T of the walk) are used.
    distinct_words : (n_images,) int64, summed over the channels used; needed by `norm` alone.
    removed : (n_images,) bool; scores are those of an index that never held these images.

    Raises
    ------
    BadConfig : the vote needs more descriptors, or a weight what was not given.
    WrongInput : channels of one detector, or per-image arrays, differ in length.
    BadIndex : word, offset or image ids out of bounds.
    VocabularyMismatch : an idf does not fit its postings.
    """
    _check(detectors, n_images, config, distinct_words, removed)
    gone = read_only(np.zeros(0, np.bool_) if removed is None else removed, np.bool_)
    values = np.zeros(n_images, dtype=np.float64)
    touched = np.zeros(n_images, dtype=np.bool_)
    for channels in detectors:
        tally = _detector_votes(channels, n_images, config, gone)
        burst = np.sqrt(np.maximum(tally.voters, 1)) if "burst" in config.weights else 1.0
        values += tally.score / burst
        touched |= tally.voters > 0
    if "norm" in config.weights and distinct_words is not None:
        values /= np.sqrt(np.maximum(distinct_words, 1))
    return Scores(values, touched)


def rank(scores: Scores, top: int | None) -> tuple[Match, ...]:
    """List the best `top` touched images (None: all), ties by image id."""
    candidates = np.flatnonzero(scores.touched)
    values = scores.values[candidates]
    if top is not None and top < len(candidates):
        least = np.partition(values, len(values) - top)[len(values) - top]
        candidates, values = candidates[values >= least], values[values >= least]
    order = np.argsort(-values, kind="stable")[:top]
    return tuple(
        Match(int(candidates[at]), place, float(values[at]))
        for place, at in enumerate(order, start=1)
    )


def full_ranking(scores: Scores) -> NDArray[np.int64]:
    """Order all images: touched ones by score, then the untouched by id; (n_images,) int64."""
    ids = np.arange(len(scores.values))
    return np.lexsort((ids, -np.where(scores.touched, scores.values, 0.0), ~scores.touched))


@dataclass(frozen=True, slots=True)
class _Tally:
    """Votes of one detector's keypoints so far, added to in place by the kernels.

    score : (n_images,) float64. voters : (n_images,) int32, keypoints that voted.
    seen : (n_images,) int32 tokens. running : (n_images,) float64, scratch of a keypoint.
    """

    score: NDArray[np.float64]
    voters: NDArray[np.int32]
    seen: NDArray[np.int32]
    running: NDArray[np.float64]


def _detector_votes(
    channels: Sequence[ChannelQuery],
    n_images: int,
    config: SearchConfig,
    removed: NDArray[np.bool_],
) -> _Tally:
    tally = _Tally(
        score=np.zeros(n_images, dtype=np.float64),
        voters=np.zeros(n_images, dtype=np.int32),
        seen=np.zeros(n_images, dtype=np.int32),
        running=np.empty(n_images, dtype=np.float64),
    )
    spans = word_spans(channels)
    distances = word_distances(channels)
    factors = word_factors(channels, use_idf="idf" in config.weights)
    lists = tuple(read_only(channel.postings.image_ids, np.uint32) for channel in channels)
    if config.vote == "intersection":
        ended = kernels.vote_intersection(
            lists,
            spans,
            distances,
            factors,
            removed,
            tally.seen,
            tally.running,
            tally.score,
            tally.voters,
        )
        if ended == kernels.BAD_IMAGE:
            raise _beyond_catalogue(n_images)
    else:
        _gather_and_vote(lists, spans, distances, factors, config, removed, tally)
    return tally


def _gather_and_vote(
    lists: tuple[NDArray[np.uint32], ...],
    spans: NDArray[np.int64],
    distances: NDArray[np.float64],
    factors: NDArray[np.float64],
    config: SearchConfig,
    removed: NDArray[np.bool_],
    tally: _Tally,
) -> None:
    """Vote by a rule that must know each word's own images first, a block at a time."""
    sizes = (spans[..., 1] - spans[..., 0]).sum(axis=(1, 2))
    blocks = list(_blocks(sizes))
    images = np.empty(max(int(sizes[block].sum()) for block in blocks), dtype=np.uint32)
    token = 0
    for block in blocks:
        n_points = block.stop - block.start
        tokens_used = n_points * 2 * (len(lists) + 1)
        if token + tokens_used >= _LAST_TOKEN:
            tally.seen[:] = 0
            token = 0
        segments = np.zeros_like(spans[block])
        filled = 0
        for at, image_ids in enumerate(lists):
            start = token + at * n_points
            filled = kernels.gather(
                image_ids, spans[block], removed, at, tally.seen, start, images, filled, segments
            )
            if filled == kernels.BAD_IMAGE:
                raise _beyond_catalogue(len(tally.seen))
        start = token + len(lists) * n_points
        _vote(images, segments, distances[block], factors[block], config, start, tally)
        token += tokens_used


def _vote(
    images: NDArray[np.uint32],
    segments: NDArray[np.int64],
    distances: NDArray[np.float64],
    factors: NDArray[np.float64],
    config: SearchConfig,
    token: int,
    tally: _Tally,
) -> None:
    seen, score, voters = tally.seen, tally.score, tally.voters
    if config.vote == "pairwise":
        kernels.vote_pairwise(
            images, segments, distances, factors, seen, token, tally.running, score, voters
        )
    elif config.max_images is None:
        kernels.vote_union(images, segments, distances, factors, seen, token, score, voters)
    else:
        vote_union_walk(
            images, segments, distances, factors, config.max_images, seen, token, score, voters
        )


def _blocks(sizes: NDArray[np.int64]) -> Iterator[slice]:
    """Cut keypoints into runs of about `_BLOCK_POSTINGS`, at least one keypoint each."""
    block = np.cumsum(sizes) // _BLOCK_POSTINGS
    cuts = np.flatnonzero(np.diff(block)) + 1
    return starmap(slice, pairwise([0, *cuts.tolist(), len(sizes)]))


def _beyond_catalogue(n_images: int) -> BadIndex:
    return BadIndex(
        f"an inverted index names an image beyond the catalogue's {n_images}; "
        "the index is damaged: restore it or index again"
    )


def _check(
    detectors: Sequence[Sequence[ChannelQuery]],
    n_images: int,
    config: SearchConfig,
    distinct_words: NDArray[np.int64] | None,
    removed: NDArray[np.bool_] | None,
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
    for name, array in (("distinct_words", distinct_words), ("removed", removed)):
        if array is not None and len(array) != n_images:
            raise WrongInput(f"{name} has {len(array)} entries for {n_images} images")
