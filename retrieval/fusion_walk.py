"""The compiled multi-sequence walk of the authors' public code, with its cut after T images.

Babenko & Lempitsky, The Inverted Multi-Index, CVPR 2012; METHOD section 3. Both lists ascend,
so each cell of the first meets the words of the second in order, and the next pair is the least
among the cells' next ones: the same pairs as from that algorithm's heap, without the heap.
"""

import numpy as np
from numpy.typing import NDArray

from retrieval.fusion_kernels import give_votes, is_skipped
from retrieval.kernels import kernel

_Seen = NDArray[np.int32]
_Floats = NDArray[np.float64]
_Offsets = NDArray[np.int64]


@kernel
def _count_new(images: NDArray[np.uint32], start: int, stop: int, seen: _Seen, token: int) -> int:
    fresh = 0
    for at in range(start, stop):
        image = images[at]
        if seen[image] != token:
            seen[image] = token
            fresh += 1
    return fresh


@kernel
def _join(
    cells: _Offsets,
    cell_distance: _Floats,
    descriptor: int,
    distances: _Floats,
    segments: _Offsets,
    images: NDArray[np.uint32],
    max_images: int,
    seen: _Seen,
    token: int,
) -> tuple[_Offsets, _Floats]:
    """Pair `cells` (m, L) of ranks with one descriptor's words until T images are seen."""
    words = np.flatnonzero(segments[descriptor, :, 1] > segments[descriptor, :, 0])
    joined = np.empty((len(cells) * len(words), cells.shape[1]), dtype=np.int64)
    joined_distance = np.empty(len(joined))
    next_word = np.zeros(len(cells), dtype=np.int64)
    counted = np.zeros(distances.shape, dtype=np.bool_)
    n_images = taken = 0
    while n_images < max_images and taken < len(joined):
        best, least = -1, np.inf
        for u in range(len(cells)):
            if next_word[u] < len(words):
                distance = cell_distance[u] + distances[descriptor, words[next_word[u]]]
                if distance < least:
                    best, least = u, distance
            if next_word[u] == 0:  # no later cell can come before this one's first pair
                break
        joined[taken] = cells[best]
        joined[taken, descriptor] = words[next_word[best]]
        joined_distance[taken] = least
        next_word[best] += 1
        for part in range(descriptor + 1):
            rank = joined[taken, part]
            if not counted[part, rank]:
                counted[part, rank] = True
                start, stop = segments[part, rank]
                n_images += _count_new(images, start, stop, seen, token)
        taken += 1
    return joined[:taken], joined_distance[:taken]


@kernel
def vote_union_walk(
    images: NDArray[np.uint32],
    segments: _Offsets,
    distances: _Floats,
    squared_idf: _Floats,
    max_images: int,
    seen: _Seen,
    token: int,
    score: _Floats,
    voters: _Seen,
) -> None:
    """Add 1 - distance for each occurrence in the cells taken, left to right over descriptors.

    T is at work where two lists are joined; a single descriptor has no join and no cut.
    """
    n_points, n_descriptors, k = distances.shape
    weights = np.empty((n_descriptors, k), dtype=np.float64)
    for point in range(n_points):
        if is_skipped(segments, point):
            continue
        base = token + 1 + point * (n_descriptors + 1)
        kept = np.flatnonzero(segments[point, 0, :, 1] > segments[point, 0, :, 0])
        cells = np.zeros((len(kept), n_descriptors), dtype=np.int64)
        cells[:, 0] = kept
        cell_distance = distances[point, 0][kept]
        for descriptor in range(1, n_descriptors):
            cells, cell_distance = _join(
                cells,
                cell_distance,
                descriptor,
                distances[point],
                segments[point],
                images,
                max_images,
                seen,
                base + descriptor,
            )
        weights[:] = np.nan
        for cell in range(len(cells)):
            for descriptor in range(n_descriptors):
                rank = cells[cell, descriptor]
                if np.isnan(weights[descriptor, rank]):
                    weights[descriptor, rank] = 0.0
                weights[descriptor, rank] += 1.0 - cell_distance[cell]
        weights *= squared_idf[point]
        give_votes(images, segments, weights, point, seen, base, score, voters)
