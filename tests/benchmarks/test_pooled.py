"""Pooling two detectors' keypoints, on a few made-up descriptors."""

import hashlib
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.pooled import Channel, Points, answer, index_pool, pool
from contracts.config import CodebookConfig, SearchConfig, Vote
from retrieval.fusion import fuse

EVERY_POINT_A_WORD = CodebookConfig(codebook_ratio=1.0)
DIGESTS = [hashlib.sha256(bytes([image])).hexdigest() for image in range(4)]
VOTES: tuple[Vote, ...] = ("union", "intersection", "pairwise")


def _letters(*images: str) -> Points:
    """Keypoints by image; each letter is one descriptor, equally far from every other letter's."""
    ids = np.repeat(np.arange(len(images), dtype=np.uint32), [len(letters) for letters in images])
    letters = np.frombuffer("".join(images).encode(), dtype=np.uint8) - ord("a")
    return Points(ids, 200 * np.eye(8, dtype=np.uint8)[letters])


def _random_points(n_images: int, per_image: int, seed: int) -> Points:
    rng = np.random.default_rng(seed)
    ids = np.repeat(np.arange(n_images, dtype=np.uint32), per_image)
    return Points(ids, rng.integers(0, 256, (len(ids), 8), dtype=np.uint8))


def _indexed(
    references: Sequence[Points], photos: Sequence[Points], config: CodebookConfig
) -> Channel:
    return index_pool(references, photos, DIGESTS, config)


def test_pooled_keypoints_stay_with_their_image_and_in_order_of_detectors() -> None:
    together = pool([_letters("ab", "", "c"), _letters("d", "e", "fg")])
    assert together.image_ids.tolist() == [0, 0, 0, 1, 2, 2, 2]
    assert (together.descriptors == _letters("abdecfg").descriptors).all()


@pytest.mark.parametrize("vote", VOTES)
def test_a_detector_pooled_with_one_that_finds_nothing_is_that_detector(vote: Vote) -> None:
    config = CodebookConfig(codebook_ratio=0.5)
    search = SearchConfig(vote=vote, weights=("idf", "norm"))
    alone, with_nothing = [], []
    for descriptor in (1, 2):
        found, asked = _random_points(4, 12, descriptor), _random_points(2, 6, descriptor + 10)
        nothing = Points(found.image_ids[:0], found.descriptors[:0])
        alone.append(_indexed([found], [asked], config))
        with_nothing.append(_indexed([nothing, found], [nothing, asked], config))
    for one, other in zip(alone, with_nothing, strict=True):
        assert (one.codebook.words == other.codebook.words).all()
        assert (one.postings.indptr == other.postings.indptr).all()
        assert (one.postings.image_ids == other.postings.image_ids).all()
    for photo in (0, 1):
        expected = answer([alone], photo, search, 2)
        scores = answer([with_nothing], photo, search, 2)
        assert expected.values.any()
        assert scores.values.tolist() == expected.values.tolist()
        assert scores.touched.tolist() == expected.touched.tolist()


def test_an_image_found_by_both_detectors_through_one_word_counts_once() -> None:
    parts = [_letters("a", "b", "c", "d"), _letters("a", "a", "e", "f")]
    pooled = _indexed(parts, parts, EVERY_POINT_A_WORD)
    a = np.flatnonzero((pooled.codebook.words == _letters("a").descriptors).all(axis=1)).item()
    start, stop = pooled.postings.indptr[a : a + 2]
    assert pooled.postings.image_ids[start:stop].tolist() == [0, 1]
    assert pooled.idf[a] == pytest.approx(np.log(4 / 2))
    assert pooled.sizes.tolist() == [1, 2, 2, 2]


def test_only_a_pooled_word_is_reached_from_the_other_detector() -> None:
    references, asked = [_letters("a", "b"), _letters("c", "d")], [_letters(""), _letters("a")]
    search = SearchConfig(vote="union", weights=("norm",))
    pooled = index_pool(references, asked, DIGESTS[:2], EVERY_POINT_A_WORD)
    apart = [
        [index_pool([found], [photo], DIGESTS[:2], EVERY_POINT_A_WORD)]
        for found, photo in zip(references, asked, strict=True)
    ]
    assert answer([[pooled]], 0, search, 1).values.tolist() == pytest.approx([2**-0.5, 0])
    assert answer(apart, 0, search, 1).values.tolist() == [0, 0]


@pytest.mark.parametrize("vote", VOTES)
def test_pooled_keypoints_vote_one_by_one(vote: Vote) -> None:
    config = CodebookConfig(codebook_ratio=0.3)
    search = SearchConfig(vote=vote, weights=("idf",))
    channels = [
        _indexed(
            [_random_points(4, 15, descriptor), _random_points(4, 10, descriptor + 50)],
            [_random_points(1, 4, descriptor + 100), _random_points(1, 3, descriptor + 150)],
            config,
        )
        for descriptor in (1, 2, 3)
    ]
    expected = np.zeros(4)
    for row in range(4 + 3):
        one = slice(row, row + 1)
        asked = [channel.asked(0, search, 3) for channel in channels]
        single = [replace(a, word_ids=a.word_ids[one], sq_dist=a.sq_dist[one]) for a in asked]
        expected += fuse([single], 4, search).values
    assert expected.any()
    assert answer([channels], 0, search, 3).values == pytest.approx(expected)


def test_a_pooled_codebook_has_as_many_words_as_those_of_its_channels() -> None:
    first, second = _random_points(4, 30, 1), _random_points(4, 7, 2)
    config = CodebookConfig(codebook_ratio=0.2, max_words=20)
    sizes = [
        len(_indexed(parts, parts, config).codebook.words)
        for parts in ([first], [second], [first, second])
    ]
    assert sizes == [20, 6, 26]


def test_each_photo_asks_with_its_own_keypoints() -> None:
    references = [_letters("a", "b", "c", "d")]
    channel = _indexed(references, [_letters("b", "", "ad")], EVERY_POINT_A_WORD)
    search = SearchConfig(vote="union", weights=())
    found = [answer([[channel]], photo, search, 1).values.tolist() for photo in range(3)]
    assert found == [[0, 1, 0, 0], [0, 0, 0, 0], [1, 0, 0, 1]]
