"""Scores of rankings that can be checked by hand, and against the protocol's own program."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from contracts.errors import BadTruth
from retrieval.evaluation import (
    QueryResult,
    ap_at_10,
    average_precision,
    first_hit_rank,
    judge,
    summarise,
)


def oxford(ranking: list[int], relevant: set[int], junk: set[int]) -> float:
    """compute_ap.cpp of the Oxford buildings set, line by line."""
    old_recall, old_precision, ap, found, counted = 0.0, 1.0, 0.0, 0, 0
    for image in ranking:
        if image in junk:
            continue
        found += image in relevant
        recall, precision = found / len(relevant), found / (counted + 1)
        ap += (recall - old_recall) * ((old_precision + precision) / 2)
        old_recall, old_precision = recall, precision
        counted += 1
    return ap


@pytest.mark.parametrize(
    ("ranking", "relevant", "junk", "expected"),
    [
        ([1, 2, 3], {1}, set(), 1.0),
        ([2, 1, 3], {1}, set(), 0.25),
        ([2, 1, 3], {1}, {2}, 1.0),
        ([1, 2, 3], {1, 3}, set(), 0.5 + 0.5 * (1 / 2 + 2 / 3) / 2),
        ([2, 3], {1}, set(), 0.0),
        ([1], {1, 2}, set(), 0.5),
        ([1, 2], {1, 2}, {2}, 1.0),
    ],
)
def test_average_precision_by_hand(
    ranking: list[int], relevant: set[int], junk: set[int], expected: float
) -> None:
    assert average_precision(ranking, relevant, junk) == pytest.approx(expected)


@given(
    st.permutations(range(15)),
    st.sets(st.integers(0, 7), min_size=1),
    st.sets(st.integers(8, 14)),
)
def test_average_precision_equals_the_protocols_program(
    ranking: list[int], relevant: set[int], junk: set[int]
) -> None:
    assert average_precision(ranking, relevant, junk) == pytest.approx(
        oxford(ranking, relevant, junk)
    )


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
