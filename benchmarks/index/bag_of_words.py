"""The peer: a bag of words by a library's sparse matrices, held in memory."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from benchmarks.fusion.simulated import SimulatedChannel
from benchmarks.index.asking import TOP, Photo
from benchmarks.index.survey import Survey


@dataclass(frozen=True, slots=True)
class Bag:
    """What the peer took; cpu_s : of each photo's search. share_found : as of `Looked`."""

    build_s: float
    n_bytes: int
    open_s: float
    cpu_s: NDArray[np.float64]
    share_found: float


def measure_bag(root: Path, survey: Survey, photos: Sequence[Photo]) -> Bag:
    """Build, store, load and ask it: tf-idf with unit rows, one product for each channel."""
    build_s = 0.0
    for name, channel in survey.channels.items():
        pairs = [channel.pairs(copy) for copy in range(channel.n_copies)]
        words = np.concatenate([words for words, _ in pairs])
        images = np.concatenate([images for _, images in pairs]).astype(np.int32)
        del pairs
        started = time.perf_counter()
        sp.save_npz(root / f"{name}.npz", _matrix(channel, words, images), compressed=False)
        build_s += time.perf_counter() - started
    started = time.perf_counter()
    matrices = {name: sp.load_npz(root / f"{name}.npz") for name in survey.channels}
    open_s = time.perf_counter() - started
    n_real = next(iter(survey.channels.values())).use.n_images
    cpu_s, n_found = [], 0
    for photo in photos:
        started = time.thread_time()
        scores = np.zeros(survey.n_images, dtype=np.float32)
        for name, (words, _) in photo.words.items():
            asked, times = np.unique(words[:, 0], return_counts=True)
            scores += matrices[name][:, asked] @ times.astype(np.float32)
        best = np.argpartition(-scores, TOP)[:TOP]
        best = best[np.lexsort((best, -scores[best]))]
        cpu_s.append(time.thread_time() - started)
        n_found += int(best[0]) // n_real == photo.copy
    n_bytes = sum(path.stat().st_size for path in root.glob("*.npz"))
    return Bag(build_s, n_bytes, open_s, np.array(cpu_s), n_found / len(photos))


def _matrix(
    channel: SimulatedChannel, words: NDArray[np.int32], images: NDArray[np.int32]
) -> sp.csc_array:
    """Images x words, idf / norm of the image where it has the word."""
    frequency = np.bincount(words, minlength=channel.n_words)
    idf = np.log(channel.n_images / np.maximum(frequency, 1)).astype(np.float32)
    norm = np.sqrt(np.bincount(images, weights=idf[words] ** 2, minlength=channel.n_images))
    values = idf[words] ** 2 / norm[images].astype(np.float32)
    shape = (channel.n_images, channel.n_words)
    return sp.coo_array((values, (images, words)), shape=shape).tocsc()
