"""The baseline against the same sums written out."""

import numpy as np
import pytest

from contracts.errors import BadIndex
from contracts.records import Postings
from retrieval.bag_of_words import score_bag_of_words
from retrieval.postings import build_postings


def test_scores_are_the_cosine_of_tf_idf_vectors() -> None:
    rng = np.random.default_rng(3)
    n_words, n_images = 12, 5
    words = rng.integers(0, n_words, 30).astype(np.int32)
    images = rng.integers(0, n_images, 30).astype(np.uint32)
    photo = rng.integers(0, n_words, 9).astype(np.int32)
    idf = rng.random(n_words)
    dense = np.zeros((n_images, n_words))
    dense[images, words] = 1
    dense *= idf
    counted = np.bincount(photo, minlength=n_words) * idf
    lengths = np.linalg.norm(dense, axis=1)
    expected = dense @ counted / np.where(lengths > 0, lengths, 1)
    scores = score_bag_of_words(photo, build_postings(words, images, n_words), idf, n_images)
    np.testing.assert_allclose(scores.values, expected, atol=1e-12)
    np.testing.assert_array_equal(scores.touched, expected > 0)


def test_a_posting_beyond_the_images_is_refused() -> None:
    postings = Postings(np.array([0, 1], dtype=np.int64), np.array([7], dtype=np.uint32))
    with pytest.raises(BadIndex, match="beyond the 3"):
        score_bag_of_words(np.zeros(1, dtype=np.int32), postings, np.ones(1), 3)
