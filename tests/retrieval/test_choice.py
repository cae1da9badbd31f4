"""The adaptive choice follows its equation within its training, and falls back outside it."""

import json
from typing import Any

import pytest
from made_model import a_model, features_where
from made_trials import CANDIDATES, PAIRS

from contracts.config import VariantName
from contracts.errors import BadIndex, WrongInput
from retrieval.candidates import Candidate, Pair
from retrieval.choice import Choice, ChoiceModel
from retrieval.regression import VARIANTS

BEST_FIXED: Candidate = (("hesaff", "star"), 5)
BY_SPREAD: dict[tuple[str, int | None, Pair | None], float] = {
    ("CSDi", 2, None): 0.5,
    ("CSDi", 5, None): 0.4,
}


@pytest.fixture
def model() -> ChoiceModel:
    """AP grows with CSDi alone, faster where k is 2."""
    return a_model("eq1", BY_SPREAD, level=0.0)


def test_the_highest_prediction_is_chosen(model: ChoiceModel) -> None:
    wide = (PAIRS[2], 5)
    choice = model.choose(features_where("CSDi", {wide: 0.8}))
    assert (choice.pairs, choice.k) == ((PAIRS[2],), 5)
    assert choice.predicted_map == pytest.approx(0.32)
    assert choice.reason == "highest predicted mAP of 6 choices"
    narrow = model.choose(features_where("CSDi", {wide: 0.6}))
    assert (narrow.pairs, narrow.k) == ((PAIRS[0],), 2)
    assert narrow.predicted_map == pytest.approx(0.25)


def test_equal_predictions_go_to_the_earlier_candidate() -> None:
    flat = a_model("eq1", {("CSDi", k, None): 0.5 for k in (2, 5)}, level=0.0)
    choice = flat.choose(features_where("CSDi", {}))
    assert (choice.pairs[0], choice.k) == CANDIDATES[0]
    late = flat.choose(features_where("CSDi", {CANDIDATES[2]: 0.7, CANDIDATES[4]: 0.7}))
    assert (late.pairs[0], late.k) == CANDIDATES[2]
    two = a_model("eq1", {("CSDi", k, None): 0.5 for k in (2, 5)}, n_joined=2, level=0.0)
    assert two.choose(features_where("CSDi", {})).pairs == (PAIRS[0], PAIRS[1])


def test_candidates_are_in_the_order_of_k_and_detectors_however_they_scored() -> None:
    assert a_model().candidates() == CANDIDATES


@pytest.mark.parametrize("k", [2, 5])
def test_the_user_may_fix_k(model: ChoiceModel, k: int) -> None:
    features = features_where("CSDi", {(PAIRS[1], k): 0.6})
    choice = model.choose(features, [each for each in CANDIDATES if each[1] == k])
    assert (choice.pairs, choice.k) == ((PAIRS[1],), k)
    assert choice.reason == "highest predicted mAP of 3 choices"


def test_the_user_may_fix_the_pair(model: ChoiceModel) -> None:
    features = features_where("CSDi", {(PAIRS[1], 5): 0.9, (PAIRS[2], 2): 0.1})
    choice = model.choose(features, [each for each in CANDIDATES if each[0] == PAIRS[2]])
    assert (choice.pairs, choice.k) == ((PAIRS[2],), 5)
    assert choice.predicted_map == pytest.approx(0.2)


def test_two_joined_are_the_best_and_the_next_of_its_k(model: ChoiceModel) -> None:
    two = model.model_copy(update={"n_joined": 2})
    spread = {(PAIRS[2], 5): 0.9, (PAIRS[0], 5): 0.1, (PAIRS[1], 2): 0.7}
    choice = two.choose(features_where("CSDi", spread))
    assert (choice.pairs, choice.k) == ((PAIRS[2], PAIRS[1]), 5)
    assert choice.predicted_map == pytest.approx(0.36)
    alone = two.choose(features_where("CSDi", spread), [(PAIRS[0], 5), (PAIRS[1], 2)])
    assert (alone.pairs, alone.k) == ((PAIRS[1],), 2)


