"""Postings equal a dictionary of sets, whatever the order of what they are made from."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from contracts.errors import BadIndex, VocabularyMismatch, WrongInput
from contracts.records import Postings
from retrieval.postings import (
    build_postings,
    distinct_words,
    document_frequency,
    inverse_document_frequency,
    merge_postings,
)

PAIRS = st.lists(st.tuples(st.integers(0, 6), st.integers(0, 9)), max_size=40)


def built(pairs: list[tuple[int, int]], n_words: int = 7) -> Postings:
    words = np.array([word for word, _ in pairs], dtype=np.int32)
    images = np.array([image for _, image in pairs], dtype=np.uint32)
    return build_postings(words, images, n_words)


def as_lists(postings: Postings) -> list[list[int]]:
    bounds = postings.indptr
    return [postings.image_ids[a:b].tolist() for a, b in pairwise(bounds)]


def oracle(pairs: list[tuple[int, int]], n_words: int = 7) -> list[list[int]]:
    return [sorted({image for w, image in pairs if w == word}) for word in range(n_words)]


@settings(deadline=None)
@given(PAIRS)
def test_a_word_lists_its_images_once_and_ascending(pairs: list[tuple[int, int]]) -> None:
    postings = built(pairs)
    assert as_lists(postings) == oracle(pairs)
    assert postings.indptr.dtype == np.int64
    assert postings.image_ids.dtype == np.uint32


@settings(max_examples=60, deadline=None)
@given(st.lists(PAIRS, min_size=1, max_size=4), st.randoms(use_true_random=False))
def test_merge_equals_building_at_once_in_any_order(parts, shuffler) -> None:  # type: ignore[no-untyped-def]
    shards = [built(part) for part in parts]
    shuffler.shuffle(shards)
    everything = [pair for part in parts for pair in part]
    assert as_lists(merge_postings(shards)) == oracle(everything)


def test_merging_leaves_its_parts_as_they_were() -> None:
    shards = [built([(0, 4), (2, 5)]), built([(0, 1), (0, 4)])]
    before = [as_lists(shard) for shard in shards]
    merge_postings(shards)
    merge_postings(shards[:1])
    assert [as_lists(shard) for shard in shards] == before


def test_parts_of_different_codebooks_do_not_merge() -> None:
    with pytest.raises(VocabularyMismatch, match=r"\[7, 8\] words"):
        merge_postings([built([(0, 1)]), built([(0, 1)], n_words=8)])


def test_merging_nothing_is_refused() -> None:
    with pytest.raises(WrongInput, match="at least one"):
        merge_postings([])


@pytest.mark.parametrize("word", [-1, 7])
def test_a_word_outside_the_codebook_is_refused(word: int) -> None:
    with pytest.raises(VocabularyMismatch, match="7 words"):
        built([(0, 0), (word, 1)])


def test_word_and_image_ids_must_pair_up() -> None:
    with pytest.raises(WrongInput, match="2 word ids and 1 image ids"):
        build_postings(np.zeros(2, np.int32), np.zeros(1, np.uint32), 3)


@pytest.mark.parametrize("indptr", [[0, 3, 2], [0, 1, 3], [1, 1, 2]])
def test_offsets_that_do_not_fit_are_refused(indptr: list[int]) -> None:
    broken = Postings(np.array(indptr, np.int64), np.array([1, 2], np.uint32))
    with pytest.raises(BadIndex, match="offsets"):
        merge_postings([broken])
    with pytest.raises(BadIndex, match="offsets"):
        document_frequency(broken)


@settings(deadline=None)
@given(PAIRS, st.sets(st.integers(0, 9)))
def test_counts_agree_with_an_index_that_never_had_the_removed_images(
    pairs: list[tuple[int, int]], gone: set[int]
) -> None:
    removed = np.array([image in gone for image in range(10)])
    kept = [(word, image) for word, image in pairs if image not in gone]
    assert document_frequency(built(pairs), removed).tolist() == [len(x) for x in oracle(kept)]
    assert document_frequency(built(pairs)).tolist() == [len(x) for x in oracle(pairs)]
    expected = [len({w for w, image in pairs if image == i}) for i in range(10)]
    assert distinct_words(built(pairs), 10).tolist() == expected


def test_an_image_beyond_the_catalogue_is_refused() -> None:
    postings = built([(0, 5)])
    with pytest.raises(BadIndex, match="beyond the catalogue's 5"):
        distinct_words(postings, 5)
    with pytest.raises(BadIndex, match="beyond the catalogue's 5"):
        document_frequency(postings, np.zeros(5, dtype=np.bool_))


def test_idf_is_the_logarithm_of_n_over_df_and_nothing_for_an_empty_word() -> None:
    idf = inverse_document_frequency(np.array([1, 10, 0]), 10)
    assert idf.tolist() == [np.log(10.0), 0.0, 0.0]


def test_memory_mapped_postings_are_read_in_place(tmp_path) -> None:  # type: ignore[no-untyped-def]
    postings = built([(0, 1), (3, 2), (3, 0)])
    np.save(tmp_path / "ids.npy", postings.image_ids)
    mapped = Postings(postings.indptr, np.load(tmp_path / "ids.npy", mmap_mode="r"))
    assert distinct_words(mapped, 4).tolist() == [1, 1, 1, 0]
    assert as_lists(merge_postings([mapped])) == as_lists(postings)
