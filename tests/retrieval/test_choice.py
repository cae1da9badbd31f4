"""The adaptive choice follows Eq. 1 within its training, and falls back outside it."""

import json
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from contracts.errors import BadIndex, WrongInput
from retrieval.choice import ChoiceModel, Pair, TrainingRow, TrainingSet, fit
from retrieval.complementarity import Complementarity

PAIRS: tuple[Pair, ...] = (("hesaff", "star"), ("hesaff", "mser"), ("star", "mser"))
TRUE = {2: (0.1, 0.5, 0.2, 0.1), 5: (0.2, 0.1, 0.4, 0.05)}
SETS = (TrainingSet(set="facades", n_queries=12, n_places=4),)


def rows(noise: float = 0.0, n_queries: int = 12) -> list[TrainingRow]:
    """APs that obey Eq. 1 with the coefficients `TRUE`."""
    rng = np.random.default_rng(1)
    made = []
    for query in range(n_queries):
        for pair in PAIRS:
            features = Complementarity(*rng.uniform(0.1, 0.9, 4))
            for k, true in TRUE.items():
                ap = float(np.dot(true, features.as_tuple())) + noise * float(rng.normal())
                made.append(TrainingRow(f"q{query}", f"p{query % 4}", pair, k, features, ap))
    return made


def fitted(training: list[TrainingRow]) -> ChoiceModel:
    return fit(
        training,
        detectors=("hesaff", "star", "mser"),
        descriptors=("sift", "sc"),
        vote="union",
        weights=("idf",),
        trained_on=SETS,
    )


@pytest.fixture
def model() -> ChoiceModel:
    return fitted(rows())


def middle(csdi: float) -> Complementarity:
    return Complementarity(0.5, csdi, 0.5, 0.5)


def test_the_fit_recovers_the_coefficients_that_made_the_scores(model: ChoiceModel) -> None:
    assert model.ks == (2, 5)
    for equation in model.fitted.equations:
        assert equation.coefficients == pytest.approx(TRUE[equation.k])


def test_a_photo_is_searched_with_the_pair_and_k_of_the_highest_prediction(
    model: ChoiceModel,
) -> None:
    features = {PAIRS[0]: middle(0.3), PAIRS[1]: middle(0.8), PAIRS[2]: middle(0.5)}
    choice = model.choose(features, (2, 5))
    assert (choice.pair, choice.k) == (PAIRS[1], 2)
    assert choice.predicted_map == pytest.approx(0.2 + 0.4)
    assert choice.reason == "highest predicted mAP of 6 choices"


def test_the_user_may_fix_the_pair_or_the_k(model: ChoiceModel) -> None:
    features = {PAIRS[0]: middle(0.3), PAIRS[1]: middle(0.8)}
    assert model.choose({PAIRS[0]: features[PAIRS[0]]}, (2, 5)).pair == PAIRS[0]
    assert model.choose(features, (5,)).k == 5


def test_equal_predictions_go_to_the_earlier_candidate(model: ChoiceModel) -> None:
    features = {pair: middle(0.4) for pair in PAIRS}
    assert model.choose(features, (2,)).pair == PAIRS[0]


def test_outside_the_training_range_the_best_fixed_choice_is_taken(model: ChoiceModel) -> None:
    means = {
        (pair, k): np.mean([row.ap for row in rows() if (row.pair, row.k) == (pair, k)])
        for pair, k in product(PAIRS, TRUE)
    }
    best = max(means, key=lambda choice: means[choice])
    assert (model.fallback_pair, model.fallback_k) == best
    choice = model.choose({pair: middle(7.0) for pair in PAIRS}, (2, 5))
    assert (choice.pair, choice.k) == best
    assert choice.predicted_map == pytest.approx(means[best])
    assert choice.reason.startswith("fallback to the best fixed choice")
    assert "CSDi was" in choice.reason
    assert "here 7" in choice.reason
    one = model.choose({PAIRS[2]: middle(7.0)}, (5,))
    assert (one.pair, one.k) == (PAIRS[2], 5)
    assert one.predicted_map == pytest.approx(means[PAIRS[2], 5])


def test_a_pair_is_the_same_in_either_order(model: ChoiceModel) -> None:
    swapped: Pair = ("star", "hesaff")
    assert model.choose({swapped: middle(7.0)}, (2,)).pair == swapped


