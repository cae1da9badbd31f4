"""A search among some images is the search of an index that holds these alone, idf aside."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from contracts.config import SearchConfig, Vote, Weight
from contracts.records import Postings
from retrieval.channel_query import ChannelQuery
from retrieval.fusion import Scores, fuse
from retrieval.packing import Part, pack, unpack
from retrieval.postings import build_postings

N_WORDS, N_IMAGES, N_POINTS = 6, 12, 4


def parts_of(pairs: np.ndarray, first_of_second: int) -> list[Part]:
    """An index of two segments; pairs : (n, 2) of word and image."""
    bounds = [(0, first_of_second), (first_of_second, N_IMAGES)]
    parts = []
    for begin, end in bounds:
        mine = pairs[(begin <= pairs[:, 1]) & (pairs[:, 1] < end)]
        images = (mine[:, 1] - begin).astype(np.uint32)
        lists = build_postings(mine[:, 0].astype(np.int32), images, N_WORDS)
        parts.append(Part(pack(lists), begin, end - begin))
    return parts


def only(pairs: np.ndarray, ids: np.ndarray) -> Postings:
    """The lists of an index that never held other images, numbered anew."""
    mine = pairs[np.isin(pairs[:, 1], ids)]
    images = np.searchsorted(ids, mine[:, 1]).astype(np.uint32)
    return build_postings(mine[:, 0].astype(np.int32), images, N_WORDS)


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    kept=st.lists(st.booleans(), min_size=N_IMAGES, max_size=N_IMAGES).filter(any),
    vote=st.sampled_from(["union", "intersection", "pairwise"]),
    weights=st.sets(st.sampled_from(["idf", "norm", "burst"])),
    max_images=st.sampled_from([None, 2]),
    cut=st.integers(1, N_IMAGES - 1),
)
def test_a_filtered_search_is_that_of_an_index_of_the_candidates(
    seed: int,
    kept: list[bool],
    vote: Vote,
    weights: set[Weight],
    max_images: int | None,
    cut: int,
) -> None:
    rng = np.random.default_rng(seed)
    config = SearchConfig.of(
        vote=vote, weights=tuple(weights), max_images=max_images if vote == "union" else None
    )
    mask = np.array(kept)
    ids = np.flatnonzero(mask)
    sizes = rng.integers(1, 5, N_IMAGES)
    filtered, alone = [], []
    for _ in range(2):
        pairs = np.column_stack([rng.integers(0, N_WORDS, 30), rng.integers(0, N_IMAGES, 30)])
        word_ids = np.array([rng.permutation(N_WORDS)[:2] for _ in range(N_POINTS)], np.int32)
        sq_dist = np.sort(rng.uniform(0.0, 1.0, (N_POINTS, 2)).astype(np.float32), axis=1)
        idf = rng.uniform(0.1, 2.0, N_WORDS)
        lists = unpack(parts_of(pairs, cut), np.arange(N_WORDS), mask)
        for channels, postings in ((filtered, lists), (alone, only(pairs, ids))):
            channels.append(ChannelQuery(word_ids, sq_dist, 0.0, 1.0, postings, idf))
    scores = fuse([filtered], N_IMAGES, config, sizes)
    expected = fuse([alone], len(ids), config, sizes[ids])
    assert not scores.touched[~mask].any()
    found = Scores(scores.values[mask], scores.touched[mask])
    assert found.touched.tolist() == expected.touched.tolist()
    assert found.values == pytest.approx(expected.values, rel=1e-12, abs=1e-12)
