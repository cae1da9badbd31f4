"""Every way, made of the votes of single detectors, equals the search that it stands for."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from contracts.config import Detector, SearchConfig, Vote, Weight
from contracts.errors import BadTruth
from retrieval.evaluation import judge_scores
from retrieval.fusion import ChannelQuery, Scores, fuse
from retrieval.late_fusion import LATE_FUSIONS, standardised_sum
from retrieval.postings import build_postings
from retrieval.ways import Method, Votes, Way, all_ways, ap_together, joined_votes, outcomes

N_IMAGES = 14
NAMES: tuple[Detector, ...] = ("hesaff", "mser", "star")
RULE: tuple[Vote, tuple[Weight, ...]] = ("union", ("idf",))
METHODS: tuple[tuple[Method, int], ...] = (("single", 1), ("fii", 2))
SEEDS = st.integers(0, 2**32 - 1)


def some_channel(rng: np.random.Generator, n_points: int) -> ChannelQuery:
    n_words = 6
    postings = build_postings(
        rng.integers(0, n_words, 20).astype(np.int32),
        rng.integers(0, N_IMAGES, 20).astype(np.uint32),
        n_words,
    )
    words = rng.permuted(np.tile(np.arange(n_words), (n_points, 1)), axis=1)[:, :2]
    distances = np.sort(rng.uniform(0, 12, (n_points, 2)), axis=1)
    return ChannelQuery(words.astype(np.int32), distances.astype(np.float32), 1.0, 10.0, postings)


def some_votes(rng: np.random.Generator, names: tuple[Detector, ...], ks: tuple[int, ...]) -> Votes:
    """Votes with ties, negative ones and untouched images."""
    return {(name, k): some_scores(rng) for k in ks for name in names}


def some_scores(rng: np.random.Generator) -> Scores:
    touched = rng.random(N_IMAGES) < 0.7
    return Scores(np.where(touched, rng.integers(-2, 9, N_IMAGES), 0.0), touched)


def some_sizes(rng: np.random.Generator) -> dict[Detector, NDArray[np.int64]]:
    return {name: rng.integers(0, 9, N_IMAGES) for name in NAMES}


@settings(deadline=None)  # kernels are compiled when they are first asked for
@given(SEEDS, st.integers(1, 3), st.sampled_from(["union", "intersection", "pairwise"]))
@pytest.mark.parametrize("with_norm", [False, True])
def test_joined_votes_of_detectors_equal_the_fusion_of_all_their_channels(
    with_norm: bool, seed: int, n_detectors: int, vote: str
) -> None:
    rng = np.random.default_rng(seed)
    n_points = rng.integers(1, 5, n_detectors)
    detectors = [[some_channel(rng, int(n)) for _ in range(2)] for n in n_points]
    sizes = [rng.integers(0, 9, N_IMAGES) for _ in detectors]
    plain = SearchConfig.of(vote=vote, weights=())
    parts = [fuse([channels], N_IMAGES, plain) for channels in detectors]
    asked = SearchConfig.of(vote=vote, weights=("norm",) if with_norm else ())
    whole = fuse(detectors, N_IMAGES, asked, np.sum(sizes, axis=0))
    joined = joined_votes(parts, sizes if with_norm else None)
    assert joined.values == pytest.approx(whole.values, rel=1e-12, abs=1e-12)
    np.testing.assert_array_equal(joined.touched, whole.touched)


def test_every_single_detector_and_pair_is_asked_for_every_k() -> None:
    votes = some_votes(np.random.default_rng(0), NAMES, (2, 5))
    ways = [way for way, _ in all_ways(votes, RULE, None, wide=False)]
    assert ways == [
        Way(method, *RULE, group, k)
        for k in (2, 5)
        for method, size in METHODS
        for group in combinations(NAMES, size)
    ]


def test_widely_three_and_all_are_asked_too_and_pairs_and_all_by_late_fusion() -> None:
    names: tuple[Detector, ...] = (*NAMES, "orb")
    votes = some_votes(np.random.default_rng(0), names, (2,))
    ways = [way for way, _ in all_ways(votes, RULE, None, wide=True)]
    assert len(set(ways)) == len(ways)
    groups = [group for size in (2, 3, 4) for group in combinations(names, size)]
    wanted = {Way("single", *RULE, (name,), 2) for name in names}
    wanted |= {Way("fii", *RULE, group, 2) for group in groups}
    late = [group for group in groups if len(group) != 3]
    wanted |= {Way(method, *RULE, group, 2) for method in LATE_FUSIONS for group in late}
    assert set(ways) == wanted


@pytest.mark.parametrize("n", [1, 2, 3])
def test_no_group_is_asked_for_twice(n: int) -> None:
    votes = some_votes(np.random.default_rng(0), NAMES[:n], (2,))
    ways = [way for way, _ in all_ways(votes, RULE, None, wide=True)]
    assert len(set(ways)) == len(ways)
    fused = {way.detectors for way in ways if way.method == "fii"}
    assert fused == {group for size in (2, 3) for group in combinations(NAMES[:n], size)}


@pytest.mark.parametrize("with_norm", [False, True])
def test_late_fusion_joins_the_single_detectors_as_they_answer_alone(with_norm: bool) -> None:
    rng = np.random.default_rng(3)
    votes = some_votes(rng, NAMES, (2,))
    sizes = some_sizes(rng) if with_norm else None
    answered = dict(all_ways(votes, RULE, sizes, wide=True))
    for group in [*combinations(NAMES, 2), NAMES]:
        alone = [answered[Way("single", *RULE, (name,), 2)] for name in group]
        for method, late in LATE_FUSIONS.items():
            got = answered[Way(method, *RULE, group, 2)]
            np.testing.assert_array_equal(got.values, late(alone).values)
        early = answered[Way("fii", *RULE, group, 2)]
        by_hand = np.sum([votes[name, 2].values for name in group], axis=0)
        if sizes is not None:
            words = np.sum([sizes[name] for name in group], axis=0)
            by_hand = by_hand / np.sqrt(np.where(words > 0, words, 1))
        assert early.values == pytest.approx(by_hand)


def test_outcomes_judge_what_the_ways_answer() -> None:
    rng = np.random.default_rng(4)
    votes, sizes = some_votes(rng, NAMES, (2,)), some_sizes(rng)
    judged = outcomes(votes, RULE, sizes, {1, 5}, {2}, wide=True)
    answered = list(all_ways(votes, RULE, sizes, wide=True))
    assert [each.way for each in judged] == [way for way, _ in answered]
    for outcome, (_, scores) in zip(judged, answered, strict=True):
        assert outcome.scored == judge_scores(scores, {1, 5}, {2})
    with pytest.raises(BadTruth):
        outcomes(votes, RULE, sizes, {2}, {2}, wide=False)


@given(SEEDS, st.booleans())
def test_ap_together_judges_the_standardised_sum_of_two_of_one_k(
    seed: int, with_norm: bool
) -> None:
    rng = np.random.default_rng(seed)
    votes, ks = some_votes(rng, NAMES, (2, 5)), (2, 5)
    sizes = some_sizes(rng) if with_norm else None
    candidates = [(pair, k) for k in ks for pair in combinations(NAMES, 2)]
    relevant, junk = {0, int(rng.integers(1, N_IMAGES))}, {7}
    together = ap_together(votes, sizes, candidates, relevant - junk, junk)
    answered = dict(all_ways(votes, RULE, sizes, wide=False))
    rankings = [answered[Way("fii", *RULE, pair, k)] for pair, k in candidates]
    np.testing.assert_array_equal(together, together.T)
    for a, (_, k_a) in enumerate(candidates):
        for b, (_, k_b) in enumerate(candidates):
            if k_a != k_b:
                assert np.isnan(together[a, b])
                continue
            both = rankings[a] if a == b else standardised_sum([rankings[a], rankings[b]])
            assert together[a, b] == judge_scores(both, relevant - junk, junk).ap
