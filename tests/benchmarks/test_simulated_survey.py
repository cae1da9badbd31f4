"""Simulated surveys use words as the real streets that they are copies of."""

import numpy as np
import pytest

from benchmarks.fusion.simulated import SimulatedChannel, copies_asked
from benchmarks.fusion.word_use import WordUse
from contracts.records import Postings

N_REAL, N_WORDS, COPIES = 30, 200, 7


def streets() -> WordUse:
    """A channel whose word w has images from w % 20 on, few for most words."""
    frequency = np.sort(np.random.default_rng(0).integers(0, 9, N_WORDS))[::-1]
    images = [
        (word % 20 + np.arange(count)).astype(np.uint32) for word, count in enumerate(frequency)
    ]
    return WordUse(
        N_REAL,
        Postings(np.concatenate([[0], np.cumsum(frequency)]), np.concatenate(images)),
        np.array([[0, 1], [5, 2], [199, 3]], np.int32),
        np.ones((3, 2), np.float32),
        np.array([0, 2, 3]),
        0.0,
        1.0,
    )


@pytest.fixture(params=[N_WORDS, 10 * N_WORDS + 7])
def survey(request: pytest.FixtureRequest) -> SimulatedChannel:
    return SimulatedChannel(streets(), COPIES * N_REAL - 4, request.param, seed=1)


def test_words_of_a_copy_are_different_ones_within_the_codebook(survey: SimulatedChannel) -> None:
    for copy in range(survey.n_copies):
        words = survey.words_of(copy)
        assert len(np.unique(words)) == N_WORDS
        assert 0 <= words.min() <= words.max() < survey.n_words


def test_a_word_stands_for_real_words_of_its_own_frequency() -> None:
    survey = SimulatedChannel(streets(), COPIES * N_REAL, N_WORDS, seed=1)
    pairs = [survey.pairs(copy)[0] for copy in range(COPIES)]
    frequency = np.bincount(np.concatenate(pairs), minlength=N_WORDS)
    for copy in range(COPIES):
        of_words = frequency[survey.words_of(copy)]
        assert of_words.tolist() == (COPIES * survey.use.frequency).tolist()


def test_images_of_a_copy_share_the_words_that_the_real_ones_share(
    survey: SimulatedChannel,
) -> None:
    real = [set(survey.use.postings.image_ids[s:e]) for s, e in _spans(survey.use.postings)]
    for copy in (0, 3):
        words, images = survey.pairs(copy)
        for word, name in zip(survey.words_of(copy), range(N_WORDS), strict=True):
            assert set(images[words == word] - copy * N_REAL) == real[name]


def test_copies_have_words_of_their_own(survey: SimulatedChannel) -> None:
    assert (survey.words_of(0) == survey.words_of(1)).mean() < 0.2


def test_lists_are_those_of_all_images_also_of_the_last_cut_copy(survey: SimulatedChannel) -> None:
    pairs = [survey.pairs(copy) for copy in range(survey.n_copies)]
    words = np.concatenate([words for words, _ in pairs])
    images = np.concatenate([images for _, images in pairs])
    assert images.max() == survey.n_images - 1
    asked = np.unique(survey.words_of(2))[::-3].astype(np.int32)
    lists = survey.lists(asked)
    for word, (start, stop) in zip(asked, _spans(lists), strict=True):
        assert lists.image_ids[start:stop].tolist() == sorted(images[words == word].tolist())


def test_a_photo_asks_with_the_words_of_its_copy(survey: SimulatedChannel) -> None:
    words, sq_dist = survey.photo(0, 4)
    assert words.tolist() == survey.words_of(4)[np.array([[0, 1], [5, 2]])].tolist()
    assert sq_dist.shape == (2, 2)
    assert copies_asked(survey, 3) == [0, 2, 5]


def _spans(postings: Postings) -> list[tuple[int, int]]:
    return list(zip(postings.indptr[:-1].tolist(), postings.indptr[1:].tolist(), strict=True))
