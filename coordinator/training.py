"""Training: rehearsed queries become the model that chooses detectors and k."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from contracts.config import Detector, SearchConfig, VariantName
from contracts.errors import WrongInput
from coordinator.truth import JudgedQuery
from index.opened import OpenedIndex
from retrieval.candidates import Candidate
from retrieval.choice import ChoiceModel
from retrieval.choice_fit import fit_choice
from retrieval.regression import VARIANTS
from retrieval.trials import Trials

Json = dict[str, Any]


def train_model(
    answers: Sequence[Json],
    queries: Sequence[JudgedQuery],
    index: OpenedIndex,
    search: SearchConfig,
    set_name: str,
    variants: Sequence[VariantName] = tuple(VARIANTS),
) -> ChoiceModel:
    """Fit the choice on what rehearsing showed; unreadable queries are left out.

    Raises
    ------
    WrongInput : fewer than two places are left.
    """
    return fit_choice(
        trials_of(
            answers,
            places_of(queries, own_images(queries, answers)),
            [set_name] * len(answers),
        ),
        detectors=index.config.features.detectors,
        descriptors=search.descriptors or index.config.features.descriptors,
        vote=search.vote,
        weights=search.weights,
        index_digest=index.generation.digest(),
        variants=variants,
    )


def trials_of(
    answers: Sequence[Json],
    places: Mapping[str, str],
    sets: Sequence[str],
) -> Trials:
    """What every pair and k achieved on every query that could be judged.

    sets : of all queries, in the order of `answers`.

    Raises
    ------
    WrongInput : none could be judged.
    """
    judged = [answer for answer in answers if "together" in answer]
    if not judged:
        raise WrongInput(
            f"none of {len(answers)} queries could be read and has a relevant image; check the "
            "ground truth and its --root"
        )
    candidates = tuple(_candidate(row) for row in judged[0]["features"])
    if not candidates:
        raise WrongInput(
            "pairs of detectors are compared and the index has only one detector; index again "
            "with two or more --detectors"
        )
    together = np.array([answer["together"] for answer in judged], dtype=np.float64)
    return Trials(
        queries=tuple(answer["query"] for answer in judged),
        places=np.array([places[answer["query"]] for answer in judged]),
        sets=np.array([name for name, a in zip(sets, answers, strict=True) if "together" in a]),
        candidates=candidates,
        ap=np.diagonal(together, axis1=1, axis2=2).copy(),
        ap_together=together,
        features=np.array([[row[3:] for row in answer["features"]] for answer in judged]),
    )


def _candidate(row: Sequence[Any]) -> Candidate:
    first: Detector = row[0]
    second: Detector = row[1]
    return (first, second), int(row[2])


def own_images(queries: Sequence[JudgedQuery], answers: Sequence[Json]) -> dict[str, set[int]]:
    """The indexed images that a query is itself: junk that the truth does not name."""
    return {
        query.query: set(answer.get("junk", ())) - set(query.junk)
        for query, answer in zip(queries, answers, strict=True)
    }


def places_of(
    queries: Sequence[JudgedQuery], own: Mapping[str, Collection[int]] | None = None
) -> dict[str, str]:
    """The place of each query: queries that share a relevant image are of one place.

    own : by query the indexed images that it is itself, which belong to its place too.
    """
    place_of_image: dict[int, str] = {}
    places: dict[str, str] = {}
    for each in queries:
        members = {*each.relevant, *(own or {}).get(each.query, ())}
        met = {place_of_image[image] for image in members if image in place_of_image}
        place = min(met, default=each.query)
        places[each.query] = place
        for image in members:
            place_of_image[image] = place
        for absorbed in met - {place}:
            place_of_image = {
                image: place if named == absorbed else named
                for image, named in place_of_image.items()
            }
            places = {
                query: place if named == absorbed else named for query, named in places.items()
            }
    return places
