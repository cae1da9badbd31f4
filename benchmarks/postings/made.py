"""The indices that are measured, and the partial ones that they are merged from."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.fusion.simulated import SimulatedChannel, copies_asked
from benchmarks.fusion.word_use import WordUse
from contracts.records import PackedPostings
from index.files import map_array
from retrieval.merging import keys_of_words, merge_keys, word_ranges
from retrieval.packing import pack

_PHOTOS = 5
_FILES_PER_COPY = 8


@dataclass(frozen=True, slots=True)
class MeasuredIndex:
    """One channel. asked : (m,) int64, ascending, the words of the keypoints of some photos."""

    name: str
    n_images: int
    packed: PackedPostings
    asked: NDArray[np.int64]


def real_index(use: WordUse) -> MeasuredIndex:
    """The images that were measured themselves."""
    asked = np.unique(np.concatenate([use.photo(number)[0] for number in range(_PHOTOS)]))
    return MeasuredIndex("real", use.n_images, pack(use.postings), asked.astype(np.int64))


def write_partials(folder: Path, channel: SimulatedChannel) -> list[Path]:
    """Write the survey's partial indices, each of a part of a copy of the streets."""
    paths = []
    for copy in range(channel.n_copies):
        keys = channel.keys(copy)
        part = (keys & np.uint64(2**32 - 1)) * np.uint64(_FILES_PER_COPY)
        part = (part // np.uint64(channel.use.n_images)) % np.uint64(_FILES_PER_COPY)
        for number in range(_FILES_PER_COPY):
            paths.append(folder / f"{copy:04d}-{number}.npy")
            np.save(paths[-1], keys[part == number], allow_pickle=False)
    return paths


def runs_of(partials: Sequence[Path], first: int, stop: int) -> list[NDArray[np.uint64]]:
    """Read a range of words as the merge task does."""
    return [keys_of_words(map_array(path, np.uint64, 1), first, stop).copy() for path in partials]


def simulated_index(channel: SimulatedChannel, partials: Sequence[Path]) -> MeasuredIndex:
    """Merge and pack all words, a range at a time."""
    n_postings = sum(len(map_array(path, np.uint64, 1)) for path in partials)
    pieces = [
        pack(merge_keys(runs_of(partials, first, stop), first, stop - first))
        for first, stop in word_ranges(channel.n_words, n_postings)
    ]
    sizes = np.concatenate([np.diff(piece.offsets) for piece in pieces])
    packed = PackedPostings(
        np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(sizes)]),
        np.concatenate([piece.counts for piece in pieces]),
        np.concatenate([piece.packed for piece in pieces]),
    )
    copies = copies_asked(channel, _PHOTOS)
    words = [channel.photo(number, copy)[0] for number, copy in enumerate(copies)]
    asked = np.unique(np.concatenate(words)).astype(np.int64)
    return MeasuredIndex("simulated", channel.n_images, packed, asked)
