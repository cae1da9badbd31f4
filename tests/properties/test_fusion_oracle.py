"""Fusion equals a literal walk of the multi-sequence queue over plain dictionaries."""

import heapq
import math
from collections import defaultdict
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from contracts.config import SearchConfig
from retrieval.fusion import ChannelQuery, Scores, full_ranking, fuse, rank
from retrieval.postings import build_postings, document_frequency, inverse_document_frequency

N_IMAGES = 9
Word = tuple[float, float, list[int]]  # d', idf, images
Cell = tuple[float, list[tuple[int, float]]]  # distance, occurrences (image, squared idf)


@st.composite
def channels_of_a_detector(draw: st.DrawFn, n_points: int, n_channels: int, k: int):  # type: ignore[no-untyped-def]
    """Channels with few words, short lists, and distances that often tie."""
    channels = []
    for _ in range(n_channels):
        n_words = draw(st.integers(1, 6))
        pairs = draw(
            st.lists(
                st.tuples(st.integers(0, n_words - 1), st.integers(0, N_IMAGES - 1)), max_size=20
            )
        )
        postings = build_postings(
            np.array([word for word, _ in pairs], np.int32),
            np.array([image for _, image in pairs], np.uint32),
            n_words,
        )
        width = min(k, n_words)
        words = [draw(st.permutations(range(n_words)))[:width] for _ in range(n_points)]
        distance = st.lists(st.integers(0, 6), min_size=width, max_size=width).map(sorted)
        distances = [draw(distance) for _ in range(n_points)]
        dmin = draw(st.sampled_from([0.0, 1.0]))
        channels.append(
            ChannelQuery(
                np.array(words, np.int32).reshape(n_points, width),
                np.array(distances, np.float32).reshape(n_points, width),
                dmin,
                draw(st.sampled_from([dmin, 4.0, 6.0])),
                postings,
            )
        )
    return channels


@st.composite
def searches(draw: st.DrawFn):  # type: ignore[no-untyped-def]
    """Detectors, a configuration that suits them, and which images are removed."""
    n_channels, k = draw(st.integers(1, 3)), draw(st.integers(1, 4))
    detectors = [
        draw(channels_of_a_detector(draw(st.integers(0, 4)), n_channels, k))
        for _ in range(draw(st.integers(1, 2)))
    ]
    votes = ["union", "walk", "intersection", *(["pairwise"] if n_channels > 1 else [])]
    vote = draw(st.sampled_from(votes))
    config = SearchConfig.of(
        vote="union" if vote == "walk" else vote,
        weights=tuple(draw(st.sets(st.sampled_from(["idf", "norm", "burst"])))),
        max_images=draw(st.integers(1, 2 * N_IMAGES)) if vote == "walk" else None,
    )
    removed = np.array(draw(st.lists(st.booleans(), min_size=N_IMAGES, max_size=N_IMAGES)))
    if draw(st.booleans()):
        removed[:] = False
    return detectors, config, removed


def with_idf(channel: ChannelQuery, removed) -> ChannelQuery:  # type: ignore[no-untyped-def]
    df = document_frequency(channel.postings, removed)
    return replace(channel, idf=inverse_document_frequency(df, int((~removed).sum())))


def words_of(channel: ChannelQuery, point: int, removed, use_idf: bool) -> list[Word]:  # type: ignore[no-untyped-def]
    """A keypoint's words, nearest first: each image with its nearest word, no empty word."""
    found: set[int] = set()
    words = []
    for word, sq_dist in zip(channel.word_ids[point], channel.sq_dist[point], strict=True):
        start, stop = channel.postings.indptr[word : word + 2]
        listed = [int(image) for image in channel.postings.image_ids[start:stop]]
        images = [image for image in listed if not removed[image] and image not in found]
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


def walked(lists: list[list[Word]], max_images: float) -> dict[int, float]:
    """Votes of one keypoint by the rule `union`."""
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
            votes[image] += (1 - distance) * factor
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


