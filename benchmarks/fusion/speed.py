"""Milliseconds from the (word, distance) lists of a photo to its 100 best images, one core."""

import resource
import time
import tracemalloc
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from statistics import median

import numba
import numpy as np
import scipy
from numpy.typing import NDArray

from benchmarks.fusion.measured import PAIR, K
from benchmarks.fusion.simulated import SimulatedChannel, copies_asked
from benchmarks.fusion.sparse_products import as_matrix, best_of_union
from benchmarks.fusion.word_use import WordUse
from benchmarks.table import print_table
from contracts.config import DESCRIPTORS, SearchConfig
from retrieval.fusion import ChannelQuery, fuse, rank
from retrieval.postings import inverse_document_frequency


@dataclass(frozen=True, slots=True)
class Size:
    """A survey to simulate, and what fusing one pair may take.

    measured_words : size of the codebooks of which the use of words was measured.
    """

    n_images: int
    n_words: int
    measured_words: int
    bar_ms: float


SIZES = (Size(7_000, 20_000, 20_000, 20), Size(1_000_000, 1_000_000, 100_000, 250))
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
PHOTOS = (0, 17, 34)
"""Of the 50: one of each third."""
ROUNDS = 9

Photo = Sequence[Sequence[ChannelQuery]]


def run(size: Size, channels: Mapping[str, WordUse]) -> None:
    """Time every rule; rounds take turns over all rules and photos.

    CPU time says what is to be had on a computer that has other work.
    """
    numba.set_num_threads(1)
    simulated = {
        name: SimulatedChannel(use, size.n_images, size.n_words, seed)
        for seed, (name, use) in enumerate(channels.items())
    }
    asked = {name: _asked(channel) for name, channel in simulated.items()}
    photos = [
        [[asked[f"{detector}-{name}"][number] for name in DESCRIPTORS] for detector in PAIR]
        for number in range(len(PHOTOS))
    ]
    print(
        f"\n{size.n_images:,} images, {size.n_words:,} words a channel, {len(channels)} channels, "
        f"k = {K}: {_postings_touched(photos) / len(photos):,.0f} postings touched a photo, to be "
        f"fused in {size.bar_ms:g} ms; {len(photos)} photos, {ROUNDS} rounds\n"
    )
    words_per_image = sum(use.words_per_image for use in channels.values())
    _time(photos, np.full(size.n_images, round(words_per_image), dtype=np.int64))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(f"\nThis process had {peak:.1f} GB at most, simulated postings included.")


def _asked(channel: SimulatedChannel) -> list[ChannelQuery]:
    """What the photos ask of one channel, and the lists of all their words."""
    copies = copies_asked(channel, len(PHOTOS))
    nearest = [channel.photo(number, copy) for number, copy in zip(PHOTOS, copies, strict=True)]
    words = np.unique(np.concatenate([word_ids.ravel() for word_ids, _ in nearest]))
    lists = channel.lists(words)
    idf = inverse_document_frequency(np.diff(lists.indptr), channel.n_images)
    return [
        ChannelQuery(
            np.searchsorted(words, word_ids).astype(np.int32),
            sq_dist,
            channel.use.dmin,
            channel.use.dmax,
            lists,
            idf,
        )
        for word_ids, sq_dist in nearest
    ]


def _postings_touched(photos: Sequence[Photo]) -> int:
    total = 0
    for photo in photos:
        for channel in (one for channels in photo for one in channels):
            lengths = np.diff(channel.postings.indptr)
            total += int(lengths[channel.word_ids].sum())
    return total


def _time(photos: Sequence[Photo], distinct: NDArray[np.int64]) -> None:
    n_images = len(distinct)

    def search(photo: Photo, config: SearchConfig) -> object:
        return rank(fuse(photo, n_images, config, distinct), TOP)

    matrices = [[[as_matrix(one, n_images) for one in row] for row in photo] for photo in photos]
    programs: dict[str, list[Callable[[], object]]] = {
        name: [partial(search, photo, config) for photo in photos]
        for name, config in SEARCHES.items()
    }
    programs[PEER] = [
        partial(best_of_union, photo, tables, distinct, TOP)
        for photo, tables in zip(photos, matrices, strict=True)
    ]
    _, expected = best_of_union(photos[0], matrices[0], distinct, TOP)
    got = fuse(photos[0], n_images, SEARCHES["union"], distinct).values
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
