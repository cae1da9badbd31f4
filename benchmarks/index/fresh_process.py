"""Running a step in a process of its own, and what it took there."""

import multiprocessing
import threading
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Generic, ParamSpec, TypeVar

import numpy as np

from retrieval.merging import merge_keys
from retrieval.packing import pack
from retrieval.postings import distinct_words

_EVERY_S = 0.01

_P = ParamSpec("_P")
_R = TypeVar("_R")


@dataclass(frozen=True, slots=True)
class Took(Generic[_R]):
    """peak_mb : most memory of its own at a time; mapped files, which can be dropped, are not."""

    result: _R
    seconds: float
    cpu_s: float
    peak_mb: float


def in_fresh_process(function: Callable[_P, _R], *args: _P.args, **named: _P.kwargs) -> Took[_R]:
    """Call a function of a module in a new process."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        return pool.submit(_watched, partial(function, *args, **named)).result()


def _watched(call: Callable[[], _R]) -> Took[_R]:
    _load_kernels()
    peaks = [_own_mb()]
    done = threading.Event()

    def watch() -> None:
        while not done.wait(_EVERY_S):
            peaks.append(_own_mb())

    watcher = threading.Thread(target=watch)
    watcher.start()
    started, busy = time.perf_counter(), time.process_time()
    try:
        result = call()
    finally:
        done.set()
        watcher.join()
    return Took(result, time.perf_counter() - started, time.process_time() - busy, max(peaks))


def _load_kernels() -> None:
    """Load what a merge worker has loaded before its first task."""
    merged = merge_keys([np.zeros(1, dtype=np.uint64)], 0, 1)
    pack(merged)
    distinct_words(merged, 1)


def _own_mb() -> float:
    """Anonymous memory of this process."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    line = next(line for line in status.splitlines() if line.startswith("RssAnon:"))
    return int(line.split()[1]) / 1024
