"""Compiling what a search needs, before the first photo waits for it."""

from typing import get_args

import numpy as np

from contracts.config import SearchConfig, Vote
from contracts.records import Frames
from retrieval.bag_of_words import score_bag_of_words
from retrieval.channel_query import ChannelQuery
from retrieval.codebooks import WordSearcher, build_search, train_codebook
from retrieval.complementarity import complementarity
from retrieval.fusion import fuse, rank
from retrieval.postings import (
    build_postings,
    distinct_words,
    document_frequency,
    inverse_document_frequency,
    merge_postings,
)

_N = 40


def compile_search_kernels() -> None:
    """Run every kernel of assignment and search once on a toy index."""
    rng = np.random.default_rng(0)
    descriptors = rng.integers(0, 256, (_N, 8), dtype=np.uint8)
    codebook = train_codebook(descriptors, 5, 0)
    searcher = WordSearcher(codebook, build_search(codebook.words))
    words, distances = searcher.nearest(descriptors, 2)
    images = np.arange(_N, dtype=np.uint32) % 7
    postings = merge_postings([build_postings(words[:, 0], images, 5)] * 2)
    idf = inverse_document_frequency(document_frequency(postings), 7)
    farthest = codebook.farthest(2, "range")
    channel = ChannelQuery(words, distances, codebook.dmin, farthest, postings, idf)
    for vote in get_args(Vote):
        config = SearchConfig(vote=vote, weights=("idf", "norm", "burst"))
        rank(fuse([[channel, channel]], 7, config, distinct_words(postings, 7)), 1)
    score_bag_of_words(words[:, 0], postings, idf, 7)
    frames = Frames(
        rng.random((_N, 2), dtype=np.float32) * 90,
        np.tile(np.eye(2, dtype=np.float32), (_N, 1, 1)),
        np.linspace(1, 0, _N, dtype=np.float32),
    )
    complementarity(frames, frames, 100, 100)
