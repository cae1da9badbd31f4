"""Every variant finds the equation that made the scores, and is blind to what it should not see."""

import numpy as np
import pytest
from made_trials import (
    CANDIDATES,
    KS,
    PAIRS,
    eq1_trials,
    made_by,
    some_features,
    term,
    trials,
    without_ridge,
)
from numpy.typing import NDArray

from contracts.config import VariantName
from retrieval.candidates import COMPLEMENTARITY, CROWDING, FEATURES
from retrieval.regression import (
    VARIANTS,
    Column,
    Variant,
    columns,
    fit_regression,
    used_features,
)

EACH = pytest.mark.parametrize("name", VARIANTS)
WITHIN = [name for name, variant in VARIANTS.items() if variant.within]


def free_coefficients(variant: Variant, seed: int = 2) -> NDArray[np.float64]:
    """Some coefficients; constants that only differences can tell sum to 0."""
    made = np.random.default_rng(seed).uniform(-0.5, 0.5, len(columns(variant, CANDIDATES)))
    if variant.constants == "candidate":
        made[-len(CANDIDATES) :] -= made[-len(CANDIDATES) :].mean()
    return made


@EACH
def test_noise_free_scores_give_back_the_coefficients_that_made_them(name: VariantName) -> None:
    variant = without_ridge(VARIANTS[name])
    features, true = some_features(40), free_coefficients(variant)
    if variant.averaged:  # one row a candidate is too few for all coefficients of two k
        true = free_coefficients(VARIANTS["kp_only"])
        variant = Variant("paper", ("Kp",), per_k=True, constants="none", averaged=True)
    ap = made_by(variant, true, features)
    found = fit_regression(trials(ap, features), variant)
    assert found.predict(features) == pytest.approx(ap, abs=1e-9)
    assert found.coefficients == pytest.approx(true, abs=1e-8)


@pytest.mark.parametrize("name", [name for name, variant in VARIANTS.items() if variant.ridge])
def test_ridge_shrinks_but_noise_free_scores_are_still_told_apart(name: VariantName) -> None:
    variant = VARIANTS[name]
    features, true = some_features(40), free_coefficients(variant)
    ap = made_by(variant, true, features)
    found = fit_regression(trials(ap, features), variant)
    predicted = found.predict(features)
    assert np.corrcoef(predicted.ravel(), ap.ravel())[0, 1] > 0.99
    assert np.linalg.norm(found.coefficients) <= np.linalg.norm(true) + 1e-9


def test_the_columns_are_eq_1_for_every_k_and_constants_where_the_variant_has_them() -> None:
    eq1 = columns(VARIANTS["eq1"], CANDIDATES)
    assert eq1 == [Column(term, k, None) for term in COMPLEMENTARITY for k in (2, 5)]
    assert columns(VARIANTS["paper"], CANDIDATES) == eq1
    assert columns(VARIANTS["kp_only"], CANDIDATES) == eq1[:2]
    of_k = [Column("constant", k, None) for k in (2, 5)]
    assert columns(VARIANTS["intercept"], CANDIDATES) == eq1 + of_k
    own = [Column("constant", k, pair) for pair, k in CANDIDATES]
    assert columns(VARIANTS["fixed"], CANDIDATES) == own
    for name, terms in (
        ("offsets", COMPLEMENTARITY),
        ("gain", COMPLEMENTARITY),
        ("crowding", COMPLEMENTARITY + CROWDING),
        ("look", FEATURES),
    ):
        wanted = [Column(each, None, None) for each in terms] + own
        assert columns(VARIANTS[name], CANDIDATES) == wanted  # type: ignore[index]


def test_only_the_look_needs_rankings() -> None:
    assert [name for name, variant in VARIANTS.items() if variant.needs_look] == ["look"]


@pytest.mark.parametrize("name", WITHIN)
def test_differences_alone_count_where_the_variant_says_within(name: VariantName) -> None:
    features, rng = some_features(30), np.random.default_rng(5)
    ap = rng.random((30, len(CANDIDATES)))
    found = fit_regression(trials(ap, features), VARIANTS[name])
    lift = rng.random((30, 1))
    moved = features + rng.random((30, 1, len(FEATURES)))
    lifted = fit_regression(trials(ap + lift, moved), VARIANTS[name])
    assert lifted.coefficients == pytest.approx(found.coefficients)
    assert lifted.level == pytest.approx(found.level + lift.mean())
    assert found.predict(moved) == pytest.approx(found.predict(features))
    assert found.predict(features).mean(axis=1) == pytest.approx([ap.mean()] * 30)


