"""Rehearse: a query of a known place, answered in every way that an evaluation compares."""

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from contracts.config import Weight
from index.selecting import candidates
from index.votes import write_outcomes, write_votes
from retrieval.candidates import FirstLook, candidate_features
from retrieval.ways import Outcome, ap_together, outcomes
from workers.messages import RehearseMessage
from workers.stages.judge import Query, read_query
from workers.stages.retrieve import densities, detector_votes, sizes_of, words_of


def rehearse_photo(request: RehearseMessage) -> dict[str, Any]:
    """What every pair and k achieves on one query, and what a choice may know of them.

    The answers of all other ways are left in the file that the message names, if it does.
    `error` : it cannot be read. `excluded` : it is the only image of its place.
    """
    query = read_query(request)
    if not isinstance(query, Query):
        return query
    index, photo = query.index, query.photo
    among = candidates(index, request.search.where)
    relevant, junk = among.places(query.relevant), among.places(query.junk)
    detectors = index.config.features.detectors
    own = (request.search.vote, _ordered(request.search.weights))
    answer: dict[str, Any] = {
        "query": request.query,
        "relevant": sorted(query.relevant),
        "junk": sorted(query.junk),
    }
    found: list[Outcome] = []
    words = words_of(index, photo, detectors, max(request.ks), request.search)
    distinct = sizes_of(index, detectors, request.search.model_copy(update={"weights": ("norm",)}))
    weightings = [_ordered(each) for each in request.weightings]
    for vote, base in product(request.votes, dict.fromkeys(map(_without_norm, weightings))):
        search = request.search.model_copy(update={"vote": vote, "weights": base})
        votes = detector_votes(index, words, request.ks, search)
        for weights in weightings:
            if _without_norm(weights) != base:
                continue
            sizes = distinct if "norm" in weights else None
            rule = (vote, weights)
            if request.keep is not None:
                found += outcomes(votes, rule, sizes, relevant, junk, wide=rule == own)
            if rule != own:
                continue
            if request.keep is not None:
                write_votes(Path(request.keep), votes)
            features = candidate_features(
                photo.complementarity(detectors),
                densities(index, detectors, search),
                request.ks,
                FirstLook(votes, sizes, junk),
            )
            answer["features"] = [[*pair, k, *values] for (pair, k), values in features.items()]
            together = ap_together(votes, sizes, tuple(features), relevant, junk)
            answer["together"] = [
                [None if np.isnan(ap) else float(ap) for ap in row] for row in together
            ]
    if request.keep is not None:
        write_outcomes(Path(request.keep), found)
    return answer


def _ordered(weights: Sequence[Weight]) -> tuple[Weight, ...]:
    return tuple(sorted(weights))


def _without_norm(weights: Sequence[Weight]) -> tuple[Weight, ...]:
    return tuple(each for each in weights if each != "norm")
