"""How every way of searching answered every query, as arrays."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import compress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contracts.config import Detector, SearchConfig, Vote, Weight
from coordinator.querying import votes_file
from coordinator.training import own_images, places_of, trials_of
from coordinator.truth import JudgedQuery
from index.opened import OpenedIndex
from index.selecting import candidates
from index.votes import read_outcomes, read_votes
from retrieval.evaluation import judge_scores
from retrieval.fusion import Scores
from retrieval.left_out import check_groups
from retrieval.resampling import Interval, weighted_mean
from retrieval.score_curves import N_CURVE, Reference, query_adaptive, reference_curves
from retrieval.trials import Trials, joined
from retrieval.ways import Sizes, Way, fused_group
from workers.stages.retrieve import sizes_of

Json = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Results:
    """All ways on all queries of one set or of several.

    rule : of the search itself, by which `trials`, what the choice is learnt from, were made.
    ap, ap_10 : (n, w) float64 of every way.
    query_adaptive : k -> (n,) AP of Zheng et al.'s late fusion of all detectors.
    """

    trials: Trials
    rule: tuple[Vote, tuple[Weight, ...]]
    ways: tuple[Way, ...]
    ap: NDArray[np.float64]
    ap_10: NDArray[np.float64]
    query_adaptive: Mapping[int, NDArray[np.float64]]

    def of_set(self, name: str) -> NDArray[np.bool_]:
        """Which queries are of a set; (n,) bool."""
        return np.asarray(self.trials.sets == name, dtype=np.bool_)

    def mean(self, values: NDArray[np.float64], rows: NDArray[np.bool_]) -> Interval:
        """Mean of some queries, weighed as in training, and its interval over places."""
        chosen = self.trials.take(rows)
        return weighted_mean(values[rows], chosen.weights(), chosen.places)


def results_of(
    answers: Sequence[Json],
    queries: Sequence[JudgedQuery],
    index: OpenedIndex,
    search: SearchConfig,
    set_names: Sequence[str],
    votes_folder: Path,
    prefix: str = "",
) -> Results:
    """Read what rehearsing gave.

    Parameters
    ----------
    answers, set_names : of `queries`, in their order. votes_folder : where rehearsing left votes
    and outcomes.
    prefix : of places, which are told apart within one index only.

    Raises
    ------
    WrongInput : no query could be judged, or all lie at one place.
    """
    judged = ["together" in answer for answer in answers]
    own = own_images(queries, answers)
    places = {query: prefix + place for query, place in places_of(queries, own).items()}
    trials = trials_of(answers, places, set_names)
    check_groups(trials.places)
    files = [votes_file(votes_folder, at) for at in np.flatnonzero(judged).tolist()]
    outcomes = [read_outcomes(file) for file in files]
    return Results(
        trials=trials,
        rule=(search.vote, tuple(sorted(search.weights))),
        ways=tuple(each.way for each in outcomes[0]),
        ap=np.array([[each.scored.ap for each in row] for row in outcomes]),
        ap_10=np.array([[each.scored.ap_10 for each in row] for row in outcomes]),
        query_adaptive=_query_adaptive(
            list(compress(answers, judged)),
            trials,
            index,
            search,
            files,
        ),
    )


def joined_results(parts: Sequence[Results]) -> Results:
    """Put the queries of several indices together; all were answered in the same ways."""
    return Results(
        trials=joined([part.trials for part in parts]),
        rule=parts[0].rule,
        ways=parts[0].ways,
        ap=np.concatenate([part.ap for part in parts]),
        ap_10=np.concatenate([part.ap_10 for part in parts]),
        query_adaptive={
            k: np.concatenate([part.query_adaptive[k] for part in parts])
            for k in parts[0].query_adaptive
        },
    )


def _query_adaptive(
    answers: Sequence[Json],
    trials: Trials,
    index: OpenedIndex,
    search: SearchConfig,
    files: Sequence[Path],
) -> dict[int, NDArray[np.float64]]:
    """AP of query-adaptive late fusion; its reference curves come from queries of other places."""
    detectors = index.config.features.detectors
    sizes = sizes_of(index, detectors, search)
    among = candidates(index, search.where)
    known = [[among.places(each[kind]) for kind in ("relevant", "junk")] for each in answers]
    ks = tuple(sorted({k for _, k in trials.candidates}))
    found: dict[int, list[float]] = {k: [] for k in ks}
    for k in ks:
        # Votes are read twice: those of all queries at once may be more than the memory.
        curves = [
            [
                _wrong_curve(scores, {*relevant, *junk})
                for scores in _alone(file, detectors, sizes, k)
            ]
            for file, (relevant, junk) in zip(files, known, strict=True)
        ]
        for number, (file, (relevant, junk)) in enumerate(zip(files, known, strict=True)):
            others = np.flatnonzero(trials.places != trials.places[number]).tolist()
            references = [
                _reference([curves[other][at] for other in others]) for at in range(len(detectors))
            ]
            fused = query_adaptive(_alone(file, detectors, sizes, k), references)
            found[k].append(judge_scores(fused, relevant, junk).ap)
    return {k: np.array(values) for k, values in found.items()}


def _reference(curves: Sequence[NDArray[np.float64]]) -> Reference:
    """All curves of one system; where nothing wrong was ever found, a flat one: it says nothing."""
    flat = np.zeros((1, N_CURVE))
    return Reference(np.concatenate(curves) if sum(map(len, curves)) else flat)


def _wrong_curve(scores: Scores, known: Collection[int]) -> NDArray[np.float64]:
    """The score curve of all but the known, so of wrong answers, (1, n_curve); none without any."""
    if not np.delete(scores.touched, sorted(known)).any():
        return np.empty((0, N_CURVE))
    return reference_curves([scores], [known]).curves


def _alone(file: Path, detectors: tuple[Detector, ...], sizes: Sizes, k: int) -> list[Scores]:
    """Each detector's own answer to a query, from its votes."""
    votes = read_votes(file, detectors, (k,))
    return [fused_group(votes, (name,), k, sizes) for name in detectors]
