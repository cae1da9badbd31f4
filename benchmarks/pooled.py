"""One codebook for both detectors of a pair, the paper's own variant, beside one per channel.

METHOD section 2: the authors' scripts pool the keypoints of two detectors and make one codebook
and one inverted index per descriptor for every pair. An index on disk has a codebook per channel
and forms a pair when asked; the pooled variant lives here alone, in memory.

On equal footing: a pooled codebook has as many words as those of its two channels together, and
is trained on as many points, by the same trainer and seed. Words are made from references alone.
"""

import json
import tempfile
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import product
from multiprocessing import get_context
from pathlib import Path

import cv2
import faiss
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track

from benchmarks.table import print_table
from contracts.config import (
    DESCRIPTORS,
    MAX_NEIGHBOURS,
    CodebookConfig,
    Descriptor,
    Detector,
    FeatureConfig,
    SearchConfig,
    Vote,
)
from contracts.records import PosedImage, Postings
from retrieval.codebooks import Codebook, WordSearcher, build_search, n_words_for, train_codebook
from retrieval.evaluation import average_precision
from retrieval.fusion import ChannelQuery, Scores, full_ranking, fuse
from retrieval.postings import (
    build_postings,
    distinct_words,
    inverse_document_frequency,
)
from retrieval.resampling import bootstrap_difference
from retrieval.sampling import SampleReservoir, sample_keys
from survey import ReadOptions, read_survey
from workers.stages.extract import image_features

SETS = ("kth-buildings", "wxbs", "budaors")
POSED = "stereopolis-paris6"
DISTRACTORS = (POSED, "san-francisco-toy/database", "gps-photos")
PAIRS: tuple[tuple[Detector, Detector], ...] = (("hesaff", "mser"), ("hesaff", "star"))
VOTES: tuple[Vote, ...] = ("union", "intersection", "pairwise")
KS = (2, 5, 10)
FEATURES = FeatureConfig(detectors=("hesaff", "mser", "star"))
CODEBOOKS = CodebookConfig(max_train_points=200_000)
"""Of one channel: 20 % of its points, at most 20,000 words, ten training points each."""
_PROCESSES = 2
_ROLES = ("references", "photos")

Detectors = tuple[Detector, ...]
"""One detector, or several that share their codebooks."""


@dataclass(frozen=True, slots=True)
class Points:
    """Described keypoints of some images.

    image_ids : (n,) uint32, ascending. descriptors : (n, D) uint8.
    """

    image_ids: NDArray[np.uint32]
    descriptors: NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Channel:
    """Codebook and inverted index of one descriptor, and what all query photos ask of them.

    postings, idf (V,), sizes (n_images,) int64 : of the references; sizes = distinct words.
    photo_ids : (n,) uint32, ascending. word_ids (n, k) int32, sq_dist (n, k) float32 : the
    nearest words of the photos' keypoints.
    """

    codebook: Codebook
    postings: Postings
    idf: NDArray[np.float64]
    sizes: NDArray[np.int64]
    photo_ids: NDArray[np.uint32]
    word_ids: NDArray[np.int32]
    sq_dist: NDArray[np.float32]

    def asked(self, photo: int, search: SearchConfig, k: int) -> ChannelQuery:
        """What one photo asks with k words a keypoint."""
        rows = slice(*np.searchsorted(self.photo_ids, [photo, photo + 1]))
        return ChannelQuery(
            np.ascontiguousarray(self.word_ids[rows, :k]),
            np.ascontiguousarray(self.sq_dist[rows, :k]),
            self.codebook.dmin,
            self.codebook.farthest(k, search.distance_scale),
            self.postings,
            self.idf,
        )


@dataclass(frozen=True, slots=True)
class Photos:
    """References in the order of their ids, and queries. relevant : reference ids by query."""

    references: tuple[PosedImage, ...]
    queries: tuple[PosedImage, ...]
    relevant: tuple[frozenset[int], ...]


