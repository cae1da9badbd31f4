"""Measuring on real images how words are used: how often, and by which images together."""

import os
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.fusion import word_use
from benchmarks.fusion.word_use import WordUse
from contracts.config import CodebookConfig, Detector, FeatureConfig
from contracts.records import PosedImage, Postings
from coordinator.intake import read_surveys
from retrieval.codebooks import WordSearcher, build_search, n_words_for, train_codebook
from retrieval.postings import build_postings
from retrieval.sampling import SampleReservoir, sample_keys
from survey import ReadOptions
from workers.stages.extract import image_features

PAIR: tuple[Detector, ...] = ("hesaff", "mser")
K = 2

_KEPT_IN = "FLANEUR_WORD_USE"
"""A folder for what was measured: extraction takes minutes, and its result is always the same."""

_Descriptors = Mapping[str, Sequence[NDArray[np.uint8]]]


def measure(data: Path, max_words: Sequence[int]) -> Iterator[Mapping[str, WordUse]]:
    """Index the facades of KTH and the survey of Stereopolis, and ask with KTH's photos.

    Yields one measurement for each size of codebooks, or fewer words where the images do not
    give so many.
    """
    kept = os.environ.get(_KEPT_IN)
    described: tuple[_Descriptors, list[str], _Descriptors] | None = None
    for limit in max_words:
        path = Path(kept or "") / f"word-use-{limit}.npz"
        if kept and path.is_file():
            yield word_use.load(path)
            continue
        described = described or _described(data)
        config = CodebookConfig(max_words=limit)
        images, digests, photos = described
        channels = {name: _channel(images[name], digests, photos[name], config) for name in images}
        if kept:
            word_use.save(path, channels)
        yield channels


def _described(data: Path) -> tuple[_Descriptors, list[str], _Descriptors]:
    """Describe all images, in the order of their uris, and all photos; images' sha256."""
    cv2.setNumThreads(1)
    sources = [
        ("", data / "kth-buildings" / "references"),
        ("stereopolis-paris6", data / "stereopolis-paris6"),
    ]
    intake = read_surveys(sources, ReadOptions(no_pose=True))
    photos = sorted((data / "kth-buildings" / "queries").glob("*.jpg"))
    described, digests = _features(intake.images)
    asked, _ = _features([PosedImage(path.name, str(path)) for path in photos])
    return described, digests, asked


def _features(images: Sequence[PosedImage]) -> tuple[_Descriptors, list[str]]:
    config = FeatureConfig(detectors=PAIR)
    described: dict[str, list[NDArray[np.uint8]]] = defaultdict(list)
    digests = []
    for image in images:
        decoded, features = image_features(image, config)
        digests.append(decoded.sha256)
        for name, descriptors in features.descriptors.items():
            described[name].append(descriptors)
    return described, digests


def _channel(
    images: Sequence[NDArray[np.uint8]],
    digests: Sequence[str],
    photos: Sequence[NDArray[np.uint8]],
    config: CodebookConfig,
) -> WordUse:
    """Train words, find those of images and photos, and put them in order of frequency."""
    reservoir = SampleReservoir(config.max_train_points)
    for digest, descriptors in zip(digests, images, strict=True):
        reservoir.offer(sample_keys(digest, len(descriptors), config.seed), descriptors)
    n_words = n_words_for(sum(map(len, images)), config)
    codebook = train_codebook(reservoir.sample(), n_words, config.seed)
    searcher = WordSearcher(codebook, build_search(codebook.words))
    word_ids = searcher.nearest(np.concatenate(images), 1)[0][:, 0]
    words, sq_dist = searcher.nearest(np.concatenate(photos), K)

    frequency = np.diff(_postings(word_ids, images, len(codebook.words)).indptr)
    place = np.empty(len(frequency), dtype=np.int32)
    place[np.argsort(-frequency, kind="stable")] = np.arange(len(frequency))
    return WordUse(
        len(images),
        _postings(place[word_ids], images, len(frequency)),
        place[words],
        sq_dist,
        np.concatenate([[0], np.cumsum([len(photo) for photo in photos])]),
        codebook.dmin,
        codebook.farthest(K, "range"),
    )


def _postings(
    word_ids: NDArray[np.int32], images: Sequence[NDArray[np.uint8]], n_words: int
) -> Postings:
    image_ids = np.repeat(np.arange(len(images), dtype=np.uint32), [len(one) for one in images])
    return build_postings(word_ids, image_ids, n_words)