@pytest.mark.parametrize("name", [name for name in VARIANTS if name not in WITHIN])
def test_the_level_of_a_query_counts_in_the_other_variants(name: VariantName) -> None:
    features = some_features(30)
    ap = np.random.default_rng(5).random((30, len(CANDIDATES)))
    found = fit_regression(trials(ap, features), VARIANTS[name])
    moved = features + 1
    assert not np.allclose(found.predict(moved), found.predict(features))


def test_the_paper_s_variant_sees_one_row_a_candidate() -> None:
    made = eq1_trials(noise=0.1)
    found = fit_regression(made, VARIANTS["paper"])
    ap, features = made.ap.mean(axis=0), made.features.mean(axis=0)
    for number, k in enumerate((2, 5)):
        rows = features[k == KS][:, :4]
        by_hand = np.linalg.lstsq(rows, ap[k == KS], rcond=None)[0]
        assert found.coefficients[number::2] == pytest.approx(by_hand)
    rng = np.random.default_rng(0)
    noise = rng.normal(size=made.features.shape)
    same = trials(made.ap, made.features + noise - noise.mean(axis=0))
    assert fit_regression(same, VARIANTS["paper"]).coefficients == pytest.approx(found.coefficients)


def test_eq_1_sees_every_query() -> None:
    made = eq1_trials(noise=0.1)
    found = fit_regression(made, VARIANTS["eq1"])
    for number, k in enumerate((2, 5)):
        rows = made.features[:, k == KS, :4].reshape(-1, 4)
        by_hand = np.linalg.lstsq(rows, made.ap[:, k == KS].ravel(), rcond=None)[0]
        assert found.coefficients[number::2] == pytest.approx(by_hand)
    assert found.level == 0


def test_fixed_predicts_the_mean_of_every_candidate_for_all() -> None:
    made = eq1_trials(noise=0.1)
    found = fit_regression(made, VARIANTS["fixed"])
    anything = some_features(7, seed=9)
    assert found.predict(anything) == pytest.approx(np.tile(made.ap.mean(axis=0), (7, 1)))


@EACH
def test_a_prediction_does_not_depend_on_other_queries(name: VariantName) -> None:
    found = fit_regression(eq1_trials(noise=0.1), VARIANTS[name])
    asked = some_features(8, seed=9)
    alone = np.concatenate([found.predict(asked[[row]]) for row in range(8)])
    assert alone == pytest.approx(found.predict(asked), abs=1e-12)


@EACH
def test_the_weights_of_sets_are_those_of_the_fit(name: VariantName) -> None:
    features = some_features(20)
    ap = np.random.default_rng(5).random((20, len(CANDIDATES)))
    unequal = trials(ap, features, sets=["town"] * 16 + ["village"] * 4)
    found = fit_regression(unequal, VARIANTS[name])
    one_set = trials(ap, features)
    weighed = fit_regression(one_set, VARIANTS[name], unequal.weights())
    assert found.coefficients == pytest.approx(weighed.coefficients)
    assert found.level == pytest.approx(weighed.level)
    unweighed = fit_regression(one_set, VARIANTS[name])
    assert unweighed.coefficients != pytest.approx(found.coefficients)


@EACH
def test_times_count_a_query_as_often_as_if_it_stood_there_so_often(name: VariantName) -> None:
    features = some_features(12)
    ap = np.random.default_rng(5).random((12, len(CANDIDATES)))
    times = np.array([0, 2, 1, 3, 1, 1, 0, 2, 1, 1, 1, 1])
    rows = np.repeat(np.arange(12), times)
    weighed = fit_regression(trials(ap, features), VARIANTS[name], times.astype(np.float64))
    repeated = fit_regression(trials(ap[rows], features[rows]), VARIANTS[name])
    assert weighed.coefficients == pytest.approx(repeated.coefficients)
    assert weighed.level == pytest.approx(repeated.level)


def test_a_term_that_never_varies_gets_no_say() -> None:
    features = some_features(20)
    features[..., FEATURES.index("gain")] = 0.5
    ap = np.random.default_rng(5).random((20, len(CANDIDATES)))
    found = fit_regression(trials(ap, features), VARIANTS["look"])
    place = [each.term for each in columns(VARIANTS["look"], CANDIDATES)].index("gain")
    assert abs(found.coefficients[place]) < 1e-6


def test_used_features_are_the_terms_in_order_and_centred_within_a_query() -> None:
    features = some_features(3)
    plain = used_features(VARIANTS["kp_only"], features)
    np.testing.assert_array_equal(plain[..., 0], term(features, "Kp"))
    within = used_features(VARIANTS["crowding"], features)
    assert within.shape == (3, len(PAIRS) * 2, 6)
    assert within.mean(axis=1) == pytest.approx(np.zeros((3, 6)), abs=1e-12)
    assert used_features(VARIANTS["fixed"], features).shape == (3, 6, 0)
