"""The plain baseline: a bag of visual words, tf-idf and cosine (Sivic & Zisserman, ICCV 2003).

The index keeps which images have a word, not how often, so the term frequency of the indexed
images is 1; the photo's own is counted.
"""

import numpy as np
from numpy.typing import NDArray

from contracts.errors import BadIndex
from contracts.records import Postings
from retrieval.fusion import Scores
from retrieval.kernels import kernel


def score_bag_of_words(
    word_ids: NDArray[np.int32], postings: Postings, idf: NDArray[np.float64], n_images: int
) -> Scores:
    """Cosine between the photo's words and every image's.

    Parameters
    ----------
    word_ids : (n,) int32, the nearest word of each keypoint. idf : (V,) float64.

    Raises
    ------
    BadIndex : a posting names an image that is not there.
    """
    if len(postings.image_ids) and int(postings.image_ids.max()) >= n_images:
        raise BadIndex(f"A posting names an image beyond the {n_images} indexed: index again.")
    weights = np.bincount(word_ids, minlength=postings.n_words) * idf**2
    values, squares = _sums(postings.indptr, postings.image_ids, weights, idf**2, n_images)
    return Scores(values / np.sqrt(np.maximum(squares, 1e-12)), values > 0)


@kernel
def _sums(
    indptr: NDArray[np.int64],
    image_ids: NDArray[np.uint32],
    weights: NDArray[np.float64],
    squares: NDArray[np.float64],
    n_images: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    dots = np.zeros(n_images)
    norms = np.zeros(n_images)
    for word in range(len(indptr) - 1):
        for at in range(indptr[word], indptr[word + 1]):
            dots[image_ids[at]] += weights[word]
            norms[image_ids[at]] += squares[word]
    return dots, norms