@pytest.mark.parametrize(("value", "said"), [(1.5, "0.5 to 1.5"), (-0.5, "-0.5 to 0.5")])
def test_outside_its_training_the_best_fixed_is_taken_and_the_feature_named(
    model: ChoiceModel, value: float, said: str
) -> None:
    choice = model.choose(features_where("CSDi", {(PAIRS[0], 2): value}))
    assert (choice.pairs[0], choice.k) == BEST_FIXED
    assert choice.predicted_map == 0.36
    assert choice.reason == (
        f"fallback to what was best for all: CSDi was 0 to 1 in training, here {said}"
    )


def test_every_feature_outside_is_named_and_one_that_is_not_asked_for_is_none(
    model: ChoiceModel,
) -> None:
    far = {(PAIRS[0], 2): 3.0}
    assert not model.choose(features_where("z_score", far)).reason.startswith("fallback")
    everything = features_where("Kp", dict.fromkeys(CANDIDATES, 2.0), others=7.0)
    reason = model.choose(everything).reason
    assert [name for name in VARIANTS["eq1"].terms if f"{name} was" in reason] == [
        "Kp",
        "CSDi",
        "CSCo",
        "CSCl",
    ]


def test_the_edges_of_the_training_are_inside(model: ChoiceModel) -> None:
    edges = {CANDIDATES[0]: 0.0, CANDIDATES[1]: 1.0}
    assert model.choose(features_where("CSDi", edges)).reason.startswith("highest")


def test_where_differences_count_a_level_is_never_outside() -> None:
    gain = a_model("gain", {("CSDi", None, None): 1.0})
    choice = gain.choose(features_where("CSDi", {CANDIDATES[3]: 90.5}, others=90.0))
    assert (choice.pairs[0], choice.k) == CANDIDATES[3]
    assert choice.predicted_map == pytest.approx(0.25 + 0.5 * 5 / 6)
    apart = gain.choose(features_where("CSDi", {CANDIDATES[3]: 95.0}, others=90.0))
    assert "CSDi was -1 to 1 in training, here -0.833 to 4.17" in apart.reason


def test_the_fallback_keeps_to_what_the_user_left_open(model: ChoiceModel) -> None:
    far = features_where("CSDi", {(PAIRS[0], 2): 7.0})
    choice = model.choose(far, [(PAIRS[0], 2), (PAIRS[2], 2)])
    assert (choice.pairs, choice.k, choice.predicted_map) == ((PAIRS[2],), 2, 0.32)
    two = model.model_copy(update={"n_joined": 2}).choose(far)
    assert (two.pairs, two.k) == ((PAIRS[1], PAIRS[2]), 5)


def test_what_was_best_for_all_can_be_asked_for_and_gives_the_reason() -> None:
    choice = a_model("fixed").best_fixed(None, "because")
    assert choice == Choice((BEST_FIXED[0],), BEST_FIXED[1], 0.36, "because")
    of_k = a_model("eq1").best_fixed([each for each in CANDIDATES if each[1] == 2], "because")
    assert (of_k.pairs, of_k.k, of_k.predicted_map) == ((PAIRS[2],), 2, 0.32)


def test_only_the_look_makes_every_candidate_search_first() -> None:
    assert a_model("look").needs_look
    assert not a_model("crowding").needs_look


def test_missing_features_are_refused_and_never_taken_for_nothing(model: ChoiceModel) -> None:
    features = features_where("CSDi", {})
    with pytest.raises(WrongInput, match="first 4 features of every pair and k"):
        model.choose({each: features[each] for each in CANDIDATES[1:]})
    short = features_where("CSDi", {}, n=6)
    assert model.choose(short).reason.startswith("highest")
    with pytest.raises(WrongInput, match="first 13 features of every pair and k"):
        a_model("look").choose(short)


def test_a_choice_among_nothing_says_what_there_is(model: ChoiceModel) -> None:
    for allowed in ([], [(PAIRS[0], 10)]):
        with pytest.raises(WrongInput, match="k from 2, 5 and pairs of hesaff, mser, star"):
            model.choose(features_where("CSDi", {}), allowed)
        with pytest.raises(WrongInput, match="k from 2, 5 and pairs of hesaff, mser, star"):
            model.best_fixed(allowed, "because")


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("n_joined", [1, 2])
def test_a_model_survives_its_json(variant: VariantName, n_joined: int) -> None:
    model = a_model(variant, n_joined=n_joined, index_digest="0123456789abcdef")
    assert ChoiceModel.from_json(model.to_json()) == model


