"""The compiled passes of fusion: gather the images of words, then let keypoints vote.

All take n keypoints with L descriptors and k words each. `spans` (n, L, k, 2) int64 holds start
and stop of each word's postings in its channel's image ids; they must have been checked.
`segments`, of the same shape, holds start and stop, in the flat `images` buffer, of what each
word adds to its keypoint: its images without removed ones and without those that a nearer word
of the same descriptor already has. `distances` (n, L, k) float64 are the d' of METHOD section 3,
`squared_idf` (n, L, k) float64 the factor of each word. `removed` has one entry an image, or
none at all when nothing is removed. Votes are added to `score`, one more voting keypoint to
`voters`; `seen` remembers, per image, a token that grows through all passes of one detector.
"""

import numpy as np
from numpy.typing import NDArray

from retrieval.kernels import kernel

BAD_IMAGE = -1

_Seen = NDArray[np.int32]
_Floats = NDArray[np.float64]
_Offsets = NDArray[np.int64]


@kernel
def gather(
    image_ids: NDArray[np.uint32],
    spans: _Offsets,
    removed: NDArray[np.bool_],
    descriptor: int,
    seen: _Seen,
    token: int,
    images: NDArray[np.uint32],
    filled: int,
    segments: _Offsets,
) -> int:
    """Append one channel's images to `images[filled:]`; give the new fill, or `BAD_IMAGE`.

    `images` must be large enough. Tokens `token + 1` to `token + n` are used up.
    """
    for point in range(len(spans)):
        token += 1
        for rank in range(spans.shape[2]):
            start, stop = spans[point, descriptor, rank]
            segments[point, descriptor, rank, 0] = filled
            for image in image_ids[start:stop]:
                if image >= len(seen):
                    return BAD_IMAGE
                if seen[image] == token or (len(removed) > 0 and removed[image]):
                    continue
                seen[image] = token
                images[filled] = image
                filled += 1
            segments[point, descriptor, rank, 1] = filled
    return filled


@kernel
def _words_kept(segments: _Offsets, point: int, descriptor: int) -> int:
    kept = 0
    for rank in range(segments.shape[2]):
        if segments[point, descriptor, rank, 1] > segments[point, descriptor, rank, 0]:
            kept += 1
    return kept


@kernel
def is_skipped(segments: _Offsets, point: int) -> bool:
    for descriptor in range(segments.shape[1]):
        if _words_kept(segments, point, descriptor) == 0:
            return True
    return False


@kernel
def give_votes(
    images: NDArray[np.uint32],
    segments: _Offsets,
    weights: _Floats,
    point: int,
    seen: _Seen,
    token: int,
    score: _Floats,
    voters: _Seen,
) -> None:
    """Give each image of a word with a weight (not NaN) that weight."""
    for descriptor in range(segments.shape[1]):
        for rank in range(segments.shape[2]):
            weight = weights[descriptor, rank]
            if np.isnan(weight):
                continue
            start, stop = segments[point, descriptor, rank]
            for at in range(start, stop):
                image = images[at]
                score[image] += weight
                if seen[image] != token:
                    seen[image] = token
                    voters[image] += 1


@kernel
def vote_union(
    images: NDArray[np.uint32],
    segments: _Offsets,
    distances: _Floats,
    squared_idf: _Floats,
    seen: _Seen,
    token: int,
    score: _Floats,
    voters: _Seen,
) -> None:
    """Add the closed form of the walk with T not binding (METHOD section 3)."""
    n_points, n_descriptors, k = distances.shape
    kept = np.empty(n_descriptors, dtype=np.int64)
    total = np.empty(n_descriptors, dtype=np.float64)
    weights = np.empty((n_descriptors, k), dtype=np.float64)
    for point in range(n_points):
        if is_skipped(segments, point):
            continue
        n_cells = 1
        for descriptor in range(n_descriptors):
            kept[descriptor] = _words_kept(segments, point, descriptor)
            n_cells *= kept[descriptor]
            total[descriptor] = 0.0
            for rank in range(k):
                if segments[point, descriptor, rank, 1] > segments[point, descriptor, rank, 0]:
                    total[descriptor] += distances[point, descriptor, rank]
        for descriptor in range(n_descriptors):
            others = 0.0
            for other in range(n_descriptors):
                if other != descriptor:
                    others += n_cells / (kept[descriptor] * kept[other]) * total[other]
            for rank in range(k):
                near = 1.0 - distances[point, descriptor, rank]
                weights[descriptor, rank] = (
                    n_cells / kept[descriptor] * near - others
                ) * squared_idf[point, descriptor, rank]
        give_votes(images, segments, weights, point, seen, token + 1 + point, score, voters)


@kernel
def vote_intersection(
    lists: tuple[NDArray[np.uint32], ...],
    spans: _Offsets,
    distances: _Floats,
    squared_idf: _Floats,
    removed: NDArray[np.bool_],
    seen: _Seen,
    running: _Floats,
    score: _Floats,
    voters: _Seen,
) -> int:
    """Add the product over descriptors of (1 - d'), for images that all of them found.

    Nothing is gathered first, `lists` are the channels' own image ids: an image that passed a
    descriptor is marked so, and passes it once, by its nearest word. `seen` starts at 0. Gives
    0 or `BAD_IMAGE`.
    """
    n_points, n_descriptors, k = distances.shape
    last = n_descriptors - 1
    for point in range(n_points):
        passed = 1 + point * n_descriptors
        for descriptor in range(n_descriptors):
            image_ids = lists[descriptor]
            for rank in range(k):
                near = 1.0 - distances[point, descriptor, rank]
                vote = near * squared_idf[point, descriptor, rank]
                start, stop = spans[point, descriptor, rank]
                for image in image_ids[start:stop]:
                    if image >= len(seen):
                        return BAD_IMAGE
                    if descriptor == 0:
                        if seen[image] == passed:
                            continue
                        product = vote
                    elif seen[image] == passed + descriptor - 1:
                        product = running[image] * vote
                    else:
                        continue
                    seen[image] = passed + descriptor
                    if descriptor < last:
                        running[image] = product
                    elif len(removed) == 0 or not removed[image]:
                        score[image] += product
                        voters[image] += 1
    return 0


@kernel
def vote_pairwise(
    images: NDArray[np.uint32],
    segments: _Offsets,
    distances: _Floats,
    squared_idf: _Floats,
    seen: _Seen,
    token: int,
    running: _Floats,
    score: _Floats,
    voters: _Seen,
) -> None:
    """Add the sum over descriptor pairs of (1 - d'_l)(1 - d'_m), for images of two or more."""
    n_points, n_descriptors, k = distances.shape
    for point in range(n_points):
        if is_skipped(segments, point):
            continue
        once, twice = token + 1 + 2 * point, token + 2 + 2 * point
        for descriptor in range(n_descriptors):
            for rank in range(k):
                vote = (1.0 - distances[point, descriptor, rank]) * squared_idf[
                    point, descriptor, rank
                ]
                start, stop = segments[point, descriptor, rank]
                for at in range(start, stop):
                    image = images[at]
                    if seen[image] != once and seen[image] != twice:
                        seen[image] = once
                        running[image] = vote
                        continue
                    if seen[image] == once:
                        seen[image] = twice
                        voters[image] += 1
                    score[image] += running[image] * vote
                    running[image] += vote
