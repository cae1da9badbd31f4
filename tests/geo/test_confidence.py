"""How sure an estimate is said to be."""

import json
import math
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from contracts.errors import BadIndex, WrongInput
from geo.confidence import CROWDING, DENSITY, Evidence, PlacingModel, TrainingSet, prominence

MODEL = PlacingModel(
    present=(-6.0, 5.0),
    least_confidence=0.6,
    right=(-4.0, 9.0),
    error_m=(2.0, 4.0, 6.0, 8.0, 20.0),
    error_slope=-0.5,
    prominences=(0.8, 2.0),
    trained_on=(TrainingSet(set="made", n_of_survey=2, n_of_others=2, n_places=2),),
)
SURE, LOST = Evidence(2.0, 1.0), Evidence(0.9, 0.2)
STREET_M = np.linspace(0.0, 500.0, 251)

evidences = st.builds(Evidence, st.none() | st.floats(-3, 30, allow_nan=False), st.floats(0.0, 1.0))
distances = st.lists(st.floats(0.0, 1e5), min_size=1, max_size=30)


@given(evidences, distances)
@settings(max_examples=80, deadline=None)
def test_the_wider_radius_holds_the_narrower(evidence: Evidence, away_m: list[float]) -> None:
    found = MODEL.certainty(evidence, away_m)
    assert 0.0 <= found.radius_68_m <= found.radius_95_m
    assert found.radius_95_m <= max(*away_m, float(MODEL.right_errors_m(evidence).max()))


@given(evidences, distances, st.randoms())
@settings(max_examples=40, deadline=None)
def test_the_order_of_the_cameras_does_not_matter(
    evidence: Evidence, away_m: list[float], random: Random
) -> None:
    shuffled = list(away_m)
    random.shuffle(shuffled)
    assert MODEL.certainty(evidence, away_m) == MODEL.certainty(evidence, shuffled)


@given(st.floats(0.5, 0.99), st.floats(0.0, 1.0))
@settings(max_examples=40, deadline=None)
def test_a_radius_holds_its_share_of_draws_from_the_mixture(share: float, agreed: float) -> None:
    evidence = Evidence(1.3, agreed)
    radius_m = MODEL.radius_m(share, evidence, STREET_M)
    right = (MODEL.right_errors_m(evidence) <= radius_m).mean()
    elsewhere = (radius_m >= STREET_M).mean()
    probability = MODEL.probability_right(evidence)
    held = probability * right + (1.0 - probability) * elsewhere
    assert held >= share - 1e-6
    # The least such radius: the next shorter distance would hold too little.
    assert held - share <= probability / 5 + (1.0 - probability) / 251 + 1e-6


def test_an_answer_that_may_be_wrong_has_the_radius_of_the_survey() -> None:
    sure, lost = (MODEL.certainty(each, STREET_M) for each in (SURE, LOST))
    assert sure.radius_95_m < 20.0
    assert lost.radius_95_m > 400.0
    larger = MODEL.certainty(LOST, STREET_M * 10.0)
    assert larger.radius_95_m == pytest.approx(10.0 * lost.radius_95_m)


def test_a_more_prominent_answer_is_nearer_until_training_ends() -> None:
    radii = [
        MODEL.radius_m(0.68, Evidence(each, 1.0), STREET_M) for each in (0.1, 0.8, 1.4, 2.0, 9.0)
    ]
    assert radii[0] == radii[1] > radii[2] > radii[3] == radii[4]


def test_confidence_is_half_where_the_log_odds_are_nought() -> None:
    assert MODEL.confidence(Evidence(1.2, 0.5)) == 0.5
    assert MODEL.confidence(Evidence(1e6, 0.5)) == 1.0
    assert MODEL.confidence(Evidence(-1e6, 0.5)) == 0.0


def test_below_the_least_confidence_a_photo_is_not_of_the_survey() -> None:
    below, above = (MODEL.certainty(Evidence(each, 1.0), [1.0]) for each in (1.25, 1.3))
    assert below.confidence is not None
    assert 0.5 < below.confidence < 0.6
    assert (below.in_survey, above.in_survey) == (False, True)


def test_a_survey_too_small_to_tell_gives_no_verdict_and_wide_radii() -> None:
    assert prominence(3.0, 29, DENSITY) is None
    found = MODEL.certainty(Evidence(None, 1.0), [5.0])
    assert (found.confidence, found.in_survey) == (None, None)
    assert found.radius_68_m == MODEL.certainty(Evidence(0.8, 1.0), [5.0]).radius_68_m


def test_errors_of_the_surveys_own_positions_are_added() -> None:
    exact, rough = (MODEL.certainty(SURE, STREET_M, error_m) for error_m in (0.0, 12.0))
    assert rough.radius_68_m == pytest.approx(math.hypot(exact.radius_68_m, 12.0))
    # Of a round normal distribution 95 % lie within 2.4477 sigma, 68 % within 1.5096.
    assert rough.radius_95_m == pytest.approx(
        math.hypot(exact.radius_95_m, 12.0 * 2.4477 / 1.5096), rel=1e-4
    )


@pytest.mark.parametrize("n_images", [100, 1_000, 100_000])
def test_the_best_of_many_unrelated_images_has_a_prominence_of_one(n_images: int) -> None:
    """Exponential scores: the median of the best is ln n + 0.37, Gumbel's law."""
    rng = np.random.default_rng(3)
    found = []
    for _ in range(25):
        scores = rng.exponential(size=n_images)
        z_score = float((scores.max() - np.median(scores)) / scores.std())
        best = prominence(z_score, n_images, DENSITY)
        assert best is not None
        found.append(best)
    assert np.median(found) == pytest.approx(1.0, abs=0.13)


def test_among_crowded_words_the_same_height_stands_out_more() -> None:
    thin, crowded = (prominence(6.0, 200, density) for density in (DENSITY, 3.0 * DENSITY))
    assert thin is not None
    assert crowded == pytest.approx(thin * 3.0**CROWDING)


@pytest.mark.parametrize("away_m", [[], [-1.0], [math.nan], [1.0, math.inf]])
def test_a_wrong_distance_is_refused(away_m: list[float]) -> None:
    with pytest.raises(WrongInput, match="finite distances"):
        MODEL.certainty(SURE, away_m)


def test_a_model_is_read_back_as_it_was_written() -> None:
    assert PlacingModel.from_json(MODEL.to_json()) == MODEL


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("present", [1.0]),
        ("least_confidence", 1.5),
        ("error_m", []),
        ("error_m", [3.0, 2.0]),
        ("error_m", [-1.0, 2.0]),
        ("error_slope", 0.5),
        ("prominences", [2.0, 1.0]),
        ("right", ["-4.0", 9.0]),
        ("form", 2),
        ("surplus", 1),
    ],
)
def test_a_damaged_model_is_refused(key: str, value: object) -> None:
    content = json.loads(MODEL.to_json()) | {key: value}
    with pytest.raises(BadIndex, match="model of certainty does not hold"):
        PlacingModel.from_json(json.dumps(content))


def test_a_truncated_model_is_refused() -> None:
    with pytest.raises(BadIndex, match="its beginning"):
        PlacingModel.from_json(MODEL.to_json()[:-9])


def test_a_model_cannot_be_changed() -> None:
    with pytest.raises(ValidationError, match="frozen"):
        MODEL.least_confidence = 0.1  # type: ignore[misc]
