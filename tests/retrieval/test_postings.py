"""Postings equal a dictionary of sets, and so does what is counted of them."""

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
    inverse_document_frequency,
    posting_keys,
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


def test_keys_hold_the_largest_word_and_image() -> None:
    words, images = np.array([2**31 - 1], np.int32), np.array([2**32 - 1], np.uint32)
    assert posting_keys(words, images, 2**31).tolist() == [((2**31 - 1) << 32) + 2**32 - 1]


@pytest.mark.parametrize("word", [-1, 7])
def test_a_word_outside_the_codebook_is_refused(word: int) -> None:
    with pytest.raises(VocabularyMismatch, match="7 words"):
        built([(0, 0), (word, 1)])


def test_word_and_image_ids_must_pair_up() -> None:
    with pytest.raises(WrongInput, match="2 word ids and 1 image ids"):
        build_postings(np.zeros(2, np.int32), np.zeros(1, np.uint32), 3)


@settings(deadline=None)
@given(PAIRS)
def test_an_image_has_as_many_words_as_lists_name_it(pairs: list[tuple[int, int]]) -> None:
    expected = [len({w for w, image in pairs if image == i}) for i in range(10)]
    assert distinct_words(built(pairs), 10).tolist() == expected


def test_an_image_beyond_the_catalogue_is_refused() -> None:
    with pytest.raises(BadIndex, match="beyond the catalogue's 5"):
        distinct_words(built([(0, 5)]), 5)


def test_idf_is_the_logarithm_of_n_over_df_and_nothing_for_an_empty_word() -> None:
    idf = inverse_document_frequency(np.array([1, 10, 0]), 10)
    assert idf.tolist() == [np.log(10.0), 0.0, 0.0]
