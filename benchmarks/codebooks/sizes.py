"""The table: microseconds, recall, memory, training and opening by size, descriptor and way."""

import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

import faiss
import numpy as np
from numpy.typing import NDArray

from benchmarks.codebooks.peers import Way, faiss_ways, ours
from benchmarks.codebooks.points import Points
from benchmarks.table import print_table
from contracts.config import CodebookConfig, Descriptor
from index.codebooks import codebook_paths, read_searcher, write_codebook
from retrieval.codebooks import Codebook, train_codebook
from retrieval.word_search import compile_word_search

_T = TypeVar("_T")
_POINTS_PER_WORD = 10
_LOOKED_UP = 4_000
_ROUNDS = 5
_HEADER = (
    "words",
    "descriptor",
    "way",
    "us a descriptor",
    "nearest found",
    "two nearest found",
    "MB",
    "training s",
    "opening ms",
)


def print_sizes(points: Mapping[Descriptor, Points], sizes: Sequence[int]) -> None:
    """Train, store, open and search codebooks of every size, one core, CPU time.

    A descriptor that is looked up is of an image of which no training point is.
    """
    faiss.omp_set_num_threads(1)
    compile_word_search()
    rows: list[tuple[str, ...]] = []
    for n_words in sizes:
        for name, of_kind in points.items():
            rows += [(f"{n_words:,}", name, *row) for row in _rows(of_kind, n_words)]
    print(f"{_LOOKED_UP} descriptors of other images at a time, best of {_ROUNDS}, CPU time\n")
    print_table(_HEADER, rows)


def _rows(points: Points, n_words: int) -> list[tuple[str, ...]]:
    limit = CodebookConfig(max_words=n_words).max_train_points
    sample = points.training[: min(_POINTS_PER_WORD * n_words, limit)]
    codebook, training_s = _timed(lambda: train_codebook(sample, n_words, seed=0), 1)
    asked = points.held_out[:_LOOKED_UP]
    exact = faiss.knn(asked.astype(np.float32), codebook.words.astype(np.float32), 2)[1]
    spent = (f"{training_s:.0f} ({len(sample):,} points)", f"{_opening_ms(codebook):.1f}")
    rows = [("ours", *_figures(ours(codebook), asked, exact), *spent)]
    for name, build in faiss_ways(codebook.words).items():
        rows.append((name, *_figures(build(), asked, exact), "", ""))
    return rows


def _figures(way: Way, asked: NDArray[np.uint8], exact: NDArray[np.int64]) -> tuple[str, ...]:
    found, _ = _timed(lambda: way.find(asked, 2), 1)
    _, seconds = _timed(lambda: way.find(asked, 1), _ROUNDS)
    both = (found[:, :, None] == exact[:, None, :]).any(axis=1).mean()
    return (
        f"{seconds / len(asked) * 1e6:.1f}",
        f"{(found[:, 0] == exact[:, 0]).mean():.3f}",
        f"{both:.3f}",
        f"{way.megabytes:.1f}",
    )


def _opening_ms(codebook: Codebook) -> float:
    with tempfile.TemporaryDirectory() as folder:
        paths = codebook_paths(Path(folder), "words", "channel")
        digests = write_codebook(paths, codebook)
        return 1000 * _timed(lambda: read_searcher(paths, digests[paths["search"]]), _ROUNDS)[1]


def _timed(call: Callable[[], _T], rounds: int) -> tuple[_T, float]:
    """What it gives, and the least CPU seconds of some rounds."""
    seconds = []
    for _ in range(rounds):
        start = time.process_time()
        given = call()
        seconds.append(time.process_time() - start)
    return given, min(seconds)
