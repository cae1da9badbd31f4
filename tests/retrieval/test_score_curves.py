"""What score curves say of rankings, and late fusion that listens to them."""

from collections.abc import Collection

import numpy as np
import pytest

from contracts.errors import WrongInput
from retrieval.fusion import Scores, full_ranking
from retrieval.score_curves import (
    CurveFeatures,
    Reference,
    agreement,
    curve_features,
    query_adaptive,
    reference_curves,
    sorted_curve,
    weights,
)

N_IMAGES = 200
EDGES = [
    ("no image", [], []),
    ("nothing touched", [0.0, 0.0, 0.0], [False, False, False]),
    ("one image", [5.0], [True]),
    ("one image, negative", [-5.0], [True]),
    ("one touched of many", [0.0, 5.0, 0.0], [False, True, False]),
    ("constant", [2.0, 2.0, 2.0], [True, True, True]),
    ("zeros", [0.0, 0.0, 0.0], [True, True, True]),
    ("negative", [-3.0, -1.0, -2.0], [True, True, True]),
    ("negative and untouched", [-3.0, 0.0, -2.0], [True, False, True]),
    ("mean of zero", [1.0, -1.0], [True, True]),
    ("tiny and huge", [1e-320, -1e300, 1e300], [True, True, True]),
    ("barely unequal", [1.0, 1.0 + 1e-16, 1.0 - 1e-16], [True, True, True]),
]
AT_THE_EDGE = pytest.mark.parametrize(
    "scores",
    [Scores(np.array(values), np.array(touched, dtype=np.bool_)) for _, values, touched in EDGES],
    ids=[name for name, _, _ in EDGES],
)


def all_touched(*values: float) -> Scores:
    return Scores(np.array(values), np.ones(len(values), dtype=np.bool_))


def ranking(*ids: int, n_images: int = 30) -> Scores:
    """Scores that put these ids first, in this order, and touch nothing else."""
    values = np.zeros(n_images)
    values[list(ids)] = np.arange(len(ids), 0, -1)
    return Scores(values, values > 0)


def query(seed: int, right: Collection[int], strength: float, n_keypoints: float = 1.0) -> Scores:
    """Scores of a declining crowd of wrong images and some right ones `strength` above them."""
    rng = np.random.default_rng(seed)
    values = 1.0 + rng.gamma(4.0, 0.1, N_IMAGES)
    values[list(right)] += strength
    return Scores(values * n_keypoints, np.ones(N_IMAGES, dtype=np.bool_))


def references(first_seed: int, n: int = 12) -> Reference:
    """Curves of other queries, whose right images 0 and 1 were left out."""
    others = [query(first_seed + at, (0, 1), 2.0) for at in range(n)]
    return reference_curves(others, [(0, 1)] * n, n_curve=100)


