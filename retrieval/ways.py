"""The ways of searching that an evaluation compares: single detectors, and what joins them.

All are made from the votes of single detectors, which are counted once: a fusion of inverted
indices adds them, a late fusion joins the finished rankings.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from contracts.config import Detector, Vote, Weight
from retrieval.evaluation import Scored, judge_scores
from retrieval.fusion import Scores
from retrieval.late_fusion import LATE_FUSIONS, LateFusion, standardised

Method = Literal["single", "fii"] | LateFusion

Votes = Mapping[tuple[Detector, int], Scores]
"""By detector and k: the scores by that detector alone, before `norm`."""

Sizes = Mapping[Detector, NDArray[np.int64]] | None
"""Distinct words of each image in a detector's channels, (n_images,); None: no `norm`."""


@dataclass(frozen=True, slots=True)
class Way:
    """One way of searching. detectors : one for `single`, two or more for the others.

    weights : in the order of the alphabet.
    """

    method: Method
    vote: Vote
    weights: tuple[Weight, ...]
    detectors: tuple[Detector, ...]
    k: int


@dataclass(frozen=True, slots=True)
class Outcome:
    """How one way answered one query."""

    way: Way
    scored: Scored


def joined_votes(parts: Sequence[Scores], sizes: Sequence[NDArray[np.int64]] | None) -> Scores:
    """Fuse detectors as `retrieval.fusion.fuse` does, from the votes of each.

    sizes : one (n_images,) a detector, for the weight `norm`; None: without it.
    """
    values = np.sum([part.values for part in parts], axis=0)
    if sizes is not None:
        values = values / np.sqrt(np.maximum(np.sum(sizes, axis=0), 1))
    return Scores(values, np.any([part.touched for part in parts], axis=0))


def fused_group(votes: Votes, group: Sequence[Detector], k: int, sizes: Sizes) -> Scores:
    """Fuse some detectors for one k; see `joined_votes`."""
    parts = [votes[name, k] for name in group]
    return joined_votes(parts, None if sizes is None else [sizes[name] for name in group])


def all_ways(
    votes: Votes, rule: tuple[Vote, tuple[Weight, ...]], sizes: Sizes, *, wide: bool
) -> Iterator[tuple[Way, Scores]]:
    """Answer one query in every way: single detectors and pairs, for every k.

    Parameters
    ----------
    rule : that the votes were counted by. sizes : given if, and only if, `norm` is among it.
    wide : three detectors and all of them too, and late fusion of pairs and of all; what it joins
        are the single detectors as they answer alone.
    """
    detectors = tuple(dict.fromkeys(detector for detector, _ in votes))
    pairs: list[tuple[Detector, ...]] = list(combinations(detectors, 2))
    everything = [detectors] if len(detectors) > 2 else []
    triples = list(combinations(detectors, 3)) if len(detectors) > 3 else []
    for k in dict.fromkeys(k for _, k in votes):
        alone = {name: fused_group(votes, (name,), k, sizes) for name in detectors}
        for name, scores in alone.items():
            yield Way("single", *rule, (name,), k), scores
        for group in [*pairs, *triples, *everything] if wide else pairs:
            yield Way("fii", *rule, group, k), fused_group(votes, group, k, sizes)
        for group in [*pairs, *everything] if wide else ():
            for method, late_fusion in LATE_FUSIONS.items():
                yield Way(method, *rule, group, k), late_fusion([alone[name] for name in group])


def outcomes(
    votes: Votes,
    rule: tuple[Vote, tuple[Weight, ...]],
    sizes: Sizes,
    relevant: Collection[int],
    junk: Collection[int],
    *,
    wide: bool,
) -> list[Outcome]:
    """Judge every way; see `all_ways`.

    Raises
    ------
    BadTruth : no relevant image is left.
    """
    return [
        Outcome(way, judge_scores(scores, relevant, junk))
        for way, scores in all_ways(votes, rule, sizes, wide=wide)
    ]


def ap_together(
    votes: Votes,
    sizes: Sizes,
    candidates: Sequence[tuple[tuple[Detector, Detector], int]],
    relevant: Collection[int],
    junk: Collection[int],
) -> NDArray[np.float64]:
    """AP of the rankings of every two candidates joined, by `late_fusion.standardised_sum`.

    Returns
    -------
    (c, c) float64; on the diagonal that of one alone; NaN where two differ in k.
    """
    rankings = [fused_group(votes, pair, k, sizes) for pair, k in candidates]
    joined = [standardised(scores) for scores in rankings]
    ap = np.full((len(candidates), len(candidates)), np.nan)
    for a, (_, k) in enumerate(candidates):
        ap[a, a] = judge_scores(rankings[a], relevant, junk).ap
        for b in range(a):
            if candidates[b][1] == k:
                both = Scores(
                    joined[a].values + joined[b].values, joined[a].touched | joined[b].touched
                )
                ap[a, b] = ap[b, a] = judge_scores(both, relevant, junk).ap
    return ap
