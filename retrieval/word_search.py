"""Nearest words by (squared distance, word id), whatever the batch, order or machine.

Words are grouped in lists around centres; a descriptor is compared with the words of its nearest
lists. Descriptors and words are whole numbers, and so is every sum: it is exact in any order.
A neighbour is handled as one int64 key, distance << 32 | word id, so that the smaller key is the
nearer word and, among equals, the smaller id.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contracts.errors import BadIndex, WrongInput
from retrieval.kernels import in_threads, kernel, read_only

_PROBES_PER_ROOT_LIST = 0.72
"""Lists searched, as a multiple of sqrt(C): see docs/decisions/0022."""

_BATCH = 8_192
_BLOCK = 64
"""Words widened at a time: with 128 dimensions they fill half of a first-level cache."""

_MISSING = np.iinfo(np.int64).max

_Points = NDArray[np.int16]
_Keys = NDArray[np.int64]
_Rows = NDArray[np.int64]
_Scan = Callable[
    [_Points, NDArray[np.uint8], NDArray[np.int32], _Rows, _Rows, NDArray[np.int32], _Keys], int
]


@dataclass(frozen=True, slots=True)
class WordLists:
    """Words by their nearest centre.

    centres : (C, D) uint8. starts : (C+1,) int64, where in `word_ids` a centre's list starts.
    word_ids : (V,) int32, every word once, ascending within a list.
    """

    centres: NDArray[np.uint8]
    starts: NDArray[np.int64]
    word_ids: NDArray[np.int32]


def one_list(words: NDArray[np.uint8]) -> WordLists:
    """A single list of (V, D) words: a descriptor is compared with every one."""
    centre = np.zeros((1, words.shape[1]), dtype=np.uint8)
    return WordLists(
        centre, np.array([0, len(words)], dtype=np.int64), np.arange(len(words), dtype=np.int32)
    )


def lists_around(centres: NDArray[np.uint8], words: NDArray[np.uint8]) -> WordLists:
    """Group (V, D) words by the nearest of (C, D) centres."""
    of_word = nearest_words(words, centres, one_list(centres), 1)[0][:, 0]
    starts = np.zeros(len(centres) + 1, dtype=np.int64)
    np.cumsum(np.bincount(of_word, minlength=len(centres)), out=starts[1:])
    return WordLists(centres, starts, np.argsort(of_word, kind="stable").astype(np.int32))


def nearest_words(
    descriptors: NDArray[np.uint8],
    words: NDArray[np.uint8],
    lists: WordLists,
    k: int,
    n_probes: int | None = None,
    n_threads: int = 1,
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Find k words of each descriptor.

    Parameters
    ----------
    descriptors : (n, D) uint8. words : (V, D) uint8. lists : of these words.
    k : at most V. n_probes : lists searched; all, where these hold fewer than k words. None: as
        many as find 0.95 of the nearest words of real descriptors, or more.
    n_threads : that share the work; what is found does not depend on them.

    Returns
    -------
    word_ids : (n, k) int32. sq_dist : (n, k) float32, exact.

    Raises
    ------
    BadIndex : the lists name words that are not there.
    WrongInput : more than 128 dimensions.
    """
    word_ids = np.empty((len(descriptors), k), dtype=np.int32)
    sq_dist = np.empty((len(descriptors), k), dtype=np.float32)
    probes = usual_probes(len(lists.centres)) if n_probes is None else n_probes

    def search(start: int) -> None:
        rows = slice(start, start + _BATCH)
        keys = _nearest_keys(_widened(descriptors[rows]), words, lists, k, probes)
        word_ids[rows] = keys & 0xFFFFFFFF
        sq_dist[rows] = keys >> 32

    starts = range(0, len(descriptors) if k else 0, _BATCH)
    for _ in in_threads(search, starts, n_threads):
        pass
    return word_ids, sq_dist


def usual_probes(n_lists: int) -> int:
    """How many of so many lists a descriptor is compared with."""
    return max(round(_PROBES_PER_ROOT_LIST * math.sqrt(n_lists)), 1)


def compile_word_search() -> None:
    """Compile every loop of a search, before the first photo or shard waits for it."""
    for width in _SCANS:
        words = np.arange(64, dtype=np.uint8)[:, None].repeat(width, axis=1)
        nearest_words(words, words, lists_around(words, words), 1)