def test_scores_leave_the_place_out() -> None:
    # One pair wins everywhere but in place p0, where the other does: without p0 nothing says so.
    features = Complementarity(0.5, 0.5, 0.5, 0.5)
    training = [
        TrainingRow(f"q{query}", f"p{query // 2}", pair, 2, features, float(wins))
        for query in range(6)
        for pair, wins in ((PAIRS[0], query >= 2), (PAIRS[1], query < 2))
    ]
    scores = fitted(training).left_out
    assert scores.best_fixed == pytest.approx(4 / 6)
    assert scores.oracle == 1.0
    assert scores.random == 0.5


def test_scores_of_a_choice_that_explains_everything_reach_the_oracle() -> None:
    training = rows(n_queries=40)
    scores = fitted(training).left_out
    assert scores.random < scores.best_fixed < scores.adaptive <= scores.oracle
    assert scores.adaptive > scores.best_fixed + 0.8 * (scores.oracle - scores.best_fixed)


def test_a_model_survives_its_json(model: ChoiceModel) -> None:
    assert ChoiceModel.from_json(model.to_json()) == model
    assert model.summary().startswith("12 queries")


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"surprise": 1}, "surprise"),
        ({"form": 2}, "form"),
        ({"vote": "loud"}, "vote"),
        ({"left_out": {"adaptive": "0.5"}}, "left_out"),
        ({"fitted": {"equations": []}}, "fitted"),
    ],
)
def test_a_model_that_does_not_hold_is_refused_by_place(
    model: ChoiceModel, change: dict[str, object], where: str
) -> None:
    text = json.dumps({**json.loads(model.to_json()), **change})
    with pytest.raises(BadIndex, match=f"does not hold at {where}"):
        ChoiceModel.from_json(text)


@pytest.mark.parametrize("text", ["", "[]", "{", '{"form": 1}'])
def test_what_is_no_model_is_refused(text: str) -> None:
    with pytest.raises(BadIndex, match="adaptive model"):
        ChoiceModel.from_json(text)


def test_what_cannot_be_chosen_is_refused_by_name(model: ChoiceModel) -> None:
    with pytest.raises(WrongInput, match="k = 2, 5, not 10"):
        model.choose({PAIRS[0]: middle(0.3)}, (10,))
    with pytest.raises(WrongInput, match="never trained on har-orb"):
        model.choose({("har", "orb"): middle(7.0)}, (2,))
    with pytest.raises(WrongInput, match="at least one pair"):
        model.choose({}, (2,))


def test_training_needs_every_query_with_everything_and_two_places() -> None:
    training = rows()
    with pytest.raises(WrongInput, match="q0 has 5 training rows, expected one for each of the 6"):
        fitted(training[1:])
    with pytest.raises(WrongInput, match="at least 2"):
        fitted([row for row in training if row.place == "p0"])
    with pytest.raises(WrongInput, match="got 0"):
        fitted([])


def test_a_pair_that_is_better_whatever_the_photo_gets_an_offset() -> None:
    better = PAIRS[2]
    lifted = [replace(row, ap=row.ap + 0.3 * (row.pair == better)) for row in rows(0.02)]
    model = fitted(lifted)
    assert model.variant == "pair_offsets"
    for equation in model.fitted.equations:
        offsets = {each.pair: each.value for each in equation.offsets}
        others = [offsets[pair] for pair in PAIRS if pair != better]
        assert offsets[better] == pytest.approx(np.mean(others) + 0.3, abs=0.05)
    same = {pair: middle(0.5) for pair in PAIRS}
    assert model.choose(same, (2, 5)).pair == better
    assert ChoiceModel.from_json(model.to_json()) == model


def test_scores_that_obey_eq_1_keep_it_as_published(model: ChoiceModel) -> None:
    assert model.variant == "eq1"
    assert all(not equation.offsets for equation in model.fitted.equations)


def test_a_model_that_proved_nothing_on_places_left_out_is_not_worth_using(
    model: ChoiceModel,
) -> None:
    assert model.is_worth_using
    scores = model.left_out.model_copy(update={"adaptive": model.left_out.best_fixed})
    assert not model.model_copy(update={"left_out": scores}).is_worth_using
