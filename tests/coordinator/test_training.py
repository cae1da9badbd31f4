"""Places: what must be left out together; and rehearsed answers become trials."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contracts.errors import WrongInput
from coordinator.training import own_images, places_of, trials_of
from coordinator.truth import JudgedQuery
from retrieval.candidates import FEATURES

PAIRS = (("hesaff", "mser"), ("hesaff", "star"))


def query(name: str, *relevant: int) -> JudgedQuery:
    return JudgedQuery(name, Path(name), relevant)


def answer(name: str, *ap: float) -> dict[str, Any]:
    """A query as rehearsed: what two pairs achieved alone and joined, and their features."""
    features = [[*pair, 2, *range(len(FEATURES))] for pair in PAIRS]
    return {"query": name, "features": features, "together": [[ap[0], None], [0.5, ap[1]]]}


def test_queries_that_share_an_image_are_of_one_place() -> None:
    places = places_of([query("a", 1, 2), query("b", 3), query("c", 2, 4), query("d", 4)])
    assert places["a"] == places["c"] == places["d"]
    assert places["b"] != places["a"]


def test_a_query_that_joins_two_places_makes_them_one() -> None:
    places = places_of([query("a", 1), query("b", 2), query("c", 3), query("d", 1, 2)])
    assert places["a"] == places["b"] == places["d"] != places["c"]


def test_trials_are_of_the_queries_that_could_be_judged() -> None:
    answers = [answer("a", 0.1, 0.2), {"query": "b", "error": "no photo"}, answer("c", 0.3, 0.4)]
    places = {"a": "here", "b": "gone", "c": "there"}
    found = trials_of(answers, places, ["x", "y", "z"])
    assert found.queries == ("a", "c")
    assert found.places.tolist() == ["here", "there"]
    assert found.sets.tolist() == ["x", "z"]
    assert found.candidates == ((PAIRS[0], 2), (PAIRS[1], 2))
    assert found.ap.tolist() == [[0.1, 0.2], [0.3, 0.4]]
    np.testing.assert_array_equal(
        found.ap_together, [[[0.1, np.nan], [0.5, 0.2]], [[0.3, np.nan], [0.5, 0.4]]]
    )
    assert found.features[0, 1].tolist() == list(range(len(FEATURES)))


def test_nothing_judged_is_nothing_to_learn_from() -> None:
    answers: list[dict[str, Any]] = [
        {"query": "a", "error": "no photo"},
        {"query": "b", "excluded": True},
    ]
    with pytest.raises(WrongInput, match="none of 2 queries"):
        trials_of(answers, {}, ["x", "x"])


def test_a_single_detector_has_no_pairs_to_choose_from() -> None:
    alone: dict[str, Any] = {"query": "a", "features": [], "together": []}
    with pytest.raises(WrongInput, match="only one detector"):
        trials_of([alone], {"a": "here"}, ["x"])


def test_queries_that_are_each_others_answer_are_of_one_place() -> None:
    queries = [
        JudgedQuery("a.jpg", Path("a.jpg"), (1,)),
        JudgedQuery("b.jpg", Path("b.jpg"), (0,)),
        JudgedQuery("c.jpg", Path("c.jpg"), (3,), junk=(0, 2)),
    ]
    answers: list[dict[str, Any]] = [{"junk": [0]}, {"junk": [1]}, {"junk": [0, 2, 4]}]
    own = own_images(queries, answers)
    assert own == {"a.jpg": {0}, "b.jpg": {1}, "c.jpg": {4}}
    assert places_of(queries, own) == {"a.jpg": "a.jpg", "b.jpg": "a.jpg", "c.jpg": "c.jpg"}
