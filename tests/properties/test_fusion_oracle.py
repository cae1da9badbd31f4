"""Fusion equals a literal walk of the multi-sequence queue over plain dictionaries."""

import heapq
import math
from collections import defaultdict

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from contracts.config import MAX_NEIGHBOURS, SearchConfig
from retrieval.codebooks import Codebook
from retrieval.fusion import ChannelQuery, Scores, full_ranking, fuse, rank
from retrieval.postings import build_postings, inverse_document_frequency

N_IMAGES = 9
DISTINCT = np.arange(1, N_IMAGES + 1)
Detectors = list[list[ChannelQuery]]
Word = tuple[float, float, list[int]]  # d', idf, images
Cell = tuple[float, list[tuple[int, float]]]  # distance, occurrences (image, squared idf)


def some_channel(rng: np.random.Generator, n_points: int, k: int, scale: str) -> ChannelQuery:
    """A channel with few words, short lists, distances that often tie and some beyond dmax."""
    n_words = int(rng.integers(1, k + 4))
    n_postings = int(rng.integers(0, 4 * n_words + 1))
    postings = build_postings(
        rng.integers(0, n_words, n_postings).astype(np.int32),
        rng.integers(0, N_IMAGES, n_postings).astype(np.uint32),
        n_words,
    )
    width = min(k, n_words)
    words = rng.permuted(np.tile(np.arange(n_words), (n_points, 1)), axis=1)[:, :width]
    distances = np.sort(rng.integers(0, 7, (n_points, width)), axis=1)
    dmin = float(rng.choice([0.0, 1.0]))
    dmax = np.full(MAX_NEIGHBOURS, rng.choice([dmin, 6.0]), np.float32)
    codebook = Codebook(np.zeros((n_words, 1), np.uint8), dmin, dmax, np.minimum(dmax, 4))
    return ChannelQuery(
        words.astype(np.int32),
        distances.astype(np.float32),
        dmin,
        codebook.farthest(k, "percentile" if scale == "percentile" else "range"),
        postings,
        inverse_document_frequency(np.diff(postings.indptr), N_IMAGES),
    )


@st.composite
def searches(draw: st.DrawFn) -> tuple[Detectors, SearchConfig]:
    """Detectors, and a configuration that suits them."""
    n_channels, k = draw(st.integers(1, 3)), draw(st.sampled_from([1, 2, 2, 3, 4, 5, 10]))
    most_points = 4 if k < 10 else 1
    points = draw(st.lists(st.integers(0, most_points), min_size=1, max_size=4))
    vote = draw(st.sampled_from(["union", "intersection", *(["pairwise"] * (n_channels > 1))]))
    scale = draw(st.sampled_from(["range", "percentile"]))
    weights = tuple(name for name in ("idf", "norm", "burst") if draw(st.booleans()))
    union = {}
    if vote == "union":
        limits = st.one_of(st.none(), st.integers(1, 2 * N_IMAGES))
        distance = draw(st.sampled_from(["sum", "mean"]))
        union = {"max_images": draw(limits), "union_distance": distance}
    config = SearchConfig.of(vote=vote, weights=weights, distance_scale=scale, **union)
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return [[some_channel(rng, n, k, scale) for _ in range(n_channels)] for n in points], config


def words_of(channel: ChannelQuery, point: int, use_idf: bool) -> list[Word]:
    """A keypoint's words, nearest first: each image with its nearest word, no empty word."""
    found: set[int] = set()
    words = []
    for word, sq_dist in zip(channel.word_ids[point], channel.sq_dist[point], strict=True):
        start, stop = channel.postings.indptr[word : word + 2]
        listed = [int(image) for image in channel.postings.image_ids[start:stop]]
        images = [image for image in listed if image not in found]
        found.update(images)
        above, span = float(sq_dist) - channel.dmin, channel.dmax - channel.dmin
        distance = min(max(above / span, 0.0), 1.0) if span > 0 else float(above > 0)
        if images:
            idf = float(channel.idf[word]) if use_idf and channel.idf is not None else 1.0
            words.append((distance, idf, images))
    return words


def joined(left: list[Cell], right: list[Cell], max_images: float) -> list[Cell]:
    """The multi-sequence algorithm: a heap of cells, popped until T images are seen."""
    heap, pushed = [(left[0][0] + right[0][0], 0, 0)], {(0, 0)}
    seen: set[int] = set()
    cells: list[Cell] = []
    while heap and len(seen) < max_images:
        distance, u, v = heapq.heappop(heap)
        occurrences = left[u][1] + right[v][1]
        seen.update(image for image, _ in occurrences)
        cells.append((distance, occurrences))
        for nu, nv in ((u + 1, v), (u, v + 1)):
            if nu < len(left) and nv < len(right) and (nu, nv) not in pushed:
                pushed.add((nu, nv))
                heapq.heappush(heap, (left[nu][0] + right[nv][0], nu, nv))
    return cells