def _nearest_keys(
    points: _Points, words: NDArray[np.uint8], lists: WordLists, k: int, n_probes: int
) -> _Keys:
    n_lists = len(lists.centres)
    if n_lists <= n_probes:
        return _among_all(points, words, lists, k)
    centres = _among_all(points, lists.centres, one_list(lists.centres), n_probes)
    starts, rows = _by_list(centres, n_lists)
    keys = _scanned(points, words, lists, starts, rows, k)
    short = np.flatnonzero(keys[:, -1] == _MISSING)
    if len(short):
        keys[short] = _among_all(points[short], words, lists, k)
    return keys


def _among_all(points: _Points, words: NDArray[np.uint8], lists: WordLists, k: int) -> _Keys:
    n_lists = len(lists.centres)
    starts = np.arange(n_lists + 1, dtype=np.int64) * len(points)
    rows = np.tile(np.arange(len(points), dtype=np.int32), n_lists)
    return _scanned(points, words, lists, starts, rows, k)


def _scanned(
    points: _Points,
    words: NDArray[np.uint8],
    lists: WordLists,
    starts: _Rows,
    rows: NDArray[np.int32],
    k: int,
) -> _Keys:
    keys = np.full((len(points), k), _MISSING, dtype=np.int64)
    scan = _SCANS[points.shape[1]]
    stray = scan(
        points,
        read_only(words, np.uint8),
        read_only(lists.word_ids, np.int32),
        read_only(lists.starts, np.int64),
        starts,
        rows,
        keys,
    )
    if stray >= 0:
        raise BadIndex(
            f"a search structure names word {lists.word_ids[stray]} of {len(words)}; "
            "restore the codebook or index again"
        )
    return keys


def _widened(descriptors: NDArray[np.uint8]) -> _Points:
    """Descriptors as int16, filled with zeros to a width that there is a loop for."""
    width = next((width for width in _SCANS if width >= descriptors.shape[1]), None)
    if width is None:
        raise WrongInput(
            f"descriptors of {descriptors.shape[1]} dimensions cannot be searched for; "
            f"at most {max(_SCANS)} keep their distances exact"
        )
    points = np.zeros((len(descriptors), width), dtype=np.int16)
    points[:, : descriptors.shape[1]] = descriptors
    return points


@kernel
def _by_list(centres: _Keys, n_lists: int) -> tuple[_Rows, NDArray[np.int32]]:
    """Turn the lists of each row into the rows of each list, ascending."""
    starts = np.zeros(n_lists + 1, dtype=np.int64)
    for key in centres.ravel():
        starts[(key & 0xFFFFFFFF) + 1] += 1
    for which in range(n_lists):
        starts[which + 1] += starts[which]
    rows = np.empty(centres.size, dtype=np.int32)
    filled = starts.copy()
    for row in range(centres.shape[0]):
        for probe in range(centres.shape[1]):
            which = centres[row, probe] & 0xFFFFFFFF
            rows[filled[which]] = row
            filled[which] += 1
    return starts, rows


def _scan_of(width: int) -> _Scan:
    """Compile the search for points of one width: known to the compiler, it becomes vectors."""

    @kernel
    def scan(
        points: _Points,
        words: NDArray[np.uint8],
        word_ids: NDArray[np.int32],
        list_starts: _Rows,
        row_starts: _Rows,
        rows: NDArray[np.int32],
        keys: _Keys,
    ) -> int:
        """Sort the words of each list into the keys of its rows; the place of a stray id, or -1."""
        last = keys.shape[1] - 1
        block = np.zeros((_BLOCK, width), dtype=np.int16)
        for which in range(len(list_starts) - 1):
            if row_starts[which] == row_starts[which + 1]:
                continue
            for start in range(list_starts[which], list_starts[which + 1], _BLOCK):
                n_words = min(_BLOCK, list_starts[which + 1] - start)
                for place in range(n_words):
                    word = word_ids[start + place]
                    if word < 0 or word >= words.shape[0]:
                        return start + place
                    for axis in range(words.shape[1]):
                        block[place, axis] = words[word, axis]
                for row in rows[row_starts[which] : row_starts[which + 1]]:
                    farthest = keys[row, last]
                    for place in range(n_words):
                        sq_dist = np.int32(0)
                        for axis in range(width):
                            apart = np.int16(points[row, axis] - block[place, axis])
                            sq_dist = np.int32(sq_dist + np.int32(np.int32(apart) * apart))
                        key = np.int64(sq_dist) << 32 | word_ids[start + place]
                        if key < farthest:
                            at = last
                            while at > 0 and keys[row, at - 1] > key:
                                keys[row, at] = keys[row, at - 1]
                                at -= 1
                            keys[row, at] = key
                            farthest = keys[row, last]
        return -1

    return scan


_SCANS: dict[int, _Scan] = {width: _scan_of(width) for width in (64, 128)}
