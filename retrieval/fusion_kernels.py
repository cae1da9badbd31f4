"""The compiled passes of fusion: words vote for their images, a range of images at a time.

A range is small enough for its tallies to stay in the processor's cache, which random access to
those of a million images would not. Each word's postings ascend, so `cursor` remembers where
the next range begins; a word that has postings left after the last one names an image beyond
the catalogue, or images out of order. An image gets its votes in the order of the words whatever
the ranges are, so neither do its sums depend on them.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from retrieval.kernels import kernel

# Named tuples and not dataclasses: the only records that compiled code takes.


class Words(NamedTuple):
    """What a detector's keypoints ask: (m,) words by keypoint, descriptor, then distance.

    lists : image ids of each of L = `n_descriptors`, more lists may follow.
    descriptor : (m,) int64 into `lists`.
    token : (m,) int32, 1 + point * L + descriptor. cursor, stop : (m,) int64 into the list.
    vote : (m,) float64.
    """

    lists: tuple[NDArray[np.uint32], ...]
    n_descriptors: int
    descriptor: NDArray[np.int64]
    token: NDArray[np.int32]
    cursor: NDArray[np.int64]
    stop: NDArray[np.int64]
    vote: NDArray[np.float64]


class Tally(NamedTuple):
    """What the images of a range got; every array (size,), zero at first.

    seen : int32, the token of the last word that gave the image anything (`pairwise`: doubled).
    running : float64, of one keypoint so far. score : float64.
    voters : int32, keypoints that voted.
    """

    seen: NDArray[np.int32]
    running: NDArray[np.float64]
    score: NDArray[np.float64]
    voters: NDArray[np.int32]


@kernel
def vote_union(words: Words, first_image: int, tally: Tally, count_voters: bool) -> None:
    """Add each word's vote to its images, but to none that a nearer word of its list has.

    Counting voters is a third of the work: without it an image with a vote is left with one.
    """
    seen, score, voters = tally.seen, tally.score, tally.voters
    base, size = np.uint32(first_image), np.uint32(len(seen))
    for word in range(len(words.cursor)):
        image_ids = words.lists[words.descriptor[word]]
        vote, token = words.vote[word], words.token[word]
        first_of_point = token - words.descriptor[word]
        at, stop = words.cursor[word], words.stop[word]
        while at < stop:
            image = np.uint32(image_ids[at] - base)
            if image >= size:
                break
            marked = seen[image]
            # Without branches: which images a keypoint listed before is not to be predicted.
            score[image] += vote if marked != token else 0.0
            if count_voters:
                voters[image] += marked < first_of_point
            seen[image] = token
            at += 1
        words.cursor[word] = at
    if not count_voters:
        voters[:] = seen > 0


@kernel
def vote_intersection(words: Words, first_image: int, tally: Tally) -> None:
    """Add the product of an image's words, one a descriptor, where all descriptors have one.

    An image that passed a descriptor is marked so, and passes it once, by its nearest word.
    """
    seen, running, score, voters = tally.seen, tally.running, tally.score, tally.voters
    base, size = np.uint32(first_image), np.uint32(len(seen))
    last = words.n_descriptors - 1
    for word in range(len(words.cursor)):
        image_ids = words.lists[words.descriptor[word]]
        vote, token, descriptor = words.vote[word], words.token[word], words.descriptor[word]
        at, stop = words.cursor[word], words.stop[word]
        while at < stop:
            image = np.uint32(image_ids[at] - base)
            if image >= size:
                break
            at += 1
            if descriptor == 0:
                if seen[image] == token:
                    continue
                product = vote
            elif seen[image] == token - 1:
                product = running[image] * vote
            else:
                continue
            seen[image] = token
            if descriptor < last:
                running[image] = product
            else:
                score[image] += product
                voters[image] += 1
        words.cursor[word] = at


@kernel
def vote_pairwise(words: Words, first_image: int, tally: Tally) -> None:
    """Add the products of two of an image's words, one a descriptor, over all such pairs.

    `seen` is odd where a second descriptor of the keypoint has listed the image.
    """
    seen, running, score, voters = tally.seen, tally.running, tally.score, tally.voters
    base, size = np.uint32(first_image), np.uint32(len(seen))
    last = words.n_descriptors - 1
    for word in range(len(words.cursor)):
        image_ids = words.lists[words.descriptor[word]]
        vote, token = words.vote[word], 2 * words.token[word]
        first_of_point = token - 2 * words.descriptor[word]
        is_last = words.descriptor[word] == last
        at, stop = words.cursor[word], words.stop[word]
        while at < stop:
            image = np.uint32(image_ids[at] - base)
            if image >= size:
                break
            at += 1
            marked = seen[image]
            if marked < first_of_point:
                if not is_last:  # nothing comes after that it could be paired with
                    seen[image] = token
                    running[image] = vote
            elif marked < token:
                voters[image] += 1 - marked % 2
                seen[image] = token + 1
                score[image] += running[image] * vote
                running[image] += vote
        words.cursor[word] = at


@kernel
def least_of_best(values: NDArray[np.float64], touched: NDArray[np.bool_], top: int) -> float:
    """Find the `top`-th largest value of touched images; -inf if there are fewer.

    A heap of the best so far, the least of them at its root.
    """
    heap = np.full(top, -np.inf)
    for image in range(len(values)):
        value = values[image]
        if value <= heap[0] or not touched[image]:
            continue
        at, child = 0, 1
        while child < top:
            if child + 1 < top and heap[child + 1] < heap[child]:
                child += 1
            if heap[child] >= value:
                break
            heap[at] = heap[child]
            at, child = child, 2 * child + 1
        heap[at] = value
    return float(heap[0])
