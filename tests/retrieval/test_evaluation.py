"""Scores of rankings that can be checked by hand, and against the published programs."""

from random import Random

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from contracts.errors import BadTruth
from retrieval.evaluation import (
    QueryResult,
    ap_at_10,
    average_precision,
    first_hit_rank,
    judge,
    judge_scores,
    summarise,
)
from retrieval.fusion import Scores, full_ranking


def published_oxford(ranked_list: list[int], pos: set[int], amb: set[int]) -> float:
    """The steps of compute_ap.cpp of the Oxford buildings set, with its names."""
    old_recall, old_precision, ap = 0.0, 1.0, 0.0
    intersect_size = j = 0
    for image in ranked_list:
        if image in amb:
            continue
        if image in pos:
            intersect_size += 1
        recall = intersect_size / len(pos)
        precision = intersect_size / (j + 1.0)
        ap += (recall - old_recall) * ((old_precision + precision) / 2.0)
        old_recall, old_precision = recall, precision
        j += 1
    return ap


def published_holidays(ranked_list: list[int], query: int, gt_results: set[int]) -> float:
    """The steps of holidays_map.py: ranks from 0, and the query shifts those after it."""
    tp_ranks, rank_shift = [], 0
    for rank, image in enumerate(ranked_list):
        if image == query:
            rank_shift = -1
        elif image in gt_results:
            tp_ranks.append(rank + rank_shift)
    ap, recall_step = 0.0, 1.0 / len(gt_results)
    for ntp, rank in enumerate(tp_ranks):
        precision_0 = 1.0 if rank == 0 else ntp / rank
        precision_1 = (ntp + 1) / (rank + 1)
        ap += (precision_1 + precision_0) * recall_step / 2.0
    return ap


@pytest.mark.parametrize(
    ("ranking", "relevant", "junk", "expected"),
    [
        # The first hit at rank 1: from P_0 = 1 to P_1 = 1 over the whole recall.
        ([1, 2, 3], {1}, set(), 1.0),
        # At rank 2 instead: P_1 = 0, P_2 = 1/2, so the trapezoid is (0 + 1/2)/2.
        ([2, 1, 3], {1}, set(), 1 / 4),
        # At rank 3: P_2 = 0, P_3 = 1/3.
        ([2, 3, 1], {1}, set(), 1 / 6),
        # Junk before the hit is as if it were not there; after it, it is no matter.
        ([2, 1, 3], {1}, {2}, 1.0),
        ([2, 1, 3], {1}, {3}, 1 / 4),
        ([9, 2, 8, 1, 3], {1, 3}, {8, 9}, (0 + 1 / 2) / 2 / 2 + (1 / 2 + 2 / 3) / 2 / 2),
        # Junk between two hits: without it the second stands at rank 2.
        ([1, 9, 3], {1, 3}, {9}, 1.0),
        # Hits at 1 and 3 of two: 1/2 * (1 + 1)/2 + 1/2 * (1/2 + 2/3)/2.
        ([1, 2, 3], {1, 3}, set(), 1 / 2 + (1 / 2 + 2 / 3) / 4),
        # Hits at 2, 3 and 6 of three: (0 + 1/2)/6 + (1/2 + 2/3)/6 + (2/5 + 3/6)/6.
        ([7, 1, 2, 8, 9, 3], {1, 2, 3}, set(), (1 / 2 + 7 / 6 + 9 / 10) / 6),
        # Never ranked: recall never reaches 1, and what is missing of it has no area.
        ([2, 3], {1}, set(), 0.0),
        ([], {1}, set(), 0.0),
        ([1], {1, 2}, set(), 1 / 2),
        ([3, 1], {1, 2}, set(), (0 + 1 / 2) / 2 / 2),
        # Nothing but junk is ranked.
        ([2, 3], {1}, {2, 3}, 0.0),
        # An image that is also junk, such as the query itself, is not asked for.
        ([2, 1], {1, 2}, {2}, 1.0),
    ],
)
def test_average_precision_by_hand(
    ranking: list[int], relevant: set[int], junk: set[int], expected: float
) -> None:
    assert average_precision(ranking, relevant, junk) == pytest.approx(expected)


IDS = range(25)


@st.composite
def rankings(draw: st.DrawFn) -> tuple[list[int], set[int], set[int]]:
    """A ranking of some of 25 images, the relevant ones and others that are junk."""
    ranking = draw(st.permutations(IDS))[: draw(st.integers(0, len(IDS)))]
    relevant = draw(st.sets(st.sampled_from(IDS), min_size=1, max_size=8))
    junk = draw(st.sets(st.sampled_from(IDS), max_size=8)) - relevant
    return ranking, relevant, junk


@given(rankings())
@example(([3, 1, 2], {1}, {3}))
@example(([0, 1, 2], {0, 24}, set()))
@example(([5, 6], {1}, {5, 6}))
def test_average_precision_equals_the_published_oxford_program(
    case: tuple[list[int], set[int], set[int]],
) -> None:
    ranking, relevant, junk = case
    expected = published_oxford(ranking, relevant, junk)
    assert average_precision(ranking, relevant, junk) == pytest.approx(expected, abs=1e-12)


@given(rankings(), st.sampled_from(IDS))
def test_average_precision_equals_the_published_holidays_program_with_the_query_as_junk(
    case: tuple[list[int], set[int], set[int]], query: int
) -> None:
    ranking, relevant, _ = case
    others = (relevant | {(query + 1) % len(IDS)}) - {query}
    expected = published_holidays(ranking, query, others)
    assert average_precision(ranking, others, {query}) == pytest.approx(expected, abs=1e-12)