def changed(model: ChoiceModel, *path: str | int, value: object) -> str:
    """The model's JSON with one thing in it replaced."""
    content: Any = json.loads(model.to_json())
    inner = content
    for step in path[:-1]:
        inner = inner[step]
    inner[path[-1]] = value
    return json.dumps(content)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("surprise",), 1),
        (("form",), 2),
        (("vote",), "loud"),
        (("variant",), "eq2"),
        (("n_joined",), 3),
        (("level",), "0.5"),
        (("coefficients", 3, "value"), None),
        (("coefficients", 3, "k"), 11),
        (("ranges", 0, "low"), "low"),
        (("fixed", 0, "pair"), ["hesaff"]),
        (("fixed",), []),
        (("left_out", "best_fixed"), None),
        (("trained_on",), []),
        (("trained_on", 1, "n_queries"), 0),
    ],
)
def test_damaged_json_is_refused_by_place(
    model: ChoiceModel, path: tuple[str | int, ...], value: object
) -> None:
    place = r"\.".join(map(str, path))
    with pytest.raises(BadIndex, match=f"does not hold at {place}.*flaneur train"):
        ChoiceModel.from_json(changed(model, *path, value=value))


@pytest.mark.parametrize("key", ["n_joined", "ranges", "left_out", "index_digest"])
def test_a_missing_key_is_named(model: ChoiceModel, key: str) -> None:
    content = json.loads(model.to_json())
    del content[key]
    with pytest.raises(BadIndex, match=f"does not hold at {key}: Field required"):
        ChoiceModel.from_json(json.dumps(content))


@pytest.mark.parametrize("text", ["", "[]", "{", '{"form": 1}', "\N{ESCAPE}"])
def test_what_is_no_model_is_refused(text: str) -> None:
    with pytest.raises(BadIndex, match="adaptive model"):
        ChoiceModel.from_json(text)


def test_no_infinity_passes_for_a_number(model: ChoiceModel) -> None:
    text = model.to_json().replace('"level": 0.0', '"level": Infinity')
    assert "Infinity" in text
    with pytest.raises(BadIndex, match="level"):
        ChoiceModel.from_json(text)


def test_coefficients_of_another_variant_or_other_candidates_are_refused(
    model: ChoiceModel,
) -> None:
    content = json.loads(model.to_json())
    for damage in (
        {"coefficients": content["coefficients"][1:]},
        {"coefficients": content["coefficients"][::-1]},
        {"coefficients": json.loads(a_model("intercept").to_json())["coefficients"]},
        {"variant": "intercept"},
    ):
        with pytest.raises(BadIndex, match="coefficients are not those of the variant"):
            ChoiceModel.from_json(json.dumps(content | damage))
    gain = json.loads(a_model("gain").to_json())
    with pytest.raises(BadIndex, match="coefficients are not those of the variant gain"):
        ChoiceModel.from_json(json.dumps(gain | {"fixed": gain["fixed"][:-1]}))


def test_ranges_that_are_missing_or_of_other_terms_are_refused(model: ChoiceModel) -> None:
    ranges = json.loads(model.to_json())["ranges"]
    for damaged in (ranges[:0], ranges[1:], ranges[::-1]):
        with pytest.raises(BadIndex, match="ranges are not of the terms of the variant eq1"):
            ChoiceModel.from_json(changed(model, "ranges", value=damaged))


def test_a_pair_of_a_detector_that_the_model_does_not_know_is_refused(model: ChoiceModel) -> None:
    with pytest.raises(BadIndex, match="adaptive model does not hold"):
        ChoiceModel.from_json(changed(model, "detectors", value=["hesaff", "mser"]))


def test_the_summary_says_what_it_is_worth_beside_its_controls(model: ChoiceModel) -> None:
    said = model.summary()
    assert said == (
        "20 queries, each with its place left out: chosen (eq1) mAP 0.400, best fixed pair 0.360 "
        "(difference +0.040 [-0.010, +0.090]), random 0.330, oracle 0.560; 4 different choices; "
        "best for all: hesaff-star with k = 5"
    )
    unsure = model.left_out.gain.model_copy(update={"low": None})
    left_out = model.left_out.model_copy(update={"gain": unsure})
    other = model.model_copy(update={"n_joined": 2, "left_out": left_out}).summary()
    assert "chosen (eq1, the two best joined) mAP 0.400" in other
    assert "(difference +0.040)" in other
