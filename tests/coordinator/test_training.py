"""Places: what must be left out together."""

from pathlib import Path

from coordinator.training import places_of
from coordinator.truth import JudgedQuery


def query(name: str, *relevant: int) -> JudgedQuery:
    return JudgedQuery(name, Path(name), relevant)


def test_queries_that_share_an_image_are_of_one_place() -> None:
    places = places_of([query("a", 1, 2), query("b", 3), query("c", 2, 4), query("d", 4)])
    assert places["a"] == places["c"] == places["d"]
    assert places["b"] != places["a"]


def test_a_query_that_joins_two_places_makes_them_one() -> None:
    places = places_of([query("a", 1), query("b", 2), query("c", 3), query("d", 1, 2)])
    assert places["a"] == places["b"] == places["d"] != places["c"]
