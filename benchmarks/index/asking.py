"""Opening the index of a simulated survey, and asking it with photos."""

import os
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.fusion.measured import PAIR
from benchmarks.fusion.simulated import SimulatedChannel, copies_asked
from benchmarks.index.survey import Survey
from contracts.config import DESCRIPTORS, SearchConfig, Vote
from contracts.records import Match
from index.opened import OpenedIndex
from retrieval.fusion import ChannelQuery, fuse, rank

TOP = 100
VOTES: tuple[Vote, ...] = ("pairwise", "union")
_OPENINGS = 5
_OPEN = """
import sys, time
started = time.perf_counter()
from pathlib import Path
from index.opened import OpenedIndex
imported = time.perf_counter()
OpenedIndex(Path(sys.argv[1]))
print(imported - started, time.perf_counter() - imported)
"""

Words = tuple[NDArray[np.int32], NDArray[np.float32]]


@dataclass(frozen=True, slots=True)
class Photo:
    """A photo's words and distances by channel, and the copy of the streets it was taken in."""

    words: Mapping[str, Words]
    copy: int


@dataclass(frozen=True, slots=True)
class Looked:
    """Seconds of each photo's search; of CPU, and of that until the lists are read.

    share_found : of photos whose first match is in their own copy of the streets.
    """

    seconds: NDArray[np.float64]
    cpu_s: NDArray[np.float64]
    reading_cpu_s: NDArray[np.float64]
    n_postings: float
    share_found: float


def photos_of(survey: Survey) -> list[Photo]:
    """Every real photo, each taken in another copy of the streets."""
    copies = copies_asked(next(iter(survey.channels.values())), survey.n_photos)
    return [
        Photo({name: one.photo(number, copy) for name, one in survey.channels.items()}, copy)
        for number, copy in enumerate(copies)
    ]


def opening_s(root: Path) -> tuple[float, float]:
    """Seconds that a new Python takes to open an index, and to import for it; the least."""
    times = []
    for _ in range(_OPENINGS):
        command = [sys.executable, "-c", _OPEN, str(root)]
        answer = subprocess.run(command, check=True, capture_output=True, text=True)
        importing, opening = map(float, answer.stdout.split())
        times.append((opening, importing))
    return min(times)


def look_up(index: OpenedIndex, survey: Survey, photos: Sequence[Photo], vote: Vote) -> Looked:
    """Search for every photo, one after the other."""
    times, touched, n_found = [], 0, 0
    for photo in photos:
        started, busy = time.perf_counter(), time.thread_time()
        detectors = _asked(index, survey, photo)
        read = time.thread_time()
        best = _best(index, detectors, vote)
        times.append((time.perf_counter() - started, time.thread_time() - busy, read - busy))
        touched += sum(_touched(one) for channels in detectors for one in channels)
        n_found += _copy_of(best[0], survey) == photo.copy
    seconds, cpu_s, reading_cpu_s = np.array(times).T
    return Looked(seconds, cpu_s, reading_cpu_s, touched / len(photos), n_found / len(photos))


def look_up_cold(root: Path, survey: Survey, photos: Sequence[Photo], vote: Vote) -> Looked:
    """The same by an index that was just opened, for each photo, with no file in memory."""
    looked = []
    for photo in photos:
        for path in (root / "segments").rglob("*.npy"):
            _drop_pages(path)
        looked.append(look_up(OpenedIndex(root), survey, [photo], vote))
    return Looked(
        np.concatenate([one.seconds for one in looked]),
        np.concatenate([one.cpu_s for one in looked]),
        np.concatenate([one.reading_cpu_s for one in looked]),
        float(np.mean([one.n_postings for one in looked])),
        float(np.mean([one.share_found for one in looked])),
    )


def _asked(index: OpenedIndex, survey: Survey, photo: Photo) -> list[list[ChannelQuery]]:
    """Read the lists of a photo's words, as workers/stages/retrieve.py does."""
    return [
        [
            _channel_query(index, name, survey.channels[name], photo.words[name])
            for name in (f"{detector}-{descriptor}" for descriptor in DESCRIPTORS)
        ]
        for detector in PAIR
    ]


def _channel_query(
    index: OpenedIndex, name: str, channel: SimulatedChannel, nearest: Words
) -> ChannelQuery:
    asked, places = np.unique(nearest[0], return_inverse=True)
    words = asked.astype(np.int64)
    return ChannelQuery(
        places.reshape(nearest[0].shape).astype(np.int32),
        nearest[1],
        channel.use.dmin,
        channel.use.dmax,
        index.lists(name, words),
        index.idf(name, words),
    )


def _best(
    index: OpenedIndex, detectors: Sequence[Sequence[ChannelQuery]], vote: Vote
) -> tuple[Match, ...]:
    distinct = index.distinct_words(index.config.features.channels())
    return rank(fuse(detectors, index.n_images, SearchConfig(vote=vote), distinct), TOP)


def _touched(channel: ChannelQuery) -> int:
    return int(np.diff(channel.postings.indptr)[channel.word_ids].sum())


def _copy_of(match: Match, survey: Survey) -> int:
    return match.image_id // next(iter(survey.channels.values())).use.n_images


def _drop_pages(path: Path) -> None:
    """Ask the system to forget a file's pages."""
    with path.open("rb") as stream:
        os.posix_fadvise(stream.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
