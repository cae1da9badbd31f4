"""Which words of a keypoint count, and what each gives its images.

All take n keypoints with L descriptors and k words each. `spans` (n, L, k, 2) int64 holds start
and stop of each word's postings in its channel's image ids; they must have been checked.
`distances` (n, L, k) float64 are the d' of METHOD section 3.
"""

import numpy as np
from numpy.typing import NDArray

from contracts.config import UnionDistance
from contracts.errors import BadIndex
from retrieval.kernels import kernel

_Lists = tuple[NDArray[np.uint32], ...]


def kept_words(lists: _Lists, spans: NDArray[np.int64], n_images: int) -> NDArray[np.bool_]:
    """Find the words that add an image to their keypoint; (n, L, k) bool.

    An image counts for the nearest of a descriptor's words alone. A keypoint of which a
    descriptor has no image at all is skipped: none of its words is kept.

    Raises
    ------
    BadIndex : an image beyond `n_images` was met.
    """
    kept = np.zeros(spans.shape[:3], dtype=np.bool_)
    if not _keep_words(lists, spans, n_images, kept):
        raise beyond_catalogue(n_images)
    complete = np.all(np.any(kept, axis=2), axis=1)
    kept &= complete[:, None, None]
    return kept


def union_votes(
    distances: NDArray[np.float64], kept: NDArray[np.bool_], distance: UnionDistance
) -> NDArray[np.float64]:
    """Give each kept word its vote by the closed form of the walk; (n, L, k) float64.

    METHOD section 3: (P / K_l) (1 - d') - sum over j != l of (P / (K_l K_j)) D_j; a cell's
    mean distance instead of its sum is that of every d' / L.
    """
    if distance == "mean":
        distances = distances / distances.shape[1]
    n_kept = np.maximum(kept.sum(axis=2), 1)
    totals = np.where(kept, distances, 0.0).sum(axis=2)
    n_cells = n_kept.prod(axis=1)[:, None] / n_kept
    mean_of_others = (totals / n_kept).sum(axis=1)[:, None] - totals / n_kept
    votes: NDArray[np.float64] = 1.0 - distances - mean_of_others[..., None]
    votes *= n_cells[..., None]
    return votes


def beyond_catalogue(n_images: int) -> BadIndex:
    """Postings that are not what a catalogue of `n_images` can have."""
    return BadIndex(
        f"an inverted index names an image beyond the catalogue's {n_images}, or images out of "
        "order; the index is damaged: restore it or index again"
    )


@kernel
def _keep_words(
    lists: _Lists, spans: NDArray[np.int64], n_images: int, kept: NDArray[np.bool_]
) -> bool:
    """Look for one image that a word has alone: mostly its first. False: out of bounds.

    A word of more images than all nearer ones together must have one.
    """
    for point in range(len(spans)):
        for descriptor in range(spans.shape[1]):
            image_ids = lists[descriptor]
            n_nearer = 0
            for rank in range(spans.shape[2]):
                start, stop = spans[point, descriptor, rank]
                length = stop - start
                if length > n_nearer:
                    kept[point, descriptor, rank] = True
                    start = stop
                n_nearer += length
                for image in image_ids[start:stop]:
                    if image >= n_images:
                        return False
                    if not _is_listed(image, image_ids, spans[point, descriptor, :rank]):
                        kept[point, descriptor, rank] = True
                        break
    return True


@kernel
def _is_listed(image: int, image_ids: NDArray[np.uint32], spans: NDArray[np.int64]) -> bool:
    for rank in range(len(spans)):
        low, stop = spans[rank]
        high = stop
        while low < high:
            middle = (low + high) // 2
            if image_ids[middle] < image:
                low = middle + 1
            else:
                high = middle
        if low < stop and image_ids[low] == image:
            return True
    return False
