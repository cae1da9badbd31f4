"""Training: rehearsed queries become the model that chooses detectors and k."""

from collections.abc import Mapping, Sequence
from typing import Any

from contracts.config import SearchConfig
from coordinator.truth import JudgedQuery
from index.opened import OpenedIndex
from retrieval.choice import ChoiceModel, TrainingRow, TrainingSet, fit
from retrieval.complementarity import Complementarity

Json = dict[str, Any]


def train_model(
    answers: Sequence[Json],
    queries: Sequence[JudgedQuery],
    index: OpenedIndex,
    search: SearchConfig,
    set_name: str,
) -> ChoiceModel:
    """Fit the choice on what rehearsing showed; unreadable queries are left out.

    Raises
    ------
    WrongInput : fewer than two places are left.
    """
    places = places_of(queries)
    rows = training_rows(answers, places)
    used = {row.query: row.place for row in rows}
    return fit(
        rows,
        detectors=index.config.features.detectors,
        descriptors=search.descriptors or index.config.features.descriptors,
        vote=search.vote,
        weights=tuple(sorted(search.weights)),
        trained_on=(
            TrainingSet(
                set=set_name, n_queries=max(len(used), 1), n_places=max(len(set(used.values())), 1)
            ),
        ),
    )


def training_rows(answers: Sequence[Json], places: Mapping[str, str]) -> list[TrainingRow]:
    """One row per query, pair and k."""
    return [
        TrainingRow(
            query=answer["query"],
            place=places[answer["query"]],
            pair=(row["pair"][0], row["pair"][1]),
            k=row["k"],
            features=Complementarity(**row["features"]),
            ap=row["ap"],
        )
        for answer in answers
        for row in answer.get("rows", ())
    ]


def places_of(queries: Sequence[JudgedQuery]) -> dict[str, str]:
    """The place of each query: queries that share a relevant image are of one place."""
    place_of_image: dict[int, str] = {}
    places: dict[str, str] = {}
    for each in queries:
        met = {place_of_image[image] for image in each.relevant if image in place_of_image}
        place = min(met, default=each.query)
        places[each.query] = place
        for image in each.relevant:
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