def pool(parts: Sequence[Points]) -> Points:
    """Put the keypoints of several detectors together: by image, then in the order of parts."""
    image_ids = np.concatenate([part.image_ids for part in parts])
    order = np.argsort(image_ids, kind="stable")
    return Points(image_ids[order], np.concatenate([part.descriptors for part in parts])[order])


def index_pool(
    references: Sequence[Points],
    photos: Sequence[Points],
    sha256: Sequence[str],
    config: CodebookConfig,
) -> Channel:
    """Train, assign and look up one descriptor of pooled detectors; of one: an index's channel.

    Parameters
    ----------
    references, photos : by detector, in one order. sha256 : of every reference image, for the
        training sample. config : of one detector's channel.
    """
    points, asking = pool(references), pool(photos)
    n_words = sum(n_words_for(len(part.image_ids), config) for part in references)
    reservoir = SampleReservoir(config.max_train_points * len(references))
    last_rows = np.cumsum(np.bincount(points.image_ids, minlength=len(sha256)))[:-1]
    for digest, described in zip(sha256, np.split(points.descriptors, last_rows), strict=True):
        reservoir.offer(sample_keys(digest, len(described), config.seed), described)
    codebook = train_codebook(reservoir.sample(), n_words, config.seed)
    searcher = WordSearcher(codebook, build_search(codebook.words))
    nearest, _ = searcher.nearest(points.descriptors, 1)
    postings = build_postings(nearest[:, 0], points.image_ids, len(codebook.words))
    return Channel(
        codebook,
        postings,
        inverse_document_frequency(np.diff(postings.indptr), len(sha256)),
        distinct_words(postings, len(sha256)),
        asking.image_ids,
        *searcher.nearest(asking.descriptors, MAX_NEIGHBOURS),
    )


def answer(
    detectors: Sequence[Sequence[Channel]], photo: int, search: SearchConfig, k: int
) -> Scores:
    """Score all references for one photo. detectors : the channels of each, or of each pool."""
    asked = [[channel.asked(photo, search, k) for channel in channels] for channels in detectors]
    sizes = np.sum([channel.sizes for channels in detectors for channel in channels], axis=0)
    return fuse(asked, len(sizes), search, sizes)


def run(data: Path) -> None:
    """Print mAP with a codebook per channel and with pooled ones, and what lies between."""
    photos = _read(data)
    with (
        tempfile.TemporaryDirectory() as scratch,
        ProcessPoolExecutor(_PROCESSES, get_context("spawn"), _one_thread) as processes,
    ):
        folder = Path(scratch)
        images = (*photos.references, *photos.queries)
        stderr = Console(stderr=True)
        found = track(processes.map(_describe, images), "images", len(images), console=stderr)
        sha256 = _store(folder, len(photos.references), found)
        groups: list[Detectors] = [*PAIRS, *((name,) for name in FEATURES.detectors)]
        jobs = list(product(groups, DESCRIPTORS))
        made = processes.map(partial(_indexed, folder, sha256), jobs)
        told = track(made, "codebooks", len(jobs), console=stderr)
        channels = dict(zip(jobs, told, strict=True))
    by_group = {group: [channels[group, name] for name in DESCRIPTORS] for group in groups}
    cap = f"at most {CODEBOOKS.max_words:,} words a channel, twice as many pooled"
    print(f"{len(photos.references)} references, {len(photos.queries)} queries; {cap}\n")
    _print_sizes(by_group)
    print()
    _print_scores(photos, by_group)


def _read(data: Path) -> Photos:
    """All images but the queries are references; both in the order of their uris."""
    truth = {
        f"{name}/{query}": [f"{name}/{reference}" for reference in relevant]
        for name in SETS
        for query, relevant in json.loads((data / name / "ground_truth.json").read_text()).items()
    }
    images = {
        image.uri: image
        for name in (*SETS, *DISTRACTORS)
        for image in read_survey(data / name, ReadOptions(name=name, no_pose=name != POSED)).images
    }
    uris = sorted(images.keys() - truth.keys())
    id_of = {uri: image_id for image_id, uri in enumerate(uris)}
    return Photos(
        tuple(images[uri] for uri in uris),
        tuple(images[uri] for uri in sorted(truth)),
        tuple(frozenset(id_of[uri] for uri in truth[query]) for query in sorted(truth)),
    )


