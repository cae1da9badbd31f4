"""What is known of a pair and k before it is chosen: in order, by hand, and blind to junk."""

from dataclasses import replace
from itertools import combinations
from math import log

import numpy as np
import pytest

from contracts.config import Detector
from retrieval.candidates import (
    AGREEMENT,
    COMPLEMENTARITY,
    CROWDING,
    CURVE,
    FEATURES,
    LOOK,
    Candidate,
    FirstLook,
    candidate_features,
)
from retrieval.complementarity import Complementarity
from retrieval.fusion import Scores
from retrieval.score_curves import agreement, curve_features
from retrieval.ways import joined_votes

NAMES: tuple[Detector, ...] = ("hesaff", "mser", "star")
PAIRS = tuple(combinations(NAMES, 2))
SCORED = {pair: Complementarity(1 + n, 0.1 * n, 0.2 * n, 0.3 * n) for n, pair in enumerate(PAIRS)}
DENSITY: dict[Detector, float] = {"hesaff": 0.1, "mser": 0.3, "star": 0.02}
N_IMAGES = 30


def a_look(junk: tuple[int, ...] = ()) -> FirstLook:
    rng = np.random.default_rng(0)
    votes = {}
    for k in (2, 5):
        for name in NAMES:
            touched = rng.random(N_IMAGES) < 0.8
            votes[name, k] = Scores(np.where(touched, rng.exponential(size=N_IMAGES), 0), touched)
    sizes = {name: rng.integers(1, 9, N_IMAGES) for name in NAMES}
    return FirstLook(votes, sizes, junk)


def described(look: FirstLook | None) -> dict[Candidate, dict[str, float]]:
    features = candidate_features(SCORED, DENSITY, (2, 5), look)
    return {each: dict(zip(FEATURES, row, strict=False)) for each, row in features.items()}


def without(look: FirstLook, images: tuple[int, ...]) -> FirstLook:
    """The look at an index that holds these images but nobody voted for them."""
    votes = {}
    for key, scores in look.votes.items():
        values, touched = scores.values.copy(), scores.touched.copy()
        values[list(images)], touched[list(images)] = 0.0, False
        votes[key] = Scores(values, touched)
    return replace(look, votes=votes, junk=())


def test_the_features_are_in_the_order_that_the_regression_reads_them_in() -> None:
    assert (*COMPLEMENTARITY, *CROWDING, *CURVE, *AGREEMENT) == FEATURES
    assert LOOK == CURVE + AGREEMENT
    look = a_look()
    found = described(look)
    assert list(found) == [(pair, k) for k in (2, 5) for pair in PAIRS]
    assert look.sizes is not None
    for (pair, k), row in found.items():
        assert tuple(row) == FEATURES
        assert tuple(row[name] for name in COMPLEMENTARITY) == SCORED[pair].as_tuple()
        ranked = {
            group: joined_votes(
                [look.votes[name, k] for name in group], [look.sizes[name] for name in group]
            )
            for group in (pair, NAMES, *((name,) for name in NAMES))
        }
        curve = curve_features(ranked[pair])
        for name in CURVE:
            assert row[name] == getattr(curve, name)
        first, second = pair
        assert row["agreement"] == agreement(ranked[first,], ranked[second,])
        assert row["consensus"] == agreement(ranked[pair], ranked[NAMES])


def test_crowding_is_the_logarithm_of_the_share_of_images_that_k_words_reach() -> None:
    found = described(None)
    shares: dict[Candidate, float] = {
        (("hesaff", "mser"), 2): 2 * 0.2,
        (("hesaff", "mser"), 5): 5 * 0.2,
        (("mser", "star"), 5): 5 * 0.16,
    }
    for (pair, k), share in shares.items():
        row = found[pair, k]
        assert row["crowding"] == pytest.approx(log(share))
        assert row["crowding_squared"] == pytest.approx(log(share) ** 2)


def test_an_index_without_words_is_not_crowded_and_no_error() -> None:
    empty = dict.fromkeys(NAMES, 0.0)
    features = candidate_features(SCORED, empty, (2,), None)
    assert np.isfinite(list(features.values())).all()


def test_without_a_look_only_what_needs_no_ranking_is_known() -> None:
    whole = described(a_look())
    for candidate, row in described(None).items():
        assert tuple(row) == (*COMPLEMENTARITY, *CROWDING)
        assert row == {name: whole[candidate][name] for name in row}


def test_junk_is_not_seen() -> None:
    junk = tuple(int(image) for image in np.argsort(a_look().votes["hesaff", 2].values)[-3:])
    assert described(a_look(junk)) == described(without(a_look(), junk))
    assert described(a_look(junk)) != described(a_look())


def test_the_votes_themselves_keep_their_junk() -> None:
    look, untouched = a_look((3, 4)), a_look()
    described(look)
    for key, scores in look.votes.items():
        np.testing.assert_array_equal(scores.values, untouched.votes[key].values)
        np.testing.assert_array_equal(scores.touched, untouched.votes[key].touched)
