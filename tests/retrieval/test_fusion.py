"""What fusion does in cases small enough to do by hand, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest

from contracts.config import SearchConfig
from contracts.errors import BadConfig, BadIndex, VocabularyMismatch, WrongInput
from contracts.records import Postings
from retrieval import fusion
from retrieval.fusion import ChannelQuery, Scores, full_ranking, fuse, rank
from retrieval.postings import build_postings

PLAIN = SearchConfig(vote="union", weights=())
WALK = SearchConfig(vote="union", weights=(), max_images=2)


def channel(
    lists: list[list[int]], words: list[list[int]], distances: list[list[float]]
) -> ChannelQuery:
    """A channel with d' = distance / 10."""
    pairs = [(word, image) for word, images in enumerate(lists) for image in images]
    postings = build_postings(
        np.array([word for word, _ in pairs], np.int32),
        np.array([image for _, image in pairs], np.uint32),
        len(lists),
    )
    return ChannelQuery(
        np.array(words, np.int32), np.array(distances, np.float32), 0.0, 10.0, postings
    )


def test_a_single_word_votes_one_minus_its_distance() -> None:
    scores = fuse([[channel([[0, 2]], [[0]], [[3]])]], 4, PLAIN)
    assert scores.values == pytest.approx([0.7, 0, 0.7, 0])
    assert scores.touched.tolist() == [True, False, True, False]


def test_union_votes_can_be_negative_and_still_rank_before_untouched_images() -> None:
    far = channel([[1]], [[0]], [[9]])
    near = channel([[2]], [[0]], [[4]])
    scores = fuse([[far, near]], 4, PLAIN)
    assert scores.values == pytest.approx([0, -0.3, -0.3, 0])
    assert full_ranking(scores).tolist() == [1, 2, 0, 3]
    assert [match.image_id for match in rank(scores, 10)] == [1, 2]


def test_intersection_needs_every_descriptor_and_pairwise_two() -> None:
    a = channel([[0, 1, 2]], [[0]], [[5]])
    b = channel([[0, 1]], [[0]], [[5]])
    c = channel([[0, 3]], [[0]], [[0]])
    every = fuse([[a, b, c]], 4, SearchConfig(vote="intersection", weights=()))
    assert every.values == pytest.approx([0.25, 0, 0, 0])
    assert every.touched.tolist() == [True, False, False, False]
    two = fuse([[a, b, c]], 4, SearchConfig(vote="pairwise", weights=()))
    assert two.values == pytest.approx([0.25 + 0.5 + 0.5, 0.25, 0, 0])
    assert two.touched.tolist() == [True, True, False, False]


def test_the_cell_that_reaches_t_is_taken_whole_and_no_further_one() -> None:
    u = channel([[0], [1]], [[0, 1]], [[1, 2]])
    v = channel([[2, 3], [4]], [[0, 1]], [[1, 5]])
    cut = fuse([[u, v]], 5, SearchConfig(vote="union", weights=(), max_images=2))
    assert cut.values == pytest.approx([0.8, 0, 0.8, 0.8, 0])
    wider = fuse([[u, v]], 5, SearchConfig(vote="union", weights=(), max_images=4))
    assert wider.values == pytest.approx([0.8, 0.7, 1.5, 1.5, 0])


def test_the_walk_counts_the_images_of_each_keypoint_afresh() -> None:
    n = 700
    u = channel([[0], [1]], [[0, 1]] * n, [[1, 2]] * n)
    v = channel([[2, 3], [4]], [[0, 1]] * n, [[1, 5]] * n)
    scores = fuse([[u, v, v]], 5, SearchConfig(vote="union", weights=(), max_images=4))
    one = [replace(each, word_ids=each.word_ids[:1], sq_dist=each.sq_dist[:1]) for each in (u, v)]
    alone = fuse([[*one, one[1]]], 5, SearchConfig(vote="union", weights=(), max_images=4))
    assert scores.values == pytest.approx(n * alone.values)
    assert alone.touched.any()


def test_burst_divides_by_the_root_of_the_keypoints_that_voted() -> None:
    one = channel([[0], [0, 1]], [[0], [1], [1], [1]], [[0], [0], [0], [0]])
    scores = fuse([[one]], 2, SearchConfig(vote="union", weights=("burst",)))
    assert scores.values == pytest.approx([4 / 2, 3 / np.sqrt(3)])


def test_norm_divides_by_the_root_of_the_distinct_words() -> None:
    one = channel([[0, 1]], [[0]], [[0]])
    config = SearchConfig(vote="union", weights=("norm",))
    assert fuse([[one]], 2, config, np.array([4, 16])).values == pytest.approx([0.5, 0.25])


def test_a_pair_sums_its_detectors_and_may_differ_in_keypoints() -> None:
    first = channel([[0]], [[0]], [[2]])
    second = channel([[0, 1]], [[0], [0]], [[0], [0]])
    assert fuse([[first], [second]], 2, PLAIN).values == pytest.approx([2.8, 2.0])


