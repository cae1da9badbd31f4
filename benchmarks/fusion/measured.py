"""How often real images, and the keypoints of real photos, have each visual word."""

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.table import print_table
from contracts.config import DESCRIPTORS, Detector, FeatureConfig, IndexConfig
from coordinator.cli.show import bars
from coordinator.engine import running_engine
from coordinator.indexing import run_job
from coordinator.plan import DEFAULT_SHARD_SIZE, make_plan, read_surveys
from index.opened import OpenedIndex
from survey import ReadOptions
from workers.stages.retrieve import nearest_words, read_photo

PAIR: tuple[Detector, ...] = ("hesaff", "mser")
K = 2
_QUERY_STEP = 3
"""Every third of the 50 photos is read."""
_SHARES = (0.001, 0.01, 0.05, 0.1, 0.25, 0.5, 1.0)


@dataclass(frozen=True, slots=True)
class WordUse:
    """One channel of a real index, its words by descending document frequency.

    frequency : (V,) int64, images that have each word. words_per_image : their mean number.
    ranks : (n, K) int64, places in that order of the words of n keypoints of photos.
    sq_dist : (n, K) float32, their distances.
    """

    frequency: NDArray[np.int64]
    words_per_image: float
    ranks: NDArray[np.int64]
    sq_dist: NDArray[np.float32]

    def relative_frequency(self) -> NDArray[np.float64]:
        """Document frequency as a multiple of its mean; (V,)."""
        relative: NDArray[np.float64] = self.frequency / self.frequency.mean()
        return relative


def measure(data: Path, root: Path) -> Mapping[str, WordUse]:
    """Index the facades of KTH and the survey of Stereopolis, and ask with KTH's photos."""
    cv2.setNumThreads(1)
    index = _indexed(data, root)
    photos = sorted((data / "kth-buildings" / "queries").glob("*.jpg"))[::_QUERY_STEP]
    found: dict[str, list[tuple[NDArray[np.int32], NDArray[np.float32]]]] = {}
    for path in photos:
        photo = read_photo(index, str(path))
        for detector in PAIR:
            for channel, nearest in nearest_words(index, photo, detector, DESCRIPTORS, K).items():
                found.setdefault(channel, []).append(nearest)
    print(f"{index.n_images} images, {len(photos)} photos, {K} words a keypoint\n")
    return {channel: _word_use(index, channel, nearest) for channel, nearest in found.items()}


def print_frequencies(channels: Mapping[str, WordUse]) -> None:
    """Print rank frequency and document frequency of every channel."""
    header = ("most frequent words", *channels)
    print("Share of the photos' words (rank frequency)\n")
    rows = [
        (
            f"{share:.1%}",
            *(
                f"{(use.ranks < share * len(use.frequency)).mean():.3f}"
                for use in channels.values()
            ),
        )
        for share in _SHARES
    ]
    print_table(header, rows)
    print("\nImages that have the last of them, as a multiple of the mean (document frequency)\n")
    rows = [
        (
            f"{share:.1%}",
            *(
                f"{use.relative_frequency()[int(share * (len(use.frequency) - 1))]:.2f}"
                for use in channels.values()
            ),
        )
        for share in _SHARES
    ]
    print_table(header, rows)
    print()
    print_table(
        ("channel", "words", "an image", "images a word", "images a photo's word"),
        [
            (
                name,
                len(use.frequency),
                f"{use.words_per_image:.0f}",
                f"{use.frequency.mean():.1f}",
                f"{use.frequency[use.ranks].mean():.1f}",
            )
            for name, use in channels.items()
        ],
    )


def _indexed(data: Path, root: Path) -> OpenedIndex:
    sources = [
        ("", data / "kth-buildings" / "references"),
        ("stereopolis-paris6", data / "stereopolis-paris6"),
    ]
    config = IndexConfig(features=FeatureConfig(detectors=PAIR))
    with running_engine(None, None) as engine, bars() as progress:
        intake = read_surveys(sources, ReadOptions(no_pose=True))
        job, plan = make_plan(root, intake, config, DEFAULT_SHARD_SIZE)
        run_job(job, plan, intake, nullcontext(engine), progress)
    return OpenedIndex(root)


def _word_use(
    index: OpenedIndex,
    channel: str,
    nearest: Sequence[tuple[NDArray[np.int32], NDArray[np.float32]]],
) -> WordUse:
    postings = index.postings(channel)
    frequency = np.diff(postings.indptr)
    by_frequency = np.argsort(-frequency, kind="stable")
    rank_of = np.empty(len(frequency), dtype=np.int64)
    rank_of[by_frequency] = np.arange(len(frequency))
    return WordUse(
        frequency[by_frequency],
        len(postings.image_ids) / index.n_images,
        rank_of[np.concatenate([words for words, _ in nearest])],
        np.concatenate([sq_dist for _, sq_dist in nearest]),
    )
