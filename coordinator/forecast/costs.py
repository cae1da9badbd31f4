"""What the stages after extraction cost: measured once, scaled by how fast this machine is.

Measured on a virtual machine of two cores (x86-64, AVX2), one thread, with descriptors of 449
real images; `python -m benchmarks planned` holds them against what indexing takes.
"""

import math

from retrieval.clustering import in_one_level
from retrieval.codebooks import DISTANCE_SAMPLE, n_lists_for
from retrieval.word_search import usual_probes

_COMPARED_ALL_S = {128: 4.2e-9, 64: 2.4e-9, 36: 2.4e-9}
_COMPARED_LISTED_S = {128: 6.8e-9, 64: 4.2e-9, 36: 4.2e-9}
"""To compare a descriptor with one word, by dimensions: of all words, or of lists."""
_LISTS_SORTED_S = 1.5e-6
"""To put a descriptor among those that ask for the same lists."""

_FLAT_PRODUCT_S = {128: 60e-9, 64: 32e-9, 36: 27e-9}
"""Training in one level (retrieval/clustering.py): for each product of points and words."""

_LEVELS_POINT_S = {128: 15e-6, 64: 8e-6, 36: 10e-6}
_LEVELS_ROOT_WORD_S = {128: 240e-9, 64: 130e-9, 36: 140e-9}
"""In two levels: for each point, and for each point x root of the number of words."""

_GROUPING_S = {128: 0.1e-6, 64: 0.06e-6, 36: 0.06e-6}
"""To group words into lists, for each word x root of their number; done twice."""

WRITE_S_A_BYTE = 2.4e-9
"""To write features and their digest."""
READ_S_A_BYTE = 0.7e-9
SAMPLE_S_AN_IMAGE = 100e-6
"""To hash an image's descriptors of a channel and offer them to the sample."""
SAMPLE_S_A_SHARD = 0.003
"""To read what a shard has put aside for the sample of a channel."""
CHANNEL_FILE_S = 0.005
"""To read a channel's features of a shard and to write its partial index, whatever their size."""

MERGE_S_A_POSTING = 25e-9
MERGE_S_A_RUN = 100e-6
"""To find a range of words in the partial index of a shard."""
JOIN_S_A_BYTE = 5e-9
FILE_S = 0.01
"""To write a small file for good, with its digest and a receipt."""

START_S = 8.0
"""Broker and workers start, kernels are loaded, and the generation is committed."""

JOIN_BYTES_A_WORD = 32.0
TRAIN_BYTES_A_VALUE = 3.5
"""Memory that training holds for each value (points x dimensions) of its sample."""
TRAIN_BYTES_A_POINT = 60.0
MERGE_BYTES_A_POSTING = 20.0
MERGE_BYTES_AN_IMAGE = 12.0

POSTING_KEY_BYTES = 8
"""A word and an image: retrieval/merging.py."""

CATALOGUE_BYTES_AN_IMAGE = 170.0
"""Mostly the sha256, which does not compress."""
JOB_BYTES_AN_IMAGE = 700.0
"""An image in the list of its shard, and what was found out about it."""

_HEADERS_BYTES = 800

MODELLED_S_WITHIN = 1.4
"""How far predicted seconds of a stage that was not run lie from the truth: a factor."""
MODELLED_BYTES_WITHIN = 1.1
"""The same of bytes."""


def assign_s(n_words: int, dimensions: int) -> float:
    """Seconds to find the nearest of `n_words` words of one descriptor, on the reference."""
    n_lists = n_lists_for(n_words)
    if n_lists == 1:
        return n_words * _COMPARED_ALL_S[dimensions]
    compared = n_lists + usual_probes(n_lists) * n_words / n_lists
    return compared * _COMPARED_LISTED_S[dimensions] + _LISTS_SORTED_S


def train_s(n_points: int, n_words: int, dimensions: int) -> float:
    """Seconds to make words of so many points, on the reference."""
    if in_one_level(n_points, n_words):
        return n_points * n_words * _FLAT_PRODUCT_S[dimensions]
    root = math.sqrt(n_words)
    a_point = _LEVELS_POINT_S[dimensions] + root * _LEVELS_ROOT_WORD_S[dimensions]
    grouping = 2 * _GROUPING_S[dimensions] * n_words * root
    return n_points * a_point + grouping + DISTANCE_SAMPLE * n_words * _COMPARED_ALL_S[dimensions]


def search_structure_bytes(n_words: int, dimensions: int) -> int:
    """Size of the saved search structure: bytes of its centres, 4 for each word, and headers."""
    return n_lists_for(n_words) * (dimensions + 8) + 4 * n_words + _HEADERS_BYTES
