"""A choice is kept where it helps, and its report says so only where it is true."""

from dataclasses import replace

import numpy as np
import pytest
from made_trials import CANDIDATES, PAIRS, eq1_trials, some_features, term, trials

from contracts.config import VariantName
from contracts.errors import WrongInput
from retrieval.choice import ChoiceModel
from retrieval.choice_fit import fit_choice
from retrieval.regression import VARIANTS, fit_regression
from retrieval.trials import Trials


def fitted(made: Trials, variants: tuple[VariantName, ...] = tuple(VARIANTS)) -> ChoiceModel:
    return fit_choice(
        made,
        detectors=("hesaff", "mser", "star"),
        descriptors=("sift", "sc"),
        vote="union",
        weights=("norm", "idf"),
        index_digest="0123456789abcdef",
        variants=variants,
    )


def telling_trials(n: int = 40, seed: int = 3) -> Trials:
    """A candidate is the better the larger its CSCo: the best one differs from photo to photo."""
    features = some_features(n)
    noise = 0.02 * np.random.default_rng(seed).normal(size=(n, len(CANDIDATES)))
    return trials(0.1 + 0.8 * term(features, "CSCo") + noise, features)


def noise_trials(n: int = 40, seed: int = 0) -> Trials:
    """Nothing that is known of a candidate says how well it does."""
    ap = np.random.default_rng(seed).random((n, len(CANDIDATES)))
    return trials(ap, some_features(n, seed + 100))


def test_where_a_feature_tells_the_best_pair_an_adaptive_choice_is_kept() -> None:
    made = telling_trials()
    model = fitted(made)
    scores = model.left_out
    assert model.variant != "fixed"
    assert model.n_joined == 1
    controls = (scores.best_fixed, scores.worst_fixed, scores.random)
    assert max(controls) < scores.adaptive.mean <= scores.oracle
    assert scores.gain.low is not None
    assert scores.gain.low > 0.1
    # Not all of it: a photo unlike the other 39 is searched with what is best for all.
    assert scores.share.mean is not None
    assert scores.share.mean > 0.5
    assert scores.n_chosen == len(CANDIDATES)


def test_the_kept_model_chooses_for_a_photo_as_it_learnt() -> None:
    model = fitted(telling_trials())
    features = some_features(1, seed=8)[0]
    choice = model.choose(
        {each: tuple(row) for each, row in zip(CANDIDATES, features, strict=True)}
    )
    best = CANDIDATES[int(term(features[np.newaxis], "CSCo").argmax())]
    assert (choice.pairs[0], choice.k) == best


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_where_nothing_tells_the_report_shows_no_real_gain(seed: int) -> None:
    scores = fitted(noise_trials(seed=seed)).left_out
    assert scores.gain.low is not None
    assert scores.gain.low <= 0


def test_of_equally_good_choices_the_simplest_is_kept() -> None:
    ap = np.tile(np.linspace(0.2, 0.7, len(CANDIDATES)), (20, 1))
    model = fitted(trials(ap))
    assert (model.variant, model.n_joined) == ("fixed", 1)
    assert model.left_out.gain.mean == 0
    best = model.best_fixed(None, "")
    assert (best.pairs, best.k) == ((PAIRS[2],), 5)
    assert best.predicted_map == pytest.approx(0.7)


@pytest.mark.parametrize(("bonus", "n_joined"), [(-0.3, 1), (0.3, 2)])
def test_two_are_joined_where_that_is_better(bonus: float, n_joined: int) -> None:
    made = telling_trials()
    alone = np.eye(len(CANDIDATES), dtype=np.bool_)
    together = np.where(alone, made.ap_together, made.ap_together + bonus)
    assert fitted(replace(made, ap_together=together)).n_joined == n_joined


# Without `paper`: three pairs, so three rows a k, leave its four coefficients open.
@pytest.mark.parametrize("name", [name for name in VARIANTS if name != "paper"])
def test_coefficients_are_those_of_a_fit_on_all_and_lie_within_their_intervals(
    name: VariantName,
) -> None:
    made = eq1_trials(noise=0.1)
    model = fitted(made, (name,))
    whole = fit_regression(made, VARIANTS[name])
    assert model.variant == name
    assert [each.value for each in model.coefficients] == whole.coefficients.tolist()
    assert model.level == whole.level
    assert all(each.low <= each.value <= each.high for each in model.coefficients)
    assert all(each.low < each.high for each in model.coefficients)


def test_noise_free_scores_leave_no_doubt_of_the_coefficients() -> None:
    model = fitted(eq1_trials(), ("eq1",))
    for each, true in zip(
        model.coefficients, [0.1, 0.2, 0.5, 0.1, 0.2, 0.4, 0.1, 0.05], strict=True
    ):
        assert (each.low, each.value, each.high) == pytest.approx((true, true, true))


def test_a_fit_is_the_same_every_time() -> None:
    assert fitted(noise_trials(12), ("eq1",)) == fitted(noise_trials(12), ("eq1",))


def test_what_it_was_trained_on_and_for_is_recorded() -> None:
    made = telling_trials(12)
    places = [f"p{number // 2}" for number in range(12)]
    sets = ["village"] * 4 + ["town"] * 8
    model = fitted(trials(made.ap, made.features, places, sets), ("fixed", "eq1"))
    assert [(each.set, each.n_queries, each.n_places) for each in model.trained_on] == [
        ("town", 8, 4),
        ("village", 4, 2),
    ]
    assert model.index_digest == "0123456789abcdef"
    assert model.detectors == ("hesaff", "mser", "star")
    assert (model.descriptors, model.vote, model.weights) == (
        ("sift", "sc"),
        "union",
        ("idf", "norm"),
    )
    assert ChoiceModel.from_json(model.to_json()) == model


def test_what_is_best_for_all_is_ranked_with_the_weights_of_sets() -> None:
    ap = np.zeros((5, 6))
    ap[:4, 0], ap[4, 3] = 0.4, 0.9
    model = fitted(trials(ap, sets=["x"] * 4 + ["y"]), ("fixed",))
    assert [(each.pair, each.k) for each in model.fixed[:2]] == [CANDIDATES[3], CANDIDATES[0]]
    means = [each.mean_ap for each in model.fixed]
    assert means == pytest.approx([0.9 / 3, 2 * 0.4 / 3, 0, 0, 0, 0])
    assert model.candidates() == CANDIDATES


def test_ranges_are_those_of_the_training_as_the_variant_sees_it() -> None:
    made = eq1_trials(noise=0.1)
    plain, within = fitted(made, ("eq1",)), fitted(made, ("gain",))
    kp = term(made.features, "Kp")
    assert (plain.ranges[0].low, plain.ranges[0].high) == (kp.min(), kp.max())
    centred = kp - kp.mean(axis=1, keepdims=True)
    assert within.ranges[0].low == pytest.approx(centred.min())
    assert within.ranges[0].high == pytest.approx(centred.max())


def test_a_single_pair_can_be_fitted() -> None:
    made = eq1_trials(8, noise=0.1)
    first = np.array([0, 3])
    few = Trials(
        made.queries,
        made.places,
        made.sets,
        (CANDIDATES[0], CANDIDATES[3]),
        made.ap[:, first],
        made.ap_together[:, first][:, :, first],
        made.features[:, first],
    )
    assert {each.pair for each in fitted(few).fixed} == {PAIRS[0]}


def test_one_place_is_no_training() -> None:
    made = eq1_trials(4)
    one = trials(made.ap, made.features, places=["a"] * 4)
    with pytest.raises(WrongInput, match="at least 2 places"):
        fitted(one)
