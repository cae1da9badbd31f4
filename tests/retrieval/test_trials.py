"""The table of trials: refused where it does not fit; a set counts by the root of its size."""

from dataclasses import replace

import numpy as np
import pytest
from made_trials import CANDIDATES, eq1_trials, trials

from contracts.errors import WrongInput
from retrieval.trials import joined

AP = np.random.default_rng(0).random((5, len(CANDIDATES)))


def test_a_set_counts_by_the_root_of_its_size() -> None:
    some = trials(AP, sets=["small", "large", "large", "large", "large"])
    assert some.weights() == pytest.approx([5 / 3, 5 / 6, 5 / 6, 5 / 6, 5 / 6])
    assert some.mean_ap() == pytest.approx((AP[0] + 2 * AP[1:].mean(axis=0)) / 3)


def test_queries_of_one_set_count_alike() -> None:
    assert trials(AP).weights().tolist() == [1.0] * 5
    assert trials(AP).mean_ap() == pytest.approx(AP.mean(axis=0))


def test_taken_queries_keep_their_rows() -> None:
    some = trials(AP, places=["a", "a", "b", "b", "c"], sets=["x", "x", "x", "y", "y"])
    kept = some.take(np.array([True, False, False, True, False]))
    assert kept.queries == ("q0", "q3")
    assert kept.places.tolist() == ["a", "b"]
    assert kept.sets.tolist() == ["x", "y"]
    assert kept.candidates == CANDIDATES
    for name in ("ap", "ap_together", "features"):
        np.testing.assert_array_equal(getattr(kept, name), getattr(some, name)[[0, 3]])
    with pytest.raises(WrongInput, match="0 queries"):
        some.take(np.zeros(5, dtype=np.bool_))


def test_parts_join_to_the_table_they_were_taken_from() -> None:
    whole = eq1_trials()
    first = np.arange(len(whole.queries)) < 9
    again = joined([whole.take(first), whole.take(~first)])
    assert again.queries == whole.queries
    for name in ("places", "sets", "ap", "ap_together", "features"):
        np.testing.assert_array_equal(getattr(again, name), getattr(whole, name))


def test_only_trials_of_the_same_candidates_join() -> None:
    other = replace(trials(AP), candidates=CANDIDATES[::-1])
    for parts in ([], [trials(AP), other]):
        with pytest.raises(WrongInput, match="the same pairs and k"):
            joined(parts)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"ap": AP[:4]}, "5 queries with 6 candidates"),
        ({"candidates": CANDIDATES[:5]}, "5 queries with 5 candidates"),
        ({"features": np.zeros((5, 6, 4))}, r"\(5, 6, 4\)"),
        ({"ap_together": np.zeros((5, 6))}, "expected"),
        ({"places": np.array(["a"])}, "expected"),
        ({"queries": ()}, "0 queries"),
        ({"ap": np.where(AP.max() == AP, np.nan, AP)}, "not finite"),
        ({"features": np.full((5, 6, 13), np.inf)}, "not finite"),
    ],
)
def test_what_does_not_fit_together_is_refused(changes: dict[str, object], says: str) -> None:
    with pytest.raises(WrongInput, match=says):
        replace(trials(AP), **changes)  # type: ignore[arg-type]