@pytest.mark.parametrize("weights", [(), ("norm", "burst")])
@pytest.mark.parametrize("vote", ["union", "intersection", "pairwise"])
def test_scores_do_not_depend_on_the_ranges_of_images(
    vote: str, weights: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(5)
    lists = [sorted(set(rng.integers(0, 50, 20).tolist())) for _ in range(30)]
    distances = np.sort(rng.integers(0, 10, (40, 3)), axis=1).tolist()
    words = [rng.permutation(30)[:3].tolist() for _ in range(40)]
    detector = [channel(lists, words, distances), channel(lists[::-1], words, distances)]
    config = SearchConfig.of(vote=vote, weights=weights)
    whole = fuse([detector, detector[::-1]], 50, config, np.arange(50))
    for size in (1, 7, 49):
        monkeypatch.setattr(fusion, "_RANGE_IMAGES", size)
        scores = fuse([detector, detector[::-1]], 50, config, np.arange(50))
        assert scores.values.tolist() == whole.values.tolist()
        assert scores.touched.tolist() == whole.touched.tolist()


def test_a_mean_distance_keeps_votes_of_a_union_positive() -> None:
    far, near = channel([[1]], [[0]], [[9]]), channel([[2]], [[0]], [[4]])
    for max_images in (None, 1):
        config = SearchConfig(
            vote="union", weights=(), union_distance="mean", max_images=max_images
        )
        assert fuse([[far, near]], 4, config).values == pytest.approx([0, 0.35, 0.35, 0])


def test_the_best_are_the_same_however_scores_are_ordered() -> None:
    rng = np.random.default_rng(3)
    values = rng.integers(-40, 40, 3_000).astype(float)
    touched = rng.random(3_000) < 0.7
    for order in (values, np.sort(values), np.sort(values)[::-1]):
        scores = Scores(np.where(touched, order, 0.0), touched)
        by_hand = sorted(np.flatnonzero(touched).tolist(), key=lambda i: (-scores.values[i], i))
        for top in (1, 2, 70, 2_999, 10_000, None):
            assert [match.image_id for match in rank(scores, top)] == by_hand[:top]


def test_a_photo_without_keypoints_or_a_channel_without_words_touches_nothing() -> None:
    none = np.zeros((0, 2), np.int32)
    postings = build_postings(np.zeros(1, np.int32), np.zeros(1, np.uint32), 1)
    blank = ChannelQuery(none, none.astype(np.float32), 0.0, 1.0, postings)
    assert not fuse([[blank, blank]], 3, PLAIN).touched.any()
    wordless = Postings(np.zeros(1, np.int64), np.zeros(0, np.uint32))
    empty = ChannelQuery(np.zeros((1, 0), np.int32), np.zeros((1, 0), np.float32), 0, 0, wordless)
    assert not fuse([[empty, channel([[0]], [[0]], [[0]])]], 3, PLAIN).touched.any()


def test_ties_break_by_image_id_also_at_the_cut() -> None:
    scores = Scores(np.array([1.0, 2.0, 1.0, 1.0]), np.ones(4, dtype=np.bool_))
    assert [match.image_id for match in rank(scores, 3)] == [1, 0, 2]


def test_what_cannot_be_fused_is_refused_by_name() -> None:
    one = channel([[0, 5]], [[0]], [[0]])
    for config in (PLAIN, WALK, SearchConfig(vote="intersection", weights=())):
        with pytest.raises(BadIndex, match="beyond the catalogue's 5"):
            fuse([[one, one]], 5, config)
    unordered = Postings(np.array([0, 2], np.int64), np.array([5, 0], np.uint32))
    with pytest.raises(BadIndex, match="out of order"):
        fuse([[replace(one, postings=unordered)]], 5, PLAIN)
    with pytest.raises(BadIndex, match="postings of 1 words"):
        fuse([[replace(one, word_ids=np.array([[1]], np.int32))]], 6, PLAIN)
    with pytest.raises(BadIndex, match="postings of 1 words"):
        fuse([[replace(one, word_ids=np.array([[-1]], np.int32))]], 6, PLAIN)
    broken = Postings(np.array([0, 9], np.int64), one.postings.image_ids)
    with pytest.raises(BadIndex, match="offsets"):
        fuse([[replace(one, postings=broken)]], 6, PLAIN)
    with pytest.raises(WrongInput, match=r"\[1, 2\] keypoints"):
        fuse([[one, channel([[0]], [[0], [0]], [[0], [0]])]], 6, PLAIN)
    with pytest.raises(WrongInput, match="distinct_words has 2 entries for 6"):
        fuse([[one]], 6, PLAIN, np.zeros(2, np.int64))
    with pytest.raises(WrongInput, match="without descriptors"):
        fuse([[]], 6, PLAIN)
    with pytest.raises(BadConfig, match="`idf` needs"):
        fuse([[one]], 6, SearchConfig(vote="union", weights=("idf",)))
    with pytest.raises(VocabularyMismatch, match="idf of 2 words"):
        fuse([[replace(one, idf=np.zeros(2))]], 6, PLAIN)
    with pytest.raises(BadConfig, match="`norm` needs"):
        fuse([[one]], 6, SearchConfig(vote="union", weights=("norm",)))
    with pytest.raises(BadConfig, match="`pairwise` needs two"):
        fuse([[one]], 6, SearchConfig(vote="pairwise", weights=()))
