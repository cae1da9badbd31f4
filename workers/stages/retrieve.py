"""Retrieve: a photo, a choice of detectors and k, and the fusion of their inverted indices."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from contracts.config import Descriptor, Detector, FeatureConfig, IndexConfig, SearchConfig
from contracts.errors import BadConfig
from contracts.records import Frames
from index.models import read_model
from index.opened import OpenedIndex
from retrieval.choice import Choice, ChoiceModel
from retrieval.complementarity import Complementarity, all_pairs
from retrieval.descriptors import describe
from retrieval.detectors import detect
from retrieval.fusion import ChannelQuery, Scores, fuse
from retrieval.pyramid import Pyramid, build_pyramid
from survey import DecodedImage, decode_image

DEFAULT_PAIR: tuple[Detector, Detector] = ("hesaff", "mser")
"""The pair where no model chooses (docs/decisions/0006)."""
DEFAULT_K = 2
KS = (2, 5, 10)
"""What `--k auto` chooses from, as in the paper's Table IV."""


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
    """The index stays open between the photos that a process works on."""
    opened = OpenedIndex(Path(root))
    if opened.generation.number != generation:
        raise BadConfig(
            f"{root} is at generation {opened.generation.number}, asked for {generation}. "
            "It was written to in between: run the command again."
        )
    return opened


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
    """What a photo is searched with, and how that came to be."""

    detectors: tuple[Detector, ...]
    k: int
    predicted_map: float | None
    choice: str


def choose(index: Configured, photo: Photo, search: SearchConfig) -> Chosen:
    """Settle the detectors and k: as given, by the model, or the default that says so."""
    if search.pair != "auto" and search.k != "auto":
        return Chosen(search.pair, search.k, None, "given")
    if search.pair != "auto" and len(search.pair) == 1:
        return Chosen(search.pair, DEFAULT_K, None, "given; k by default: models choose for pairs")
    model, why_not = usable_model(index, search)
    if model is None:
        pair = search.pair if search.pair != "auto" else default_pair(index)
        k = search.k if search.k != "auto" else DEFAULT_K
        return Chosen(pair, k, None, f"default: {why_not}")
    features = photo.complementarity(model.detectors)
    if search.pair != "auto":
        wanted = set(search.pair)
        features = {pair: scores for pair, scores in features.items() if set(pair) == wanted}
    made: Choice = model.choose(features, KS if search.k == "auto" else (search.k,))
    return Chosen(made.pair, made.k, made.predicted_map, made.reason)


def default_pair(index: Configured) -> tuple[Detector, ...]:
    """The default pair, or the first detectors of an index that lacks one of it."""
    detectors = index.config.features.detectors
    return DEFAULT_PAIR if set(DEFAULT_PAIR) <= set(detectors) else detectors[:2]


def usable_model(index: Configured, search: SearchConfig) -> tuple[ChoiceModel | None, str]:
    """The index's own model, or the shipped one, if it fits this search and is worth it."""
    model = read_model(index.root)
    if model is None:
        return None, "no model"
    missing = set(model.detectors) - set(index.config.features.detectors)
    if missing:
        return None, f"the model also wants {', '.join(sorted(missing))}"
    untrained = set(() if search.pair == "auto" else search.pair) - set(model.detectors)
    if untrained:
        return None, f"the model was trained without {', '.join(sorted(untrained))}"
    trained = (model.descriptors, model.vote, model.weights)
    asked = (descriptors_of(index, search), search.vote, tuple(sorted(search.weights)))
    if trained != asked:
        return None, "the model was trained with other descriptors, vote or weights"
    if not model.is_worth_using:
        scores = model.left_out
        return None, (
            f"on places left out the model ({scores.adaptive:.3f}) is no better than one pair "
            f"for all ({scores.best_fixed:.3f})"
        )
    return model, ""


def descriptors_of(index: Configured, search: SearchConfig) -> tuple[Descriptor, ...]:
    """The descriptors a search uses: those asked for, or all of the index."""
    return search.descriptors or index.config.features.descriptors


def nearest_words(
    index: OpenedIndex,
    photo: Photo,
    detector: Detector,
    descriptors: Sequence[Descriptor],
    k: int,
) -> dict[str, tuple[NDArray[np.int32], NDArray[np.float32]]]:
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


def channel_query(
    index: OpenedIndex,
    channel: str,
    nearest: tuple[NDArray[np.int32], NDArray[np.float32]],
    k: int,
    search: SearchConfig,
) -> ChannelQuery:
    """What fusion needs of one channel: the first k of the words found, and their postings."""
    codebook = index.searcher(channel).codebook
    return ChannelQuery(
        word_ids=np.ascontiguousarray(nearest[0][:, :k]),
        sq_dist=np.ascontiguousarray(nearest[1][:, :k]),
        dmin=codebook.dmin,
        dmax=float(codebook.dmax[k - 1]),
        postings=index.postings(channel),
        idf=index.idf(channel) if "idf" in search.weights else None,
    )


def search_photo(index: OpenedIndex, photo: Photo, chosen: Chosen, search: SearchConfig) -> Scores:
    """Score every image of the index for a photo."""
    descriptors = descriptors_of(index, search)
    queries = []
    for detector in chosen.detectors:
        nearest = nearest_words(index, photo, detector, descriptors, chosen.k)
        queries.append(
            [channel_query(index, name, found, chosen.k, search) for name, found in nearest.items()]
        )
    channels = [f"{det}-{desc}" for det in chosen.detectors for desc in descriptors]
    distinct = index.distinct_words(channels) if "norm" in search.weights else None
    return fuse(queries, index.n_images, search, distinct)