def oracle(detectors, config: SearchConfig, distinct, removed) -> dict[int, float]:  # type: ignore[no-untyped-def]
    scores: dict[int, float] = defaultdict(float)
    for channels in detectors:
        score: dict[int, float] = defaultdict(float)
        voters: dict[int, int] = defaultdict(int)
        for point in range(len(channels[0].word_ids)):
            lists = [words_of(one, point, removed, "idf" in config.weights) for one in channels]
            if not all(lists):
                continue
            if config.vote == "union":
                votes = walked(lists, config.max_images or math.inf)
            else:
                votes = multiplied(lists, config.vote)
            for image, vote in votes.items():
                score[image] += vote
                voters[image] += 1
        for image, total in score.items():
            burst = math.sqrt(voters[image]) if "burst" in config.weights else 1.0
            scores[image] += total / burst
    if "norm" in config.weights:
        return {image: score / math.sqrt(distinct[image]) for image, score in scores.items()}
    return scores


def assert_equal(got: Scores, expected: dict[int, float]) -> None:
    assert set(np.flatnonzero(got.touched).tolist()) == set(expected)
    for image in range(N_IMAGES):
        assert got.values[image] == pytest.approx(expected.get(image, 0.0), rel=1e-9, abs=1e-9)


@settings(max_examples=400, deadline=None)
@given(searches())
def test_fusion_equals_the_literal_walk(search) -> None:  # type: ignore[no-untyped-def]
    detectors, config, removed = search
    detectors = [[with_idf(channel, removed) for channel in one] for one in detectors]
    distinct = np.arange(1, N_IMAGES + 1)
    scores = fuse(detectors, N_IMAGES, config, distinct, removed)
    assert_equal(scores, oracle(detectors, config, distinct, removed))

    matches = rank(scores, None)
    by_hand = sorted(np.flatnonzero(scores.touched), key=lambda i: (-scores.values[i], i))
    assert [match.image_id for match in matches] == by_hand
    assert [match.rank for match in matches] == list(range(1, len(by_hand) + 1))
    assert rank(scores, 3) == matches[:3]
    rest = [image for image in range(N_IMAGES) if not scores.touched[image]]
    assert full_ranking(scores).tolist() == by_hand + rest


@settings(max_examples=100, deadline=None)
@given(searches())
def test_a_removed_image_is_as_if_never_indexed(search) -> None:  # type: ignore[no-untyped-def]
    detectors, config, removed = search
    detectors = [[with_idf(channel, removed) for channel in one] for one in detectors]
    distinct = np.arange(1, N_IMAGES + 1)
    compacted: list[list[ChannelQuery]] = []
    for channels in detectors:
        compacted.append([])
        for one in channels:
            words = np.repeat(np.arange(one.postings.n_words), np.diff(one.postings.indptr))
            kept = ~removed[one.postings.image_ids]
            ids = one.postings.image_ids[kept]
            postings = build_postings(words[kept].astype(np.int32), ids, one.postings.n_words)
            compacted[-1].append(replace(one, postings=postings))
    tombstoned = fuse(detectors, N_IMAGES, config, distinct, removed)
    rebuilt = fuse(compacted, N_IMAGES, config, distinct)
    assert tombstoned.values.tolist() == rebuilt.values.tolist()
    assert tombstoned.touched.tolist() == rebuilt.touched.tolist()


@settings(max_examples=60, deadline=None)
@given(st.data(), st.integers(1, 3), st.integers(1, 4))
def test_a_walk_that_never_reaches_t_equals_the_closed_form(data, n_channels, k) -> None:  # type: ignore[no-untyped-def]
    detectors = [data.draw(channels_of_a_detector(4, n_channels, k))]
    closed = fuse(detectors, N_IMAGES, SearchConfig(vote="union", weights=()))
    walk = fuse(
        detectors, N_IMAGES, SearchConfig(vote="union", weights=(), max_images=N_IMAGES + 1)
    )
    assert walk.touched.tolist() == closed.touched.tolist()
    assert walk.values == pytest.approx(closed.values, rel=1e-9, abs=1e-9)
