"""Sampling ignores shards, training repeats itself, and the nearest words are exactly those."""

import hashlib
from dataclasses import replace
from itertools import pairwise

import faiss
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from contracts.config import MAX_NEIGHBOURS, CodebookConfig
from contracts.errors import BadIndex, VocabularyMismatch, WrongInput
from retrieval import clustering
from retrieval.clustering import flat_kmeans, share_out, two_level_kmeans
from retrieval.codebooks import (
    Codebook,
    WordSearcher,
    build_search,
    n_words_for,
    outgrown,
    train_codebook,
)

SHA = hashlib.sha256(b"an image").hexdigest()
FAR = np.ones(MAX_NEIGHBOURS, np.float32)


def descriptors(n: int, dimensions: int = 36, seed: int = 0, top: int = 60) -> NDArray[np.uint8]:
    """Blobs around 40 centres, as descriptors are."""
    rng = np.random.default_rng(seed)
    centres = np.random.default_rng(99).integers(0, top, (40, dimensions))
    noisy: NDArray[np.int64] = centres[rng.integers(0, 40, n)] + rng.integers(
        -9, 10, (n, dimensions)
    )
    return np.clip(noisy, 0, 255).astype(np.uint8)


def by_hand(
    points: NDArray[np.uint8], words: NDArray[np.uint8], k: int
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    difference = points[:, None].astype(np.int64) - words[None].astype(np.int64)
    sq_dist = (difference**2).sum(axis=2)
    ids = np.argsort(sq_dist, axis=1, kind="stable")[:, :k]
    return ids.astype(np.int32), np.take_along_axis(sq_dist, ids, axis=1).astype(np.float32)


def searcher(words: NDArray[np.uint8]) -> WordSearcher:
    codebook = Codebook(words, 0.0, FAR, FAR)
    return WordSearcher(codebook, build_search(words))


@pytest.mark.parametrize(
    ("n_points", "settings", "expected"),
    [
        (1000, {}, 200),
        (2, {}, 1),
        (0, {}, 0),
        (10**6, {}, 20_000),
        (10**6, {"max_words": 10**6}, 200_000),
        (10**6, {"max_words": 10**6, "max_train_points": 500}, 500),
        (3, {"codebook_ratio": 1.0}, 3),
    ],
)
def test_a_codebook_is_sized_by_its_points(
    n_points: int, settings: dict[str, object], expected: int
) -> None:
    assert n_words_for(n_points, CodebookConfig.of(**settings)) == expected


@pytest.mark.parametrize("n_words", [1, 30, 2_100])
@pytest.mark.parametrize("flat_work", [0, 10**8])
def test_training_twice_gives_the_same_words(
    n_words: int, flat_work: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(clustering, "_FLAT_WORK", flat_work)
    sample = descriptors(4_000, 16)
    first, second = (train_codebook(sample, n_words, 3, n_threads) for n_threads in (1, 3))
    assert first.words.dtype == np.uint8
    assert first.words.tobytes() == second.words.tobytes()
    assert first.dmax.tobytes() == second.dmax.tobytes()
    assert first.d99.tobytes() == second.d99.tobytes()
    assert 0.95 * n_words <= len(first.words) <= n_words
    assert len(np.unique(first.words, axis=0)) == len(first.words)


def test_training_does_not_depend_on_the_threads_it_is_given() -> None:
    sample = descriptors(3_000, 16)
    threads = faiss.omp_get_max_threads()
    faiss.omp_set_num_threads(2)
    try:
        words = train_codebook(sample, 50, seed=0).words
        assert faiss.omp_get_max_threads() == 2
    finally:
        faiss.omp_set_num_threads(threads)
    assert words.tobytes() == train_codebook(sample, 50, seed=0).words.tobytes()


def test_dmin_and_dmax_are_the_extreme_distances_to_the_kth_word() -> None:
    sample = descriptors(400)
    codebook = train_codebook(sample, 25, seed=0)
    _, sq_dist = by_hand(sample, codebook.words, MAX_NEIGHBOURS)
    assert codebook.dmin == sq_dist[:, 0].min()
    assert codebook.dmax.tolist() == sq_dist.max(axis=0).tolist()
    assert codebook.d99.tolist() == np.sort(sq_dist, axis=0)[395].tolist()  # 396 = 99 % of 400
    assert codebook.farthest(3, "range") == sq_dist[:, 2].max() > codebook.farthest(3, "percentile")


def test_a_codebook_of_few_words_repeats_its_last_distance() -> None:
    codebook = train_codebook(np.array([[0, 0], [0, 0], [9, 0]], np.uint8), 2, seed=0)
    assert codebook.words.tolist() == [[0, 0], [9, 0]]
    assert codebook.dmin == 0
    assert codebook.dmax.tolist() == codebook.d99.tolist() == [0.0] + [81.0] * 9


def test_a_channel_without_descriptors_gets_a_codebook_without_words() -> None:
    codebook = train_codebook(np.zeros((0, 36), np.uint8), 0, seed=0)
    word_ids, sq_dist = WordSearcher(codebook, build_search(codebook.words)).nearest(
        descriptors(3), 2
    )
    assert word_ids.shape == sq_dist.shape == (3, 0)


@pytest.mark.parametrize("n_words", [0, 11])
def test_more_words_than_points_or_none_are_refused(n_words: int) -> None:
    with pytest.raises(WrongInput, match=f"{n_words} words cannot be trained from 10"):
        train_codebook(descriptors(10), n_words, seed=0)


def test_two_levels_quantise_nearly_as_well_as_one() -> None:
    sample = descriptors(3_000, 16)
    flat = by_hand(sample, flat_kmeans(sample, 300, seed=0), 1)[1].mean()
    two_level = by_hand(sample, two_level_kmeans(sample, 300, seed=0), 1)[1].mean()
    assert two_level <= 1.03 * flat


@given(st.lists(st.integers(0, 50), min_size=1, max_size=12), st.floats(0, 1))
def test_shares_are_proportional_and_feasible(sizes: list[int], part: float) -> None:
    points = np.array([*sizes, 3])
    least, most = int((points > 0).sum()), int(points.sum())
    n_shares = least + round(part * (most - least))
    shares = share_out(n_shares, points)
    assert shares.sum() == n_shares
    assert np.all(shares <= points)
    assert np.all((shares > 0) == (points > 0))


@pytest.mark.parametrize("dimensions", [36, 64, 128])
@pytest.mark.parametrize("k", [1, 3])
def test_nearest_words_are_exact_with_ties_by_word_id(dimensions: int, k: int) -> None:
    words = np.unique(descriptors(300, dimensions, seed=1, top=12) // 6, axis=0)
    points = descriptors(200, dimensions, seed=2, top=12) // 6
    expected_ids, expected_distances = by_hand(points, words, k)
    word_ids, sq_dist = searcher(words).nearest(points, k)
    assert word_ids.tolist() == expected_ids.tolist()
    assert sq_dist.tolist() == expected_distances.tolist()
    assert [word_ids.dtype, sq_dist.dtype] == [np.dtype(np.int32), np.dtype(np.float32)]


def test_ties_reaching_far_beyond_what_was_asked_still_go_to_the_smallest_word() -> None:
    words = np.repeat(np.eye(3, dtype=np.uint8) * 9, 200, axis=0)
    word_ids, _ = searcher(words).nearest(np.array([[0, 9, 0]] * 30, np.uint8), 2)
    assert word_ids.tolist() == [[200, 201]] * 30


def test_the_largest_distances_stay_exact() -> None:
    words = np.array([[0] * 128, [255] * 127 + [254]], np.uint8)
    _, sq_dist = searcher(words).nearest(np.full((40, 128), 255, np.uint8), 2)
    assert sq_dist.tolist() == [[1.0, 128 * 255**2]] * 40


@pytest.fixture(scope="module")
def large() -> WordSearcher:
    """A codebook above the limit of exhaustive search."""
    return searcher(np.unique(descriptors(6_000, seed=4), axis=0))


def test_a_large_codebook_finds_nearly_all_nearest_words(large: WordSearcher) -> None:
    points = descriptors(60, seed=5)
    expected, _ = by_hand(points, large.codebook.words, 1)
    word_ids, _ = large.nearest(points, 1)
    assert (word_ids == expected).mean() >= 0.95


@pytest.mark.parametrize("k", [1, 2, 10])
def test_nearest_words_do_not_depend_on_the_batch(large: WordSearcher, k: int) -> None:
    points = descriptors(250, seed=6) // 2 * 2
    whole_ids, whole_distances = large.nearest(points, k)
    for size in (1, 7, 19, 120):
        parts = [large.nearest(points[at : at + size], k) for at in range(0, 250, size)]
        assert np.concatenate([ids for ids, _ in parts]).tolist() == whole_ids.tolist()
        distances = np.concatenate([sq_dist for _, sq_dist in parts])
        assert distances.tolist() == whole_distances.tolist()


def test_every_word_is_found_even_where_lists_are_short(large: WordSearcher) -> None:
    n_words = len(large.codebook.words)
    word_ids, _ = large.nearest(descriptors(2, seed=7), n_words)
    assert np.sort(word_ids, axis=1).tolist() == [list(range(n_words))] * 2


def test_the_lists_of_words_do_not_depend_on_the_order_of_the_words(large: WordSearcher) -> None:
    words = large.codebook.words
    order = np.random.default_rng(0).permutation(len(words))
    points = descriptors(100, seed=8)
    ids, sq_dist = large.nearest(points, 2)
    shuffled_ids, shuffled_distances = searcher(words[order]).nearest(points, 2)
    assert shuffled_distances.tolist() == sq_dist.tolist()
    alone = sq_dist[:, 0] < sq_dist[:, 1]
    assert order[shuffled_ids[alone, 0]].tolist() == ids[alone, 0].tolist()


def test_a_structure_of_other_words_or_other_descriptors_is_refused() -> None:
    codebook = Codebook(descriptors(10), 0.0, FAR, FAR)
    with pytest.raises(VocabularyMismatch, match="9 words"):
        WordSearcher(codebook, build_search(codebook.words[:9]))
    with pytest.raises(VocabularyMismatch, match="36"):
        WordSearcher(replace(codebook, words=descriptors(10, 64)), build_search(codebook.words))
    with pytest.raises(VocabularyMismatch, match="64"):
        searcher(codebook.words).nearest(descriptors(2, 64), 1)
    with pytest.raises(WrongInput, match="129 dimensions"):
        searcher(descriptors(10, 129)).nearest(descriptors(2, 129), 1)


@pytest.mark.parametrize("starts", [[0, 11], [1, 10], [0, 11, 10], [0, 5, 10], []])
def test_lists_that_do_not_hold_the_words_are_refused(starts: list[int]) -> None:
    codebook = Codebook(descriptors(10), 0.0, FAR, FAR)
    lists = replace(build_search(codebook.words), starts=np.array(starts, dtype=np.int64))
    with pytest.raises(VocabularyMismatch, match="build it from these words"):
        WordSearcher(codebook, lists)


@pytest.mark.parametrize("word_id", [-1, 10, 2**31 - 1])
def test_a_word_that_is_not_there_is_refused(word_id: int) -> None:
    codebook = Codebook(descriptors(10), 0.0, FAR, FAR)
    lists = build_search(codebook.words)
    lists.word_ids[7] = word_id
    with pytest.raises(BadIndex, match=f"names word {word_id} of 10"):
        WordSearcher(codebook, lists).nearest(descriptors(3), 1)


def test_trained_words_come_list_after_list() -> None:
    words = train_codebook(descriptors(9_000, 16, top=200), 4_500, seed=0).words
    lists = build_search(words)
    assert len(lists.centres) > 100
    assert lists.word_ids.tolist() == list(range(len(words)))


def test_words_of_one_list_are_ascending_and_each_is_in_one(large: WordSearcher) -> None:
    words = large.codebook.words
    lists = build_search(words)
    expected, _ = by_hand(words[::50], lists.centres, 1)
    of_word = np.empty(len(words), np.int64)
    for centre, (start, stop) in enumerate(pairwise(lists.starts)):
        assert np.all(np.diff(lists.word_ids[start:stop]) > 0)
        of_word[lists.word_ids[start:stop]] = centre
    assert np.sort(lists.word_ids).tolist() == list(range(len(words)))
    assert of_word[::50].tolist() == expected[:, 0].tolist()


def test_words_are_outgrown_where_descriptors_lie_much_farther_from_them() -> None:
    before = {"hesaff-sift": 100.0, "star-sc": 100.0, "mser-sc": 0.0, "orb-sc": 5.0}
    now = {"star-sc": 10_000.0, "hesaff-sift": 99.0, "mser-sc": 7.0, "har-sc": 1e9}
    assert outgrown(before, now) == ("star-sc",)
    assert outgrown(before, before) == outgrown({}, now) == ()


def test_words_of_few_points_each_are_outgrown_later() -> None:
    before, now = {"hesaff-sift": 100.0}, {"hesaff-sift": 200.0}
    assert outgrown(before, now) == ()
    assert outgrown(before, now, {"hesaff-sift": 50}) == ("hesaff-sift",)
    assert outgrown(before, {"hesaff-sift": 149.0}, {"hesaff-sift": 1e6}) == ()


def test_words_of_some_scenes_are_outgrown_by_others_and_not_by_more_of_the_same() -> None:
    def mean(points: NDArray[np.uint8]) -> dict[str, float]:
        return {"hesaff-sc": float(scenes.nearest(points, 1)[1].mean())}

    codebook = train_codebook(descriptors(5_000, seed=1), 100, seed=0)
    scenes = WordSearcher(codebook, build_search(codebook.words))
    before, fifty = mean(descriptors(5_000, seed=1)), {"hesaff-sc": 50.0}
    assert outgrown(before, mean(descriptors(5_000, seed=2)), fifty) == ()
    assert outgrown(before, mean(descriptors(5_000, seed=3, top=120)), fifty) == ("hesaff-sc",)
