"""Words are the same bytes however many there are, and real descriptors find theirs."""

from collections.abc import Callable
from pathlib import Path

import faiss
import numpy as np
import pytest
from numpy.typing import NDArray

from contracts.config import FeatureConfig
from retrieval import clustering, codebooks
from retrieval.codebooks import Codebook, WordSearcher, build_search, train_codebook
from survey import ReadOptions, read_survey
from workers.stages.extract import image_features

FLAT, TWO_LEVELS = 10**8, 0
ONE_LIST, LISTS = 4_096, 100
N_WORDS = 600


@pytest.fixture(params=[(FLAT, ONE_LIST), (TWO_LEVELS, ONE_LIST), (TWO_LEVELS, LISTS)])
def train(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> Callable[[NDArray[np.uint8]], Codebook]:
    """Training of a few words as if there were many."""
    flat_work, exhaustive = request.param
    monkeypatch.setattr(clustering, "_FLAT_WORK", flat_work)
    monkeypatch.setattr(codebooks, "_EXHAUSTIVE_WORDS", exhaustive)
    return lambda sample: train_codebook(sample, N_WORDS, seed=5)


@pytest.fixture
def sample() -> NDArray[np.uint8]:
    rng = np.random.default_rng(0)
    blobs = rng.integers(20, 200, (60, 36))[rng.integers(0, 60, 6_000)]
    return (blobs + rng.integers(-20, 21, blobs.shape)).astype(np.uint8)


def everything_of(codebook: Codebook) -> list[bytes]:
    lists = build_search(codebook.words)
    arrays = (codebook.words, codebook.dmax, codebook.d99)
    searched = (lists.centres, lists.starts, lists.word_ids)
    return [array.tobytes() for array in (*arrays, *searched)]


def test_words_and_lists_are_the_same_bytes_whatever_threads_there_are(
    train: Callable[[NDArray[np.uint8]], Codebook], sample: NDArray[np.uint8]
) -> None:
    once = everything_of(train(sample))
    threads = faiss.omp_get_max_threads()
    faiss.omp_set_num_threads(2 if threads == 1 else 1)
    try:
        assert everything_of(train(sample)) == once
    finally:
        faiss.omp_set_num_threads(threads)


def test_another_seed_gives_other_words(
    train: Callable[[NDArray[np.uint8]], Codebook], sample: NDArray[np.uint8]
) -> None:
    assert train(sample).words.tobytes() != train_codebook(sample, N_WORDS, 6).words.tobytes()


def test_descriptors_of_other_streets_find_nineteen_of_twenty_nearest_words(
    test_data: Path,
) -> None:
    """20,000 words of real photos, as many as are made by default, and five points to a word."""
    images = read_survey(test_data / "stereopolis-paris6", ReadOptions()).images
    config = FeatureConfig(detectors=("hesaff",), descriptors=("surf",), max_frames=5_000)
    described = [
        image_features(image, config)[1].descriptors["hesaff-surf"] for image in images[::11]
    ]
    codebook = train_codebook(np.concatenate(described[:-2]), 20_000, seed=0)
    asked = described[-1]
    found, _ = WordSearcher(codebook, build_search(codebook.words)).nearest(asked, 1)
    words = codebook.words.astype(np.float32)
    exact = faiss.knn(asked.astype(np.float32), words, 1)[1]
    assert len(words) > 19_900
    assert (found == exact).mean() >= 0.95
