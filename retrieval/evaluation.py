"""Scores of rankings against a ground truth: METHOD section 5."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contracts.config import Detector
from contracts.errors import BadTruth
from retrieval.fusion import Scores

Ranking = Sequence[int] | NDArray[np.int64]
"""Image ids, best first."""


@dataclass(frozen=True, slots=True)
class QueryResult:
    """How well one query was answered.

    first_hit_rank : 1 = best, junk not counted; None if no relevant image was ranked.
    detectors, k : what was used. seconds : wall time of the search.
    choice : how detectors and k came to be; empty where nobody asked.
    """

    query: str
    ap: float
    ap_10: float
    first_hit_rank: int | None
    n_relevant: int
    detectors: tuple[Detector, ...]
    k: int
    seconds: float
    choice: str = ""


@dataclass(frozen=True, slots=True)
class Scored:
    """How well a ranking answers a query; fields as in `QueryResult`."""

    ap: float
    ap_10: float
    first_hit_rank: int | None


@dataclass(frozen=True, slots=True)
class Summary:
    """Means over queries. n_excluded : queries without a relevant image, not in any mean."""

    mean_ap: float
    mean_ap_10: float
    recall_1: float
    recall_5: float
    recall_10: float
    mrr: float
    seconds_per_query: float
    n_queries: int
    n_excluded: int

    def as_json(self) -> dict[str, float | int]:
        """Name the scores as `flaneur evaluate --json` prints them."""
        return {
            "mAP": self.mean_ap,
            "mAP@10": self.mean_ap_10,
            "R@1": self.recall_1,
            "R@5": self.recall_5,
            "R@10": self.recall_10,
            "MRR": self.mrr,
            "seconds_per_query": self.seconds_per_query,
            "n_queries": self.n_queries,
            "n_excluded": self.n_excluded,
        }


def average_precision(
    ranking: Ranking, relevant: Collection[int], junk: Collection[int] = ()
) -> float:
    """AP as the Oxford and Paris buildings protocol computes it (Philbin et al., CVPR 2007).

    The sum of (R_j - R_(j-1)) (P_j + P_(j-1)) / 2 with R_0 = 0 and P_0 = 1 over the ranking
    without junk, as their compute_ap.cpp has it. R_j = hits among the first j / all relevant
    images, ranked or not: where one is missing from the ranking R never reaches 1, and the area
    to the right of the last hit is 0. Between hits R stands still and nothing is added.

    Departures: the program divides by all images of the good and ok lists, here one that is
    also junk counts as junk only; and without a relevant image it divides by 0.

    Parameters
    ----------
    ranking : image ids, best first, each once; ties are settled by who ranks.
    relevant : image ids that answer the query; one that is also junk does not.
    junk : image ids taken out of the ranking: neither right nor wrong.

    Raises
    ------
    BadTruth : no relevant image is left.
    """
    wanted = _wanted(relevant, junk)
    return _area(_hits(ranking, wanted, junk), len(wanted))


def ap_at_10(ranking: Ranking, relevant: Collection[int], junk: Collection[int] = ()) -> float:
    """AP over the first ten, recall divided by min(10, number relevant).

    Raises
    ------
    BadTruth : no relevant image is left.
    """
    wanted = _wanted(relevant, junk)
    hits = [rank for rank in _hits(ranking, wanted, junk) if rank <= 10]
    return _area(hits, min(10, len(wanted)))


def first_hit_rank(
    ranking: Ranking, relevant: Collection[int], junk: Collection[int] = ()
) -> int | None:
    """Rank of the best relevant image, 1 = best, junk not counted; None if none was ranked.

    Raises
    ------
    BadTruth : no relevant image is left.
    """
    hits = _hits(ranking, _wanted(relevant, junk), junk)
    return hits[0] if hits else None


def judge(
    query: str,
    ranking: Ranking,
    relevant: Collection[int],
    junk: Collection[int],
    detectors: tuple[Detector, ...],
    k: int,
    seconds: float,
) -> QueryResult:
    """Score one query's ranking.

    Raises
    ------
    BadTruth : no relevant image is left.
    """
    wanted = _wanted(relevant, junk)
    scored = _scored(_hits(ranking, wanted, junk), len(wanted))
    return QueryResult(
        query=query,
        ap=scored.ap,
        ap_10=scored.ap_10,
        first_hit_rank=scored.first_hit_rank,
        n_relevant=len(wanted),
        detectors=detectors,
        k=k,
        seconds=seconds,
    )


def judge_scores(scores: Scores, relevant: Collection[int], junk: Collection[int]) -> Scored:
    """Score the ranking that `retrieval.fusion.full_ranking` makes, without making it.

    Raises
    ------
    BadTruth : no relevant image is left.
    """
    wanted = np.array(sorted(_wanted(relevant, junk)), dtype=np.int64)
    kept = np.ones(len(scores.values), dtype=np.bool_)
    kept[list(junk)] = False
    values = np.where(scores.touched, scores.values, -np.inf)[kept]
    ids = np.flatnonzero(kept)
    hits = [
        1 + int(np.count_nonzero((values > value) | ((values == value) & (ids < image))))
        for image, value in zip(
            wanted, np.where(scores.touched, scores.values, -np.inf)[wanted], strict=True
        )
    ]
    return _scored(sorted(hits), len(wanted))


def summarise(results: Sequence[QueryResult], n_excluded: int = 0) -> Summary:
    """Average over queries; R@n is the share of queries with a hit in the first n.

    Raises
    ------
    BadTruth : there is no query.
    """
    if not results:
        raise BadTruth(
            f"no query with a relevant image is left to average ({n_excluded} were excluded); "
            "check the ground truth"
        )
    n_queries = len(results)
    firsts = [result.first_hit_rank for result in results if result.first_hit_rank is not None]
    return Summary(
        mean_ap=sum(result.ap for result in results) / n_queries,
        mean_ap_10=sum(result.ap_10 for result in results) / n_queries,
        recall_1=sum(rank <= 1 for rank in firsts) / n_queries,
        recall_5=sum(rank <= 5 for rank in firsts) / n_queries,
        recall_10=sum(rank <= 10 for rank in firsts) / n_queries,
        mrr=sum(1 / rank for rank in firsts) / n_queries,
        seconds_per_query=sum(result.seconds for result in results) / n_queries,
        n_queries=n_queries,
        n_excluded=n_excluded,
    )


def _wanted(relevant: Collection[int], junk: Collection[int]) -> set[int]:
    wanted = set(relevant) - set(junk)
    if not wanted:
        raise BadTruth(
            f"a query has {len(set(relevant))} relevant images, none of which is not junk; "
            "AP needs at least one: exclude the query"
        )
    return wanted


def _scored(hits: Sequence[int], n_relevant: int) -> Scored:
    return Scored(
        ap=_area(hits, n_relevant),
        ap_10=_area([rank for rank in hits if rank <= 10], min(10, n_relevant)),
        first_hit_rank=hits[0] if hits else None,
    )


def _hits(ranking: Ranking, wanted: set[int], junk: Collection[int]) -> list[int]:
    """Ranks, from 1 and without junk, at which wanted images stand."""
    order = np.asarray(ranking, dtype=np.int64)
    order = order[~np.isin(order, list(junk))]
    hits: list[int] = (np.flatnonzero(np.isin(order, list(wanted))) + 1).tolist()
    return hits


def _area(hits: Sequence[int], n_relevant: int) -> float:
    """Area under precision over recall; between hits recall stands still and adds nothing."""
    area = 0.0
    for found, rank in enumerate(hits):
        before = found / (rank - 1) if rank > 1 else 1.0
        area += (before + (found + 1) / rank) / 2 / n_relevant
    return area
