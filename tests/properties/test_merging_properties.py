"""However (word, image) pairs are cut, ordered, repeated and merged: the bytes of one build."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from contracts.errors import BadIndex, WrongInput
from contracts.records import Postings
from retrieval import merging
from retrieval.merging import keys_of_words, merge_keys, renumbered_keys, word_ranges
from retrieval.packing import pack
from retrieval.postings import build_postings, posting_keys

N_WORDS, N_IMAGES = 9, 12
Pairs = list[tuple[int, int]]
PAIRS = st.lists(st.tuples(st.integers(0, N_WORDS - 1), st.integers(0, N_IMAGES - 1)), max_size=60)


def columns(pairs: Pairs) -> tuple[np.ndarray, np.ndarray]:
    words = np.array([word for word, _ in pairs], dtype=np.int32)
    return words, np.array([image for _, image in pairs], dtype=np.uint32)


def keys_of(pairs: Pairs) -> np.ndarray:
    return posting_keys(*columns(pairs), N_WORDS)


def at_once(pairs: Pairs) -> Postings:
    return build_postings(*columns(pairs), N_WORDS)


def together(parts: list[Pairs]) -> Pairs:
    return [pair for part in parts for pair in part]


def same(found: Postings, expected: Postings) -> bool:
    return (
        found.indptr.tobytes() == expected.indptr.tobytes()
        and found.image_ids.tobytes() == expected.image_ids.tobytes()
    )


@settings(max_examples=100, deadline=None)
@given(st.lists(PAIRS, max_size=5), st.data())
def test_any_split_order_and_repeat_gives_one_build(
    parts: list[Pairs], data: st.DataObject
) -> None:
    runs = [keys_of(part) for part in parts]
    again = data.draw(st.lists(st.sampled_from(runs), max_size=3)) if runs else []
    shuffled = data.draw(st.permutations([*runs, *again]))
    assert same(merge_keys(shuffled, 0, N_WORDS), at_once(together(parts)))


@settings(max_examples=60, deadline=None)
@given(PAIRS, PAIRS, PAIRS)
def test_merging_in_two_steps_is_merging_in_one(first: Pairs, second: Pairs, third: Pairs) -> None:
    def merged(*runs: np.ndarray) -> np.ndarray:
        return renumbered_keys(merge_keys(runs, 0, N_WORDS), 0, np.arange(N_IMAGES))

    a, b, c = keys_of(first), keys_of(second), keys_of(third)
    np.testing.assert_array_equal(merged(merged(a, b), c), merged(a, merged(b, c)))
    np.testing.assert_array_equal(merged(merged(a, b), c), keys_of(first + second + third))


@settings(max_examples=60, deadline=None)
@given(st.lists(PAIRS, max_size=4), st.sets(st.integers(1, N_WORDS - 1)))
def test_ranges_of_words_end_to_end_are_the_whole(parts: list[Pairs], cuts: set[int]) -> None:
    bounds = [0, *sorted(cuts), N_WORDS]
    whole = pack(at_once(together(parts)))
    packed, counts = b"", []
    for first, stop in pairwise(bounds):
        runs = [keys_of_words(keys_of(part), first, stop) for part in parts]
        piece = pack(merge_keys(runs, first, stop - first))
        packed += piece.packed.tobytes()
        counts += piece.counts.tolist()
    assert packed == whole.packed.tobytes()
    assert counts == whole.counts.tolist()


@settings(max_examples=60, deadline=None)
@given(
    PAIRS, PAIRS, st.permutations(range(2 * N_IMAGES)), st.sets(st.integers(0, 2 * N_IMAGES - 1))
)
def test_segments_with_new_ids_merge_as_if_built_with_them(
    first: Pairs, second: Pairs, order: list[int], gone: set[int]
) -> None:
    new_ids = np.array([-1 if old in gone else new for old, new in enumerate(order)])
    runs = [
        renumbered_keys(at_once(first), 0, new_ids[:N_IMAGES]),
        renumbered_keys(at_once(second), 0, new_ids[N_IMAGES:]),
    ]
    pairs = [(word, int(new_ids[image])) for word, image in first]
    pairs += [(word, int(new_ids[N_IMAGES + image])) for word, image in second]
    kept = [(word, image) for word, image in pairs if image >= 0]
    assert same(merge_keys(runs, 0, N_WORDS), at_once(kept))


def test_a_range_is_merged_from_its_first_word_on() -> None:
    keys = posting_keys(np.array([5, 6], np.int32), np.array([3, 4], np.uint32), N_WORDS)
    merged = merge_keys([keys], 5, 3)
    assert merged.indptr.tolist() == [0, 1, 2, 2]
    assert merged.image_ids.tolist() == [3, 4]


def test_merging_leaves_its_runs_as_they_were() -> None:
    run = keys_of([(0, 4), (2, 5)])
    before = run.copy()
    merge_keys([run, run[::1]], 0, N_WORDS)
    np.testing.assert_array_equal(run, before)


@pytest.mark.parametrize("keys", [[4 << 32], [8 << 32], [6 << 32, 5 << 32], [2**64 - 1]])
def test_keys_of_other_words_or_out_of_order_are_refused(keys: list[int]) -> None:
    with pytest.raises(BadIndex, match="words 5 to 7"):
        merge_keys([np.array(keys, dtype=np.uint64)], 5, 3)


def test_new_ids_must_be_there_and_fit() -> None:
    with pytest.raises(BadIndex, match="beyond the 3"):
        renumbered_keys(at_once([(0, 3)]), 0, np.arange(3))
    with pytest.raises(WrongInput, match="run from 0 to 4294967296"):
        renumbered_keys(at_once([(0, 0)]), 0, np.array([0, 2**32]))


@given(st.integers(0, 50), st.integers(0, 2000))
def test_ranges_cover_all_words_and_hold_equally_many(n_words: int, n_postings: int) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(merging, "POSTINGS_AT_ONCE", 100)
        ranges = word_ranges(n_words, n_postings)
    assert [word for first, stop in ranges for word in range(first, stop)] == list(range(n_words))
    sizes = {stop - first for first, stop in ranges}
    assert not sizes or max(sizes) - min(sizes) <= 1
    assert len(ranges) == min(n_words, max(1, -(-n_postings // 100)))
