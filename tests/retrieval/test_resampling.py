"""Bootstrap intervals: against a slow loop, where theory knows the answer, and at the edges."""

import numpy as np
import pytest

from contracts.errors import WrongInput
from retrieval import resampling
from retrieval.resampling import (
    Interval,
    bootstrap_difference,
    bootstrap_mean,
    bootstrap_ratio,
    weighted_mean,
)


def slow_interval(
    above: np.ndarray, below: np.ndarray, groups: list[int], n_resamples: int
) -> tuple[float, float]:
    """Draw whole groups, copy their members into a list, divide the sums; 95 % of that."""
    rng = np.random.default_rng(99)
    labels = sorted(set(groups))
    statistics = []
    for _ in range(n_resamples):
        drawn = []
        for label in rng.choice(labels, len(labels)):
            drawn += [at for at, group in enumerate(groups) if group == label]
        statistics.append(sum(above[drawn]) / sum(below[drawn]))
    statistics.sort()
    return statistics[int(0.025 * n_resamples)], statistics[int(0.975 * n_resamples)]


def test_intervals_are_those_of_a_slow_loop_over_whole_groups() -> None:
    rng = np.random.default_rng(1)
    groups = [0, 0, 0, 0, 1, 2, 2, 3, 4, 4, 5, 6, 6, 6, 7]
    values = rng.random(15) + np.array(groups) / 4
    below = rng.random(15) + 0.5
    slow = slow_interval(values, np.ones(15), groups, 3000)
    fast = bootstrap_mean(values, groups)
    assert (fast.low, fast.high) == pytest.approx(slow, abs=0.04)
    assert fast.mean == pytest.approx(values.mean())
    slow = slow_interval(values, below, groups, 3000)
    ratio = bootstrap_ratio(values, below, groups)
    assert (ratio.low, ratio.high) == pytest.approx(slow, abs=0.05)
    assert ratio.mean == pytest.approx(values.sum() / below.sum())


def test_the_interval_of_many_independent_values_is_the_normal_one() -> None:
    values = np.random.default_rng(2).normal(3.0, 2.0, 400)
    interval = bootstrap_mean(values)
    half = 1.96 * values.std() / np.sqrt(400)
    assert interval.low == pytest.approx(values.mean() - half, abs=0.02)
    assert interval.high == pytest.approx(values.mean() + half, abs=0.02)


def test_about_nineteen_intervals_in_twenty_hold_the_true_mean() -> None:
    rng = np.random.default_rng(3)
    held = 0
    for seed in range(300):
        interval = bootstrap_mean(rng.normal(1.0, 1.0, 40), n_resamples=500, seed=seed)
        held += interval.low <= 1.0 <= interval.high
    assert 0.89 <= held / 300 <= 0.98


def test_queries_of_one_place_do_not_count_as_independent() -> None:
    """Forty copies of each place: the interval must be that of the places, not of the copies."""
    places = np.random.default_rng(4).random(12)
    copied, labels = np.repeat(places, 40), np.repeat(np.arange(12), 40)
    grouped, alone = bootstrap_mean(copied, labels), bootstrap_mean(places)
    assert (grouped.low, grouped.high) == pytest.approx((alone.low, alone.high))
    blind = bootstrap_mean(copied)
    assert blind.high - blind.low < (grouped.high - grouped.low) / 4


def test_groups_of_one_are_no_groups_and_labels_may_be_any_words() -> None:
    values = np.random.default_rng(5).random(9)
    assert bootstrap_mean(values, [f"place {at}" for at in range(9)]) == bootstrap_mean(values)


def test_constant_values_give_an_interval_of_no_width() -> None:
    values = np.full(7, 0.1)
    assert bootstrap_mean(values) == Interval(0.1, 0.1, 0.1)
    assert bootstrap_mean(values, [0, 0, 0, 1, 1, 2, 3]) == Interval(0.1, 0.1, 0.1)


def test_a_single_group_has_a_mean_but_no_interval() -> None:
    for interval in (
        bootstrap_mean(np.array([0.2, 0.4]), ["here", "here"]),
        bootstrap_mean(np.array([0.3])),
        bootstrap_ratio(np.array([0.3, 0.3]), np.array([1.0, 1.0]), ["here", "here"]),
    ):
        assert interval.mean == pytest.approx(0.3)
        assert np.isnan([interval.low, interval.high]).all()


