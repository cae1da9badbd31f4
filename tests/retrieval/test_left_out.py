"""What a place achieved never reaches the model that is judged on it; controls by hand."""

from dataclasses import replace

import numpy as np
import pytest
from made_trials import CANDIDATES, KS, eq1_trials, some_features, term, trials

from contracts.config import VariantName
from contracts.errors import WrongInput
from retrieval.left_out import (
    achieved,
    boosted_predictions,
    chosen,
    controls,
    left_out_predictions,
    picked_by_others,
    worth,
)
from retrieval.regression import (
    VARIANTS,
    feature_ranges,
    fit_regression,
    is_outside,
    used_features,
)
from retrieval.trials import Trials

EACH = pytest.mark.parametrize("name", VARIANTS)


def two_a_place(n: int = 24, noise: float = 0.1) -> Trials:
    made = eq1_trials(n, noise)
    return replace(made, places=np.array([f"p{number // 2}" for number in range(n)]))


def poisoned(made: Trials, place: str) -> Trials:
    """Huge scores, other for every candidate, at one place."""
    here = made.places == place
    ap = made.ap.copy()
    ap[here] += 1e6 * (1 + np.arange(len(CANDIDATES)) ** 2)
    return replace(made, ap=ap)


@EACH
def test_the_scores_of_a_place_do_not_reach_its_own_predictions(name: VariantName) -> None:
    made = two_a_place()
    here = made.places == "p3"
    clean = left_out_predictions(made, VARIANTS[name], made.places)
    dirty = left_out_predictions(poisoned(made, "p3"), VARIANTS[name], made.places)
    np.testing.assert_array_equal(dirty[here], clean[here])
    assert (dirty[~here] != clean[~here]).all()


@EACH
def test_a_place_left_out_is_predicted_by_a_fit_on_the_others(name: VariantName) -> None:
    made = two_a_place()
    predicted = left_out_predictions(made, VARIANTS[name], made.places)
    for place in np.unique(made.places):
        here = made.places == place
        training = made.take(~here)
        others = fit_regression(training, VARIANTS[name])
        low, high = feature_ranges(training, VARIANTS[name])
        known = ~is_outside(VARIANTS[name], made.features[here], low, high).any(axis=1)
        expected = others.predict(made.features[here])
        np.testing.assert_array_equal(predicted[here][known], expected[known])


def test_a_photo_unlike_those_of_the_fit_gets_what_was_best_for_all() -> None:
    made = eq1_trials(30)
    features = made.features.copy()
    features[7] *= 5.0
    made = replace(made, features=features)
    predicted = left_out_predictions(made, VARIANTS["eq1"], made.places)
    others = made.take(made.places != made.places[7])
    np.testing.assert_array_equal(predicted[7], others.mean_ap())


def test_a_rounding_error_is_not_outside_the_range() -> None:
    features = some_features(2)
    low = high = used_features(VARIANTS["kp_only"], features)[0].max(axis=0)
    features[:] = features[0].max(axis=0)
    features[..., 0] = low[0] * (1 + 1e-12)
    assert not is_outside(VARIANTS["kp_only"], features, low, high).any()
    assert is_outside(VARIANTS["kp_only"], features + 1e-6, low, high).all()


def test_boosting_too_leaves_the_place_out_and_is_the_same_every_time() -> None:
    made = eq1_trials(150, 0.1)
    made = replace(made, places=np.array(["a", "b", "c"] * 50))
    here = made.places == "b"
    clean = boosted_predictions(made, made.places)
    dirty = boosted_predictions(poisoned(made, "b"), made.places)
    np.testing.assert_array_equal(dirty[here], clean[here])
    assert (dirty[~here] != clean[~here]).any()


def test_boosting_learns_what_no_straight_line_does() -> None:
    features = some_features(200)
    kp = term(features, "Kp")
    ap = np.where(np.abs(kp - 0.5) < 0.2, 0.8, 0.2)
    made = trials(ap, features, places=["a", "b"] * 100)
    oracle = ap.max(axis=1).mean()
    boosted = achieved(made, chosen(made, boosted_predictions(made, made.places), 1)).mean()
    straight = left_out_predictions(made, VARIANTS["look"], made.places)
    assert boosted > 0.95 * oracle
    assert achieved(made, chosen(made, straight, 1)).mean() < 0.8 * oracle


def test_controls_by_hand() -> None:
    # Without place a the first candidate is best and the last worst, without b the other way round.
    ap = np.array([[0.0, 0.5, 0.5, 0.5, 0.5, 1.0]] * 2 + [[0.9, 0.5, 0.5, 0.5, 0.5, 0.1]] * 3)
    made = trials(ap, places=["a", "a", "b", "b", "b"])
    found = controls(made, made.places)
    assert found.best_fixed.tolist() == [0.0, 0.0, 0.1, 0.1, 0.1]
    assert found.worst_fixed.tolist() == [1.0, 1.0, 0.9, 0.9, 0.9]
    assert found.random == pytest.approx([0.5] * 5)
    assert found.oracle.tolist() == [1.0, 1.0, 0.9, 0.9, 0.9]