def walked(lists: list[list[Word]], config: SearchConfig) -> dict[int, float]:
    """Votes of one keypoint by the rule `union`."""
    max_images = config.max_images or math.inf
    share = len(lists) if config.union_distance == "mean" else 1
    as_cells = [
        [(distance, [(image, idf * idf) for image in images]) for distance, idf, images in words]
        for words in lists
    ]
    cells = as_cells[0]
    for more in as_cells[1:]:
        cells = joined(cells, more, max_images)
    votes: dict[int, float] = defaultdict(float)
    for distance, occurrences in cells:
        for image, factor in occurrences:
            votes[image] += (1 - distance / share) * factor
    return votes


def multiplied(lists: list[list[Word]], vote: str) -> dict[int, float]:
    """Votes of one keypoint by the rules `intersection` and `pairwise`."""
    near = [
        {image: (1 - distance) * idf * idf for distance, idf, images in words for image in images}
        for words in lists
    ]
    votes: dict[int, float] = {}
    for image in range(N_IMAGES):
        held = [one[image] for one in near if image in one]
        if vote == "intersection" and len(held) == len(near):
            votes[image] = math.prod(held)
        if vote == "pairwise" and len(held) >= 2:
            votes[image] = sum(a * b for at, a in enumerate(held) for b in held[at + 1 :])
    return votes


def oracle(detectors: Detectors, config: SearchConfig) -> dict[int, float]:
    scores: dict[int, float] = defaultdict(float)
    for channels in detectors:
        score: dict[int, float] = defaultdict(float)
        voters: dict[int, int] = defaultdict(int)
        for point in range(len(channels[0].word_ids)):
            lists = [words_of(one, point, "idf" in config.weights) for one in channels]
            if not all(lists):
                continue
            if config.vote == "union":
                votes = walked(lists, config)
            else:
                votes = multiplied(lists, config.vote)
            for image, vote in votes.items():
                score[image] += vote
                voters[image] += 1
        for image, total in score.items():
            burst = math.sqrt(voters[image]) if "burst" in config.weights else 1.0
            scores[image] += total / burst
    if "norm" in config.weights:
        return {image: score / math.sqrt(DISTINCT[image]) for image, score in scores.items()}
    return scores


def assert_equal(got: Scores, expected: dict[int, float]) -> None:
    assert set(np.flatnonzero(got.touched).tolist()) == set(expected)
    for image in range(N_IMAGES):
        assert got.values[image] == pytest.approx(expected.get(image, 0.0), rel=1e-9, abs=1e-9)


@settings(max_examples=2500, deadline=None)
@given(searches())
def test_fusion_equals_the_literal_walk(
    search: tuple[Detectors, SearchConfig],
) -> None:
    detectors, config = search
    scores = fuse(detectors, N_IMAGES, config, DISTINCT)
    assert_equal(scores, oracle(detectors, config))

    matches = rank(scores, None)
    by_hand = sorted(np.flatnonzero(scores.touched), key=lambda i: (-scores.values[i], i))
    assert [match.image_id for match in matches] == by_hand
    assert [match.rank for match in matches] == list(range(1, len(by_hand) + 1))
    assert rank(scores, 3) == matches[:3]
    rest = [image for image in range(N_IMAGES) if not scores.touched[image]]
    assert full_ranking(scores).tolist() == by_hand + rest


@settings(max_examples=300, deadline=None)
@given(searches())
def test_a_walk_that_never_reaches_t_equals_the_closed_form(
    search: tuple[Detectors, SearchConfig],
) -> None:
    detectors, config = search
    settings = {"vote": "union", "weights": config.weights, "union_distance": config.union_distance}
    closed, walk = (
        fuse(detectors, N_IMAGES, SearchConfig.of(max_images=t, **settings), DISTINCT)
        for t in (None, N_IMAGES + 1)
    )
    assert walk.touched.tolist() == closed.touched.tolist()
    assert walk.values == pytest.approx(closed.values, rel=1e-9, abs=1e-9)


@settings(max_examples=300, deadline=None)
@given(searches())
def test_detectors_are_independent_of_each_other(
    search: tuple[Detectors, SearchConfig],
) -> None:
    detectors, config = search
    together = fuse(detectors, N_IMAGES, config, DISTINCT)
    alone = [fuse([one], N_IMAGES, config, DISTINCT) for one in detectors]
    assert together.values == pytest.approx(sum(one.values for one in alone), rel=1e-9, abs=1e-9)
    assert together.touched.tolist() == np.any([one.touched for one in alone], axis=0).tolist()