@given(rankings(), st.randoms(use_true_random=False))
def test_only_the_order_of_what_is_not_junk_counts(
    case: tuple[list[int], set[int], set[int]], random: Random
) -> None:
    ranking, relevant, junk = case
    without = [image for image in ranking if image not in junk]
    shuffled = list(without)
    for image in junk:
        shuffled.insert(random.randint(0, len(shuffled)), image)
    assert average_precision(shuffled, relevant, junk) == average_precision(without, relevant)


def test_of_tied_images_the_caseorder_counts() -> None:
    assert average_precision([1, 2], {1}) == 1.0
    assert average_precision([2, 1], {1}) == 1 / 4


def test_the_published_oxford_program_counts_the_query_itself_and_we_do_not() -> None:
    query, other = 0, 1
    assert published_oxford([query, 5, 6, other], {query, other}, set()) == pytest.approx(
        1 / 2 + (1 / 3 + 1 / 2) / 4
    )
    assert average_precision([query, 5, 6, other], {query, other}, {query}) == pytest.approx(1 / 6)


def test_ap_at_10_looks_no_further_and_asks_for_no_more_than_ten() -> None:
    assert ap_at_10(range(30), set(range(30))) == pytest.approx(1.0)
    assert average_precision(range(10), set(range(30))) == pytest.approx(1 / 3)
    assert ap_at_10([*range(10), 99], {99}) == 0.0
    assert ap_at_10([50, *range(9), 99], {99}, junk={50}) == pytest.approx((0 + 1 / 10) / 2)


@pytest.mark.parametrize(("relevant", "junk"), [(set(), set()), ({1}, {1, 2})])
def test_a_query_without_a_relevant_image_has_no_score(relevant: set[int], junk: set[int]) -> None:
    for score in (average_precision, ap_at_10, first_hit_rank):
        with pytest.raises(BadTruth, match="exclude the query"):
            score([1, 2], relevant, junk)


def result(first: int | None, ap: float = 0.5, seconds: float = 1.0) -> QueryResult:
    return QueryResult("q", ap, ap / 2, first, 1, ("hesaff",), 2, seconds)


def test_the_first_hit_counts_no_junk_and_may_be_missing() -> None:
    assert first_hit_rank(np.array([5, 3, 8, 1]), {1, 8}, {3}) == 2
    assert first_hit_rank([5, 3], {1}) is None


def test_a_judged_query_holds_all_its_scores() -> None:
    got = judge("a.jpg", [4, 7, 9], {7, 8}, {4}, ("hesaff", "star"), 5, 0.25)
    assert got == QueryResult("a.jpg", 0.5, 0.5, 1, 2, ("hesaff", "star"), 5, 0.25)
    assert judge("a.jpg", [4], {7}, set(), ("orb",), 2, 0.1).first_hit_rank is None


@st.composite
def scored(draw: st.DrawFn) -> tuple[Scores, set[int], set[int]]:
    """Scores with ties, negative ones and untouched images; relevant and junk may overlap."""
    n_images = draw(st.integers(1, 25))
    values = draw(st.lists(st.integers(-2, 3), min_size=n_images, max_size=n_images))
    touched = np.array(draw(st.lists(st.booleans(), min_size=n_images, max_size=n_images)))
    ids = st.sampled_from(range(n_images))
    relevant, junk = draw(st.sets(ids, min_size=1, max_size=8)), draw(st.sets(ids, max_size=8))
    assume(relevant - junk)
    return Scores(np.where(touched, np.array(values, dtype=float), 0.0), touched), relevant, junk


@given(scored())
@example((Scores(np.zeros(4), np.zeros(4, dtype=np.bool_)), {3}, {0}))
@example((Scores(np.array([-1.0, 0.0]), np.array([True, False])), {1}, set()))
def test_scores_are_judged_as_the_ranking_that_they_make(
    case: tuple[Scores, set[int], set[int]],
) -> None:
    scores, relevant, junk = case
    whole = judge("q", full_ranking(scores), relevant, junk, ("hesaff",), 2, 0.0)
    found = judge_scores(scores, relevant, junk)
    assert (found.ap, found.ap_10, found.first_hit_rank) == (
        whole.ap,
        whole.ap_10,
        whole.first_hit_rank,
    )


def test_of_tied_scores_the_lower_id_is_first_and_junk_is_not_counted() -> None:
    scores = Scores(np.array([5.0, 1.0, 1.0, 0.0]), np.array([True, True, True, False]))
    assert judge_scores(scores, {2}, set()).first_hit_rank == 3
    assert judge_scores(scores, {2}, {0, 3}).first_hit_rank == 2
    assert judge_scores(scores, {3}, {0}).first_hit_rank == 3
    with pytest.raises(BadTruth, match="exclude the query"):
        judge_scores(scores, {2}, {2})


def test_summary_averages_over_queries_and_counts_a_miss_as_nothing() -> None:
    summary = summarise(
        [result(1, 1.0, 3.0), result(5, 0.5), result(10, 0.5), result(None, 0.0)], n_excluded=2
    )
    assert summary.as_json() == {
        "mAP": 0.5,
        "mAP@10": 0.25,
        "R@1": 0.25,
        "R@5": 0.5,
        "R@10": 0.75,
        "MRR": pytest.approx((1 + 0.2 + 0.1) / 4),
        "seconds_per_query": 1.5,
        "n_queries": 4,
        "n_excluded": 2,
    }


def test_no_query_has_no_summary() -> None:
    with pytest.raises(BadTruth, match="3 were excluded"):
        summarise([], n_excluded=3)
