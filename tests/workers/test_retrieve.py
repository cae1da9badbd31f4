"""What a photo is read into, and that a search by parts is the fusion it stands for."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from contracts.config import Detector, SearchConfig, Where
from contracts.errors import BadConfig, BadIndex
from contracts.records import Postings
from coordinator.cli.show import Bars
from coordinator.removing import remove_images
from index.opened import OpenedIndex
from retrieval.fusion import fuse, rank
from retrieval.late_fusion import standardised_sum
from workers.stages.retrieve import (
    Chosen,
    Photo,
    best_matches,
    channel_queries,
    densities,
    detector_votes,
    nearest_words,
    open_index,
    read_photo,
    search_photo,
    sizes_of,
    words_of,
)


@pytest.fixture
def photo(small_index: OpenedIndex, small_survey: Path) -> Photo:
    return read_photo(small_index, str(small_survey / "03.jpg"))


def by_one_fusion(
    index: OpenedIndex, photo: Photo, chosen: Chosen, search: SearchConfig
) -> np.ndarray:
    """The scores of one group by `fuse` of all its channels at once."""
    detectors, names = [], []
    for detector in chosen.detectors:
        found = nearest_words(index, photo, detector, index.config.features.descriptors, chosen.k)
        names += list(found)
        detectors.append(
            [
                channel_queries(index, name, near, (chosen.k,), search)[chosen.k]
                for name, near in found.items()
            ]
        )
    return fuse(detectors, index.n_images, search, index.distinct_words(names)).values


def test_only_frames_that_are_asked_for_are_found(photo: Photo) -> None:
    assert not photo.found
    assert 0 < len(photo.frames("star")) <= 100
    assert set(photo.found) == {"star"}


@pytest.mark.parametrize(
    "search",
    [SearchConfig(), SearchConfig(weights=("norm",)), SearchConfig(vote="union", weights=("idf",))],
)
@pytest.mark.parametrize("group", [("star",), ("mser", "star"), ("hesaff", "mser", "star")])
def test_a_search_is_one_fusion_of_all_its_channels(
    small_index: OpenedIndex, photo: Photo, search: SearchConfig, group: tuple[Detector, ...]
) -> None:
    chosen = Chosen((group,), 2, None, "given")
    scores = search_photo(small_index, photo, chosen, search)
    whole = by_one_fusion(small_index, photo, chosen, search)
    assert scores.values == pytest.approx(whole, rel=1e-12)


def test_an_indexed_photo_finds_itself(small_index: OpenedIndex, photo: Photo) -> None:
    for groups in ((("mser",),), (("hesaff", "star"),), (("hesaff", "mser"), ("mser", "star"))):
        scores = search_photo(small_index, photo, Chosen(groups, 2, None, ""), SearchConfig())
        assert rank(scores, 1)[0].image_id == 3


def test_two_groups_are_the_standardised_sum_of_their_rankings(
    small_index: OpenedIndex, photo: Photo
) -> None:
    search = SearchConfig()
    groups: tuple[tuple[Detector, ...], ...] = (("hesaff", "mser"), ("hesaff", "star"))
    both = Chosen(groups, 2, None, "given")
    alone = [
        search_photo(small_index, photo, Chosen((one,), 2, None, ""), search) for one in groups
    ]
    joined = search_photo(small_index, photo, both, search)
    assert joined.values == pytest.approx(standardised_sum(alone).values)
    assert both.detectors == ("hesaff", "mser", "star")


def test_fewer_words_a_keypoint_are_the_nearest_of_more(
    small_index: OpenedIndex, photo: Photo
) -> None:
    search = SearchConfig()
    several = words_of(small_index, photo, ("star",), 10, search)
    for k in (2, 5, 10):
        alone = words_of(small_index, photo, ("star",), k, search)
        votes = [detector_votes(small_index, each, (k,), search) for each in (several, alone)]
        np.testing.assert_array_equal(votes[0]["star", k].values, votes[1]["star", k].values)


def test_votes_are_kept_without_norm(small_index: OpenedIndex, photo: Photo) -> None:
    plain, normed = SearchConfig(weights=("idf",)), SearchConfig(weights=("idf", "norm"))
    words = words_of(small_index, photo, ("star",), 2, plain)
    votes = [detector_votes(small_index, words, (2,), each) for each in (plain, normed)]
    np.testing.assert_array_equal(votes[0]["star", 2].values, votes[1]["star", 2].values)
    assert sizes_of(small_index, ("star",), plain) is None
    sizes = sizes_of(small_index, ("star",), normed)
    assert sizes is not None
    channels = ["star-sift", "star-surf", "star-sc"]
    np.testing.assert_array_equal(sizes["star"], small_index.distinct_words(channels))


def test_density_is_the_mean_share_of_the_images_that_a_word_is_in(
    small_index: OpenedIndex,
) -> None:
    (found,) = densities(small_index, ("star",), SearchConfig(descriptors=("sift",))).values()
    shares = small_index.document_frequency("star-sift") / small_index.n_images
    assert found == pytest.approx(shares.mean())
    both = densities(small_index, ("star",), SearchConfig(descriptors=("sift", "sc")))["star"]
    (other,) = densities(small_index, ("star",), SearchConfig(descriptors=("sc",))).values()
    assert both == pytest.approx((found + other) / 2)


def test_a_detector_that_was_not_indexed_is_refused_by_name(
    small_index: OpenedIndex, photo: Photo
) -> None:
    with pytest.raises(BadConfig, match=r"no detector 'orb'; it was indexed with hesaff, mser"):
        nearest_words(small_index, photo, "orb", ("sift",), 2)


def test_only_candidates_are_scored_and_found_by_their_own_ids(
    small_index: OpenedIndex, photo: Photo
) -> None:
    chosen = Chosen((("hesaff", "mser"), ("mser", "star")), 2, None, "given")
    search = SearchConfig(where=Where(uris=("02.jpg", "03.jpg", "0[789].jpg")))
    scores = search_photo(small_index, photo, chosen, search)
    assert len(scores.values) == len(scores.touched) == 5
    matches = best_matches(small_index, scores, search, 10)
    assert matches[0].image_id == 3
    assert {match.image_id for match in matches} <= {2, 3, 7, 8, 9}
    assert [match.rank for match in matches] == list(range(1, len(matches) + 1))


def test_conditions_that_all_images_meet_change_nothing(
    small_index: OpenedIndex, photo: Photo
) -> None:
    chosen = Chosen((("hesaff", "mser"),), 2, None, "given")
    every = SearchConfig(where=Where(since="2020", until="2020"))
    for one, other in (
        (search_photo(small_index, photo, chosen, each) for each in (SearchConfig(), every)),
    ):
        np.testing.assert_array_equal(one.values, other.values)


def test_a_word_tells_as_much_whoever_is_a_candidate(
    small_index: OpenedIndex, photo: Photo
) -> None:
    near = nearest_words(small_index, photo, "star", ("sift",), 2)["star-sift"]
    few = SearchConfig(where=Where(uris=("03.jpg",)))
    idfs = [
        channel_queries(small_index, "star-sift", near, (2,), search)[2].idf
        for search in (SearchConfig(), few)
    ]
    np.testing.assert_array_equal(*idfs)


def test_a_word_of_several_keypoints_is_read_once(small_index: OpenedIndex, photo: Photo) -> None:
    word_ids = np.array([[5, 1], [1, 5], [9, 5]], np.int32)
    near = word_ids, np.zeros(word_ids.shape, np.float32)
    query = channel_queries(small_index, "star-sift", near, (2,), SearchConfig())[2]
    assert query.postings.n_words == 3
    whole = small_index.lists("star-sift", np.arange(10))
    for number, word in zip(query.word_ids.ravel(), word_ids.ravel(), strict=True):
        np.testing.assert_array_equal(images_of(query.postings, number), images_of(whole, word))


def images_of(postings: Postings, word: int) -> np.ndarray:
    return postings.image_ids[postings.indptr[word] : postings.indptr[word + 1]]


@pytest.fixture
def own_index(small_index: OpenedIndex, tmp_path: Path) -> Path:
    """A copy that may be changed."""
    root = tmp_path / "index"
    shutil.copytree(small_index.root, root)
    return root


def test_an_opened_generation_answers_the_same_whatever_is_committed(
    own_index: Path, small_survey: Path
) -> None:
    def scores(number: int) -> np.ndarray:
        index = open_index(str(own_index), number)
        photo = read_photo(index, str(small_survey / "03.jpg"))
        chosen = Chosen((("hesaff", "mser"),), 2, None, "given")
        return search_photo(index, photo, chosen, SearchConfig()).values

    before = scores(1)
    remove_images(own_index, Where(), ["03.jpg"], [], Bars(None))
    assert OpenedIndex(own_index).generation.number == 2
    np.testing.assert_array_equal(scores(1), before)
    open_index.cache_clear()
    np.testing.assert_array_equal(scores(1), before)
    assert len(scores(2)) == 9


def test_a_generation_that_is_not_there_is_refused_by_number(small_index: OpenedIndex) -> None:
    with pytest.raises(BadIndex, match="has no generation 2; there are: 1"):
        open_index(str(small_index.root), 2)
