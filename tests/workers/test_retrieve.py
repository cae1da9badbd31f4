"""What a photo is read into, and that a search by parts is the fusion it stands for."""

from pathlib import Path

import numpy as np
import pytest

from contracts.config import Detector, SearchConfig
from contracts.errors import BadConfig
from index.opened import OpenedIndex
from retrieval.fusion import fuse, rank
from retrieval.late_fusion import standardised_sum
from workers.stages.retrieve import (
    Chosen,
    Photo,
    channel_query,
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
            [channel_query(index, name, near, chosen.k, search) for name, near in found.items()]
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
    postings = small_index.postings("star-sift")
    shares = np.diff(postings.indptr) / small_index.n_images
    assert found == pytest.approx(shares.mean())
    both = densities(small_index, ("star",), SearchConfig(descriptors=("sift", "sc")))["star"]
    (other,) = densities(small_index, ("star",), SearchConfig(descriptors=("sc",))).values()
    assert both == pytest.approx((found + other) / 2)


def test_a_detector_that_was_not_indexed_is_refused_by_name(
    small_index: OpenedIndex, photo: Photo
) -> None:
    with pytest.raises(BadConfig, match=r"no detector 'orb'; it was indexed with hesaff, mser"):
        nearest_words(small_index, photo, "orb", ("sift",), 2)


def test_an_index_that_was_written_to_in_between_is_refused(small_index: OpenedIndex) -> None:
    root, number = str(small_index.root), small_index.generation.number
    assert open_index(root, number).n_images == 10
    with pytest.raises(BadConfig, match=f"at generation {number}, asked for {number + 1}"):
        open_index(root, number + 1)
