"""Milliseconds from the (word, distance) lists of a photo to its 100 best images, one core."""

import resource
import time
import tracemalloc
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from statistics import median

import numba
import numpy as np
import scipy

from benchmarks.fusion.measured import K, WordUse
from benchmarks.fusion.simulated import N_KEYPOINTS, Size, simulated_photo
from benchmarks.fusion.sparse_products import as_matrix, best_of_union
from benchmarks.table import print_table
from contracts.config import FeatureConfig, SearchConfig
from retrieval.fusion import ChannelQuery, fuse, rank

SIZES = (
    Size(7_000, 20_000, None, 20),
    # With so many words hardly two frames of an image share one: the most there can be.
    Size(1_000_000, 1_000_000, FeatureConfig().max_frames, 250),
)
SEARCHES = {
    "union": SearchConfig(vote="union"),
    "union, burst": SearchConfig(vote="union", weights=("idf", "norm", "burst")),
    "union, T = 1,000": SearchConfig(vote="union", max_images=1_000),
    "union, T = 4,000": SearchConfig(vote="union", max_images=4_000),
    "intersection": SearchConfig(vote="intersection"),
    "pairwise": SearchConfig(vote="pairwise"),
}
PEER = f"scipy {scipy.__version__} sparse products, union"
TOP = 100
N_PHOTOS = 3
ROUNDS = 9

Photo = Sequence[Sequence[ChannelQuery]]


def run(channels: Mapping[str, WordUse]) -> None:
    """Time every rule at every size; rounds take turns over all rules and photos.

    CPU time says what is to be had on a computer that has other work.
    """
    numba.set_num_threads(1)
    for size in SIZES:
        photos = [simulated_photo(channels, size, seed) for seed in range(N_PHOTOS)]
        print(
            f"\n{size.n_images:,} images, {size.n_words:,} words a channel, {len(channels)} "
            f"channels of {N_KEYPOINTS} keypoints, k = {K}: "
            f"{_postings_touched(photos) / N_PHOTOS:,.0f} postings touched a photo, "
            f"to be fused in {size.bar_ms:g} ms; {N_PHOTOS} photos, {ROUNDS} rounds\n"
        )
        _time(photos, size, len(channels))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(f"\nThis process had {peak:.1f} GB at most, simulated postings included.")


def _postings_touched(photos: Sequence[Photo]) -> int:
    total = 0
    for photo in photos:
        for channel in (one for channels in photo for one in channels):
            lengths = np.diff(channel.postings.indptr)
            total += int(lengths[channel.word_ids].sum())
    return total


def _time(photos: Sequence[Photo], size: Size, n_channels: int) -> None:
    words = size.words_per_image or FeatureConfig().max_frames
    distinct = np.full(size.n_images, round(n_channels * words), dtype=np.int64)

    def search(photo: Photo, config: SearchConfig) -> object:
        return rank(fuse(photo, size.n_images, config, distinct), TOP)

    matrices = [
        [[as_matrix(one, size.n_images) for one in row] for row in photo] for photo in photos
    ]
    programs: dict[str, list[Callable[[], object]]] = {
        name: [partial(search, photo, config) for photo in photos]
        for name, config in SEARCHES.items()
    }
    programs[PEER] = [
        partial(best_of_union, photo, tables, distinct, TOP)
        for photo, tables in zip(photos, matrices, strict=True)
    ]
    _, expected = best_of_union(photos[0], matrices[0], distinct, TOP)
    got = fuse(photos[0], size.n_images, SEARCHES["union"], distinct).values
    assert np.allclose(got, expected, rtol=1e-9, atol=1e-9), "the peer computes something else"
    for calls in programs.values():
        calls[0]()
    wall: dict[str, list[float]] = {name: [] for name in programs}
    used: dict[str, list[float]] = {name: [] for name in programs}
    for _ in range(ROUNDS):
        for name, calls in programs.items():
            started, busy = time.perf_counter(), time.process_time()
            for call in calls:
                call()
            wall[name].append(1000 * (time.perf_counter() - started) / len(calls))
            used[name].append(1000 * (time.process_time() - busy) / len(calls))
    print_table(
        ("vote", "best ms", "median ms", "best ms of CPU", "memory beyond the postings, MB"),
        [
            (
                name,
                f"{min(wall[name]):.1f}",
                f"{median(wall[name]):.1f}",
                f"{min(used[name]):.1f}",
                f"{_peak_mb(calls[0]):.0f}",
            )
            for name, calls in programs.items()
        ],
    )


def _peak_mb(call: Callable[[], object]) -> float:
    tracemalloc.start()
    call()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 1e6