def slow_weights(curves: list[np.ndarray], sets: list[Reference], n_nearest: int) -> list[float]:
    """Zheng et al.'s equations 2 to 4, number by number."""
    areas = []
    for curve, reference in zip(curves, sets, strict=True):
        start = min(10, len(curve) // 2)
        by_tail = sorted(
            reference.curves.tolist(),
            key=lambda other: sum((other[at] - curve[at]) ** 2 for at in range(start, len(curve))),
        )[:n_nearest]
        mean = [sum(column) / len(by_tail) for column in zip(*by_tail, strict=True)]
        above = [mine - theirs for mine, theirs in zip(curve, mean, strict=True)]
        scaled = [(one - min(above)) / (max(above) - min(above)) for one in above]
        areas.append(sum(scaled) / len(scaled))
    total = sum(1 / area for area in areas)
    return [1 / area / total for area in areas]


def test_a_curve_is_sorted_cut_and_free_of_scale() -> None:
    curve = sorted_curve(all_touched(1, 4, 2, 0.5), 3)
    assert curve == pytest.approx(np.array([4, 2, 1]) / np.sqrt(21))
    assert sorted_curve(all_touched(10, 40, 20, 5), 3) == pytest.approx(curve)


def test_a_short_curve_goes_on_with_untouched_images() -> None:
    touched = np.array([True, False, True])
    assert sorted_curve(Scores(np.array([4.0, 0, 3]), touched), 5) == pytest.approx(
        [0.8, 0.6, 0, 0, 0]
    )
    assert sorted_curve(Scores(np.array([1.0, 0, -3]), touched), 5) == pytest.approx(
        [1, 0, 0, 0, 0]
    )


@AT_THE_EDGE
def test_a_curve_descends_to_no_less_than_zero_for_any_scores(scores: Scores) -> None:
    curve = sorted_curve(scores, 4)
    assert np.isfinite(curve).all()
    assert (np.diff(curve) <= 0).all()
    assert curve[-1] >= 0
    assert np.linalg.norm(curve) == pytest.approx(1.0) or not curve.any()


def test_reference_curves_leave_the_right_answers_out() -> None:
    made = reference_curves([all_touched(9, 4, 3, 8), all_touched(1, 2, 3, 4)], [(0, 3), ()], 2)
    assert made.curves == pytest.approx(np.array([[0.8, 0.6], [0.8, 0.6]]))


def test_a_query_that_found_only_its_answers_gives_no_reference() -> None:
    only = Scores(np.array([5.0, 0, 0]), np.array([True, False, False]))
    made = reference_curves([only, all_touched(1, 4, 3)], [(0,), (0,)], 2)
    assert made.curves == pytest.approx(np.array([[0.8, 0.6]]))
    with pytest.raises(WrongInput, match="none of 1 queries"):
        reference_curves([only], [(0,)], 2)


@pytest.mark.parametrize("n_nearest", [1, 3, 50])
@pytest.mark.parametrize("n_curve", [8, 100])
def test_weights_are_those_of_the_equations(n_curve: int, n_nearest: int) -> None:
    curves = [sorted_curve(query(seed, (4,), seed / 3), n_curve) for seed in range(3)]
    sets = [
        reference_curves([query(90 + 9 * s + at, (), 0) for at in range(6)], [()] * 6, n_curve)
        for s in range(3)
    ]
    assert weights(curves, sets, n_nearest) == pytest.approx(slow_weights(curves, sets, n_nearest))


def test_the_system_whose_best_answers_stand_out_weighs_more() -> None:
    for seed in range(20):
        sure = query(seed, (4, 5), 2.0, n_keypoints=300)
        guess = query(seed + 50, (), 0.0, n_keypoints=7000)
        curves = [sorted_curve(one, 100) for one in (sure, guess)]
        weighed = weights(curves, [references(200), references(300)])
        assert weighed[0] > 1.5 * weighed[1]


def test_the_sure_system_leads_the_fused_ranking() -> None:
    sure, guess = query(1, (4, 5), 2.0), query(2, (80,), 0.9)
    fused = query_adaptive([sure, guess], [references(200), references(300)])
    assert sorted(full_ranking(fused)[:2].tolist()) == [4, 5]


def test_systems_alike_in_every_way_weigh_the_same() -> None:
    curve, reference = sorted_curve(query(1, (4,), 1.0), 100), references(200)
    assert weights([curve] * 4, [reference] * 4) == pytest.approx([0.25] * 4)


def test_a_difference_that_is_constant_has_the_largest_area() -> None:
    """Areas 1/4 and 1: the one rank that stands out, and none."""
    curve = np.array([0.8, 0.6, 0.0, 0.0])
    lower, same = Reference(np.array([[0.5, 0.6, 0.0, 0.0]])), Reference(curve[np.newaxis])
    assert weights([curve, curve], [lower, same]) == pytest.approx([0.8, 0.2])


def test_the_product_is_that_of_powers() -> None:
    systems = [query(1, (4,), 1.0), query(2, (5,), 0.3)]
    sets = [references(200), references(300)]
    w = weights([sorted_curve(one, 100) for one in systems], sets)
    product = systems[0].values ** w[0] * systems[1].values ** w[1]
    fused = query_adaptive(systems, sets)
    assert fused.values / fused.values[0] == pytest.approx(product / product[0])


def test_an_image_that_one_system_missed_comes_late_but_before_the_untouched() -> None:
    first = Scores(np.array([5.0, 4, 3, 0, 0, 0]), np.array([1, 1, 1, 0, 0, 0], dtype=np.bool_))
    second = Scores(np.array([0.0, 1, 2, 3, 0, 0]), np.array([0, 1, 1, 1, 0, 0], dtype=np.bool_))
    reference = Reference(sorted_curve(all_touched(3, 2, 1), 3)[np.newaxis])
    fused = query_adaptive([first, second], [reference, reference])
    assert set(full_ranking(fused)[:2].tolist()) == {1, 2}
    assert fused.touched.tolist() == [True, True, True, True, False, False]
    assert full_ranking(fused)[4:].tolist() == [4, 5]
    assert fused.values[4:].tolist() == [0, 0]


def test_a_system_that_found_nothing_has_no_say() -> None:
    nothing = Scores(np.zeros(N_IMAGES), np.zeros(N_IMAGES, dtype=np.bool_))
    one, reference = query(1, (4,), 1.0), references(200)
    fused = query_adaptive([nothing, one], [reference, reference])
    assert full_ranking(fused).tolist() == full_ranking(one).tolist()
    assert not query_adaptive([nothing, nothing], [reference, reference]).touched.any()
    empty, curve = sorted_curve(nothing, 100), sorted_curve(one, 100)
    assert weights([empty, curve], [reference, reference]).tolist() == [0, 1]
    assert weights([empty, empty], [reference, reference]).tolist() == [0.5, 0.5]


@AT_THE_EDGE
def test_fusing_any_scores_gives_a_number_for_every_image(scores: Scores) -> None:
    reference = Reference(np.array([[0.8, 0.6, 0.0, 0.0]]))
    fused = query_adaptive([scores, scores], [reference, reference])
    assert (fused.touched == scores.touched).all()
    assert ((fused.values >= 0) & (fused.values <= 1)).all()
    assert (fused.values[fused.touched] > 0).all()


def test_negative_scores_keep_their_order() -> None:
    below = all_touched(-5, -1, -3, -2)
    reference = Reference(np.array([[0.8, 0.6, 0.0, 0.0]]))
    assert full_ranking(query_adaptive([below], [reference])).tolist() == [1, 3, 2, 0]


def test_features_by_hand() -> None:
    scores = all_touched(2, 20, 4, 6, 3, 5, 0, 7, 8, 9, 10, 12)
    top = np.array([20, 12, 10, 9, 8, 7, 6, 5, 4, 3, 2, 0])
    assert curve_features(scores).as_tuple() == pytest.approx(
        (
            20,
            (20 - 12) / 20,
            (20 - 64 / 9) / 20,
            (20 - 6.5) / top.std(),
            top.mean() / 20,
            (59 / 5 - top.mean()) / top.mean(),
        )
    )


def test_features_see_the_first_n_and_but_for_the_best_no_scale() -> None:
    rng = np.random.default_rng(1)
    values = rng.random(500)
    cut = all_touched(*np.sort(values)[-100:])
    whole, scaled = all_touched(*values), all_touched(*(values * 64))
    assert curve_features(whole) == curve_features(cut)
    assert curve_features(scaled).as_tuple()[1:] == curve_features(whole).as_tuple()[1:]
    assert curve_features(scaled).best == 64 * curve_features(whole).best


def test_features_tell_a_sure_answer_from_a_guess() -> None:
    sure, guess = curve_features(query(1, (4,), 3.0)), curve_features(query(1, (), 0.0))
    assert sure.second_gap > guess.second_gap
    assert sure.mean_gap > guess.mean_gap
    assert sure.z_score > guess.z_score
    assert sure.gain > guess.gain
    assert sure.area < guess.area


@AT_THE_EDGE
def test_features_are_finite_for_any_scores(scores: Scores) -> None:
    assert np.isfinite(curve_features(scores).as_tuple()).all()


def test_a_ranking_without_an_answer_looks_as_bad_as_can_be() -> None:
    nothing = Scores(np.zeros(3), np.zeros(3, dtype=np.bool_))
    assert curve_features(nothing) == CurveFeatures(0, 0, 0, 0, 1, 0)


def test_agreement_by_hand() -> None:
    """Overlaps 0/1, 2/2 and 2/3 at depths 1 to 3, weights 1, 0.9 and 0.81."""
    by_hand = (0.9 * 1 + 0.81 * 2 / 3) / (1 + 0.9 + 0.81)
    assert agreement(ranking(7, 3, 9), ranking(3, 7, 8), 3) == pytest.approx(by_hand)


@pytest.mark.parametrize("seed", range(20))
def test_agreement_is_the_sum_over_depths_of_shared_answers(seed: int) -> None:
    rng = np.random.default_rng(seed)
    first, second = (rng.permutation(14)[: int(rng.integers(1, 14))].tolist() for _ in range(2))
    depths = range(1, min(10, max(len(first), len(second))) + 1)
    shares = [len(set(first[:d]) & set(second[:d])) / d for d in depths]
    ps = [0.9 ** (d - 1) for d in depths]
    slow = sum(p * share for p, share in zip(ps, shares, strict=True)) / sum(ps)
    a, b = ranking(*first), ranking(*second)
    assert agreement(a, b) == pytest.approx(slow)
    assert agreement(b, a) == agreement(a, b)


def test_agreement_is_one_with_itself_and_nothing_with_nothing() -> None:
    some, other, none = ranking(3, 1, 2), ranking(4, 5), ranking()
    assert agreement(some, some) == 1.0
    assert agreement(some, other) == 0.0
    assert agreement(some, none) == 0.0
    assert agreement(none, none) == 0.0


def test_agreement_counts_the_first_answers_most() -> None:
    same_head, same_tail = ranking(1, 2, 3, 8, 9), ranking(8, 9, 3, 4, 5)
    assert agreement(ranking(1, 2, 3, 4, 5), same_head) > agreement(
        ranking(1, 2, 3, 4, 5), same_tail
    )


def test_what_does_not_fit_together_is_refused() -> None:
    one, reference = query(1, (4,), 1.0), references(200)
    with pytest.raises(WrongInput, match="2 systems came with references for 1"):
        query_adaptive([one, one], [reference])
    with pytest.raises(WrongInput, match="0 systems"):
        weights([], [])
    with pytest.raises(WrongInput, match=r"shape \(50,\).*\(12, 100\)"):
        weights([sorted_curve(one, 50)], [reference])
    with pytest.raises(WrongInput, match="n_nearest is 0"):
        weights([sorted_curve(one, 100)], [reference], 0)
    with pytest.raises(WrongInput, match="it needs 2 or more"):
        sorted_curve(one, 1)
    with pytest.raises(WrongInput, match="1 queries' scores came with 2 sets"):
        reference_curves([one], [(), ()])
    with pytest.raises(WrongInput, match="3 to 200 do not fit scores of 200 images"):
        reference_curves([one], [(3, 200)])
