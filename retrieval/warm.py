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
from retrieval.merging import merge_keys, posting_keys, renumbered_keys
from retrieval.packing import Part, pack, unpack
from retrieval.postings import distinct_words, inverse_document_frequency
from retrieval.word_search import compile_word_search

_N = 40


def compile_search_kernels() -> None:
    """Run every kernel of assignment, merging and search once on a toy index."""
    compile_word_search()
    rng = np.random.default_rng(0)
    descriptors = rng.integers(0, 256, (_N, 8), dtype=np.uint8)
    codebook = train_codebook(descriptors, 5, 0)
    searcher = WordSearcher(codebook, build_search(codebook.words))
    words, distances = searcher.nearest(descriptors, 2)
    images = np.arange(_N, dtype=np.uint32) % 7
    keys = posting_keys(words[:, 0], images, 5)
    packed = pack(merge_keys([keys], 0, 5))
    postings = unpack([Part(packed, 0, 7)], np.arange(5), np.ones(7, dtype=np.bool_))
    renumbered_keys(postings, 0, np.arange(7))
    idf = inverse_document_frequency(np.diff(postings.indptr), 7)
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
