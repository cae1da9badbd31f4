"""What this machine is like: how fast at finding words, and what a process takes to begin with."""

import time

import cv2
import faiss
import numpy as np

from coordinator.forecast.costs import assign_s
from coordinator.forecast.process import Held, held, waited_for_a_core_s
from coordinator.forecast.vocabulary import searcher
from retrieval.features import compile_kernels
from retrieval.warm import compile_search_kernels
from workers import tasks  # noqa: F401 - what a worker imports, for the memory it takes

_WORDS, _DESCRIPTORS, _DIMENSIONS = 2_000, 8_000, 128
_ROUNDS = 3


def idle_as_a_worker() -> Held | None:
    """Make this process what a worker is before its first task; returns what it holds.

    One thread, and all kernels compiled: `workers.run.run_worker`. None: not known here.
    """
    cv2.setNumThreads(1)
    faiss.omp_set_num_threads(1)
    compile_kernels()
    compile_search_kernels()
    return held()


def slowness() -> float:
    """How many times longer this machine takes than the one of `costs`, one thread.

    Made-up descriptors are compared with every one of some words, the best of a few rounds.
    """
    rng = np.random.default_rng(0)
    words = rng.integers(0, 256, (_WORDS, _DIMENSIONS), dtype=np.uint8)
    descriptors = rng.integers(0, 256, (_DESCRIPTORS, _DIMENSIONS), dtype=np.uint8)
    search = searcher(words)
    rounds = []
    for _ in range(_ROUNDS):
        began = time.perf_counter() - waited_for_a_core_s()
        search.nearest(descriptors, 1)
        rounds.append(time.perf_counter() - waited_for_a_core_s() - began)
    return min(rounds) / (_DESCRIPTORS * assign_s(_WORDS, _DIMENSIONS))
