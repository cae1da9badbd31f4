"""What late fusion of finished rankings does: by hand, and against a slow, obvious oracle."""

from collections.abc import Callable, Sequence
from statistics import median, pstdev

import numpy as np
import pytest

from contracts.errors import WrongInput
from retrieval.fusion import Scores, full_ranking
from retrieval.late_fusion import (
    LATE_FUSIONS,
    borda,
    comb_mnz,
    comb_sum,
    reciprocal_rank,
    standardised,
    standardised_sum,
)

Fusion = Callable[[Sequence[Scores]], Scores]
EACH = pytest.mark.parametrize("fuse", LATE_FUSIONS.values(), ids=LATE_FUSIONS.keys())


def system(*values: float | None) -> Scores:
    """Scores of a few images; None: not touched."""
    return Scores(
        np.array([0.0 if value is None else value for value in values]),
        np.array([value is not None for value in values]),
    )


def random_system(rng: np.random.Generator, n_images: int) -> Scores:
    """Scores with ties, negative values and untouched images."""
    touched = rng.random(n_images) < rng.random()
    return Scores(np.where(touched, rng.integers(-3, 6, n_images), 0.0), touched)


def slow_points(name: str, one: Scores, image: int) -> float:
    """What one system gives one image, from the definitions, counting images one by one."""
    n_images = len(one.values)
    found = [other for other in range(n_images) if one.touched[other]]
    if name in {"comb_sum", "comb_mnz"}:
        if image not in found:
            return 0.0
        lowest, highest = (
            extreme([one.values[other] for other in found]) for extreme in (min, max)
        )
        return 1.0 if lowest == highest else (one.values[image] - lowest) / (highest - lowest)
    before = [other for other in found if (-one.values[other], other) < (-one.values[image], image)]
    place = len(before) + 1
    if name == "reciprocal_rank":
        return 1 / (60 + place) if image in found else 0.0
    if image in found:
        return n_images - place + 1
    return sum(range(1, n_images - len(found) + 1)) / (n_images - len(found))


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("name", LATE_FUSIONS)
def test_each_fusion_is_what_its_definition_counts_up(name: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    n_images = int(rng.integers(1, 12))
    systems = [random_system(rng, n_images) for _ in range(int(rng.integers(1, 5)))]
    fused = LATE_FUSIONS[name](systems)
    for image in range(n_images):
        n_touching = sum(bool(one.touched[image]) for one in systems)
        points = sum(slow_points(name, one, image) for one in systems)
        if name == "comb_mnz":
            points *= n_touching
        assert fused.touched[image] == (n_touching > 0)
        assert fused.values[image] == pytest.approx(points if n_touching else 0.0)


def test_comb_sum_and_mnz_by_hand() -> None:
    systems = [system(10, 20, 15, None), system(-1, None, 3, None)]
    assert comb_sum(systems).values.tolist() == [0, 1, 1.5, 0]
    assert comb_mnz(systems).values.tolist() == [0, 1, 3, 0]


def test_borda_shares_the_points_left_among_untouched_images() -> None:
    fused = borda([system(5, None, 9, None, None), system(None, 1, None, None, None)])
    assert fused.values.tolist() == [4 + 2.5, 2 + 5, 5 + 2.5, 0, 0]
    assert fused.touched.tolist() == [True, True, True, False, False]


def test_reciprocal_rank_is_that_of_the_paper() -> None:
    fused = reciprocal_rank([system(0.5, 0.9, None), system(7, None, None)])
    assert fused.values == pytest.approx([1 / 62 + 1 / 61, 1 / 61, 0])


@EACH
def test_one_system_keeps_its_own_order(fuse: Fusion) -> None:
    one = system(3, None, -2, 8, 5, None)
    assert full_ranking(fuse([one])).tolist() == full_ranking(one).tolist()


@EACH
def test_systems_may_come_in_any_order(fuse: Fusion) -> None:
    systems = [system(3, None, 1, 8), system(1, 2, None, 4), system(None, None, 6, 5)]
    forward, backward = fuse(systems), fuse(systems[::-1])
    assert forward.values == pytest.approx(backward.values)


@EACH
def test_a_system_that_found_nothing_changes_no_ranking(fuse: Fusion) -> None:
    systems = [system(3, None, 1, 8), system(1, 2, None, 4)]
    nothing = system(None, None, None, None)
    assert (full_ranking(fuse([*systems, nothing])) == full_ranking(fuse(systems))).all()
    alone = fuse([nothing])
    assert not alone.touched.any()
    assert not alone.values.any()


@EACH
def test_all_equal_scores_still_put_touched_images_first(fuse: Fusion) -> None:
    fused = fuse([system(None, 4, 4, None)])
    assert full_ranking(fused).tolist() == [1, 2, 0, 3]
    assert (fused.values[1:3] > 0).all()


@EACH
def test_one_image_is_a_ranking(fuse: Fusion) -> None:
    fused = fuse([system(-3), system(2)])
    assert fused.touched.tolist() == [True]
    assert np.isfinite(fused.values).all()


@EACH
def test_systems_of_different_indexes_are_refused(fuse: Fusion) -> None:
    with pytest.raises(WrongInput, match=r"\[2, 3\] images"):
        fuse([system(1, 2), system(1, 2, 3)])
    with pytest.raises(WrongInput, match="no system"):
        fuse([])


def slow_standardised(one: Scores, image: int) -> float:
    """In deviations of the crowd above its median, by sorting and the statistics module."""
    values = sorted(one.values.tolist())
    n_right = min(10, len(values) // 4)
    crowd = values[: len(values) - n_right]
    above = float(one.values[image]) - float(median(values))
    deviation = float(pstdev(crowd))
    return above / deviation if deviation > 0 else above


@pytest.mark.parametrize("seed", range(20))
def test_standardised_scores_are_deviations_above_the_median_of_the_crowd(seed: int) -> None:
    rng = np.random.default_rng(seed)
    one = random_system(rng, int(rng.integers(1, 80)))
    found = standardised(one)
    np.testing.assert_array_equal(found.touched, one.touched)
    expected = [slow_standardised(one, image) for image in range(len(one.values))]
    assert found.values == pytest.approx(expected, abs=1e-12)


def test_standardising_by_hand() -> None:
    # Of eight values the two best are left out; the others deviate by 1 from their mean of 1.
    found = standardised(system(0, 2, 0, 2, 0, 2, 50, 90))
    assert found.values.tolist() == [-2, 0, -2, 0, -2, 0, 48, 88]


def test_what_the_best_ten_have_does_not_change_the_scale() -> None:
    rng = np.random.default_rng(0)
    values = rng.random(60)
    found = standardised(Scores(values, np.ones(60, dtype=np.bool_)))
    best = np.argsort(values)[-10:]
    higher = values.copy()
    higher[best] += 1000
    lifted = standardised(Scores(higher, np.ones(60, dtype=np.bool_)))
    others = np.setdiff1d(np.arange(60), best)
    np.testing.assert_array_equal(lifted.values[others], found.values[others])
    eleventh = others[np.argmax(values[others])]
    higher[eleventh] += 1
    assert not np.allclose(
        standardised(Scores(higher, np.ones(60, dtype=np.bool_))).values[others[:5]],
        found.values[others[:5]],
    )


@pytest.mark.parametrize("seed", range(10))
def test_joined_rankings_do_not_depend_on_the_scale_of_either(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = (Scores(rng.exponential(size=30), rng.random(30) < 0.9) for _ in range(2))
    joined = standardised_sum([a, b])
    scaled = standardised_sum([Scores(7 * a.values, a.touched), Scores(b.values / 9, b.touched)])
    assert joined.values == pytest.approx(scaled.values)
    swapped = standardised_sum([b, a])
    np.testing.assert_array_equal(joined.values, swapped.values)
    np.testing.assert_array_equal(joined.touched, a.touched | b.touched)
    assert joined.values == pytest.approx(standardised(a).values + standardised(b).values)


def test_a_crowd_without_spread_is_not_divided_by_it() -> None:
    assert standardised(system(3, 3, 3, 3)).values.tolist() == [0, 0, 0, 0]
    assert standardised(system(0, 0, 0, 0, 0, 0, 0, 5)).values.tolist() == [0] * 7 + [5]
    assert standardised(system(7)).values.tolist() == [0]
    nothing = Scores(np.zeros(0), np.zeros(0, dtype=np.bool_))
    assert len(standardised(nothing).values) == 0


def test_systems_of_different_indexes_have_no_standardised_sum() -> None:
    with pytest.raises(WrongInput, match=r"\[2, 3\] images"):
        standardised_sum([system(1, 2), system(1, 2, 3)])
    with pytest.raises(WrongInput, match="no system"):
        standardised_sum([])
