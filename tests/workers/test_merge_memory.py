"""Merging holds a range of words, and joining a piece, however many there are."""

import tracemalloc
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from contracts.config import IndexConfig
from index.codebooks import codebook_paths
from index.files import write_array
from index.jobs import JobFolder, JobPlan
from retrieval.postings import posting_keys
from workers.stages.join import join_channel
from workers.stages.merge import merge_words

CHANNEL, N_IMAGES, N_SHARDS, RANGE = "hesaff-sift", 4_000, 4, 60


def partials_of(root: Path, n_words: int) -> JobFolder:
    """Shards in which every word is in half of the images."""
    job, config = JobFolder(root, "0" * 16), IndexConfig()
    plan = JobPlan(
        job=job.job,
        verb="index",
        config=config,
        config_digest=config.digest(),
        segment="0001",
        codebooks="0001",
        trains=True,
        n_images=N_IMAGES,
        shard_size=N_IMAGES // N_SHARDS,
        n_shards=N_SHARDS,
    )
    job.write_plan(plan, ())
    words = codebook_paths(root, "0001", CHANNEL)["words"]
    write_array(words, np.zeros((n_words, 128), dtype=np.uint8))
    rng = np.random.default_rng(0)
    for shard in range(N_SHARDS):
        word_ids, rows = np.nonzero(rng.random((n_words, plan.shard_size)) < 0.5)
        images = (shard * plan.shard_size + rows).astype(np.uint32)
        keys = posting_keys(word_ids.astype(np.int32), images, n_words)
        write_array(job.partial(shard, CHANNEL), keys)
    return job


def peak(work: Callable[[], object]) -> int:
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.fixture(scope="module")
def peaks(tmp_path_factory: pytest.TempPathFactory) -> NDArray[np.int64]:
    """Most bytes of merging a range and of joining all; of one range, one again, and four."""

    def of(n_ranges: int) -> tuple[int, int]:
        job = partials_of(tmp_path_factory.mktemp("index"), n_ranges * RANGE)
        firsts = [number * RANGE for number in range(n_ranges)]
        ranges = [range(first, first + RANGE) for first in firsts]
        merging = max(peak(partial(merge_words, job, CHANNEL, words, N_IMAGES)) for words in ranges)
        return merging, peak(lambda: join_channel(job, CHANNEL, firsts, N_IMAGES))

    of(1)  # compiles
    return np.array([of(1), of(4)])


def test_four_times_the_postings_in_four_ranges_take_no_more_memory(
    peaks: NDArray[np.int64],
) -> None:
    postings = RANGE * N_IMAGES / 2
    (merging, joining), (merging_more, joining_more) = peaks
    assert postings < joining < merging < 40 * postings
    assert merging_more < 1.2 * merging
    assert joining_more < 1.2 * joining
