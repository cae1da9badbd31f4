"""The compiled multi-sequence walk of the authors' public code, with its cut after T images.

Babenko & Lempitsky, The Inverted Multi-Index, CVPR 2012; METHOD section 3. Both lists ascend,
so each cell of the first meets the words of the second in order, and the next pair is the least
among the cells' next ones: the same pairs as from that algorithm's heap, without the heap.
"""

import numpy as np
from numpy.typing import NDArray

from contracts.config import UnionDistance
from retrieval.fusion_words import beyond_catalogue
from retrieval.kernels import kernel

_Lists = tuple[NDArray[np.uint32], ...]
_Floats = NDArray[np.float64]
_Offsets = NDArray[np.int64]

_OUT_OF_BOUNDS = -1
_MOST_JOINS = 255
"""That can be told apart by a byte an image, which stays in the cache."""


def walked_votes(
    lists: _Lists,
    spans: _Offsets,
    distances: _Floats,
    kept: NDArray[np.bool_],
    max_images: int,
    n_images: int,
    distance: UnionDistance,
) -> tuple[_Floats, NDArray[np.bool_]]:
    """Give each word the sum of 1 - distance over the cells taken that it is in.

    T is at work where two lists are joined, left to right over the descriptors; a single
    descriptor has no join and no cut. Arguments are as in `fusion_words`.

    Returns
    -------
    votes : (n, L, k) float64. taken : (n, L, k) bool, the word is in a cell; for each
        descriptor the first of its kept words, so that the others take no image from them.

    Raises
    ------
    BadIndex : an image beyond `n_images` was met.
    """
    scale = 1.0 / kept.shape[1] if distance == "mean" else 1.0
    votes = np.zeros(kept.shape, dtype=np.float64)
    taken = np.zeros(kept.shape, dtype=np.bool_)
    if not _walk(lists, spans, distances, kept, max_images, n_images, scale, votes, taken):
        raise beyond_catalogue(n_images)
    return votes, taken


@kernel
def _walk(
    lists: _Lists,
    spans: _Offsets,
    distances: _Floats,
    kept: NDArray[np.bool_],
    max_images: int,
    n_images: int,
    scale: float,
    votes: _Floats,
    taken: NDArray[np.bool_],
) -> bool:
    n_points, n_descriptors, _ = kept.shape
    seen = np.zeros(n_images, dtype=np.uint8)
    token = 0
    for point in range(n_points):
        words = np.flatnonzero(kept[point, 0])
        cells = np.zeros((len(words), n_descriptors), dtype=np.int64)
        cells[:, 0] = words
        cell_distance = distances[point, 0][words]
        for descriptor in range(1, n_descriptors):
            token += 1
            if token > _MOST_JOINS:
                seen[:] = 0
                token = 1
            n_taken, cells, cell_distance = _join(
                cells,
                cell_distance,
                descriptor,
                distances[point],
                kept[point],
                lists,
                spans[point],
                max_images,
                seen,
                token,
            )
            if n_taken == _OUT_OF_BOUNDS:
                return False
        for cell in range(len(cells)):
            for descriptor in range(n_descriptors):
                rank = cells[cell, descriptor]
                votes[point, descriptor, rank] += 1.0 - scale * cell_distance[cell]
                taken[point, descriptor, rank] = True
    return True


@kernel
def _join(
    cells: _Offsets,
    cell_distance: _Floats,
    descriptor: int,
    distances: _Floats,
    kept: NDArray[np.bool_],
    lists: _Lists,
    spans: _Offsets,
    max_images: int,
    seen: NDArray[np.uint8],
    token: int,
) -> tuple[int, _Offsets, _Floats]:
    """Pair `cells` (m, L) of ranks with one descriptor's words until T images are seen.

    `at_most` bounds the images seen by the lengths of the lists: only where it reaches T are
    images counted one by one, those of `waiting` words.
    """
    words = np.flatnonzero(kept[descriptor])
    joined = np.empty((len(cells) * len(words), cells.shape[1]), dtype=np.int64)
    joined_distance = np.empty(len(joined))
    next_word = np.zeros(len(cells), dtype=np.int64)
    met = np.zeros(kept.shape, dtype=np.bool_)
    waiting = np.zeros(kept.shape, dtype=np.bool_)
    n_images = at_most = taken = 0
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
            if not met[part, rank]:
                met[part, rank] = waiting[part, rank] = True
                at_most += spans[part, rank, 1] - spans[part, rank, 0]
        if at_most >= max_images:
            fresh = _count_new(lists, spans, waiting, seen, token, max_images - n_images)
            if fresh == _OUT_OF_BOUNDS:
                return _OUT_OF_BOUNDS, joined, joined_distance
            n_images += fresh
            at_most = n_images
            waiting[:] = False
        taken += 1
    return taken, joined[:taken], joined_distance[:taken]


@kernel
def _count_new(
    lists: _Lists,
    spans: _Offsets,
    waiting: NDArray[np.bool_],
    seen: NDArray[np.uint8],
    token: int,
    enough: int,
) -> int:
    """Count and mark the images of waiting words that this join has not seen, to `enough`."""
    fresh = 0
    for part, rank in np.argwhere(waiting):
        if fresh >= enough:
            break
        start, stop = spans[part, rank]
        for image in lists[part][start:stop]:
            if image >= len(seen):
                return _OUT_OF_BOUNDS
            fresh += seen[image] < token
            seen[image] = token
    return fresh