def test_fixed_controls_are_picked_with_the_weights_of_sets() -> None:
    first, last = np.eye(6)[0], np.eye(6)[-1]
    ap = np.array([first, first, first, 2 * last, first])
    made = trials(ap, places=["a", "b", "c", "d", "e"], sets=["x", "x", "x", "y", "x"])
    assert controls(made, made.places).best_fixed.tolist() == [0.0, 0.0, 0.0, 0.0, 0.0]
    alike = replace(made, sets=np.array(["x"] * 5))
    assert controls(alike, made.places).best_fixed.tolist() == [1.0, 1.0, 1.0, 0.0, 1.0]


def test_the_fixed_variant_chooses_as_the_control_does() -> None:
    made = two_a_place()
    predicted = left_out_predictions(made, VARIANTS["fixed"], made.places)
    got = achieved(made, chosen(made, predicted, 1))
    np.testing.assert_array_equal(got, controls(made, made.places).best_fixed)


def test_the_highest_prediction_is_chosen_and_the_earlier_of_equal_ones() -> None:
    made = trials(np.zeros((3, 6)))
    predicted = np.array([[1, 9, 2, 3, 4, 5], [7, 7, 7, 7, 7, 7], [0, 1, 2, 3, 4, 4]], float)
    assert chosen(made, predicted, 1).tolist() == [[1], [0], [4]]


def test_two_joined_are_the_best_and_the_next_of_the_same_k() -> None:
    made = trials(np.zeros((3, 6)))
    predicted = np.array([[1, 9, 2, 8, 4, 5], [7, 7, 7, 7, 7, 7], [9, 9, 9, 3, 4, 10]], float)
    pairs = chosen(made, predicted, 2)
    assert pairs.tolist() == [[1, 2], [0, 1], [5, 4]]
    assert (KS[pairs[:, 0]] == KS[pairs[:, 1]]).all()


def test_where_a_k_has_one_pair_only_it_is_joined_with_none() -> None:
    made = trials(np.random.default_rng(0).random((4, 6)))
    first = np.array([0, 3])  # one candidate a k
    few = Trials(
        made.queries,
        made.places,
        made.sets,
        (CANDIDATES[0], CANDIDATES[3]),
        made.ap[:, first],
        made.ap_together[:, first][:, :, first],
        made.features[:, first],
    )
    choices = chosen(few, few.ap, 2)
    assert achieved(few, choices).tolist() == few.ap.max(axis=1).tolist()


def test_what_was_achieved_is_the_joined_ranking_s_own_score() -> None:
    made = eq1_trials(3)
    choices = np.array([[1, 2], [5, 4], [0, 1]])
    assert achieved(made, choices).tolist() == [
        made.ap_together[row, a, b] for row, (a, b) in enumerate(choices.tolist())
    ]
    assert achieved(made, choices[:, :1]).tolist() == [
        made.ap[row, a] for row, a in enumerate([1, 5, 0])
    ]


def test_who_knows_everything_takes_all_of_the_room() -> None:
    made = two_a_place()
    beside = controls(made, made.places)
    best = worth(made, chosen(made, made.ap, 1), beside, made.places)
    assert best.share.mean == pytest.approx(1.0)
    assert (best.share.low, best.share.high) == pytest.approx((1.0, 1.0))
    assert best.ap.mean == pytest.approx(beside.oracle.mean())
    assert best.gain.mean == pytest.approx((beside.oracle - beside.best_fixed).mean())
    assert best.n_chosen == len(np.unique(made.ap.argmax(axis=1)))


def test_who_takes_the_best_fixed_takes_none_of_the_room() -> None:
    made = two_a_place()
    beside = controls(made, made.places)
    predicted = left_out_predictions(made, VARIANTS["fixed"], made.places)
    fixed = worth(made, chosen(made, predicted, 1), beside, made.places)
    assert (fixed.gain.mean, fixed.gain.low, fixed.gain.high) == (0.0, 0.0, 0.0)
    assert fixed.share.mean == 0.0


def test_worth_weighs_sets_and_draws_places() -> None:
    ap = np.zeros((5, 6))
    ap[0] = 1.0
    sets = ["small", "large", "large", "large", "large"]
    made = trials(ap, places=["a", "b", "b", "c", "c"], sets=sets)
    nothing = np.zeros((5, 1), dtype=np.int64)
    found = worth(made, nothing, controls(made, made.places), made.places)
    assert found.ap.mean == pytest.approx(1 / 3)
    alone = trials(ap, places=["a"] * 5, sets=sets)
    lone = worth(alone, nothing, controls(made, made.places), alone.places)
    assert np.isnan(lone.ap.low)


def test_one_place_cannot_be_left_out() -> None:
    made = replace(eq1_trials(4), places=np.array(["a"] * 4))
    with pytest.raises(WrongInput, match="at least 2 places are needed, got 1"):
        left_out_predictions(made, VARIANTS["eq1"], made.places)
    for judge in (controls, boosted_predictions):
        with pytest.raises(WrongInput, match="at least 2"):
            judge(made, made.places)


def test_the_pick_among_ways_is_made_on_the_other_groups() -> None:
    ap = np.full((6, len(CANDIDATES)), 0.1)
    ap[:, 0] = 0.2
    ap[0, 1] = 1.0  # so good that choosing 1 wins overall, by this query alone
    made = trials(ap)
    ways = [np.full((6, 1), number) for number in (0, 1)]
    picked = picked_by_others(made, ways, made.places)
    assert achieved(made, ways[1]).mean() > achieved(made, ways[0]).mean()
    assert picked[0].tolist() == [0, 0]
    assert picked[1:].tolist() == [[1, 1]] * 5
