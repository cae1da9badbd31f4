"""K-means of byte descriptors: flat, and in two levels where flat would take minutes.

The same points, number and seed give the same centres: every sum is made by one thread, in one
order, and threads share what does not depend on each other.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import faiss
import numpy as np
from numpy.typing import NDArray

from retrieval.kernels import in_threads
from retrieval.word_search import lists_around, nearest_words, one_list

_ITERATIONS = 15
_FLAT_WORK = 100_000_000
"""Points times centres up to which flat k-means is used: some six seconds of one core."""

_POINTS_PER_COARSE_CLUSTER = 256
_REFINEMENTS = 3
_REFINEMENT_PROBES = 8
_CENTRES_MOVED_AT_ONCE = 8_192


@contextmanager
def one_thread() -> Iterator[None]:
    """Let faiss use one thread: sums then come in one order."""
    threads = faiss.omp_get_max_threads()
    faiss.omp_set_num_threads(1)
    try:
        yield
    finally:
        faiss.omp_set_num_threads(threads)


def kmeans(
    points: NDArray[np.uint8], n_clusters: int, seed: int, n_threads: int = 1
) -> NDArray[np.uint8]:
    """Find (n_clusters, D) whole-number centres of (n, D) points, flat or in two levels."""
    if in_one_level(len(points), n_clusters):
        return flat_kmeans(points, n_clusters, seed)
    return two_level_kmeans(points, n_clusters, seed, n_threads)


def in_one_level(n_points: int, n_clusters: int) -> bool:
    """Whether flat k-means is quick enough."""
    return n_points * n_clusters <= _FLAT_WORK


def flat_kmeans(points: NDArray[np.uint8], n_clusters: int, seed: int) -> NDArray[np.uint8]:
    """Lloyd's k-means on all of the (n, D) points; (n_clusters, D) whole-number centres.

    n_clusters is at least 1 and at most n.
    """
    clustering = faiss.Kmeans(
        points.shape[1],
        n_clusters,
        niter=_ITERATIONS,
        seed=seed,
        min_points_per_centroid=1,
        max_points_per_centroid=len(points),
    )
    with one_thread():
        clustering.train(points.astype(np.float32))
    centres = np.asarray(clustering.centroids, dtype=np.float32)
    return np.clip(np.rint(centres), 0, 255).astype(np.uint8)


def two_level_kmeans(
    points: NDArray[np.uint8], n_clusters: int, seed: int, n_threads: int = 1
) -> NDArray[np.uint8]:
    """About sqrt(n_clusters) coarse clusters, each one's share of centres within it, then mend.

    Three Lloyd steps over all points let centres cross the borders of the coarse clusters.
    """
    n_coarse = round(np.sqrt(n_clusters))
    coarse = flat_kmeans(points[: n_coarse * _POINTS_PER_COARSE_CLUSTER], n_coarse, seed)
    nearest = nearest_words(points, coarse, one_list(coarse), 1, None, n_threads)[0][:, 0]
    sizes = np.bincount(nearest, minlength=n_coarse)
    members = np.split(np.argsort(nearest, kind="stable"), np.cumsum(sizes)[:-1])
    shares = share_out(n_clusters, sizes).tolist()

    def divide(cluster: int) -> NDArray[np.uint8]:
        return flat_kmeans(points[members[cluster]], shares[cluster], seed + 1 + cluster)

    shared = (cluster for cluster, share in enumerate(shares) if share)
    centres = np.concatenate(list(in_threads(divide, shared, n_threads)))
    for _ in range(_REFINEMENTS):
        centres = _lloyd_step(points, centres, coarse, n_threads)
    return centres


def _lloyd_step(
    points: NDArray[np.uint8],
    centres: NDArray[np.uint8],
    coarse: NDArray[np.uint8],
    n_threads: int,
) -> NDArray[np.uint8]:
    """Move each centre to the rounded mean of the points that find it; one without stays."""
    lists = lists_around(coarse, centres)
    nearest = nearest_words(points, centres, lists, 1, _REFINEMENT_PROBES, n_threads)[0][:, 0]
    order = np.argsort(nearest, kind="stable")
    sizes = np.bincount(nearest, minlength=len(centres))
    starts = np.concatenate([[0], np.cumsum(sizes)])
    moved = centres.copy()
    for first in range(0, len(centres), _CENTRES_MOVED_AT_ONCE):
        used = first + np.flatnonzero(sizes[first : first + _CENTRES_MOVED_AT_ONCE])
        if len(used):
            members = points[order[starts[used[0]] : starts[used[-1] + 1]]]
            sums = np.add.reduceat(members, starts[used] - starts[used[0]], axis=0, dtype=np.int64)
            moved[used] = np.rint(sums / sizes[used, None])
    return moved


def share_out(n_shares: int, sizes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Divide shares by size: at least 1 if not empty, at most a cluster's size; (C,) int64.

    n_shares lies between the number of clusters that are not empty and the sum of sizes.
    Largest remainders first get what rounding leaves; ties go to the earlier cluster.
    """
    quota: NDArray[np.float64] = n_shares * sizes / sizes.sum()
    shares: NDArray[np.int64] = np.maximum(np.floor(quota).astype(np.int64), sizes > 0)
    neediest = np.argsort(shares - quota, kind="stable")
    while (missing := n_shares - int(shares.sum())) > 0:
        shares[neediest[shares[neediest] < sizes[neediest]][:missing]] += 1
    while (excess := int(shares.sum()) - n_shares) > 0:
        richest = neediest[::-1]
        shares[richest[shares[richest] > 1][:excess]] -= 1
    return shares
