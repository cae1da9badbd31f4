"""Retrieve: a photo, its words, and the fusion of their inverted indices."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from contracts.config import Descriptor, Detector, FeatureConfig, IndexConfig, SearchConfig
from contracts.errors import BadConfig
from contracts.places import place_of
from contracts.records import Frames, Match
from index.opened import OpenedIndex
from index.selecting import candidates
from retrieval.complementarity import Complementarity, all_pairs
from retrieval.descriptors import describe
from retrieval.detectors import detect
from retrieval.fusion import ChannelQuery, Scores, fuse, rank
from retrieval.late_fusion import standardised_sum
from retrieval.pyramid import Pyramid, build_pyramid
from retrieval.ways import fused_group
from survey import DecodedImage, decode_image

WordsFound = dict[str, tuple[NDArray[np.int32], NDArray[np.float32]]]
"""By channel of one detector: word ids (n, k) and their squared distances (n, k)."""


class Configured(Protocol):
    """As much of an index as a photo is read and a choice is made with.

    root : where the index's own model may be; None: there is no index yet.
    config : how its images became features.
    """

    @property
    def root(self) -> Path | None: ...
    @property
    def config(self) -> IndexConfig: ...


@lru_cache(maxsize=2)
def open_index(root: str, generation: int) -> OpenedIndex:
    """One generation of an index, whichever is live by now, open between a process's photos."""
    return OpenedIndex(place_of(root), generation)


@dataclass(frozen=True, slots=True)
class Photo:
    """A query photo: what was decoded, and the frames of the detectors that were asked for.

    usable : (h, w) bool of the decoded photo, True = scenery; None = all of it.
    found : frames by detector; the others are found when they are first asked for.
    """

    decoded: DecodedImage
    pyramid: Pyramid
    config: FeatureConfig
    usable: NDArray[np.bool_] | None = None
    found: dict[Detector, Frames] = field(default_factory=dict)

    def frames(self, detector: Detector) -> Frames:
        """The frames of one detector, as the index's images have them."""
        if detector not in self.found:
            limit = self.config.frames_of(detector)
            self.found[detector] = detect(self.pyramid, detector, limit, self.usable)
        return self.found[detector]

    def complementarity(
        self, detectors: Sequence[Detector]
    ) -> dict[tuple[Detector, Detector], Complementarity]:
        """The four scores of every pair of `detectors`, in the order of the index."""
        height, width = self.decoded.rgb.shape[:2]
        return all_pairs({name: self.frames(name) for name in detectors}, width, height)


def read_photo(index: Configured, path: str) -> Photo:
    """Decode a photo as the index's images were.

    Raises
    ------
    UnusableImage : the photo cannot be read.
    """
    config = index.config.features
    decoded = decode_image(path, max_side_px=config.max_side_px, max_pixels=config.max_pixels)
    return Photo(decoded, build_pyramid(decoded.rgb), config)


@dataclass(frozen=True, slots=True)
class Chosen:
    """What a photo is searched with, and how that came to be.

    groups : the detectors that are fused; of two groups the finished rankings are joined.
    """

    groups: tuple[tuple[Detector, ...], ...]
    k: int
    predicted_map: float | None
    choice: str

    @property
    def detectors(self) -> tuple[Detector, ...]:
        """Every detector that is searched with, once."""
        return tuple(dict.fromkeys(name for group in self.groups for name in group))


def descriptors_of(index: Configured, search: SearchConfig) -> tuple[Descriptor, ...]:
    """The descriptors a search uses: those asked for, or all of the index."""
    return search.descriptors or index.config.features.descriptors


def nearest_words(
    index: OpenedIndex,
    photo: Photo,
    detector: Detector,
    descriptors: Sequence[Descriptor],
    k: int,
) -> WordsFound:
    """Describe one detector's frames and find their k nearest words, by channel."""
    if detector not in photo.config.detectors:
        raise BadConfig(
            f"{index.root} has no detector {detector!r}; it was indexed with "
            f"{', '.join(index.config.features.detectors)}. Choose from these or index again."
        )
    described = describe(photo.pyramid, photo.frames(detector), descriptors)
    return {
        f"{detector}-{name}": index.searcher(f"{detector}-{name}").nearest(described[name], k)
        for name in descriptors
    }