def _one_thread() -> None:
    cv2.setNumThreads(1)
    faiss.omp_set_num_threads(1)


def _describe(image: PosedImage) -> tuple[str, dict[str, NDArray[np.uint8]]]:
    decoded, features = image_features(image, FEATURES)
    return decoded.sha256, features.descriptors


def _store(
    folder: Path, n_references: int, found: Iterable[tuple[str, dict[str, NDArray[np.uint8]]]]
) -> tuple[str, ...]:
    """Write every channel's points, references apart from photos; give references' digests."""
    digests, described = zip(*found, strict=True)
    parts = (described[:n_references], described[n_references:])
    for role, images in zip(_ROLES, parts, strict=True):
        for channel in FEATURES.channels():
            counts = [len(image[channel]) for image in images]
            ids = np.repeat(np.arange(len(images), dtype=np.uint32), counts)
            np.save(folder / f"{role}-{channel}-ids.npy", ids)
            np.save(folder / f"{role}-{channel}.npy", np.concatenate([i[channel] for i in images]))
    return digests[:n_references]


def _indexed(folder: Path, sha256: Sequence[str], job: tuple[Detectors, Descriptor]) -> Channel:
    def stored(role: str, detector: Detector) -> Points:
        name = folder / f"{role}-{detector}-{job[1]}"
        return Points(np.load(f"{name}-ids.npy"), np.load(f"{name}.npy", mmap_mode="r"))

    references, photos = ([stored(role, name) for name in job[0]] for role in _ROLES)
    return index_pool(references, photos, sha256, CODEBOOKS)


def _print_sizes(made: dict[Detectors, list[Channel]]) -> None:
    rows = []
    for group, channels in made.items():
        words = (f"{len(channel.codebook.words):,}" for channel in channels)
        postings = sum(len(channel.postings.image_ids) for channel in channels)
        rows.append(("-".join(group), *words, f"{postings:,}"))
    print_table(("codebooks of", *(f"{name} words" for name in DESCRIPTORS), "postings"), rows)


def _print_scores(photos: Photos, made: dict[Detectors, list[Channel]]) -> None:
    """A row for every set, pair, vote and k, and one a set for the means of each query."""
    settings = list(product(PAIRS, VOTES, KS))
    apart, pooled = [], []
    for pair, vote, k in settings:
        search = SearchConfig(vote=vote, weights=("idf", "norm"))
        apart.append(_average_precisions(photos, [made[name,] for name in pair], search, k))
        pooled.append(_average_precisions(photos, [made[pair]], search, k))
    labels = [("-".join(pair), vote, k) for pair, vote, k in settings]
    rows: list[tuple[object, ...]] = []
    for name in SETS:
        own = np.array([image.uri.startswith(f"{name}/") for image in photos.queries])
        one, other = np.array(apart)[:, own], np.array(pooled)[:, own]
        rows += [
            (name, *label, *_compared(*aps)) for label, *aps in zip(labels, one, other, strict=True)
        ]
        rows.append((name, "mean", "", "", *_compared(one.mean(axis=0), other.mean(axis=0))))
    scores = ("mAP per channel", "mAP pooled", "pooled - per channel")
    print_table(("set", "pair", "vote", "k", *scores), rows)


def _average_precisions(
    photos: Photos, detectors: Sequence[Sequence[Channel]], search: SearchConfig, k: int
) -> NDArray[np.float64]:
    rankings = (
        full_ranking(answer(detectors, photo, search, k)) for photo in range(len(photos.queries))
    )
    return np.array(list(map(average_precision, rankings, photos.relevant)), dtype=np.float64)


def _compared(apart: NDArray[np.float64], pooled: NDArray[np.float64]) -> tuple[str, str, str]:
    gain = bootstrap_difference(pooled, apart)
    shown = f"{gain.mean:+.3f} [{gain.low:+.3f}, {gain.high:+.3f}]"
    return f"{apart.mean():.3f}", f"{pooled.mean():.3f}", shown