def test_a_paired_difference_is_surer_than_its_two_parts() -> None:
    rng = np.random.default_rng(6)
    hard = rng.random(60)
    a, b = hard + 0.05, hard + rng.normal(0, 0.01, 60)
    paired = bootstrap_difference(a, b)
    assert paired == bootstrap_mean(a - b)
    assert 0.04 < paired.low < paired.mean < paired.high < 0.06
    part = bootstrap_mean(a)
    assert part.high - part.low > 5 * (paired.high - paired.low)


def test_a_fixed_share_of_the_room_is_found_without_doubt() -> None:
    room = np.random.default_rng(7).random(30)
    share = bootstrap_ratio(0.25 * room, room)
    assert (share.mean, share.low, share.high) == pytest.approx((0.25, 0.25, 0.25))


def test_a_ratio_without_a_positive_denominator_is_not_a_number() -> None:
    for room in (np.zeros(4), np.array([0.1, -0.2, 0.0, 0.0])):
        share = bootstrap_ratio(np.ones(4), room)
        assert np.isnan([share.mean, share.low, share.high]).all()


def test_a_ratio_that_resamples_leave_undefined_has_no_bounds() -> None:
    """One query of four has room: (3/4)^4 of the resamples, a third, have none."""
    share = bootstrap_ratio(np.array([0.1, 0, 0, 0]), np.array([0.2, 0, 0, 0]))
    assert share == Interval(0.5, -np.inf, np.inf)


def test_rarely_undefined_resamples_leave_the_bounds_finite() -> None:
    """Half of twenty queries have room: one resample in a million has none."""
    room = np.tile([0.2, 0.0], 10)
    share = bootstrap_ratio(room / 2, room)
    assert (share.low, share.high) == pytest.approx((0.5, 0.5))


def test_the_same_seed_gives_the_same_interval_in_blocks_of_any_size(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    values = np.random.default_rng(8).random(50)
    whole = bootstrap_mean(values, n_resamples=999)
    assert bootstrap_mean(values, n_resamples=999) == whole
    assert bootstrap_mean(values, n_resamples=999, seed=1) != whole
    monkeypatch.setattr(resampling, "_BLOCK_DRAWS", 70)
    small = bootstrap_mean(values, n_resamples=999)
    assert (small.low, small.high) == pytest.approx((whole.low, whole.high))


def test_arguments_are_not_changed() -> None:
    values = np.arange(5.0)
    bootstrap_mean(values, [0, 0, 1, 1, 2])
    bootstrap_ratio(values, values, [0, 0, 1, 1, 2])
    assert values.tolist() == [0, 1, 2, 3, 4]


def test_what_cannot_be_resampled_is_refused() -> None:
    two = np.array([0.1, 0.2])
    with pytest.raises(WrongInput, match="shape"):
        bootstrap_mean(np.zeros(0))
    with pytest.raises(WrongInput, match=r"value 1 .* is nan"):
        bootstrap_mean(np.array([0.1, np.nan]))
    with pytest.raises(WrongInput, match="3 group labels"):
        bootstrap_mean(two, [1, 2, 3])
    with pytest.raises(WrongInput, match="n_resamples is 0"):
        bootstrap_mean(two, n_resamples=0)
    with pytest.raises(WrongInput, match="paired"):
        bootstrap_difference(two, np.zeros(3))
    with pytest.raises(WrongInput, match="paired"):
        bootstrap_ratio(two, np.zeros(3))


def test_a_weighted_mean_of_equal_values_is_sure_whatever_the_weights() -> None:
    values = np.full(59, 0.9)
    weights = np.array([1 / np.sqrt(50)] * 50 + [1 / 3] * 9)
    found = weighted_mean(values, weights)
    assert (found.mean, found.low, found.high) == pytest.approx((0.9, 0.9, 0.9))


def test_a_weighted_mean_divides_each_resample_by_what_it_drew() -> None:
    values, weights = np.array([0.0, 1.0]), np.array([1.0, 3.0])
    found = weighted_mean(values, weights)
    assert (found.mean, found.low, found.high) == pytest.approx((0.75, 0.0, 1.0))
