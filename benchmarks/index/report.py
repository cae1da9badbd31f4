"""The table of all sizes, each beside what linear growth from the smallest would give."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.index.asking import Looked
from benchmarks.index.bag_of_words import Bag
from benchmarks.index.measuring import Measured
from benchmarks.table import print_table

_Figure = Callable[[Measured], float | None]


@dataclass(frozen=True, slots=True)
class _Row:
    """A line of the table. grows : with the number of images, so that linear means something."""

    name: str
    figure: _Figure
    digits: int = 1
    grows: bool = True


def _p(percent: int, seconds: Callable[[Measured], NDArray[np.float64]]) -> _Figure:
    return lambda one: 1000 * float(np.percentile(seconds(one), percent))


def _of_bag(figure: Callable[[Bag, float], float]) -> _Figure:
    """A figure of the peer and its peak, where there is one."""
    return lambda one: figure(one.bag.result, one.bag.peak_mb) if one.bag else None


_ROWS = (
    _Row("words a channel", lambda one: one.survey.n_words, 0, False),
    _Row("postings, million", lambda one: one.built.n_postings / 1e6),
    _Row("merged, s", lambda one: one.built.merge_s),
    _Row("joined, s", lambda one: one.built.join_s),
    _Row("catalogue and commit, s", lambda one: one.built.commit_s),
    _Row("from partials to the commit, s", lambda one: one.built.seconds),
    _Row("merged, M postings/s", lambda one: _rate(one, one.built.merge_s), 1, False),
    _Row("merged, M postings/s of CPU", lambda one: _rate(one, one.built.merge_cpu_s), 1, False),
    _Row("merging, peak MB", lambda one: one.built.merge_mb, 0, False),
    _Row("joining, peak MB", lambda one: one.built.join_mb, 0, False),
    _Row("inverted indices, MB", lambda one: one.built.n_bytes / 1e6),
    _Row("bytes a posting", lambda one: one.built.n_bytes / one.built.n_postings, 2, False),
    _Row("opening, ms", lambda one: 1000 * one.open_s, 1, False),
    _Row("importing before it, ms", lambda one: 1000 * one.import_s, 0, False),
    _Row("postings a photo touches, million", lambda one: _warm(one).n_postings / 1e6, 2),
    _Row("pairwise, p50 ms", _p(50, lambda one: _warm(one).seconds)),
    _Row("pairwise, p95 ms", _p(95, lambda one: _warm(one).seconds)),
    _Row("pairwise, p50 ms of CPU", _p(50, lambda one: _warm(one).cpu_s)),
    _Row("pairwise, p95 ms of CPU", _p(95, lambda one: _warm(one).cpu_s)),
    _Row("of that reading lists, p50 ms", _p(50, lambda one: _warm(one).reading_cpu_s)),
    _Row("union, p50 ms of CPU", _p(50, lambda one: one.asked.result.warm["union"].cpu_s)),
    _Row("union, p95 ms of CPU", _p(95, lambda one: one.asked.result.warm["union"].cpu_s)),
    _Row("all on disk: pairwise, p50 ms", _p(50, lambda one: one.asked.result.cold.seconds)),
    _Row("all on disk: pairwise, p95 ms", _p(95, lambda one: one.asked.result.cold.seconds)),
    _Row("asking, peak MB", lambda one: one.asked.peak_mb, 0),
    _Row("first match in its own streets", lambda one: _warm(one).share_found, 2, False),
    _Row("bag of words: built, s", _of_bag(lambda bag, _: bag.build_s)),
    _Row("bag of words: MB on disk", _of_bag(lambda bag, _: bag.n_bytes / 1e6)),
    _Row("bag of words: loaded, ms", _of_bag(lambda bag, _: 1000 * bag.open_s)),
    _Row("bag of words: peak MB", _of_bag(lambda _, peak_mb: peak_mb), 0),
    _Row("bag of words: p50 ms of CPU", _of_bag(lambda bag, _: 1000 * np.median(bag.cpu_s))),
    _Row(
        "bag of words: first match in its own streets",
        _of_bag(lambda bag, _: bag.share_found),
        2,
        False,
    ),
)


def print_report(measured: Sequence[Measured]) -> None:
    """Print it; figures in brackets are those of linear growth."""
    smallest = measured[0]
    rows = []
    for row in _ROWS:
        start = row.figure(smallest)
        cells = []
        for one in measured:
            figure = row.figure(one)
            growth = one.survey.n_images / smallest.survey.n_images
            linear = row.grows and one is not smallest and start is not None
            cells.append(
                "-"
                if figure is None
                else f"{figure:,.{row.digits}f}"
                + (f" ({start * growth:,.{row.digits}f})" if linear and start else "")
            )
        rows.append((row.name, *cells))
    print_table(("images", *(f"{one.survey.n_images:,}" for one in measured)), rows)


def _warm(one: Measured) -> Looked:
    return one.asked.result.warm["pairwise"]


def _rate(one: Measured, seconds: float) -> float:
    return one.built.n_postings / seconds / 1e6