def channel_queries(
    index: OpenedIndex,
    channel: str,
    nearest: tuple[NDArray[np.int32], NDArray[np.float32]],
    ks: Sequence[int],
    search: SearchConfig,
) -> dict[int, ChannelQuery]:
    """What fusion needs of one channel, for every k: the first k of the words found, their images.

    Each word's list is read once, whoever asks for it; the words of a query are numbers in these
    lists.
    """
    word_ids, sq_dist = (each[:, : max(ks)] for each in nearest)
    asked, at = np.unique(word_ids, return_inverse=True)
    words, numbers = asked.astype(np.int64), at.reshape(word_ids.shape).astype(np.int32)
    postings = index.lists(channel, words, candidates(index, search.where).kept)
    idf = index.idf(channel, words) if "idf" in search.weights else None
    codebook = index.searcher(channel).codebook
    return {
        k: ChannelQuery(
            word_ids=np.ascontiguousarray(numbers[:, :k]),
            sq_dist=np.ascontiguousarray(sq_dist[:, :k]),
            dmin=codebook.dmin,
            dmax=codebook.farthest(k, search.distance_scale),
            postings=postings,
            idf=idf,
        )
        for k in ks
    }


def of_candidates(index: OpenedIndex, scores: Scores, search: SearchConfig) -> Scores:
    """Scores of all images, left to those that a search may find and numbered as they are."""
    among = candidates(index, search.where)
    return Scores(among.of(scores.values), among.of(scores.touched))


def best_matches(index: OpenedIndex, scores: Scores, search: SearchConfig, top: int) -> list[Match]:
    """The first `top` candidates of a ranking, by the ids that the index has for them."""
    ids = candidates(index, search.where).ids
    return [replace(match, image_id=int(ids[match.image_id])) for match in rank(scores, top)]


def densities(
    index: OpenedIndex, detectors: Sequence[Detector], search: SearchConfig
) -> dict[Detector, float]:
    """By detector, the mean share of the images that one of its words is in."""
    return {
        name: index.density([f"{name}-{each}" for each in descriptors_of(index, search)])
        for name in detectors
    }


def sizes_of(
    index: OpenedIndex, detectors: Sequence[Detector], search: SearchConfig
) -> dict[Detector, NDArray[np.int64]] | None:
    """By detector, the distinct words of each candidate, where the weight `norm` wants them."""
    if "norm" not in search.weights:
        return None
    among, descriptors = candidates(index, search.where), descriptors_of(index, search)
    return {
        name: among.of(index.distinct_words([f"{name}-{each}" for each in descriptors]))
        for name in detectors
    }


def words_of(
    index: OpenedIndex,
    photo: Photo,
    detectors: Sequence[Detector],
    k: int,
    search: SearchConfig,
) -> dict[Detector, WordsFound]:
    """Describe the frames of some detectors and find their k nearest words."""
    descriptors = descriptors_of(index, search)
    return {name: nearest_words(index, photo, name, descriptors, k) for name in detectors}


def detector_votes(
    index: OpenedIndex,
    words: Mapping[Detector, WordsFound],
    ks: Sequence[int],
    search: SearchConfig,
) -> dict[tuple[Detector, int], Scores]:
    """Search with each detector alone and every k; scores of all candidates, before `norm`.

    words : as many a keypoint as the largest k, or more.
    """
    without_norm = search.model_copy(
        update={"weights": tuple(each for each in search.weights if each != "norm")}
    )
    votes = {}
    for detector, found in words.items():
        channels = [
            channel_queries(index, name, nearest, ks, search) for name, nearest in found.items()
        ]
        for k in ks:
            scores = fuse([[each[k] for each in channels]], index.n_images, without_norm)
            votes[detector, k] = of_candidates(index, scores, search)
    return votes


def search_photo(index: OpenedIndex, photo: Photo, chosen: Chosen, search: SearchConfig) -> Scores:
    """Score every candidate (`index.selecting`) for a photo, numbered as these are."""
    words = words_of(index, photo, chosen.detectors, chosen.k, search)
    votes = detector_votes(index, words, (chosen.k,), search)
    sizes = sizes_of(index, chosen.detectors, search)
    rankings = [fused_group(votes, group, chosen.k, sizes) for group in chosen.groups]
    return rankings[0] if len(rankings) == 1 else standardised_sum(rankings)
