"""Bytes of a posting and how fast lists are read, packed and otherwise."""

import importlib
import importlib.util
import time
import zlib
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from benchmarks.postings.made import MeasuredIndex
from benchmarks.table import print_table
from contracts.records import Postings
from retrieval.packing import Part, unpack
from retrieval.packing_kernels import BLOCK

_ROUNDS = 15
_HEADER = (
    *("index", "images", "words", "images a word, mean", "median", "kept as", "bytes a posting"),
    *("M postings/s, all asked", "mean list", "M postings/s, lists >= 128"),
)

_Read = Callable[[NDArray[np.int64]], object]


def print_unpacking(indices: Sequence[MeasuredIndex], with_peers: bool) -> None:
    """Read the words of photos from each index, and of these the long lists alone."""
    rows = []
    for index in indices:
        counts = index.packed.counts
        long = index.asked[counts[index.asked] >= BLOCK]
        use = f"{counts.mean():.0f}", f"{np.median(counts):.0f}"
        about = (index.name, index.n_images, index.packed.n_words, *use)
        mean_list = f"{counts[index.asked].mean():.0f}"
        for name, n_bytes, read in _ways(index, with_peers):
            speeds = [_speed(read, words, counts) for words in (index.asked, long)]
            rows.append((*about, name, f"{n_bytes:.2f}", speeds[0], mean_list, speeds[1]))
    print_table(_HEADER, rows)
    print(flush=True)


def _speed(read: _Read, words: NDArray[np.int64], counts: NDArray[np.uint32]) -> str:
    if not len(words):
        return "-"
    return f"{counts[words].sum(dtype=np.int64) / best_cpu_s(lambda: read(words)) / 1e6:,.0f}"


def best_cpu_s(work: Callable[[], object], rounds: int = _ROUNDS) -> float:
    """The least CPU time of several rounds, after one that compiles."""
    work()
    best = np.inf
    for _ in range(rounds):
        started = time.process_time()
        work()
        best = min(best, time.process_time() - started)
    return float(best)


def _ways(index: MeasuredIndex, with_peers: bool) -> Iterator[tuple[str, float, _Read]]:
    """Each way to keep the postings: its name, bytes a posting with offsets, a way to read."""
    packed, part = index.packed, Part(index.packed, 0, index.n_images)
    n_bytes = packed.offsets.nbytes + packed.counts.nbytes + packed.packed.nbytes
    yield "packed", n_bytes / packed.n_postings, lambda words: unpack([part], words)
    kept = np.ones(index.n_images, dtype=np.bool_)
    yield "packed, filtered", n_bytes / packed.n_postings, lambda words: unpack([part], words, kept)
    if not with_peers:
        return
    lists = unpack([part], np.arange(packed.n_words))
    shape = (packed.n_words, index.n_images)
    ones = np.ones(len(lists.image_ids), dtype=np.uint8)
    rows = csr_array((ones, lists.image_ids.astype(np.int32), lists.indptr), shape=shape)
    plain = 4 + lists.indptr.nbytes / packed.n_postings
    yield "uint32", plain, lambda words: _slices(lists, words)
    yield "scipy CSR", plain + 1, lambda words: rows[words].indices
    yield _zlib(lists, index)
    if importlib.util.find_spec("pyroaring"):
        yield _roaring(lists, index)


def _slices(lists: Postings, words: NDArray[np.int64]) -> NDArray[np.uint32]:
    bounds = zip(lists.indptr[words], lists.indptr[words + 1], strict=True)
    return np.concatenate([lists.image_ids[start:stop] for start, stop in bounds])


def _zlib(lists: Postings, index: MeasuredIndex) -> tuple[str, float, _Read]:
    """Gaps of the asked words as uint32, compressed list by list."""
    kept = {}
    for word in index.asked.tolist():
        images = lists.image_ids[lists.indptr[word] : lists.indptr[word + 1]]
        kept[word] = zlib.compress(np.diff(images, prepend=np.uint32(0)).tobytes(), 6)

    def read(words: NDArray[np.int64]) -> object:
        gaps = [np.frombuffer(zlib.decompress(kept[word]), np.uint32) for word in words.tolist()]
        return [np.cumsum(each, dtype=np.uint32) for each in gaps]

    return "gaps, zlib", _bytes_a_posting(map(len, kept.values()), index), read


def _roaring(lists: Postings, index: MeasuredIndex) -> tuple[str, float, _Read]:
    BitMap = importlib.import_module("pyroaring").BitMap  # noqa: N806 - a peer, if it is there
    kept = {}
    for word in index.asked.tolist():
        images = BitMap(lists.image_ids[lists.indptr[word] : lists.indptr[word + 1]])
        images.run_optimize()
        kept[word] = images.serialize()

    def read(words: NDArray[np.int64]) -> object:
        return [BitMap.deserialize(kept[word]).to_array() for word in words.tolist()]

    return "pyroaring", _bytes_a_posting(map(len, kept.values()), index), read


def _bytes_a_posting(sizes: Iterator[int], index: MeasuredIndex) -> float:
    """Of the asked words' lists; with 8 bytes a word for where they begin."""
    total = sum(sizes) + 8 * len(index.asked)
    return total / int(index.packed.counts[index.asked].sum(dtype=np.int64))
